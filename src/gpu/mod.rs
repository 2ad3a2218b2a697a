//! Vulkan behind small RAII types: devices, memory, buffers, kernels, acceleration structures, and the one place that
//! submits work and waits for it. It knows nothing of scenes.
#![allow(unsafe_code, reason = "this is the one module that calls Vulkan; each block states why it is sound")]

mod acceleration_structure;
mod buffer;
mod cache_folder;
mod calibration;
mod device;
mod driver_environment;
mod enumerate;
mod error;
mod instance;
mod kernel;
mod lavapipe;
mod pipeline_cache;
pub mod shader_compiler;
pub mod specialize;
mod submit;

pub use acceleration_structure::{AccelerationStructures, InstanceGeometry, MeshGeometry, MeshPart};
pub use buffer::{Buffer, MemoryUse};
pub use calibration::{CalibratedVariant, Calibration, forget_calibration};
pub use device::{DeviceRequirements, Gpu};
pub use driver_environment::{DriverEnvironment, driver_environment, prepare_driver_environment};
pub use enumerate::{DeviceInfo, DeviceKind, DeviceLimits, DeviceSelection, devices, select};
pub use error::{GpuError, GpuResult};
pub use instance::{Instance, take_validation_messages, validation_is_available};
pub use kernel::{ArrayForm, BindingResource, Kernel, KernelDescription, TraceBackend};
pub use submit::{Dispatch, Submission};

/// The shaders compiled by build.rs.
pub mod embedded {
    include!(concat!(env!("OUT_DIR"), "/embedded_shaders.rs"));
}
