//! `sunfleck render`: from a job to images and a report.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use sunfleck::Error;
use sunfleck::film::Film;
use sunfleck::film::aov::Aov;
use sunfleck::film::aov_picture::aov_picture;
use sunfleck::film::exr::ExrImage;
use sunfleck::film::metadata::{Metadata, REC709_CHROMATICITIES, software};
use sunfleck::film::output::ImageFormat;
use sunfleck::film::png::{tone_map_srgb8, write_png};
use sunfleck::film::tev_feed::{TevFeed, TevNews};
use sunfleck::render::{RenderResult, Settings, StopReason, choose_camera, open_device, render_on};
use sunfleck::scene::load::{self, Decoded};
use sunfleck::scene::{Environment, Scene};

use super::estimator_args::EnvironmentArgs;
use super::progress::Progress;
use super::render_args::RenderJob;
use super::render_report::{print_summary, report};
use super::statistics_report::print_statistics;
use super::{interrupt, print_json, print_warnings};

/// Renders the job and writes its images.
pub(crate) fn run(job: RenderJob) -> anyhow::Result<()> {
    let loading = Instant::now();
    let mut scene = load_scene(&job.scene, &job.environment, job.quiet)?;
    if let Some(to_world) = job.look_at.and_then(|pose| pose.camera_to_world()) {
        let camera = choose_camera(&scene, job.settings.camera.as_deref())?;
        scene.cameras[camera].camera_to_world = to_world;
    }
    let load_seconds = loading.elapsed().as_secs_f64();
    let viewer = job.tev.as_deref().map(|address| connect(address, &scene)).transpose()?;
    let device = open_device(&job.settings)?;
    if !job.quiet {
        eprintln!("device: {}, {}", device.reason, device.gpu.info.driver);
    }
    interrupt::install();
    let mut progress = Progress::new(job.quiet);
    let result = render_on(&device, &scene, &job.settings, &mut |update| {
        progress.show(update);
        if let (Some(viewer), Some(run)) = (viewer.as_ref().filter(|viewer| viewer.is_due()), update.run) {
            viewer.show(&run.film, run.aovs.as_ref());
        }
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    progress.finish();
    let mut result = result?;
    if let Some(viewer) = viewer {
        viewer.show(&result.film, result.aovs.as_ref());
        viewer.finish();
    }
    result.seconds.load = load_seconds;
    finish(&job, &scene, result)
}

fn connect(address: &str, scene: &Scene) -> anyhow::Result<TevFeed> {
    let said = |news: &TevNews| {
        if let TevNews::Lost(error) = news {
            eprintln!("warning: tev: {error}; the render goes on without it");
        }
    };
    TevFeed::connect(address, &scene.name, said).map_err(|error| {
        let message = format!("cannot be reached: {error}; start tev first, or leave --tev out");
        Error::input(Path::new(&format!("--tev {address}")), message).into()
    })
}

/// Writes and reports a result, and judges it.
fn finish(job: &RenderJob, scene: &Scene, mut result: RenderResult) -> anyhow::Result<()> {
    let writing = Instant::now();
    write_outputs(job, scene, &result)?;
    result.seconds.write = writing.elapsed().as_secs_f64();
    print_warnings(&result.warnings);
    if !job.quiet {
        print_summary(job, &result);
        result.statistics.iter().for_each(|statistics| print_statistics(&statistics.report()));
    }
    if job.json {
        print_json(&report(job, scene, &result))?;
    }
    verdict(&job.settings, &result)
}

/// The scene with the environment that the flags ask for, with a camera and with light.
pub(super) fn load_scene(name: &str, environment: &EnvironmentArgs, quiet: bool) -> anyhow::Result<Scene> {
    load_scene_again(name, environment, quiet, &Decoded::default())
}

/// The same with the images of earlier calls.
pub(super) fn load_scene_again(
    name: &str,
    environment: &EnvironmentArgs,
    quiet: bool,
    decoded: &Decoded,
) -> anyhow::Result<Scene> {
    let mut scene = load::resolve_again(name, decoded).map_err(Error::from)?;
    change_environment(&mut scene, environment, decoded)?;
    scene.frame_if_no_camera();
    print_warnings(&scene.warnings);
    if !quiet {
        scene.notes.iter().for_each(|note| eprintln!("note: {note}"));
    }
    Ok(scene)
}

fn change_environment(scene: &mut Scene, change: &EnvironmentArgs, decoded: &Decoded) -> anyhow::Result<()> {
    if let Some(file) = &change.file {
        scene.environment = decoded
            .environment(file, change.strength, change.rotation_degrees)
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
            ImageFormat::Exr => exr_image(job, scene, result).write(path),
            ImageFormat::Png => write_tone_mapped(path, job, &result.film),
        };
        outcome = outcome.and(written);
    }
    for (path, aov) in &job.aov_pictures {
        outcome = outcome.and(write_aov_picture(path, *aov, job.quiet, result));
    }
    outcome
}

fn exr_image(job: &RenderJob, scene: &Scene, result: &RenderResult) -> ExrImage {
    let mut image = ExrImage::from_film(&result.film, metadata(job, scene, result));
    if let Some(aovs) = &result.aovs {
        aovs.push_layers(&result.film, &mut image);
    }
    image
}

fn write_aov_picture(path: &Path, aov: Aov, quiet: bool, result: &RenderResult) -> sunfleck::Result<()> {
    let film = &result.film;
    let Some(picture) = result.aovs.as_ref().and_then(|aovs| aov_picture(aovs, film, aov)) else { return Ok(()) };
    if let Some(scale) = picture.scale.filter(|_| !quiet) {
        eprintln!("note: {}: {scale}", path.display());
    }
    write_png(path, film.width(), film.height(), &picture.pixels)
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
        sample_ranges: vec![result.samples.clone()],
        render_time_seconds: Some(result.seconds.render as f32),
        world_to_camera: Some(result.world_to_camera),
        world_to_ndc: Some(result.world_to_ndc),
        chromaticities: Some(REC709_CHROMATICITIES),
        software: Some(software()),
        kernel_key: Some(result.kernel_key.clone()),
        scene: Some(scene.name.clone()),
        integrator: Some(job.settings.integrator.to_string()),
        sampler: Some(sampler_text(&job.settings)),
        clamp_indirect: job.settings.clamp_indirect,
        estimated_error: result.error_estimate.map(|e| e.error as f32),
        estimated_error_interval: result.error_estimate.map(|e| e.interval.map(|bound| bound as f32)),
        device: Some(format!("{}, {}", result.device, result.driver)),
        ..Metadata::default()
    }
}

/// How the samples were drawn.
fn sampler_text(settings: &Settings) -> String {
    let adaptive = settings.adaptive.map(|pilot| format!(", adaptive by a pilot of {pilot}"));
    format!("{}{}", settings.sampler, adaptive.unwrap_or_default())
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
    if let Some(target) =
        settings.target_error.filter(|_| settings.strict && result.stopped_by != StopReason::TargetError)
    {
        return Err(Error::Untrustworthy(format!("--strict: the target error of {target} was not reached")).into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunfleck::film::exr::read_exr;
    use sunfleck::film::replicates::ErrorEstimate;
    use sunfleck::film::tonemap::ToneMap;
    use sunfleck::render::{NonFiniteSample, Seconds};

    fn job(folder: &Path) -> RenderJob {
        RenderJob {
            scene: "cornell".to_owned(),
            outputs: vec![(folder.join("a.exr"), ImageFormat::Exr), (folder.join("a.png"), ImageFormat::Png)],
            aov_pictures: Vec::new(),
            look_at: None,
            settings: Settings { width: 2, height: 1, seed: 3, ..Settings::default() },
            environment: EnvironmentArgs { file: None, strength: 1.0, rotation_degrees: 0.0 },
            exposure_ev: 0.0,
            tone_map: ToneMap::default(),
            tev: None,
            json: false,
            quiet: true,
        }
    }

    fn result() -> RenderResult {
        let mut film = Film::new(2, 1);
        film.add_block(0, [4.0; 3], 5.0, 4);
        film.add_block(1, [2.0; 3], 1.5, 4);
        RenderResult {
            film,
            samples: 0..4,
            pilot: None,
            aovs: None,
            statistics: None,
            stopped_by: StopReason::Samples,
            device_reason: String::new(),
            device: "a device".to_owned(),
            driver: "its driver".to_owned(),
            trace: "bvh".to_owned(),
            kernel_key: "key".to_owned(),
            light_choice: sunfleck::render::LightChoice::Power,
            baked: sunfleck::render::BakeReport::default(),
            features: vec!["mis".to_owned()],
            rays: 100,
            paths: 8,
            seconds: Seconds { render: 2.0, ..Seconds::default() },
            gpu_bytes: 1000,
            non_finite_samples: 0,
            first_non_finite: Vec::new(),
            world_to_camera: [1.0; 16],
            world_to_ndc: [2.0; 16],
            error_estimate: None,
            robust_mean: None,
            warnings: Vec::new(),
        }
    }

    #[test]
    fn an_error_that_is_asked_for_is_reported_and_judged() {
        let folder = tempfile::tempdir().unwrap();
        let mut job = job(folder.path());
        (job.settings.target_error, job.settings.strict) = (Some(0.1), true);
        let estimate = ErrorEstimate { error: 0.2, interval: [0.1, 0.4], replicates: 4 };
        let short = RenderResult { error_estimate: Some(estimate), ..result() };
        assert_eq!(exit_code(&finish(&job, &Scene::default(), short.clone()).unwrap_err()), 6);
        let report = report(&job, &Scene::default(), &short);
        assert_eq!(report["estimated_error"], 0.2);
        assert_eq!(report["estimated_error_interval"], serde_json::json!([0.1, 0.4]));
        assert_eq!((&report["estimated_error_replicates"], &report["target_error"]), (&4.into(), &0.1.into()));
        let image = read_exr(&folder.path().join("a.exr")).unwrap();
        assert_eq!(image.metadata.estimated_error, Some(0.2));
        assert_eq!(image.metadata.estimated_error_interval, Some([0.1, 0.4]));
        let reached = RenderResult { stopped_by: StopReason::TargetError, ..short };
        finish(&job, &Scene::default(), reached).unwrap();
    }

    fn exit_code(error: &anyhow::Error) -> u8 {
        super::super::exit_code(error)
    }

    #[test]
    fn a_result_becomes_images_with_attributes() {
        let folder = tempfile::tempdir().unwrap();
        finish(&job(folder.path()), &Scene::default(), result()).unwrap();
        let image = read_exr(&folder.path().join("a.exr")).unwrap();
        assert_eq!(image.rgb().unwrap(), vec![[1.0; 3], [0.5; 3]]);
        assert_eq!(sunfleck::film::metadata::format_ranges(&image.metadata.sample_ranges), "0..4");
        assert_eq!((image.metadata.seed, image.metadata.samples_per_pixel), (Some(3), Some(4.0)));
        assert_eq!(image.metadata.device.as_deref(), Some("a device, its driver"));
        assert!(folder.path().join("a.png").exists());
    }

    #[test]
    fn the_report_has_what_the_contract_names() {
        let report = report(&job(Path::new("")), &Scene::default(), &result());
        let names = "device driver trace width height spp rays seconds rays_per_second paths_per_second estimated_error \
            non_finite_samples features gpu_bytes outputs";
        for name in names.split_whitespace() {
            assert!(report.get(name).is_some_and(|value| !value.is_null()), "{name}: {report}");
        }
        for part in ["load", "prepare", "compile", "upload", "render", "write"] {
            assert!(report["seconds"][part].is_f64(), "{part}");
        }
        assert_eq!((&report["rays_per_second"], &report["spp"]), (&50.0.into(), &4.0.into()));
    }

    #[test]
    fn the_images_are_written_before_a_run_is_judged() {
        let folder = tempfile::tempdir().unwrap();
        let bad = NonFiniteSample { x: 1, y: 0, sample: 2 };
        let suspect = RenderResult { non_finite_samples: 1, first_non_finite: vec![bad], ..result() };
        let mut job = job(folder.path());
        finish(&job, &Scene::default(), suspect.clone()).unwrap();
        job.settings.strict = true;
        assert_eq!(exit_code(&finish(&job, &Scene::default(), suspect).unwrap_err()), 6);
        let interrupted = RenderResult { stopped_by: StopReason::Interrupted, ..result() };
        std::fs::remove_file(&job.outputs[0].0).unwrap();
        assert_eq!(exit_code(&finish(&job, &Scene::default(), interrupted).unwrap_err()), 130);
        assert!(job.outputs[0].0.exists());
    }
}
