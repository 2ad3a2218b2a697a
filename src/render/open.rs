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

impl OpenDevice {
    /// A device on which kernels can be built while this one renders: this one, but for CPU devices, where a driver may
    /// compile in the queue's thread (lavapipe does, at the first dispatch). They are opened a second time.
    ///
    /// # Errors
    /// When the driver refuses.
    pub fn for_building(&self) -> Result<Arc<Gpu>> {
        if self.gpu.info.kind != DeviceKind::Cpu {
            return Ok(Arc::clone(&self.gpu));
        }
        let requirements = DeviceRequirements { ray_query: self.trace == TraceBackend::RayQuery };
        Ok(Gpu::new(Arc::clone(self.gpu.instance()), self.gpu.info.clone(), requirements)?)
    }
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

/// How rays are traced on the device, and why. `auto` takes what is faster, not what exists: what was measured on the device
/// ([`crate::gpu::Calibration`]), else by the rule that a CPU driver's ray query is slower than our BVH by 4 to 26 times
/// (docs/benchmarks).
pub fn choose_trace(info: &DeviceInfo, choice: TraceChoice) -> (TraceBackend, String) {
    let measured = info.calibration.as_ref().and_then(|calibration| calibration.best());
    let (trace, why) = match choice {
        TraceChoice::Bvh => (TraceBackend::Bvh, "asked for"),
        TraceChoice::RayQuery => (TraceBackend::RayQuery, "asked for"),
        TraceChoice::Auto if !info.ray_query => (TraceBackend::Bvh, "the device has no ray queries"),
        TraceChoice::Auto => {
            if let Some(best) = measured {
                let rate = best.mean_paths_per_second() / 1e6;
                return (best.trace, format!("calibrated: {rate:.2} million paths/s, the fastest"));
            }
            if info.kind == DeviceKind::Cpu {
                (TraceBackend::Bvh, "faster than a software driver's ray queries")
            } else {
                (TraceBackend::RayQuery, "hardware ray queries")
            }
        }
    };
    (trace, why.to_owned())
}
