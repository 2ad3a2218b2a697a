//! The errors, intervals and the bias test of `sunfleck bench` on synthetic images with a known answer.

use sunfleck::bench::bias::{ALPHA, find_bias};
use sunfleck::bench::jackknife::{jackknife, mean_without};
use sunfleck::bench::mean_image::{ImageAccumulator, MeanImage};
use sunfleck::bench::own_reference::other_estimator;
use sunfleck::bench::reference::Reference;
use sunfleck::bench::statistics::{Interval, sidak, t_quantile};
use sunfleck::film::Film;
use sunfleck::film::exr::ExrImage;
use sunfleck::film::metadata::Metadata;
use sunfleck::gpu::{DeviceKind, TraceBackend};
use sunfleck::render::{LightSampling, Settings, TraceChoice};

use crate::common::random::Random;

/// An image of this mean whose pixels are means of `spp` exponential samples: skewed, as radiance is.
fn image(random: &mut Random, side: u32, spp: u32, mean: impl Fn(u32, u32) -> f64) -> Vec<[f32; 3]> {
    let mut pixel = |mean: f64| {
        let sum: f64 = (0..spp).map(|_| random.exponential()).sum();
        (mean * sum / f64::from(spp)) as f32
    };
    (0..side * side).map(|i| [0; 3].map(|_: i32| pixel(mean(i % side, i / side)))).collect()
}

fn mean_image(random: &mut Random, side: u32, images: u32, spp: u32, mean: impl Fn(u32, u32) -> f64) -> MeanImage {
    let mut accumulator = ImageAccumulator::new((side, side));
    for _ in 0..images {
        accumulator.add(&image(random, side, spp, &mean), f64::from(spp));
    }
    accumulator.finish()
}

/// The t interval of a mean.
fn mean_interval(values: &[f64]) -> Interval {
    jackknife(values.len(), |left_out| mean_without(values, left_out)).unwrap().interval()
}

#[test]
fn quantiles_are_those_of_the_tables() {
    // Abramowitz and Stegun, table 26.10.
    for (p, degrees, value) in [(0.975, 7.0, 2.365), (0.975, 1.0, 12.706), (0.995, 30.0, 2.750)] {
        assert!((t_quantile(p, degrees) - value).abs() < 5e-4, "{p} {degrees}: {}", t_quantile(p, degrees));
    }
    assert!((t_quantile(0.975, f64::INFINITY) - 1.959_964).abs() < 1e-6);
    // Across the change of formula, and far beyond; by an incomplete beta function of 40 digits.
    for (p, degrees, value) in [
        (0.999_993_5, 7.0, 10.781_578_579),
        (0.999_993_5, 9999.0, 4.362_287_461),
        (0.999_993_5, 10_001.0, 4.362_287_024),
        (0.975, 1e6, 1.959_966_357),
        (0.95, 1e7, 1.644_853_779),
    ] {
        assert!((t_quantile(p, degrees) - value).abs() < 1e-6, "{p} {degrees}: {}", t_quantile(p, degrees));
    }
    assert!((1.0 - (1.0 - sidak(ALPHA, 300)).powi(300) - ALPHA).abs() < 1e-12);
}

#[test]
fn an_interval_holds_the_truth_as_often_as_it_says() {
    let mut random = Random(1);
    let hits = (0..4000).filter(|_| {
        let values: Vec<f64> = (0..8).map(|_| 3.0 + 2.0 * random.normal()).collect();
        mean_interval(&values).contains(3.0)
    });
    // Binomial with n 4000 and p 0.95: its standard deviation is 13.8, the bound four of them.
    let hits = hits.count();
    assert!((3745..=3855).contains(&hits), "{hits} of 4000");
}

#[test]
fn no_bias_is_found_where_there_is_none() {
    let mut random = Random(3);
    let found = (0..100).filter(|_| {
        let image = mean_image(&mut random, 24, 8, 64, |_, _| 0.5);
        let reference = mean_image(&mut random, 24, 8, 128, |_, _| 0.5);
        find_bias(&image, &reference).biased
    });
    // At the level 0.01 more than 5 of 100 happen with probability 5e-4.
    let found = found.count();
    assert!(found <= 5, "{found} of 100");
}

#[test]
fn a_bias_in_one_tile_is_found_there() {
    let mut random = Random(4);
    let reference = mean_image(&mut random, 24, 8, 128, |_, _| 0.5);
    let in_tile = |x, y| if (8..16).contains(&x) && y >= 16 { 0.54 } else { 0.5 };
    let verdict = find_bias(&mean_image(&mut random, 24, 8, 64, in_tile), &reference);
    assert!(verdict.biased && verdict.worst.tile == Some([8, 16]), "{verdict:?}");
    let same = find_bias(&mean_image(&mut random, 24, 8, 64, |_, _| 0.5), &reference);
    assert!(!same.biased && same.tests == 3 * 10, "{same:?}");
}

/// One sample of 20,000 carries a sixth of the light: four runs in five of this length meet none.
#[test]
fn light_that_a_short_run_has_not_met_is_no_bias() {
    let mut random = Random(6);
    let mut runs = |images: u32, spp: u32| {
        let mut accumulator = ImageAccumulator::new((8, 8));
        for _ in 0..images {
            let pixel = |random: &mut Random| {
                let sum: f64 = (0..spp).map(|_| if random.unit() < 5e-5 { 1000.0 } else { 0.5 * random.unit() }).sum();
                [(sum / f64::from(spp)) as f32; 3]
            };
            let radiance: Vec<_> = (0..64).map(|_| pixel(&mut random)).collect();
            accumulator.add(&radiance, f64::from(spp));
        }
        accumulator.finish()
    };
    let reference = runs(8, 4096);
    let (mut found, mut without) = (0, 0);
    for _ in 0..50 {
        let image = runs(4, 16);
        found += u32::from(find_bias(&image, &reference).biased);
        without += u32::from(find_bias(&MeanImage { spp: None, ..image }, &reference).biased);
    }
    assert!(found <= 3, "{found} of 50 at the level 0.01");
    assert!(without >= 25, "the case is one that the plain test gets wrong: {without} of 50");
}

#[test]
fn what_would_have_been_seen_is_seen() {
    let mut random = Random(5);
    let mut seen = 0;
    for _ in 0..40 {
        let reference = mean_image(&mut random, 24, 8, 128, |_, _| 0.5);
        let share = find_bias(&mean_image(&mut random, 24, 8, 64, |_, _| 0.5), &reference).detectable_image;
        let biased = mean_image(&mut random, 24, 8, 64, |_, _| 0.5 * (1.0 + share));
        seen += u32::from(find_bias(&biased, &reference).biased);
    }
    // Any of the three channels shows it, so the chance is above POWER = 0.95; less than 33 of 40 has probability 1e-4.
    assert!(seen >= 33, "{seen} of 40");
}

#[test]
fn equal_constants_are_no_bias_and_different_ones_are() {
    let constant = |value: f32| {
        let mut image = ImageAccumulator::new((8, 8));
        image.add(&[[value; 3]; 64], 1.0);
        image.add(&[[value; 3]; 64], 1.0);
        image.finish()
    };
    assert!(!find_bias(&constant(0.3), &constant(0.3)).biased);
    assert!(!find_bias(&constant(0.0), &constant(0.0)).biased);
    assert!(find_bias(&constant(0.3), &constant(0.300_01)).biased);
}

#[test]
fn the_own_reference_differs_where_it_can() {
    let other = |settings: &Settings, trace, kind, ray_query| {
        let other = other_estimator(settings, trace, kind, ray_query);
        assert_eq!((other.max_bounces, other.shaders_dir), (settings.max_bounces, None));
        (other.light_sampling, other.trace)
    };
    let settings = Settings { max_bounces: Some(3), shaders_dir: Some("mine".into()), ..Settings::default() };
    let (bvh, query) = (TraceBackend::Bvh, TraceBackend::RayQuery);
    for (trace, kind, ray_query, expected) in [
        (bvh, DeviceKind::Discrete, false, TraceChoice::Bvh),
        (bvh, DeviceKind::Discrete, true, TraceChoice::RayQuery),
        (query, DeviceKind::Discrete, true, TraceChoice::Bvh),
        (bvh, DeviceKind::Cpu, true, TraceChoice::Bvh),
        (query, DeviceKind::Cpu, true, TraceChoice::Bvh),
    ] {
        assert_eq!(other(&settings, trace, kind, ray_query), (LightSampling::Mixture, expected));
    }
    for light_sampling in LightSampling::ALL.iter().copied().filter(|mode| *mode != LightSampling::Mis) {
        let settings = Settings { light_sampling, ..Settings::default() };
        assert_eq!(other(&settings, bvh, DeviceKind::Cpu, false).0, LightSampling::Mis);
    }
}

#[test]
fn the_noise_of_the_reference_is_subtracted() {
    let mut random = Random(6);
    let (side, runs) = (32, 40);
    let mut corrected = Vec::new();
    for _ in 0..runs {
        // Variance of a pixel: 0.25 / 32 of the image, 0.25 / (8 · 8) of the reference.
        let reference = mean_image(&mut random, side, 8, 8, |_, _| 0.5);
        let reference = Reference::from_images(reference, String::new(), 64.0, 1.0);
        corrected.push(reference.errors_of(&image(&mut random, side, 32, |_, _| 0.5)).mse);
    }
    let (truth, biased) = (0.25 / 32.0, 0.25 / 32.0 + 0.25 / 64.0);
    let interval = mean_interval(&corrected);
    // The interval at 95 %, widened to four standard errors: 4 / 2.02 (t with 39 degrees of freedom).
    let half = (interval.high - interval.estimate) * 4.0 / 2.02;
    assert!((interval.estimate - truth).abs() < half, "{interval:?}, {truth}");
    assert!((interval.estimate - biased).abs() > half, "the test could not tell: {interval:?}, {biased}");
}

/// Of the Sobol' sampler the variance channel is an upper bound, and so it may be where nothing is said.
#[test]
fn the_variance_of_a_file_is_subtracted_if_its_samples_are_independent() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("reference.exr");
    let mut film = Film::new(1, 1);
    film.add_block(0, [4.0; 3], 5.0, 4);
    let variance = film.pixels()[0].variance_of_mean().unwrap();
    for (sampler, noise) in [(Some("independent"), variance), (Some("sobol"), 0.0), (None, 0.0)] {
        let metadata = Metadata { sampler: sampler.map(str::to_owned), ..Metadata::default() };
        ExrImage::from_film(&film, metadata).write(&path).unwrap();
        let about = Reference::read(&path, (1, 1)).unwrap().about;
        assert!((about.noise_mse - noise).abs() < 1e-6, "{sampler:?}: {} for {noise}", about.noise_mse);
    }
}
