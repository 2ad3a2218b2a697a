//! What a render returns: the film, and what the run has to say about itself.

use std::fmt;
use std::ops::Range;

use super::{BakeReport, Pilot, Statistics};
use crate::film::Film;
use crate::film::aov::AovFilm;
use crate::film::replicates::{ErrorEstimate, RobustMean};
use crate::prepare::LightChoice;

/// The outcome of a render.
#[derive(Clone, Debug)]
pub struct RenderResult {
    /// The samples.
    pub film: Film,
    /// Which of the image they are; a run that ended early has the first ones.
    pub samples: Range<u32>,
    /// What the pilot of adaptive sampling found, if there was one.
    pub pilot: Option<Pilot>,
    /// What was kept besides radiance, if the settings ask for anything.
    pub aovs: Option<AovFilm>,
    /// Counters, if the settings ask for them.
    pub statistics: Option<Statistics>,
    /// Which rule ended the run.
    pub stopped_by: StopReason,
    /// Name of the device.
    pub device: String,
    /// Name and version of its driver.
    pub driver: String,
    /// Why this device and this way to trace.
    pub device_reason: String,
    /// How rays were traced: `ray-query` or `bvh`.
    pub trace: String,
    /// The kernel key: equal keys compute equal bits on one device and driver.
    pub kernel_key: String,
    /// What the kernel was built with, one name each.
    pub features: Vec<String>,
    /// What of the scene was compiled in.
    pub baked: BakeReport,
    /// How lights were picked: what the settings ask for, unless the scene has too few.
    pub light_choice: LightChoice,
    /// Rays traced, shadow rays included.
    pub rays: u64,
    /// Paths traced: samples over all pixels, those of a pilot too.
    pub paths: u64,
    /// Where the time went.
    pub seconds: Seconds,
    /// Bytes of device memory in use at the peak.
    pub gpu_bytes: u64,
    /// Samples that were NaN or infinite. Each is a bug.
    pub non_finite_samples: u64,
    /// The first few of them.
    pub first_non_finite: Vec<NonFiniteSample>,
    /// The camera as EXR attributes `worldToCamera` and `worldToNDC` (see [`crate::film::metadata`]).
    pub world_to_camera: [f32; 16],
    /// See `world_to_camera`.
    pub world_to_ndc: [f32; 16],
    /// The error with an interval, where the settings ask for it and enough samples were drawn.
    pub error_estimate: Option<ErrorEstimate>,
    /// The image's mean beside its median of means, where replicates were kept.
    pub robust_mean: Option<RobustMean>,
    /// What the user should know, one line each.
    pub warnings: Vec<String>,
}

/// Which rule ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All samples are done.
    Samples,
    /// The time was up.
    Time,
    /// The target error was reached.
    TargetError,
    /// The caller's closure said so.
    Interrupted,
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Samples => "samples",
            Self::Time => "time",
            Self::TargetError => "target-error",
            Self::Interrupted => "interrupted",
        })
    }
}

/// Wall time of the parts of a run, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Seconds {
    /// Reading the scene. The caller of the renderer fills it in.
    pub load: f64,
    /// Building BVHs and tables.
    pub prepare: f64,
    /// Compiling shaders and pipelines.
    pub compile: f64,
    /// Copying to the device.
    pub upload: f64,
    /// Tracing.
    pub render: f64,
    /// Writing the images. The caller of the renderer fills it in.
    pub write: f64,
}

/// A sample that was NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct NonFiniteSample {
    /// Column of the pixel, from the left.
    pub x: u32,
    /// Row of the pixel, from the top.
    pub y: u32,
    /// Index of the sample.
    pub sample: u32,
}
