//! Adaptive sampling: noisy pixels have more samples, the mean stays, and the parts of a run are those of the whole.

use std::ops::{ControlFlow, Range};
use std::time::Duration;

use glam::DVec3;
use sunfleck::film::Film;
use sunfleck::render::{BindingOverride, PathTracer, Run, RunPlan, SamplerKind, Settings, StopReason};
use sunfleck::scene::{Bsdf, Environment, Material, Scene};

use crate::common::builder::{camera, rectangle, scene};
use crate::common::gpu;
use crate::common::scenes::slow_driver;
use crate::common::statistics::{TileStatistics, assert_agree, squared_deviations};

const PILOT: u32 = 8;

/// A floor under a grey sky, in which a mirror shows a small lamp from behind: all noise is at the edge of its picture.
fn lamp_in_a_mirror() -> Scene {
    let mirror = Material { bsdf: Bsdf::Mirror, ..Material::lambertian("mirror", [0.9; 3]) };
    let lamp = Material { emission: [80.0, 60.0, 30.0], ..Material::lambertian("lamp", [0.0; 3]) };
    let primitives = vec![
        rectangle(DVec3::new(-4.0, -1.0, 4.0), 8.0 * DVec3::X, -8.0 * DVec3::Z, 0),
        rectangle(DVec3::new(-1.0, -0.8, 0.0), 2.0 * DVec3::X, 2.0 * DVec3::Y, 1),
        // Behind the camera, it turns its front to the mirror.
        rectangle(DVec3::new(0.3, 0.2, 5.0), DVec3::new(0.1, 0.5, 0.0), DVec3::new(0.6, 0.1, 0.0), 2),
    ];
    let materials = vec![Material::lambertian("floor", [0.5; 3]), mirror, lamp];
    let mut scene = scene(primitives, materials, camera(DVec3::new(0.0, 0.1, 3.0), DVec3::ZERO, 0.8));
    scene.environment = Environment::Constant([0.3, 0.35, 0.4]);
    scene
}

fn settings() -> Settings {
    Settings { max_bounces: Some(3), ..gpu::settings(50, 37) }
}

fn run(tracer: &mut PathTracer, seed: u32, samples: Range<u32>, pilot: Option<u32>) -> Run {
    let plan = RunPlan { samples, pilot, ..RunPlan::default() };
    let run = tracer.run_plan(seed, &plan, &mut |_| ControlFlow::Continue(())).expect("the device works");
    gpu::assert_no_validation_messages();
    run
}

fn bits(film: &Film) -> Vec<([u64; 3], u32)> {
    film.pixels().iter().map(|p| (p.rgb.map(f64::to_bits), p.count)).collect()
}

/// Over pilots that find different pixels, by both samplers, and by ranges that begin in the middle.
#[test]
fn the_mean_stays() {
    let seeds = if slow_driver() { 8 } else { 64 };
    for sampler in [SamplerKind::Independent, SamplerKind::Sobol] {
        let settings = Settings { sampler, ..settings() };
        let mut tracer = gpu::path_tracer(&lamp_in_a_mirror(), &settings);
        let mut images = |samples: Range<u32>, pilot| {
            let mut statistics = TileStatistics::new(50, 37, 8);
            for seed in 0..seeds {
                let run = run(&mut tracer, seed, samples.clone(), pilot);
                assert_eq!(run.pilot.is_some_and(|pilot| pilot.found.noisy_pixels > 0), pilot.is_some());
                statistics.add(&run.film.radiance());
            }
            statistics.image()
        };
        let even = images(0..16, None);
        assert_agree(&format!("{sampler}, all"), even, images(0..16, Some(PILOT)));
        assert_agree(&format!("{sampler}, a part"), even, images(5..21, Some(PILOT)));
    }
}

/// At the edge of the lamp's picture the variance of n samples is that of one over n, so the image has the less of it.
#[test]
fn noise_goes_where_it_is_found() {
    let mut tracer = gpu::path_tracer(&lamp_in_a_mirror(), &settings());
    let mut variance_and_rays = |pilot| {
        let runs: Vec<Run> = (0..24).map(|seed| run(&mut tracer, seed, 0..64, pilot)).collect();
        let images: Vec<_> = runs.iter().map(|run| run.film.radiance()).collect();
        let rays = runs.iter().map(|run| run.rays).sum::<u64>() as f64;
        (squared_deviations(&images), rays, runs[0].pilot)
    };
    let (even, even_rays, _) = variance_and_rays(None);
    let (adaptive, rays, pilot) = variance_and_rays(Some(PILOT));
    println!("variance {:.3}, rays {:.3}: {pilot:?}", adaptive / even, rays / even_rays);
    assert!(adaptive < even / 4.0, "{adaptive} of {even}");
    // A quarter more by the rule, and the pilot's eighth.
    assert!(rays < 1.4 * even_rays, "{rays} of {even_rays}");
}

#[test]
fn counts_and_parts_are_those_of_the_whole() {
    let mut tracer = gpu::path_tracer(&lamp_in_a_mirror(), &settings());
    let whole = run(&mut tracer, 3, 0..40, Some(PILOT));
    assert_eq!(whole.samples, 0..40);
    let pilot = whole.pilot.expect("asked for");
    let counts: Vec<u32> = whole.film.pixels().iter().map(|pixel| pixel.count).collect();
    assert!(counts.iter().all(|count| count % 40 == 0 && (count / 40).is_power_of_two()));
    assert_eq!(counts.iter().max(), Some(&(40 * pilot.found.most_samples)));
    assert_eq!(counts.iter().filter(|&&count| count > 40).count(), pilot.found.noisy_pixels);
    let sum: u64 = counts.iter().map(|&count| u64::from(count)).sum();
    assert_eq!((whole.paths, pilot.paths), (sum + pilot.paths, u64::from(PILOT) * 50 * 37));

    let mut parts = run(&mut tracer, 3, 0..7, Some(PILOT)).film;
    parts.merge(&run(&mut tracer, 3, 7..40, Some(PILOT)).film);
    for (part, pixel) in parts.pixels().iter().zip(whole.film.pixels()) {
        assert_eq!(part.count, pixel.count);
        assert!((0..3).all(|c| (part.rgb[c] - pixel.rgb[c]).abs() <= 1e-12 * pixel.rgb[c]), "{part:?} {pixel:?}");
    }
    // However the work is cut.
    let overrides = BindingOverride { slice_atoms: Some(777), ray_budget: Some(5), ..BindingOverride::default() };
    let mut cut = gpu::path_tracer_with(&lamp_in_a_mirror(), &settings(), overrides);
    assert!(bits(&run(&mut cut, 3, 0..40, Some(PILOT)).film) == bits(&whole.film));
}

/// Where noise is everywhere alike, the image is, bit for bit, that without a pilot.
#[test]
fn even_noise_is_sampled_evenly() {
    let floor = rectangle(DVec3::new(-9.0, 0.0, 9.0), 18.0 * DVec3::X, -18.0 * DVec3::Z, 0);
    let view = camera(DVec3::new(0.0, 2.0, 0.1), DVec3::ZERO, 0.5);
    let mut scene = scene(vec![floor], vec![Material::lambertian("floor", [0.5; 3])], view);
    scene.environment = Environment::Constant([1.0; 3]);
    let mut tracer = gpu::path_tracer(&scene, &settings());
    let with = run(&mut tracer, 1, 0..20, Some(PILOT));
    let pilot = with.pilot.expect("asked for");
    assert_eq!((pilot.found.noisy_pixels, pilot.found.most_samples, pilot.found.mean_samples), (0, 1, 1.0));
    assert!(bits(&with.film) == bits(&run(&mut tracer, 1, 0..20, None).film));
}

/// A pilot that has not ended decides nothing, and an interrupted one renders no image.
#[test]
fn a_pilot_that_does_not_end_decides_nothing() {
    let mut tracer = gpu::path_tracer(&lamp_in_a_mirror(), &settings());
    let plan = RunPlan { samples: 0..u32::MAX, pilot: Some(4096), ..RunPlan::default() };
    let in_time = RunPlan { time: Some(Duration::from_millis(200)), ..plan.clone() };
    let mut limits = Vec::new();
    let run = tracer.run_plan(1, &in_time, &mut |update| {
        limits.push(update.time_limit);
        ControlFlow::Continue(())
    });
    let run = run.expect("the device works");
    let pilot = run.pilot.expect("it began");
    assert_eq!((pilot.is_complete, pilot.found.noisy_pixels, run.stopped_by), (false, 0, StopReason::Time));
    assert!(pilot.seconds < run.seconds && run.film.pixels().iter().any(|pixel| pixel.count > 0), "{pilot:?}");
    assert!(limits.iter().all(|&limit| limit == in_time.time));

    let run = tracer.run_plan(1, &plan, &mut |_| ControlFlow::Break(())).expect("the device works");
    assert_eq!((run.stopped_by, run.samples), (StopReason::Interrupted, 0..0));
    assert!(run.film.pixels().iter().all(|pixel| pixel.count == 0));
    gpu::assert_no_validation_messages();
}
