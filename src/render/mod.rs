//! Rendering: what is asked for ([`Settings`]), how it goes on ([`ProgressUpdate`]) and what comes out ([`RenderResult`]).

mod adaptive;
mod bake;
mod calibrate;
mod emission_pixels;
mod function_kernel;
mod kernel_build;
mod kernel_key;
mod looks;
mod open;
mod other_scene;
mod path_tracer;
mod pilot;
mod prints;
mod progress;
mod result;
mod run;
mod scene_buffers;
mod schedule;
mod settings;
mod slices;
mod statistics;

use std::time::Instant;

pub use adaptive::FactorReport;
pub use bake::{Bake, BakeReport, Baked, MOST_BAKED_RECORDS, MOST_BAKED_TRIANGLES};
pub use calibrate::calibrate;
pub use function_kernel::{FunctionCall, FunctionKernel};
pub use kernel_build::BindingOverride;
pub use kernel_key::KernelKey;
pub use open::{OpenDevice, choose_trace, open_device};
pub use other_scene::OtherScene;
pub use path_tracer::PathTracer;
pub use prints::Printed;
pub use progress::{Progress, ProgressUpdate};
pub use result::{NonFiniteSample, RenderResult, Seconds, StopReason};
pub use run::{Pilot, Run, RunPlan};
pub use scene_buffers::{SceneBuffers, choose_array_form};
pub use settings::{
    DeviceChoice, Integrator, LightSampling, MisHeuristic, PixelFilter, SamplerKind, Settings, TraceChoice,
    choose_camera,
};
pub use statistics::{Occupancy, RayCount, RayReport, SliceReport, Statistics, StatisticsReport};

use crate::film::metadata::{world_to_camera, world_to_ndc_orthographic, world_to_ndc_perspective};
use crate::film::replicates::ReplicateSums;
use crate::prepare::{self, Kept, PrepareOptions, Prepared};
pub use crate::prepare::{BvhQuality, EnvironmentSampling, LightChoice};
use crate::scene::{Camera, Projection, Scene};
use crate::{Error, Result};

/// Prepares a scene for a camera and the settings.
///
/// # Errors
/// [`Error::Prepare`] if the scene does not fit the layout.
pub fn prepare_scene(scene: &Scene, camera: &Camera, settings: &Settings) -> Result<Prepared> {
    prepare_scene_again(scene, camera, settings, &Kept::default())
}

/// The same with what was kept of other calls.
///
/// # Errors
/// Those of [`prepare_scene`].
pub fn prepare_scene_again(scene: &Scene, camera: &Camera, settings: &Settings, kept: &Kept) -> Result<Prepared> {
    let options = PrepareOptions {
        camera: camera.camera_to_world.translation,
        environment_sampling: settings.environment_sampling(),
        mip: settings.mip,
        light_choice: settings.light_choice,
        bvh_quality: settings.bvh_quality,
        ..PrepareOptions::default()
    };
    Ok(prepare::prepare_again(scene, &options, kept)?)
}

/// Renders a scene on the device that the settings ask for. `progress` is called after every slice and may stop the run.
///
/// # Errors
/// No usable device, and those of [`render_on`].
pub fn render(scene: &Scene, settings: &Settings, progress: Progress<'_>) -> Result<RenderResult> {
    render_on(&open_device(settings)?, scene, settings, progress)
}

/// The kernel of a scene for the camera that the settings choose, that camera, and the seconds that preparing took.
///
/// # Errors
/// A camera that does not exist, a scene that does not fit, a lost device.
pub fn path_tracer_on<'a>(
    open: &OpenDevice,
    scene: &'a Scene,
    settings: &Settings,
) -> Result<(PathTracer, &'a Camera, f64)> {
    let camera_index = choose_camera(scene, settings.camera.as_deref())?;
    let camera =
        scene.cameras.get(camera_index).ok_or_else(|| Error::Usage(format!("{} has no camera", scene.name)))?;
    let start = Instant::now();
    let prepared = prepare_scene(scene, camera, settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let tracer = PathTracer::new(&open.gpu, open.trace, &prepared, camera, settings, BindingOverride::default())?;
    Ok((tracer, camera, seconds))
}

/// Renders a scene on an open device.
///
/// # Errors
/// A camera that does not exist, a scene that does not fit, a lost device.
pub fn render_on(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    progress: Progress<'_>,
) -> Result<RenderResult> {
    let (mut tracer, camera, prepare_seconds) = path_tracer_on(open, scene, settings)?;
    let run = tracer.run_plan(settings.seed, &RunPlan::new(settings), progress)?;
    let mut warnings = Vec::new();
    if run.capped_samples > 0 {
        warnings
            .push(format!("{} samples had a path cut off at 65535 bounces: the image is too dark", run.capped_samples));
    }
    if let Some(most) = settings.clamp_indirect {
        warnings.push(format!("biased: indirect light above {most} is cut off, the image is too dark where it was"));
    }
    if run.statistics.as_ref().is_some_and(|statistics| statistics.is_saturated) || run.saturated_costs > 0 {
        warnings
            .push(String::from("a counter stopped at 4294967295 within a block of 16 samples: there were more visits"));
    }
    if run.pilot.is_some_and(|pilot| !pilot.is_complete) && run.stopped_by != StopReason::Interrupted {
        warnings.push(String::from(
            "--adaptive: a quarter of the time was up before its pilot was complete; all pixels are sampled alike",
        ));
    }
    let error_estimate = run.replicates.as_ref().and_then(ReplicateSums::estimate);
    if run.replicates.is_some() && error_estimate.is_none() {
        warnings.push(String::from(
            "the error is not known: every pixel needs at least two blocks of 16 samples, and finite sums",
        ));
    }
    if let Some(target) = settings.target_error.filter(|_| run.stopped_by != StopReason::TargetError) {
        warnings.push(format!("the target error of {target} was not reached"));
    }
    let aspect = f64::from(settings.width) / f64::from(settings.height);
    let key = tracer.key();
    Ok(RenderResult {
        stopped_by: run.stopped_by,
        device: open.gpu.info.name.clone(),
        driver: open.gpu.info.driver.clone(),
        device_reason: open.reason.clone(),
        trace: open.trace.to_string(),
        kernel_key: key.to_string(),
        light_choice: key.features.light_choice,
        baked: tracer.bake_report().clone(),
        features: key.kept(),
        rays: run.rays,
        paths: run.paths,
        seconds: Seconds {
            load: 0.0,
            prepare: prepare_seconds,
            compile: tracer.compile_seconds,
            upload: tracer.upload_seconds,
            render: run.seconds,
            write: 0.0,
        },
        gpu_bytes: tracer.gpu_bytes(),
        non_finite_samples: run.non_finite_samples,
        first_non_finite: run.first_non_finite,
        film: run.film,
        samples: run.samples,
        pilot: run.pilot,
        aovs: run.aovs,
        statistics: run.statistics,
        world_to_camera: world_to_camera(camera.camera_to_world),
        world_to_ndc: match camera.projection {
            Projection::Perspective { yfov_radians } => {
                world_to_ndc_perspective(camera.camera_to_world, yfov_radians, aspect)
            }
            Projection::Orthographic { ymag } => world_to_ndc_orthographic(camera.camera_to_world, ymag, aspect),
        },
        error_estimate,
        robust_mean: run.replicates.as_ref().and_then(ReplicateSums::robust_mean),
        warnings,
    })
}
