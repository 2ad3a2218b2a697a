//! What `sunfleck render` says when it is done: a summary for people, an object for programs.

use serde_json::{Value, json};
use sunfleck::film::replicates::CONFIDENCE;
use sunfleck::render::{RenderResult, SamplerKind, Statistics, StopReason};
use sunfleck::scene::Scene;

use super::progress::{time, with_prefix};
use super::render_args::RenderJob;

/// The object of `--json`. Rates are per second of the render part alone.
pub(crate) fn report(job: &RenderJob, scene: &Scene, result: &RenderResult) -> Value {
    let rate = |count: u64| count as f64 / result.seconds.render.max(1e-9);
    let warnings = [scene.warnings.as_slice(), result.warnings.as_slice()].concat();
    let pictures = job.aov_pictures.iter().map(|(path, _)| path);
    let outputs: Vec<_> =
        job.outputs.iter().map(|(path, _)| path).chain(pictures).map(|path| path.display().to_string()).collect();
    let aovs: Vec<_> = job.settings.aovs.iter().map(|aov| aov.name()).collect();
    let mut object = json!({
        "scene": job.scene,
        "device": result.device,
        "driver": result.driver,
        "device_reason": result.device_reason,
        "driver_environment": super::devices::environment_json(),
        "trace": result.trace,
        "kernel_key": result.kernel_key,
        "features": result.features,
        "baked": result.baked,
        "width": result.film.width(),
        "height": result.film.height(),
        "spp": result.film.mean_samples_per_pixel(),
        "samples": [result.samples.start, result.samples.end],
        "seed": job.settings.seed,
        "integrator": job.settings.integrator.name(),
        "sampler": job.settings.sampler.name(),
        "light_sampling": job.settings.light_sampling.name(),
        "light_choice": result.light_choice.name(),
        "max_bounces": job.settings.max_bounces,
        "clamp_indirect": job.settings.clamp_indirect,
        "biased": job.settings.clamp_indirect.is_some(),
        "stopped_by": result.stopped_by.to_string(),
        "rays": result.rays,
        "paths": result.paths,
        "seconds": result.seconds,
        "rays_per_second": rate(result.rays),
        "paths_per_second": rate(result.paths),
        "estimated_error": estimated_error(result),
        "estimated_error_is_upper_bound": is_upper_bound(job, result),
        "estimated_error_interval": result.error_estimate.map(|e| e.interval),
        "estimated_error_confidence": result.error_estimate.map(|_| CONFIDENCE),
        "estimated_error_replicates": result.error_estimate.map(|e| e.replicates),
        "mean_luminance": result.robust_mean.map(|m| m.mean),
        "median_of_means_luminance": result.robust_mean.map(|m| m.median_of_means),
        "target_error": job.settings.target_error,
        "non_finite_samples": result.non_finite_samples,
        "first_non_finite": result.first_non_finite,
        "gpu_bytes": result.gpu_bytes,
        "notes": scene.notes,
        "warnings": warnings,
        "outputs": outputs,
    });
    object["aovs"] = json!(aovs);
    object["adaptive"] = json!(result.pilot);
    object["statistics"] = json!(result.statistics.as_ref().map(Statistics::report));
    object
}

/// From the replicates where they were asked for, else from the variance of the samples: see [`is_upper_bound`].
fn estimated_error(result: &RenderResult) -> Option<f64> {
    result.error_estimate.map(|estimate| estimate.error).or_else(|| result.film.estimated_error())
}

/// Samples that are not independent of each other have a mean whose variance is less than theirs over their number.
fn is_upper_bound(job: &RenderJob, result: &RenderResult) -> bool {
    result.error_estimate.is_none() && job.settings.sampler != SamplerKind::Independent
}

fn print_error(job: &RenderJob, result: &RenderResult) {
    let Some(error) = estimated_error(result) else { return };
    if is_upper_bound(job, result) {
        eprintln!("  relative error below {:.3} %, an upper bound; --estimate estimates it", 100.0 * error);
        return;
    }
    eprint!("  estimated relative error {:.3} %", 100.0 * error);
    if let Some(estimate) = result.error_estimate {
        let [low, high] = estimate.interval.map(|bound| 100.0 * bound);
        let confidence = 100.0 * CONFIDENCE;
        eprint!(" ({confidence:.0} %: {low:.3} % to {high:.3} %, from {} replicates)", estimate.replicates);
    }
    eprintln!();
    if let Some(m) = result.robust_mean.filter(|m| m.mean > 0.0) {
        let share = 100.0 * (1.0 - m.median_of_means / m.mean);
        eprintln!(
            "  mean luminance {:.5}, median of means {:.5}: {share:.2} % hangs on a few bright samples",
            m.mean, m.median_of_means
        );
    }
}

fn print_pilot(result: &RenderResult) {
    let Some(pilot) = result.pilot else { return };
    let share = 100.0 * pilot.found.noisy_pixels as f64 / result.film.pixels().len().max(1) as f64;
    let found = match pilot.found.noisy_pixels {
        _ if !pilot.is_complete => String::from("not completed"),
        0 => String::from("its noise is spread too evenly for more samples to pay anywhere"),
        _ => format!("{share:.1} % of the pixels have up to {} times the samples", pilot.found.most_samples),
    };
    eprintln!("  pilot of {} samples per pixel in {}: {found}", pilot.samples, time(pilot.seconds));
}

/// What the run did, in a few lines on standard error.
pub(crate) fn print_summary(job: &RenderJob, result: &RenderResult) {
    let film = &result.film;
    let why = match result.stopped_by {
        StopReason::Samples => "all samples are done",
        StopReason::Time => "the time was up",
        StopReason::TargetError => "the target error was reached",
        StopReason::Interrupted => "interrupted",
    };
    eprintln!(
        "rendered {}x{} at {} samples per pixel in {} ({why})",
        film.width(),
        film.height(),
        (1000.0 * film.mean_samples_per_pixel()).round() / 1000.0,
        time(result.seconds.render)
    );
    let seconds = result.seconds.render.max(1e-9);
    let rate = |count: u64| with_prefix(count as f64 / seconds);
    eprintln!("  {}paths/s, {}rays/s", rate(result.paths), rate(result.rays));
    print_pilot(result);
    print_error(job, result);
    if result.non_finite_samples > 0 {
        eprintln!("warning: {} samples were NaN or infinite; each is a bug:", result.non_finite_samples);
        for s in &result.first_non_finite {
            eprintln!("  pixel ({}, {}), sample {}", s.x, s.y, s.sample);
        }
    }
    for path in job.outputs.iter().map(|(path, _)| path).chain(job.aov_pictures.iter().map(|(path, _)| path)) {
        eprintln!("  {}", path.display());
    }
}
