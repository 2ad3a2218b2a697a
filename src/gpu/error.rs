//! What can go wrong on the device.

use ash::vk;

/// An error of the device or its driver.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// There is no Vulkan loader or no driver.
    #[error("no Vulkan driver was found: {0}; install one (on Debian the software driver is in mesa-vulkan-drivers)")]
    NoDriver(String),
    /// No device matches what was asked for.
    #[error("{0}")]
    NoDevice(String),
    /// The device lacks something that is needed or was demanded.
    #[error("device '{device}' {lacks}")]
    Lacks {
        /// Name of the device.
        device: String,
        /// What it lacks, as the rest of the sentence.
        lacks: String,
    },
    /// Memory ran out.
    #[error("out of device memory: {what} needs {bytes} bytes")]
    OutOfMemory {
        /// What was being allocated.
        what: String,
        /// Its size.
        bytes: u64,
    },
    /// The device was lost.
    #[error("the device was lost while {during}")]
    DeviceLost {
        /// What was running.
        during: String,
    },
    /// Another Vulkan call failed.
    #[error("{call} failed for {object}: {result}")]
    Vulkan {
        /// The Vulkan command.
        call: &'static str,
        /// The object it was for.
        object: String,
        /// Its result.
        result: vk::Result,
    },
    /// A shader does not compile.
    #[error("{0}")]
    Shader(#[from] super::shader_compiler::CompileError),
}

/// Result of a device operation.
pub type GpuResult<T> = Result<T, GpuError>;

impl GpuError {
    /// For `map_err` on a Vulkan call: names the call and the object, and tells lost devices and full memory apart.
    pub(crate) fn call(call: &'static str, object: &str) -> impl FnOnce(vk::Result) -> Self {
        let object = object.to_owned();
        move |result| match result {
            vk::Result::ERROR_DEVICE_LOST => Self::DeviceLost { during: format!("{call} for {object}") },
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                Self::OutOfMemory { what: format!("{call} for {object}"), bytes: 0 }
            }
            _ => Self::Vulkan { call, object, result },
        }
    }
}
