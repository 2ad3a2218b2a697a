//! `sunfleck render`: from a job to images and a report.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use sunfleck::Error;
use sunfleck::film::Film;
use sunfleck::film::exr::ExrImage;
use sunfleck::film::metadata::{Metadata, REC709_CHROMATICITIES, software};
use sunfleck::film::output::ImageFormat;
use sunfleck::film::png::{tone_map_srgb8, write_png};
use sunfleck::render::{ProgressUpdate, RenderResult, Settings, StopReason};
use sunfleck::scene::{Environment, Scene, load};

use super::progress::Progress;
use super::render_args::{EnvironmentArgs, RenderJob};
use super::render_report::{print_summary, report};
use super::{interrupt, print_json, print_warnings};

/// Renders the job and writes its images.
pub(crate) fn run(job: RenderJob) -> anyhow::Result<()> {
    let loading = Instant::now();
    let scene = load_scene(&job)?;
    let load_seconds = loading.elapsed().as_secs_f64();
    interrupt::install();
    let mut progress = Progress::new(job.quiet);
    let result = render(&scene, &job.settings, &mut |update| {
        progress.show(update);
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    progress.finish();
    let mut result = result?;
    result.seconds.load = load_seconds;
    let writing = Instant::now();
    write_outputs(&job, &scene, &result)?;
    result.seconds.write = writing.elapsed().as_secs_f64();
    print_warnings(&result.warnings);
    if !job.quiet {
        print_summary(&job, &result);
    }
    if job.json {
        print_json(&report(&job, &scene, &result))?;
    }
    verdict(&job.settings, &result)
}

/// The one call into the renderer.
fn render(
    _scene: &Scene,
    _settings: &Settings,
    _progress: &mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>,
) -> sunfleck::Result<RenderResult> {
    Err(Error::Usage(format!("rendering is not built yet in {}", software())))
}

/// The scene with the environment that the flags ask for, with a camera and with light.
fn load_scene(job: &RenderJob) -> anyhow::Result<Scene> {
    let mut scene = load::resolve(&job.scene).map_err(Error::from)?;
    change_environment(&mut scene, &job.environment)?;
    scene.frame_if_no_camera();
    print_warnings(&scene.warnings);
    if !job.quiet {
        scene.notes.iter().for_each(|note| eprintln!("note: {note}"));
    }
    Ok(scene)
}

fn change_environment(scene: &mut Scene, change: &EnvironmentArgs) -> anyhow::Result<()> {
    if let Some(file) = &change.file {
        scene.environment = load::load_environment(file, change.strength, change.rotation_degrees)
            .map_err(Error::from)
            .context("--env")?;
        scene.light_if_dark();
        return Ok(());
    }
    // Before the strength is applied, so that it acts on the added environment too.
    scene.light_if_dark();
    match &mut scene.environment {
        Environment::None => {}
        Environment::Constant(radiance) => *radiance = radiance.map(|c| c * change.strength),
        Environment::Image { strength, rotation_radians, .. } => {
            *strength *= change.strength;
            *rotation_radians += change.rotation_degrees.to_radians();
        }
    }
    Ok(())
}

/// Writes every image. If one fails the others are still written, since the samples took their time.
fn write_outputs(job: &RenderJob, scene: &Scene, result: &RenderResult) -> sunfleck::Result<()> {
    let mut outcome = Ok(());
    for (path, format) in &job.outputs {
        let written = match format {
            ImageFormat::Exr => ExrImage::from_film(&result.film, metadata(job, scene, result)).write(path),
            ImageFormat::Png => write_tone_mapped(path, job, &result.film),
        };
        outcome = outcome.and(written);
    }
    outcome
}

fn write_tone_mapped(path: &Path, job: &RenderJob, film: &Film) -> sunfleck::Result<()> {
    let (pixels, non_finite) = tone_map_srgb8(&film.radiance(), job.exposure_ev, job.tone_map);
    if non_finite > 0 {
        eprintln!("warning: {}: {non_finite} pixels are NaN or infinite; they are magenta", path.display());
    }
    write_png(path, film.width(), film.height(), &pixels)
}

fn metadata(job: &RenderJob, scene: &Scene, result: &RenderResult) -> Metadata {
    Metadata {
        seed: Some(job.settings.seed),
        sample_ranges: vec![job.settings.samples_in(&result.film)],
        render_time_seconds: Some(result.seconds.render as f32),
        world_to_camera: Some(result.world_to_camera),
        world_to_ndc: Some(result.world_to_ndc),
        chromaticities: Some(REC709_CHROMATICITIES),
        software: Some(software()),
        kernel_key: Some(result.kernel_key.clone()),
        scene: Some(scene.name.clone()),
        integrator: Some(job.settings.integrator.to_string()),
        device: Some(format!("{}, {}", result.device, result.driver)),
        ..Metadata::default()
    }
}

/// Whether a run whose images are written was a success.
fn verdict(settings: &Settings, result: &RenderResult) -> anyhow::Result<()> {
    if result.stopped_by == StopReason::Interrupted {
        return Err(Error::Interrupted.into());
    }
    if settings.strict && result.non_finite_samples > 0 {
        let count = result.non_finite_samples;
        return Err(Error::Untrustworthy(format!("--strict: {count} samples were NaN or infinite")).into());
    }
    Ok(())
}
