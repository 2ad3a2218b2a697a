//! The error estimate against the true error: the interval holds it as often as it says, and a run to a target error ends
//! near it. The true error of an image is its distance from the mean of many others.

use std::ops::ControlFlow;

use crate::common::gpu;
use crate::common::scenes::{scene, short_form};
use crate::common::statistics::binomial_at_least;
use sunfleck::film::replicates::{CONFIDENCE, ErrorEstimate};
use sunfleck::film::{Film, RELATIVE_ERROR_EPSILON, luminance};
use sunfleck::render::{PathTracer, RunPlan, SamplerKind, Settings, StopReason};

/// What one seed gave.
struct Image {
    luminance: Vec<f64>,
    estimate: ErrorEstimate,
    samples: u32,
}

fn plan(samples: u32, target_error: Option<f64>) -> RunPlan {
    RunPlan { samples: 0..samples, target_error, estimate: true, ..RunPlan::default() }
}

fn render(tracer: &mut PathTracer, seed: u32, plan: &RunPlan) -> (Image, StopReason) {
    let run = tracer.run_plan(seed, plan, &mut |_| ControlFlow::Continue(())).expect("the device works");
    gpu::assert_no_validation_messages();
    let estimate = run.replicates.as_ref().and_then(|r| r.estimate()).expect("enough samples");
    let image = Image { luminance: luminances(&run.film), estimate, samples: run.samples.end };
    (image, run.stopped_by)
}

fn luminances(film: &Film) -> Vec<f64> {
    film.pixels().iter().map(|pixel| luminance(pixel.mean())).collect()
}

/// Sums over images of a pixel's samples, and their count.
fn sums(images: &[Image]) -> (Vec<f64>, f64) {
    let sum = |pixel: usize| images.iter().map(|i| i.luminance[pixel] * f64::from(i.samples)).sum();
    let count = images.iter().map(|image| f64::from(image.samples)).sum();
    ((0..images[0].luminance.len()).map(sum).collect(), count)
}

/// Relative error of an image against the mean of other samples. Both are unbiased, so the square is larger than that of the
/// distance to the truth by the reference's share of the variance.
fn relative_error(image: &Image, reference: impl Iterator<Item = f64>, count: f64) -> f64 {
    let share = count / (count + f64::from(image.samples));
    let term = |(y, truth): (&f64, f64)| {
        (y - truth).powi(2) * share / (truth * truth + RELATIVE_ERROR_EPSILON * RELATIVE_ERROR_EPSILON)
    };
    (image.luminance.iter().zip(reference).map(term).sum::<f64>() / image.luminance.len() as f64).sqrt()
}

fn error_against(image: &Image, others: &[Image]) -> f64 {
    let (sums, count) = sums(others);
    relative_error(image, sums.iter().map(|sum| sum / count), count)
}

/// Relative errors of the images, each against the mean of all others.
fn true_errors(images: &[Image]) -> Vec<f64> {
    let (sums, count) = sums(images);
    let error = |image: &Image| {
        let own = f64::from(image.samples);
        let others = sums.iter().zip(&image.luminance).map(|(sum, y)| (sum - y * own) / (count - own));
        relative_error(image, others, count - own)
    };
    images.iter().map(error).collect()
}

fn tracer(name: &str, size: u32, sampler: SamplerKind) -> PathTracer {
    let settings = Settings { sampler, estimate: true, ..gpu::settings(size, size) };
    gpu::path_tracer(&scene(name), &settings)
}

fn images(name: &str, seeds: u32, plan: &RunPlan, sampler: SamplerKind) -> Vec<Image> {
    let mut tracer = tracer(name, 24, sampler);
    (0..seeds).map(|seed| render(&mut tracer, seed, plan).0).collect()
}

/// How many intervals, narrowed to a share of their width in the logarithm, hold the true error.
fn covered(images: &[Image], errors: &[f64], share: f64) -> u64 {
    let holds = |(image, error): (&Image, &f64)| {
        let ratio = error / image.estimate.error;
        let [low, high] = image.estimate.interval.map(|bound| (bound / image.estimate.error).powf(share));
        u64::from((low..=high).contains(&ratio))
    };
    images.iter().zip(errors).map(holds).sum()
}

#[test]
fn intervals_hold_the_true_error_as_often_as_they_say() {
    // What is judged here runs on the host, so one driver is enough.
    if short_form() {
        return;
    }
    // Two kinds of scene: every pixel well known, and fireflies from lamps that few paths find.
    let scenes = [("cornell", 128), ("many_lights", 64)];
    let samplers = [SamplerKind::Independent, SamplerKind::Sobol];
    let even = samplers.into_iter().flat_map(|sampler| scenes.map(|(name, samples)| (name, samples, sampler, None)));
    for (name, samples, sampler, pilot) in even.chain([("many_lights", 64, SamplerKind::Sobol, Some(8))]) {
        let seeds = 100;
        let images = images(name, seeds, &RunPlan { pilot, ..plan(samples, None) }, sampler);
        let errors = true_errors(&images);
        let count = covered(&images, &errors, 1.0);
        let width =
            images.iter().map(|i| i.estimate.interval[1] / i.estimate.interval[0]).sum::<f64>() / f64::from(seeds);
        println!(
            "{name}, {sampler}, {samples}, pilot {pilot:?}: {count} of {seeds} intervals hold the error; they span {width:.3}"
        );
        // P(X ≤ count) for the coverage that is promised: not too seldom.
        let p = 1.0 - binomial_at_least(count + 1, u64::from(seeds), CONFIDENCE);
        assert!(p > 0.01, "{name}, {sampler}, {samples}, pilot {pilot:?}: {count} of {seeds}, p = {p}");
        if name == "cornell" {
            let ratios = errors.iter().zip(&images).map(|(error, image)| error / image.estimate.error);
            let mean_ratio = ratios.sum::<f64>() / f64::from(seeds);
            println!("  true over estimated error: {mean_ratio:.4} in the mean");
            assert!((mean_ratio - 1.0).abs() < 0.05, "{mean_ratio}");
            // At 64 samples there are four replicates alone.
            assert!(
                width < if samples == 128 { 1.5 } else { 2.0 },
                "intervals that span a factor of {width} say nothing"
            );
            // Were they a third as wide, the test would see it.
            let narrow = covered(&images, &errors, 1.0 / 3.0);
            let p = 1.0 - binomial_at_least(narrow + 1, u64::from(seeds), CONFIDENCE);
            assert!(p < 0.01, "{narrow} of {seeds} narrow intervals hold it too");
        }
    }
}

#[test]
fn a_run_to_a_target_error_ends_near_it() {
    if short_form() {
        return;
    }
    for (sampler, targets) in [(SamplerKind::Independent, [0.14, 0.09]), (SamplerKind::Sobol, [0.08, 0.05])] {
        runs_end_near(&targets, sampler);
    }
}

fn runs_end_near(targets: &[f64], sampler: SamplerKind) {
    let mut tracer = tracer("cornell", 48, sampler);
    let seeds = 10;
    // The reference is of other seeds.
    let reference: Vec<Image> = (seeds..seeds + 8).map(|seed| render(&mut tracer, seed, &plan(512, None)).0).collect();
    for &target in targets {
        for seed in 0..seeds {
            let (image, stopped_by) = render(&mut tracer, seed, &plan(u32::MAX, Some(target)));
            assert_eq!(stopped_by, StopReason::TargetError);
            assert!(image.estimate.error <= target);
            let error = error_against(&image, &reference);
            println!("{sampler}, target {target}, seed {seed}: {} samples, true error {error:.4}", image.samples);
            assert!((error / target - 1.0).abs() < 0.2, "target {target}, seed {seed}: {error}");
        }
    }
}

#[test]
fn asking_for_the_error_does_not_change_a_bit() {
    let mut tracer = gpu::path_tracer(&scene("cornell"), &gpu::settings(20, 12));
    let film = |tracer: &mut PathTracer, plan: &RunPlan| {
        tracer.run_plan(7, plan, &mut |_| ControlFlow::Continue(())).expect("the device works").film
    };
    let to_target = film(&mut tracer, &plan(u32::MAX, Some(0.1)));
    let samples = to_target.pixels()[0].count;
    assert!(samples > 64, "one look alone");
    let plain = film(&mut tracer, &RunPlan { estimate: false, ..plan(samples, None) });
    assert_eq!(plain, to_target);
    assert_eq!(plain, film(&mut tracer, &plan(samples, None)));
}

#[test]
fn a_limit_that_comes_first_ends_the_run() {
    let mut tracer = gpu::path_tracer(&scene("cornell"), &gpu::settings(16, 16));
    let (image, stopped_by) = render(&mut tracer, 1, &plan(100, Some(1e-3)));
    assert_eq!((image.samples, stopped_by), (100, StopReason::Samples));
    assert!(image.estimate.error > 1e-3);
}
