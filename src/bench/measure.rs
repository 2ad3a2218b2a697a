//! The renders of a bench: one kernel, every seed in every row, and their errors.

use std::path::Path;

use serde::Serialize;

use super::bias::{BiasVerdict, find_bias};
use super::mean_image::ImageAccumulator;
use super::own_reference::{self, REFERENCE_PARTS};
use super::plan::{Budget, Plan, ReferenceChoice};
use super::point::{Point, SeedRun, mse_over};
use super::power_law::PowerLaw;
use super::reference::{Reference, ReferenceInfo};
use super::work::Work;
use crate::render::{OpenDevice, PathTracer, Progress, Seconds, Settings, path_tracer_on};
use crate::scene::Scene;
use crate::{Error, Result};

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
    /// Whether it was stopped from outside: then it holds the seeds that all rows had by then.
    pub interrupted: bool,
    /// One entry a row.
    pub points: Vec<Point>,
    /// MSE over samples per pixel; `None` where no power law fits.
    pub mse_over_spp: Option<PowerLaw>,
    /// MSE over seconds.
    pub mse_over_seconds: Option<PowerLaw>,
    /// The mean of all images of the last row against the reference; `None` if there are fewer than two.
    pub bias: Option<BiasVerdict>,
    /// Samples that were NaN or infinite. Each is a bug.
    pub non_finite_samples: u64,
    /// Where the time before the first image went, in seconds; `render` is the sum over all images.
    pub seconds: Seconds,
}

/// Renders everything and measures it. `progress` is called after every slice with what is done of the whole bench. If
/// it says to stop, what there is is measured, and [`Measurement::interrupted`] says so.
///
/// # Errors
/// Those of a render; a reference that cannot be used; a time that is too short for an image;
/// [`Error::Interrupted`] if `progress` says so before the first image is done.
pub fn measure(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    progress: Progress<'_>,
) -> Result<Measurement> {
    let mut work = Work::new(progress);
    let reference = reference_of_rows(open, scene, settings, plan, &mut work)?;
    let (mut tracer, _, prepare_seconds) = path_tracer_on(open, scene, settings)?;
    let images = Images::render(&mut tracer, settings, plan, &reference, &mut work)?;
    let points: Vec<_> = images.rows.into_iter().map(Point::new).collect();
    let common_error = reference.about.common_error();
    Ok(Measurement {
        device: open.gpu.info.name.clone(),
        driver: open.gpu.info.driver.clone(),
        device_reason: open.reason.clone(),
        processor: processor_name(),
        kernel_key: tracer.key().to_string(),
        width: settings.width,
        height: settings.height,
        interrupted: images.interrupted,
        mse_over_spp: mse_over(&points, |run| run.spp, common_error),
        mse_over_seconds: mse_over(&points, |run| run.seconds, common_error),
        points,
        bias: (images.mean.count() >= 2).then(|| find_bias(&images.mean.finish(), &reference.image)),
        reference: reference.about,
        non_finite_samples: work.non_finite_samples,
        seconds: Seconds {
            prepare: prepare_seconds,
            compile: tracer.compile_seconds,
            upload: tracer.upload_seconds,
            render: images.render_seconds,
            ..Seconds::default()
        },
    })
}

/// What was rendered.
struct Images {
    /// The images of every row, of the same seeds; without rows that have none.
    rows: Vec<Vec<SeedRun>>,
    /// Mean of the last row.
    mean: ImageAccumulator,
    render_seconds: f64,
    interrupted: bool,
}

impl Images {
    fn render(
        tracer: &mut PathTracer,
        settings: &Settings,
        plan: &Plan,
        reference: &Reference,
        work: &mut Work,
    ) -> Result<Self> {
        let mut rows: Vec<Vec<SeedRun>> = plan.rows.iter().map(|_| Vec::new()).collect();
        let mut mean = ImageAccumulator::new((settings.width, settings.height));
        let (mut render_seconds, mut interrupted) = (0.0, false);
        // All rows of one seed after the other, so that a drift of the machine's speed falls on every row.
        'images: for seed in (0..plan.seeds).map(|n| settings.seed.wrapping_add(n)) {
            for (row, &budget) in plan.rows.iter().enumerate() {
                let run = match work.render(tracer, seed, settings.adaptive, budget) {
                    Err(Error::Interrupted) => {
                        interrupted = true;
                        break 'images;
                    }
                    run => run?,
                };
                let radiance = run.film.radiance();
                render_seconds += run.seconds;
                tracing::info!("seed {seed}, {budget}: {:.3} s", run.seconds);
                let (spp, seconds) = (run.film.mean_samples_per_pixel(), run.seconds);
                if row + 1 == plan.rows.len() {
                    mean.add(&radiance, spp);
                }
                rows[row].push(SeedRun { seed, spp, seconds, errors: reference.errors_of(&radiance) });
            }
        }
        keep_common_seeds(&mut rows);
        if rows.is_empty() { Err(Error::Interrupted) } else { Ok(Self { rows, mean, render_seconds, interrupted }) }
    }
}

/// Of an interrupted run keeps the seeds that every row has, or, where no seed was done with, the rows that have one.
pub fn keep_common_seeds<T>(rows: &mut Vec<Vec<T>>) {
    let complete = rows.last().map_or(0, Vec::len);
    rows.iter_mut().for_each(|row| row.truncate(complete.max(1)));
    rows.retain(|row| !row.is_empty());
}

/// Renders or reads the reference of a plan, and begins the work on its rows.
fn reference_of_rows(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    work: &mut Work,
) -> Result<Reference> {
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    let parts = reference_parts(plan);
    let images: Vec<_> = plan.rows.iter().flat_map(|&budget| (0..plan.seeds).map(move |_| budget)).collect();
    // Samples and seconds do not add up to one progress.
    let one_kind =
        parts.iter().chain(&images).all(|budget| std::mem::discriminant(budget) == std::mem::discriminant(&images[0]));
    work.begin(pixels, parts.iter().chain(images.iter().filter(|_| one_kind)).copied());
    let reference = find_reference(open, scene, settings, plan, work)?;
    if !one_kind {
        work.begin(pixels, images.into_iter());
    }
    Ok(reference)
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
    progress: Progress<'_>,
) -> Result<Reference> {
    let mut work = Work::new(progress);
    work.begin(u64::from(settings.width) * u64::from(settings.height), reference_parts(plan).into_iter());
    find_reference(open, scene, settings, plan, &mut work)
}

fn reference_parts(plan: &Plan) -> Vec<Budget> {
    match plan.reference {
        ReferenceChoice::File(_) => Vec::new(),
        ReferenceChoice::Own(budget) => vec![budget.part(REFERENCE_PARTS); REFERENCE_PARTS as usize],
    }
}

fn find_reference(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    work: &mut Work,
) -> Result<Reference> {
    match &plan.reference {
        ReferenceChoice::File(path) => {
            let reference = Reference::read(path, (settings.width, settings.height))?;
            let seed = reference.about.seed.filter(|seed| seed.wrapping_sub(settings.seed) < plan.seeds);
            seed.map_or(Ok(reference), |seed| Err(shared_seed(path, seed)))
        }
        ReferenceChoice::Own(budget) => {
            own_reference::render(open, scene, settings, *budget, settings.seed.wrapping_add(plan.seeds), work)
        }
    }
}

/// Equal seeds are equal random numbers: the errors would be those of images that know their reference.
fn shared_seed(path: &Path, seed: u32) -> Error {
    let path = path.display();
    Error::Usage(format!("--reference: {path} has seed {seed}, as one of the images has; choose others by --seed"))
}

/// The processor's name from /proc/cpuinfo; on Arm, where no name is given, and elsewhere than Linux `None`.
pub fn processor_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    let threads = text.lines().filter(|line| line.starts_with("processor")).count();
    Some(format!("{}, {threads} threads", name.trim()))
}
