//! From the settings to an open device and a trace back end, with the reasons for both.

use std::sync::Arc;

use super::{DeviceChoice, Settings, TraceChoice};
use crate::gpu::{self, DeviceInfo, DeviceKind, DeviceRequirements, DeviceSelection, Gpu, Instance, TraceBackend};
use crate::{Error, Result};

/// An open device and how rays are traced on it.
pub struct OpenDevice {
    /// The device.
    pub gpu: Arc<Gpu>,
    /// The trace back end.
    pub trace: TraceBackend,
    /// Why this device and this back end.
    pub reason: String,
}

/// Opens the device that the settings ask for.
///
/// # Errors
/// [`Error::Device`] if there is none or it lacks what is demanded.
pub fn open_device(settings: &Settings) -> Result<OpenDevice> {
    let instance = Instance::new()?;
    let wanted = match &settings.device {
        DeviceChoice::Auto => DeviceSelection::Auto,
        DeviceChoice::Index(index) => DeviceSelection::Index(*index),
        DeviceChoice::Name(name) => DeviceSelection::Name(name.clone()),
        DeviceChoice::All => return Err(Error::Usage("--device all is not built yet".to_owned())),
    };
    let (info, why_device) = gpu::select(&gpu::devices(&instance)?, &wanted)?;
    let (trace, why_trace) = choose_trace(&info, settings.trace);
    let reason = format!("{} ({why_device}), trace {trace} ({why_trace})", info.name);
    let requirements = DeviceRequirements { ray_query: trace == TraceBackend::RayQuery };
    Ok(OpenDevice { gpu: Gpu::new(instance, info, requirements)?, trace, reason })
}

/// `auto` takes what is faster, not what exists: a CPU driver's ray query is slower than our BVH by 4 to 26 times (see
/// docs/benchmarks).
pub fn choose_trace(info: &DeviceInfo, choice: TraceChoice) -> (TraceBackend, &'static str) {
    match choice {
        TraceChoice::Bvh => (TraceBackend::Bvh, "asked for"),
        TraceChoice::RayQuery => (TraceBackend::RayQuery, "asked for"),
        TraceChoice::Auto if !info.ray_query => (TraceBackend::Bvh, "the device has no ray queries"),
        TraceChoice::Auto if info.kind == DeviceKind::Cpu => {
            (TraceBackend::Bvh, "faster than a software driver's ray queries")
        }
        TraceChoice::Auto => (TraceBackend::RayQuery, "hardware ray queries"),
    }
}
