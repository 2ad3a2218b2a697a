//! Buffers with their memory.

use std::sync::Arc;

use ash::vk;
use bytemuck::{AnyBitPattern, NoUninit};
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::{Dispatch, Gpu, GpuError, GpuResult, Submission};

/// Who touches a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryUse {
    /// The device alone.
    Device,
    /// The host writes, the device reads.
    Upload,
    /// The device writes, the host reads.
    Readback,
}

/// A buffer in memory of its own; freed on drop.
pub struct Buffer {
    pub(super) raw: vk::Buffer,
    /// Size in bytes.
    pub size: u64,
    name: String,
    allocation: Option<Allocation>,
    view: Option<vk::BufferView>,
    gpu: Arc<Gpu>,
}

impl Buffer {
    /// Makes a buffer of `size` bytes (at least 16, so that it can be bound). The name is for messages.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] with the name and size.
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        memory: MemoryUse,
    ) -> GpuResult<Self> {
        let size = size.max(16);
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive; the buffer is destroyed in `drop`.
        let raw = unsafe { gpu.device.create_buffer(&info, None) }.map_err(GpuError::call("vkCreateBuffer", name))?;
        // Owned from here on, so that an error below frees it.
        let mut buffer = Self { raw, size, name: name.to_owned(), allocation: None, view: None, gpu: gpu.clone() };
        // SAFETY: `raw` is a buffer of this device.
        let requirements = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        let location = match memory {
            MemoryUse::Device => MemoryLocation::GpuOnly,
            MemoryUse::Upload => MemoryLocation::CpuToGpu,
            MemoryUse::Readback => MemoryLocation::GpuToCpu,
        };
        let allocation = gpu
            .allocator()
            .allocate(&AllocationCreateDesc {
                name,
                requirements,
                location,
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            })
            .map_err(|_| GpuError::OutOfMemory { what: name.to_owned(), bytes: size })?;
        // SAFETY: the memory was allocated for this buffer's requirements and is bound once.
        unsafe { gpu.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }
            .map_err(GpuError::call("vkBindBufferMemory", name))?;
        buffer.allocation = Some(allocation);
        if usage.contains(vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER) {
            buffer.view = Some(buffer.create_texel_view()?);
        }
        Ok(buffer)
    }

    /// Makes a buffer that the device reads, filled with `data`: by a copy where the device has memory of its own.
    ///
    /// # Errors
    /// As [`Buffer::new`], and those of the copy.
    pub fn with_data<T: NoUninit>(
        gpu: &Arc<Gpu>,
        name: &str,
        data: &[T],
        usage: vk::BufferUsageFlags,
    ) -> GpuResult<Self> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let size = bytes.len() as u64;
        if gpu.has_unified_memory() {
            let mut buffer = Self::new(gpu, name, size, usage, MemoryUse::Upload)?;
            buffer.write(bytes)?;
            return Ok(buffer);
        }
        let usage = usage | vk::BufferUsageFlags::TRANSFER_DST;
        let buffer = Self::new(gpu, name, size, usage, MemoryUse::Device)?;
        let mut staging = Self::new(gpu, name, size, vk::BufferUsageFlags::TRANSFER_SRC, MemoryUse::Upload)?;
        staging.write(bytes)?;
        let mut submission = Submission::new(gpu, name)?;
        submission.submit(&[Dispatch::Copy { from: &staging, to: &buffer, bytes: size }])?;
        submission.wait()?;
        Ok(buffer)
    }

    /// Writes to the start of a host-visible buffer.
    ///
    /// # Errors
    /// When the memory cannot be mapped.
    pub fn write<T: NoUninit>(&mut self, data: &[T]) -> GpuResult<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let error = || GpuError::Vulkan {
            call: "mapping memory",
            object: self.name.clone(),
            result: vk::Result::ERROR_MEMORY_MAP_FAILED,
        };
        let slice = self.allocation.as_mut().and_then(Allocation::mapped_slice_mut);
        match slice.and_then(|slice| slice.get_mut(..bytes.len())) {
            Some(target) => target.copy_from_slice(bytes),
            None => return Err(error()),
        }
        Ok(())
    }

    /// The first `count` elements of a host-visible buffer. The device must be done writing it.
    ///
    /// # Errors
    /// When the memory cannot be mapped or is too small.
    pub fn read<T: AnyBitPattern>(&self, count: usize) -> GpuResult<&[T]> {
        let bytes = count * size_of::<T>();
        self.allocation
            .as_ref()
            .and_then(Allocation::mapped_slice)
            .and_then(|slice| slice.get(..bytes))
            .and_then(|slice| bytemuck::try_cast_slice(slice).ok())
            .ok_or_else(|| GpuError::Vulkan {
                call: "mapping memory",
                object: self.name.clone(),
                result: vk::Result::ERROR_MEMORY_MAP_FAILED,
            })
    }

    /// Device address; needs the usage flag for it.
    pub fn device_address(&self) -> u64 {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.raw);
        // SAFETY: the buffer was made with SHADER_DEVICE_ADDRESS and is bound to memory.
        unsafe { self.gpu.device.get_buffer_device_address(&info) }
    }

    /// The buffer as rgba32ui texels; there if its usage has UNIFORM_TEXEL_BUFFER.
    pub(super) fn texel_view(&self) -> vk::BufferView {
        self.view.unwrap_or_default()
    }

    fn create_texel_view(&self) -> GpuResult<vk::BufferView> {
        let info = vk::BufferViewCreateInfo::default()
            .buffer(self.raw)
            .format(vk::Format::R32G32B32A32_UINT)
            .range(self.size / 16 * 16);
        // SAFETY: the buffer has UNIFORM_TEXEL_BUFFER usage, is bound to memory and lives as long as the view.
        unsafe { self.gpu.device.create_buffer_view(&info, None) }
            .map_err(GpuError::call("vkCreateBufferView", &self.name))
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: whoever submitted work with the buffer waited for it before dropping it (see `Submission`).
        unsafe {
            if let Some(view) = self.view {
                self.gpu.device.destroy_buffer_view(view, None);
            }
            self.gpu.device.destroy_buffer(self.raw, None);
        }
        if let Some(allocation) = self.allocation.take()
            && let Err(error) = self.gpu.allocator().free(allocation)
        {
            tracing::error!("freeing {}: {error}", self.name);
        }
    }
}
