//! The logical device with its queue and its allocator.

use std::ffi::CStr;
use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::{khr, vk};
use gpu_allocator::AllocatorDebugSettings;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::pipeline_cache::PipelineCache;
use super::{DeviceInfo, GpuError, GpuResult, Instance};

/// Extensions that hardware ray queries need.
pub(super) const RAY_QUERY_EXTENSIONS: [&CStr; 3] =
    [khr::ray_query::NAME, khr::acceleration_structure::NAME, khr::deferred_host_operations::NAME];

/// What is switched on when the device is made.
#[derive(Clone, Copy, Debug, Default)]
pub struct DeviceRequirements {
    /// Hardware ray queries.
    pub ray_query: bool,
}

/// A device ready for work. Everything made on it holds an `Arc` of it.
pub struct Gpu {
    pub(super) device: ash::Device,
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) queue_family: u32,
    pub(super) acceleration: Option<khr::acceleration_structure::Device>,
    pub(super) pipeline_cache: PipelineCache,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    /// What the device can do.
    pub info: DeviceInfo,
    // Last, so that it outlives the device.
    instance: Arc<Instance>,
}

impl Gpu {
    /// Opens a device.
    ///
    /// # Errors
    /// [`GpuError::Lacks`] if it has not what is required.
    pub fn new(instance: Arc<Instance>, info: DeviceInfo, requirements: DeviceRequirements) -> GpuResult<Arc<Self>> {
        let lacks = |what: &str| GpuError::Lacks { device: info.name.clone(), lacks: what.to_owned() };
        if requirements.ray_query && !info.ray_query {
            return Err(lacks("has no hardware ray queries (VK_KHR_ray_query); use --trace bvh"));
        }
        // SAFETY: the physical device belongs to the instance.
        let families = unsafe { instance.raw.get_physical_device_queue_family_properties(info.raw) };
        let queue_family = families
            .iter()
            .position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE))
            .and_then(|i| u32::try_from(i).ok())
            .ok_or_else(|| lacks("has no compute queue"))?;
        let device = create_device(&instance, &info, requirements, queue_family)?;
        let pipeline_cache = PipelineCache::new(&device, &info.identity)?;
        // SAFETY: queue 0 of this family was created with the device.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: device.clone(),
            physical_device: info.raw,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: info.buffer_device_address,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        })
        .map_err(|e| GpuError::OutOfMemory { what: format!("the allocator ({e})"), bytes: 0 })?;
        let acceleration =
            requirements.ray_query.then(|| khr::acceleration_structure::Device::new(&instance.raw, &device));
        Ok(Arc::new(Self {
            device,
            queue: Mutex::new(queue),
            queue_family,
            acceleration,
            pipeline_cache,
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            info,
            instance,
        }))
    }

    pub(super) fn allocator(&self) -> MutexGuard<'_, Allocator> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The instance that the device belongs to.
    pub fn instance(&self) -> &Arc<Instance> {
        &self.instance
    }

    /// Whether host-visible memory is as good as any other, so that uploads need no copy.
    pub fn has_unified_memory(&self) -> bool {
        matches!(self.info.kind, super::DeviceKind::Cpu | super::DeviceKind::Integrated)
    }
}

fn create_device(
    instance: &Instance,
    info: &DeviceInfo,
    requirements: DeviceRequirements,
    queue_family: u32,
) -> GpuResult<ash::Device> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
    let mut extensions: Vec<*const std::ffi::c_char> = Vec::new();
    let mut address = vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true);
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
    let mut structure = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut create = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
    if info.buffer_device_address {
        create = create.push_next(&mut address);
    }
    if requirements.ray_query {
        extensions.extend(RAY_QUERY_EXTENSIONS.iter().map(|name| name.as_ptr()));
        create = create.push_next(&mut query).push_next(&mut structure);
    }
    let create = create.enabled_extension_names(&extensions);
    // SAFETY: everything asked for was found on the device, and all pointers outlive the call.
    unsafe { instance.raw.create_device(info.raw, &create, None) }.map_err(GpuError::call("vkCreateDevice", &info.name))
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: buffers and pipelines hold an Arc of this device, so none is left; the allocator goes first because it
        // frees its memory blocks through the device.
        unsafe {
            let _ = self.device.device_wait_idle();
            ManuallyDrop::drop(&mut self.allocator);
            self.pipeline_cache.destroy(&self.device);
            self.device.destroy_device(None);
        }
    }
}
