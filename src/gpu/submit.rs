//! The one place that submits work and waits for it.

use std::sync::Arc;

use ash::vk;

use super::{Buffer, Gpu, GpuError, GpuResult, Kernel};

/// A piece of work.
pub enum Dispatch<'a> {
    /// Runs a kernel over `lanes` lanes with one of its sets of resources.
    Run {
        /// The kernel.
        kernel: &'a Kernel,
        /// Which of its sets.
        set: usize,
        /// Push constants.
        push: &'a [u8],
        /// Number of lanes; the last workgroup may have idle ones.
        lanes: u32,
    },
    /// Copies the start of a buffer.
    Copy {
        /// Source.
        from: &'a Buffer,
        /// Target.
        to: &'a Buffer,
        /// Bytes.
        bytes: u64,
    },
    /// Fills a buffer, made for transfers, with zeros.
    Clear(&'a Buffer),
    /// Records commands of its own (acceleration structure builds).
    Record(&'a dyn Fn(&ash::Device, vk::CommandBuffer)),
}

/// A command buffer with its fence; one piece of work is in flight in it at a time.
pub struct Submission {
    name: String,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    in_flight: bool,
    gpu: Arc<Gpu>,
}

impl Submission {
    /// Makes an empty submission. The name is for messages.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn new(gpu: &Arc<Gpu>, name: &str) -> GpuResult<Self> {
        let mut submission = Self {
            name: name.to_owned(),
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            in_flight: false,
            gpu: gpu.clone(),
        };
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(gpu.queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device is alive; what is made is destroyed in `drop`.
        unsafe {
            submission.pool =
                gpu.device.create_command_pool(&info, None).map_err(GpuError::call("vkCreateCommandPool", name))?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(submission.pool).command_buffer_count(1);
            submission.commands =
                gpu.device.allocate_command_buffers(&info).map_err(GpuError::call("vkAllocateCommandBuffers", name))?
                    [0];
            submission.fence = gpu
                .device
                .create_fence(&vk::FenceCreateInfo::default(), None)
                .map_err(GpuError::call("vkCreateFence", name))?;
        }
        Ok(submission)
    }

    /// Submits the work, each piece after the one before it. Everything it uses must stay until [`Submission::wait`].
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`] and other results of Vulkan.
    pub fn submit(&mut self, work: &[Dispatch<'_>]) -> GpuResult<()> {
        self.wait()?;
        let device = &self.gpu.device;
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is not in flight (waited above).
        unsafe { device.begin_command_buffer(self.commands, &begin) }
            .map_err(GpuError::call("vkBeginCommandBuffer", &self.name))?;
        for piece in work {
            self.record(piece);
            self.barrier();
        }
        let buffers = [self.commands];
        let info = [vk::SubmitInfo::default().command_buffers(&buffers)];
        // SAFETY: recording is complete; the queue is locked while it is used.
        unsafe {
            device.end_command_buffer(self.commands).map_err(GpuError::call("vkEndCommandBuffer", &self.name))?;
            device.reset_fences(&[self.fence]).map_err(GpuError::call("vkResetFences", &self.name))?;
            let queue = self.gpu.queue();
            device.queue_submit(*queue, &info, self.fence).map_err(GpuError::call("vkQueueSubmit", &self.name))?;
        }
        self.in_flight = true;
        Ok(())
    }

    fn record(&self, piece: &Dispatch<'_>) {
        let device = &self.gpu.device;
        match piece {
            // SAFETY: the kernel, its set and the buffers belong to this device and stay until `wait`.
            Dispatch::Run { kernel, set, push, lanes } => unsafe {
                device.cmd_bind_pipeline(self.commands, vk::PipelineBindPoint::COMPUTE, kernel.pipeline);
                device.cmd_bind_descriptor_sets(
                    self.commands,
                    vk::PipelineBindPoint::COMPUTE,
                    kernel.layout,
                    0,
                    &[kernel.sets[*set]],
                    &[],
                );
                if !push.is_empty() {
                    device.cmd_push_constants(self.commands, kernel.layout, vk::ShaderStageFlags::COMPUTE, 0, push);
                }
                device.cmd_dispatch(self.commands, lanes.div_ceil(kernel.workgroup_size), 1, 1);
            },
            Dispatch::Copy { from, to, bytes } => {
                let region = [vk::BufferCopy::default().size(*bytes)];
                // SAFETY: both buffers are at least `bytes` long and have the transfer usages.
                unsafe { device.cmd_copy_buffer(self.commands, from.raw, to.raw, &region) };
            }
            // SAFETY: the buffer has the transfer usage.
            Dispatch::Clear(buffer) => unsafe {
                device.cmd_fill_buffer(self.commands, buffer.raw, 0, vk::WHOLE_SIZE, 0);
            },
            Dispatch::Record(record) => record(device, self.commands),
        }
    }

    /// Everything before is done and visible to everything after, the host included.
    fn barrier(&self) {
        let barrier = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE)];
        // SAFETY: called between begin and end of the command buffer.
        unsafe {
            self.gpu.device.cmd_pipeline_barrier(
                self.commands,
                vk::PipelineStageFlags::ALL_COMMANDS,
                vk::PipelineStageFlags::ALL_COMMANDS | vk::PipelineStageFlags::HOST,
                vk::DependencyFlags::empty(),
                &barrier,
                &[],
                &[],
            );
        }
    }

    /// Waits until the work is done; returns at once if there is none.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`] naming what was running.
    pub fn wait(&mut self) -> GpuResult<()> {
        if !self.in_flight {
            return Ok(());
        }
        self.in_flight = false;
        // SAFETY: the fence belongs to the submitted work.
        unsafe { self.gpu.device.wait_for_fences(&[self.fence], true, u64::MAX) }.map_err(|result| match result {
            vk::Result::ERROR_DEVICE_LOST => GpuError::DeviceLost { during: format!("running {}", self.name) },
            other => GpuError::call("vkWaitForFences", &self.name)(other),
        })
    }
}

impl Drop for Submission {
    fn drop(&mut self) {
        let _ = self.wait();
        // SAFETY: the work is done; null handles are allowed.
        unsafe {
            self.gpu.device.destroy_fence(self.fence, None);
            self.gpu.device.destroy_command_pool(self.pool, None);
        }
    }
}
