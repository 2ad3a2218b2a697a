//! The renders of a bench: one kernel, every seed at every sample count, and their errors.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::bias::{BiasVerdict, find_bias};
use super::mean_image::ImageAccumulator;
use super::reference::{Errors, Reference, ReferenceInfo};
use super::statistics::{PowerLaw, Summary, fit_power_law};
use crate::layout::{LIGHT_ENVIRONMENT, LIGHT_TRIANGLE};
use crate::render::{
    LightSampling, OpenDevice, PathTracer, ProgressUpdate, Run, Seconds, Settings, StopReason, path_tracer_on,
};
use crate::scene::Scene;
use crate::{Error, Result};

/// Independent parts of the reference that a bench renders itself: enough for a variance of every pixel.
pub const REFERENCE_PARTS: u32 = 8;

/// What a bench renders.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Samples per pixel of the images, ascending.
    pub spp: Vec<u32>,
    /// Images at each count, of the seeds `settings.seed ..`; at least two.
    pub seeds: u32,
    /// What they are measured against.
    pub reference: ReferenceChoice,
}

/// Where the reference comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferenceChoice {
    /// An EXR file.
    File(PathBuf),
    /// A run of [`other_estimator`] at this many samples per pixel, rounded up to a multiple of [`REFERENCE_PARTS`].
    Own(u32),
}

/// What a bench found.
#[derive(Clone, Debug, Serialize)]
pub struct Measurement {
    /// Name of the device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Why this device and this trace back end.
    pub device_reason: String,
    /// The processor's name, where the system tells.
    pub processor: Option<String>,
    /// The kernel: equal keys compute equal bits on one device and driver.
    pub kernel_key: String,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// What the errors are to.
    pub reference: ReferenceInfo,
    /// One entry a sample count.
    pub points: Vec<Point>,
    /// MSE over samples per pixel; `None` where no power law fits (an MSE that is not above the reference's noise).
    pub mse_over_spp: Option<PowerLaw>,
    /// MSE over seconds.
    pub mse_over_seconds: Option<PowerLaw>,
    /// The mean of all images at the largest count against the reference.
    pub bias: BiasVerdict,
    /// Samples that were NaN or infinite. Each is a bug.
    pub non_finite_samples: u64,
    /// Where the time before the first image went, in seconds; `render` is the sum over all images.
    pub seconds: Seconds,
}

/// All images at one sample count.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Samples per pixel.
    pub spp: u32,
    /// Seconds of rendering.
    pub seconds: Summary,
    /// MSE without the reference's noise.
    pub mse: Summary,
    /// relMSE without the reference's noise.
    pub rel_mse: Summary,
    /// FLIP, the reference's noise included; `None` if the images are too large for it.
    pub flip: Option<Summary>,
    /// 1 / (MSE · seconds).
    pub efficiency: f64,
    /// The raw numbers.
    pub runs: Vec<SeedRun>,
}

/// One image.
#[derive(Clone, Debug, Serialize)]
pub struct SeedRun {
    /// Its seed.
    pub seed: u32,
    /// Seconds of rendering.
    pub seconds: f64,
    /// Its errors.
    #[serde(flatten)]
    pub errors: Errors,
}

impl Point {
    fn new(spp: u32, runs: Vec<SeedRun>) -> Self {
        let summary = |of: fn(&SeedRun) -> f64| Summary::of(&runs.iter().map(of).collect::<Vec<_>>());
        let flips: Option<Vec<f64>> = runs.iter().map(|run| run.errors.flip).collect();
        let (seconds, mse) = (summary(|run| run.seconds), summary(|run| run.errors.mse));
        Self {
            spp,
            seconds,
            mse,
            rel_mse: summary(|run| run.errors.rel_mse),
            flip: flips.map(|flips| Summary::of(&flips)),
            efficiency: 1.0 / (mse.mean * seconds.mean),
            runs,
        }
    }
}

/// The estimator that checks another one: the same integral, by other samples. Strategies that share no code path would
/// be better still; what both share (BSDFs, cameras, intersection) is tested against Mitsuba instead.
pub fn other_estimator(settings: &Settings) -> Settings {
    let light_sampling = match settings.light_sampling {
        LightSampling::Mis => LightSampling::Mixture,
        LightSampling::Mixture | LightSampling::Nee | LightSampling::Bsdf => LightSampling::Mis,
    };
    Settings { light_sampling, ..settings.clone() }
}

/// Renders everything and measures it. `progress` is called after every slice with the samples of the whole bench.
///
/// # Errors
/// Those of a render; a reference that cannot be used; [`Error::Interrupted`] if `progress` says so.
pub fn measure(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    progress: &mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>,
) -> Result<Measurement> {
    let mut work = Work::new(settings, plan, progress);
    let reference = find_reference(open, scene, settings, plan, &mut work)?;
    let (mut tracer, _, prepare_seconds) = path_tracer_on(open, scene, settings)?;
    let mut mean = ImageAccumulator::new((settings.width, settings.height));
    let mut runs: Vec<Vec<SeedRun>> = plan.spp.iter().map(|_| Vec::new()).collect();
    let mut render_seconds = 0.0;
    // All counts of one seed after the other, so that a drift of the machine's speed falls on every count.
    for seed in (0..plan.seeds).map(|n| settings.seed.wrapping_add(n)) {
        for (&spp, runs) in plan.spp.iter().zip(&mut runs) {
            let run = work.render(&mut tracer, seed, spp)?;
            let radiance = run.film.radiance();
            if Some(&spp) == plan.spp.last() {
                mean.add(&radiance);
            }
            render_seconds += run.seconds;
            runs.push(SeedRun { seed, seconds: run.seconds, errors: reference.errors_of(&radiance) });
        }
    }
    let points: Vec<_> = plan.spp.iter().zip(runs).map(|(&spp, runs)| Point::new(spp, runs)).collect();
    Ok(Measurement {
        device: open.gpu.info.name.clone(),
        driver: open.gpu.info.driver.clone(),
        device_reason: open.reason.clone(),
        processor: processor_name(),
        kernel_key: tracer.key().to_string(),
        width: settings.width,
        height: settings.height,
        mse_over_spp: fit_power_law(&by_seed(&points, |spp, run| (f64::from(spp), run.errors.mse))),
        mse_over_seconds: fit_power_law(&by_seed(&points, |_, run| (run.seconds, run.errors.mse))),
        points,
        bias: find_bias(&mean.finish(), &reference.image),
        reference: reference.about,
        non_finite_samples: work.non_finite_samples,
        seconds: Seconds {
            prepare: prepare_seconds,
            compile: tracer.compile_seconds,
            upload: tracer.upload_seconds,
            render: render_seconds,
            ..Seconds::default()
        },
    })
}

/// Renders or reads only the reference of a plan.
///
/// # Errors
/// Those of [`measure`].
pub fn reference_of(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    progress: &mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>,
) -> Result<Reference> {
    let only_reference = Plan { spp: Vec::new(), ..plan.clone() };
    let mut work = Work::new(settings, &only_reference, progress);
    find_reference(open, scene, settings, plan, &mut work)
}

fn find_reference(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    work: &mut Work,
) -> Result<Reference> {
    let spp = match &plan.reference {
        ReferenceChoice::File(path) => {
            let reference = Reference::read(path, (settings.width, settings.height))?;
            let seed = reference.about.seed.filter(|seed| seed.wrapping_sub(settings.seed) < plan.seeds);
            return seed.map_or(Ok(reference), |seed| Err(shared_seed(path, seed)));
        }
        ReferenceChoice::Own(spp) => spp.div_ceil(REFERENCE_PARTS),
    };
    let other = other_estimator(settings);
    let (mut tracer, ..) = path_tracer_on(open, scene, &other)?;
    let mut image = ImageAccumulator::new((settings.width, settings.height));
    let first_seed = settings.seed.wrapping_add(plan.seeds);
    let mut seconds = 0.0;
    for seed in (0..REFERENCE_PARTS).map(|n| first_seed.wrapping_add(n)) {
        let run = work.render(&mut tracer, seed, spp)?;
        image.add(&run.film.radiance());
        seconds += run.seconds;
    }
    let total = u64::from(spp) * u64::from(REFERENCE_PARTS);
    let last_seed = first_seed.wrapping_add(REFERENCE_PARTS - 1);
    let mut description = format!(
        "own run with --light-sampling {}, {total} samples per pixel of seeds {first_seed} to {last_seed}",
        other.light_sampling
    );
    if tracer.key().features.lights & (1 << LIGHT_TRIANGLE | 1 << LIGHT_ENVIRONMENT) == 0 {
        description += " (no light here has an area: every light sampling is the same estimator)";
    }
    Ok(Reference::from_images(image.finish(), description, total as f64, seconds))
}

/// Equal seeds are equal random numbers: the errors would be those of images that know their reference.
fn shared_seed(path: &Path, seed: u32) -> Error {
    let path = path.display();
    Error::Usage(format!("--reference: {path} has seed {seed}, as one of the images has; choose others by --seed"))
}

/// The points (x, y) of every seed, one list a seed.
fn by_seed(points: &[Point], xy: impl Fn(u32, &SeedRun) -> (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let seeds = points.first().map_or(0, |point| point.runs.len());
    (0..seeds).map(|seed| points.iter().map(|point| xy(point.spp, &point.runs[seed])).collect()).collect()
}

/// Counts what is done of a whole bench.
struct Work<'a> {
    progress: &'a mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>,
    start: Instant,
    done: u64,
    total: u64,
    non_finite_samples: u64,
}

impl<'a> Work<'a> {
    fn new(settings: &Settings, plan: &Plan, progress: &'a mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>) -> Self {
        let reference = match plan.reference {
            ReferenceChoice::File(_) => 0,
            ReferenceChoice::Own(spp) => u64::from(spp.div_ceil(REFERENCE_PARTS)) * u64::from(REFERENCE_PARTS),
        };
        let images: u64 = plan.spp.iter().map(|&spp| u64::from(spp)).sum();
        let pixels = u64::from(settings.width) * u64::from(settings.height);
        let total = (reference + images * u64::from(plan.seeds)) * pixels;
        Self { progress, start: Instant::now(), done: 0, total, non_finite_samples: 0 }
    }

    fn render(&mut self, tracer: &mut PathTracer, seed: u32, spp: u32) -> Result<Run> {
        let run = tracer.run(seed, 0..spp, None, &mut |update| {
            (self.progress)(&ProgressUpdate {
                samples_done: self.done + update.samples_done,
                samples_total: Some(self.total),
                elapsed: self.start.elapsed(),
                time_limit: None,
            })
        })?;
        if run.stopped_by == StopReason::Interrupted {
            return Err(Error::Interrupted);
        }
        self.done += run.paths;
        self.non_finite_samples += run.non_finite_samples;
        Ok(run)
    }
}

/// The processor's name from /proc/cpuinfo; on Arm, where no name is given, and elsewhere than Linux `None`.
pub fn processor_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    let threads = text.lines().filter(|line| line.starts_with("processor")).count();
    Some(format!("{}, {threads} threads", name.trim()))
}
