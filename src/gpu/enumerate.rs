//! Which devices there are, what they can do, and which one to take.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use ash::vk;

use super::{Calibration, GpuError, GpuResult, Instance};

/// The class of a device, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A graphics card.
    Discrete,
    /// A GPU that shares the host's memory.
    Integrated,
    /// A GPU passed into a virtual machine.
    Virtual,
    /// A software driver.
    Cpu,
    /// Anything else.
    Other,
}

impl std::fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Cpu => "CPU",
            Self::Other => "other",
        })
    }
}

/// The limits that decide how scene data is bound.
#[derive(Clone, Copy, Debug)]
pub struct DeviceLimits {
    /// Largest storage buffer binding in bytes.
    pub storage_buffer_range: u64,
    /// Largest texel buffer in texels.
    pub texel_buffer_elements: u64,
    /// Largest single allocation in bytes.
    pub allocation_size: u64,
    /// Largest workgroup along x.
    pub workgroup_invocations: u32,
    /// Lanes of a subgroup.
    pub subgroup_size: u32,
    /// Storage buffers that one shader stage may bind.
    pub stage_storage_buffers: u32,
}

/// A device and what it can do.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Position in the driver's list.
    pub index: usize,
    /// Name of the device.
    pub name: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Class of the device.
    pub kind: DeviceKind,
    /// Vulkan version it offers.
    pub api_version: (u32, u32, u32),
    /// Bytes of device-local memory.
    pub memory_bytes: u64,
    /// Hardware ray queries and acceleration structures are there.
    pub ray_query: bool,
    /// Buffer device addresses are there.
    pub buffer_device_address: bool,
    /// Limits.
    pub limits: DeviceLimits,
    /// Tells this device and this build of its driver from all others, as the driver does; fit for a file name.
    pub identity: String,
    /// What `sunfleck devices --calibrate` measured on it.
    pub calibration: Option<Calibration>,
    /// Why it cannot be used at all, if so.
    pub unusable: Option<String>,
    pub(super) raw: vk::PhysicalDevice,
}

/// Which device is wanted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceSelection {
    /// The best one: discrete, integrated, virtual, then CPU.
    #[default]
    Auto,
    /// By position in the list.
    Index(usize),
    /// By a part of its name, in any case.
    Name(String),
}

/// Lists the devices in the driver's order.
///
/// # Errors
/// [`GpuError::NoDriver`] when there is none.
pub fn devices(instance: &Arc<Instance>) -> GpuResult<Vec<DeviceInfo>> {
    // SAFETY: the instance is alive.
    let raw = unsafe { instance.raw.enumerate_physical_devices() }
        .map_err(|result| GpuError::NoDriver(format!("vkEnumeratePhysicalDevices says {result}")))?;
    if raw.is_empty() {
        return Err(GpuError::NoDriver("the Vulkan loader knows no device".to_owned()));
    }
    Ok(raw.into_iter().enumerate().map(|(index, device)| describe(instance, index, device)).collect())
}

fn describe(instance: &Instance, index: usize, raw: vk::PhysicalDevice) -> DeviceInfo {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default();
    // SAFETY: `raw` is a physical device of this instance.
    let base = unsafe { instance.raw.get_physical_device_properties(raw) };
    let has_1_2 = base.api_version >= vk::API_VERSION_1_2;
    if has_1_2 {
        properties = properties.push_next(&mut driver).push_next(&mut subgroup).push_next(&mut maintenance3);
        // SAFETY: Vulkan 1.2 devices know these structures.
        unsafe { instance.raw.get_physical_device_properties2(raw, &mut properties) };
    }
    let name = base.device_name_as_c_str().map_or_else(|_| String::new(), |n| n.to_string_lossy().into_owned());
    let driver_text = [driver.driver_name_as_c_str(), driver.driver_info_as_c_str()]
        .into_iter()
        .filter_map(|text| text.ok().map(|t| t.to_string_lossy().into_owned()))
        .filter(|text| !text.is_empty())
        .collect::<Vec<_>>()
        .join(" ");
    let v = base.api_version;
    let features = Features::of(instance, raw, has_1_2);
    let identity = identity(&base, &driver_text);
    let unusable = (!has_1_2).then(|| "offers Vulkan below 1.2".to_owned());
    DeviceInfo {
        index,
        name,
        driver: driver_text,
        kind: kind(base.device_type),
        api_version: (vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v)),
        memory_bytes: device_local_bytes(instance, raw),
        ray_query: features.ray_query,
        buffer_device_address: features.buffer_device_address,
        limits: DeviceLimits {
            storage_buffer_range: u64::from(base.limits.max_storage_buffer_range),
            texel_buffer_elements: u64::from(base.limits.max_texel_buffer_elements),
            allocation_size: maintenance3.max_memory_allocation_size,
            workgroup_invocations: base
                .limits
                .max_compute_work_group_invocations
                .min(base.limits.max_compute_work_group_size[0]),
            subgroup_size: subgroup.subgroup_size,
            stage_storage_buffers: base.limits.max_per_stage_descriptor_storage_buffers,
        },
        calibration: Calibration::load(&identity),
        identity,
        unusable,
        raw,
    }
}

fn identity(properties: &vk::PhysicalDeviceProperties, driver: &str) -> String {
    let uuid: String = properties.pipeline_cache_uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    // Mesa 22's lavapipe has one UUID and one version number for all of its builds.
    let mut text = DefaultHasher::new();
    driver.hash(&mut text);
    format!(
        "{:04x}-{:04x}-{:08x}-{uuid}-{:08x}",
        properties.vendor_id,
        properties.device_id,
        properties.driver_version,
        text.finish() as u32
    )
}

fn kind(device_type: vk::PhysicalDeviceType) -> DeviceKind {
    match device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}

fn device_local_bytes(instance: &Instance, raw: vk::PhysicalDevice) -> u64 {
    // SAFETY: `raw` is a physical device of this instance.
    let memory = unsafe { instance.raw.get_physical_device_memory_properties(raw) };
    memory
        .memory_heaps_as_slice()
        .iter()
        .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
        .map(|heap| heap.size)
        .sum()
}

struct Features {
    ray_query: bool,
    buffer_device_address: bool,
}

impl Features {
    fn of(instance: &Instance, raw: vk::PhysicalDevice, has_1_2: bool) -> Self {
        if !has_1_2 {
            return Self { ray_query: false, buffer_device_address: false };
        }
        // SAFETY: `raw` is a physical device of this instance.
        let extensions = unsafe { instance.raw.enumerate_device_extension_properties(raw) }.unwrap_or_default();
        let has = |name| extensions.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|n| n == name));
        let mut address = vk::PhysicalDeviceBufferDeviceAddressFeatures::default();
        let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
        let mut structure = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
        let has_extensions = super::device::RAY_QUERY_EXTENSIONS.iter().all(|name| has(*name));
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut address);
        if has_extensions {
            features = features.push_next(&mut query).push_next(&mut structure);
        }
        // SAFETY: the structures belong to Vulkan 1.2 or to extensions that the device has.
        unsafe { instance.raw.get_physical_device_features2(raw, &mut features) };
        Self {
            ray_query: query.ray_query == vk::TRUE
                && structure.acceleration_structure == vk::TRUE
                && address.buffer_device_address == vk::TRUE,
            buffer_device_address: address.buffer_device_address == vk::TRUE,
        }
    }
}

/// Picks a device and says why.
///
/// # Errors
/// [`GpuError::NoDevice`] when nothing matches, listing what there is.
pub fn select(devices: &[DeviceInfo], wanted: &DeviceSelection) -> GpuResult<(DeviceInfo, String)> {
    let list = || devices.iter().map(|d| format!("{}: {}", d.index, d.name)).collect::<Vec<_>>().join(", ");
    let (device, reason) = match wanted {
        DeviceSelection::Auto => {
            let best = devices.iter().filter(|d| d.unusable.is_none()).min_by_key(|d| (d.kind, d.index));
            let device = best.ok_or_else(|| GpuError::NoDevice(format!("no device offers Vulkan 1.2 ({})", list())))?;
            (device, format!("the best of {}: a {}", devices.len(), device.kind))
        }
        DeviceSelection::Index(index) => {
            let device = devices
                .get(*index)
                .ok_or_else(|| GpuError::NoDevice(format!("there is no device {index}; there are {}", list())))?;
            (device, "asked for by index".to_owned())
        }
        DeviceSelection::Name(name) => {
            let lower = name.to_lowercase();
            let device = devices
                .iter()
                .find(|d| d.name.to_lowercase().contains(&lower))
                .ok_or_else(|| GpuError::NoDevice(format!("no device is named like '{name}'; there are {}", list())))?;
            (device, "asked for by name".to_owned())
        }
    };
    if let Some(lacks) = &device.unusable {
        return Err(GpuError::Lacks { device: device.name.clone(), lacks: lacks.clone() });
    }
    Ok((device.clone(), reason))
}
