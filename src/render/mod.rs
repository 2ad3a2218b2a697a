//! Rendering: what is asked for ([`Settings`]), how it goes on ([`ProgressUpdate`]) and what comes out ([`RenderResult`]).

mod progress;
mod result;
mod settings;

pub use progress::ProgressUpdate;
pub use result::{NonFiniteSample, RenderResult, Seconds, StopReason};
pub use settings::{
    DeviceChoice, EnvSampling, Integrator, LightSampling, MisHeuristic, PixelFilter, SamplerKind, Settings,
    TraceChoice, choose_camera,
};
