//! Sums of very many samples do not drift, and merges do not depend on their order.

use std::path::PathBuf;

use glam::DVec3;
use proptest::prelude::*;
use sunfleck::film::exr::{ExrImage, read_exr};
use sunfleck::film::merge::merge;
use sunfleck::film::metadata::Metadata;
use sunfleck::film::{Film, luminance};
use sunfleck::scene::Material;

use crate::common::scenes::full_form;
use crate::common::statistics::{binomial_two_sided, sidak};
use crate::common::{builder, gpu};

/// Unit roundoff of f32 and of f64.
const F32: f64 = 1.0 / (1_u64 << 24) as f64;
const F64: f64 = 1.0 / (1_u64 << 53) as f64;
const BLOCK: u32 = 16;

/// A radiance that binary fractions cannot hold, so that every addition rounds.
const RADIANCE: f32 = 0.1;

/// Four pixels a side before black; of each pixel in column i a vertical strip of (2i + 1)/8 of its width shines. A
/// sample is then RADIANCE with that probability and else 0.
fn strips() -> sunfleck::scene::Scene {
    let lamp = Material { emission: [RADIANCE; 3], ..Material::lambertian("lamp", [0.0; 3]) };
    let strip = |i: i32| {
        let left = DVec3::new(0.5 * f64::from(i) - 1.0, -1.0, 0.0);
        builder::rectangle(left, DVec3::X * (0.5 * probability(i)), DVec3::Y * 2.0, 0)
    };
    // Half of the view is 1 high at distance 1.
    let camera = builder::camera(DVec3::Z, DVec3::ZERO, std::f64::consts::FRAC_PI_2);
    builder::scene((0..4).map(strip).collect(), vec![lamp], camera)
}

fn probability(column: i32) -> f64 {
    f64::from(2 * column + 1) / 8.0
}

/// 2^24 samples a pixel in the full form, 2^16 in the short one. The sum of k samples of one value is a whole multiple of
/// it to the rounding of its additions, k is binomial, and the squares add up as well.
#[test]
fn many_samples_do_not_drift_on_the_device() {
    let spp = 1_u32 << if full_form() { 24 } else { 16 };
    let run = gpu::run(&mut gpu::path_tracer(&strips(), &gpu::settings(4, 4)), 7, spp);
    let level = sidak(0.01, 16);
    let value = f64::from(RADIANCE);
    let mut worst = (0.0_f64, 0.0_f64, 1.0_f64);
    for (pixel, index) in run.film.pixels().iter().zip(0_i32..) {
        assert_eq!(pixel.count, spp);
        let hits = (pixel.rgb[1] / value).round();
        // A block's sum is exact but for the rounding of its compensation (at most 16 terms of it, each 2^-24 of the
        // sum and itself rounded by 2^-24); the host adds spp/16 blocks in f64.
        let bound = 16.0 * F32 * F32 + f64::from(spp / BLOCK) * F64;
        let drift = (pixel.rgb[1] / (hits * value) - 1.0).abs();
        assert!(drift <= bound, "pixel {index}: drift {drift:e}, bound {bound:e}");
        // Squares: the luminance has 5 rounded operations, squaring one, a block at most 15 additions, all in f32.
        let squares = pixel.luminance_squared / (hits * luminance([value; 3]).powi(2));
        let squares_bound = (2.0 * 5.0 + 1.0 + 15.0 + 1.0) * F32;
        assert!((squares - 1.0).abs() <= squares_bound, "pixel {index}: squares {squares}");
        let p = binomial_two_sided(hits as u64, spp.into(), probability(index % 4));
        assert!(p > level, "pixel {index}: {hits} of {spp} hits, p = {p:e}");
        worst = (worst.0.max(drift), worst.1.max((squares - 1.0).abs()), worst.2.min(p));
    }
    println!("{spp} samples a pixel: drift {:.2e}, squares {:.2e}, least p {:.3}", worst.0, worst.1, worst.2);
}

/// 2^24 samples in blocks of 16 on the host: 1000 + i/1024 for i = 0…1023 in turn, whose sums are exact in integers.
#[test]
fn many_samples_do_not_drift_on_the_host() {
    let blocks = 1_u32 << 20;
    let mut film = Film::new(1, 1);
    for block in 0..blocks {
        let samples = (0..BLOCK).map(|i| 1000.0 + f64::from((block * BLOCK + i) % 1024) / 1024.0);
        let (sum, squares) = samples.fold((0.0, 0.0), |(s, q), y| (s + y, q + luminance([y; 3]).powi(2)));
        film.add_block(0, [sum; 3], squares, BLOCK);
    }
    let n = f64::from(blocks * BLOCK);
    let exact_mean = 1000.0 + 1023.0 / 2048.0;
    let mean = film.mean(0)[0];
    assert!((mean / exact_mean - 1.0).abs() <= f64::from(blocks) * F64, "mean {mean}");
    // The variance of the uniform distribution on 1024 steps of 1/1024, of a mean of n.
    let exact_variance = (1024.0 * 1024.0 - 1.0) / 12.0 / (1024.0 * 1024.0) / (n - 1.0);
    let variance = film.pixels()[0].variance_of_mean().expect("many samples");
    // ΣY² and (ΣY)²/n are each off by (blocks + 32) u at most, and their difference is smaller by mean²/σ².
    let bound = 3.0 * f64::from(blocks + 32) * F64 * exact_mean * exact_mean * 12.0;
    let error = (variance / exact_variance - 1.0).abs();
    assert!(error <= bound, "variance {variance:e}, exact {exact_variance:e}");
    println!(
        "2^24 samples on the host: mean {:.1e}, variance {error:.1e} (bound {bound:.1e})",
        mean / exact_mean - 1.0
    );
}

/// Steps from one float to the next between two floats that are not negative.
fn ulps(a: f32, b: f32) -> u32 {
    a.to_bits().abs_diff(b.to_bits())
}

fn radiance() -> impl Strategy<Value = f32> {
    prop_oneof![9 => (-20.0f32..20.0).prop_map(f32::exp2), 1 => Just(0.0f32)]
}

/// A film of 2 × 1 pixels from rows of samples.
fn film(samples: &[[f32; 6]]) -> Film {
    let mut film = Film::new(2, 1);
    for s in samples {
        for (pixel, rgb) in s.chunks_exact(3).enumerate() {
            let rgb = [rgb[0], rgb[1], rgb[2]].map(f64::from);
            film.add_block(pixel, rgb, luminance(rgb).powi(2), 1);
        }
    }
    film
}

fn assert_within_1_ulp(a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<(), TestCaseError> {
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        prop_assert!(ulps(*a, *b) <= 1, "{a:e} and {b:e}");
    }
    Ok(())
}

type Parts = Vec<Vec<[f32; 6]>>;

/// Parts of a run, and an order of them.
fn parts_and_order() -> impl Strategy<Value = (Parts, Vec<usize>)> {
    let sample = prop::array::uniform6(radiance());
    prop::collection::vec(prop::collection::vec(sample, 1..24), 2..8).prop_flat_map(|parts| {
        let order: Vec<usize> = (0..parts.len()).collect();
        (Just(parts), Just(order).prop_shuffle())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Films, merged in any order, and the single film of all samples.
    #[test]
    fn films_merge_in_any_order((parts, order) in parts_and_order()) {
        let merged = |order: &mut dyn Iterator<Item = usize>| {
            let mut sum = Film::new(2, 1);
            order.for_each(|index| sum.merge(&film(&parts[index])));
            sum.radiance()
        };
        let in_order = merged(&mut (0..parts.len()));
        assert_within_1_ulp(&merged(&mut order.iter().copied()), &in_order)?;
        assert_within_1_ulp(&film(&parts.concat()).radiance(), &in_order)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// The same through EXR files, of one seed's sample ranges and of one range of several seeds.
    #[test]
    fn files_merge_in_any_order((parts, order) in parts_and_order(), one_seed in any::<bool>()) {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let mut start = 0;
        let mut files: Vec<PathBuf> = Vec::new();
        for (part, index) in parts.iter().zip(0_u32..) {
            let range = start..start + part.len() as u32;
            start = if one_seed { range.end } else { 0 };
            let seed = Some(if one_seed { 0 } else { index });
            let metadata = Metadata { seed, sample_ranges: vec![range], ..Metadata::default() };
            files.push(folder.path().join(format!("{index}.exr")));
            ExrImage::from_film(&film(part), metadata).write(&files[index as usize]).expect("written");
        }
        let merged = |order: &mut dyn Iterator<Item = usize>| {
            let read = |i: usize| (files[i].clone(), read_exr(&files[i]).expect("readable"));
            merge(order.map(read).collect()).expect("mergeable").image.rgb().expect("has colours")
        };
        let in_order = merged(&mut (0..files.len()));
        assert_within_1_ulp(&merged(&mut order.iter().copied()), &in_order)?;
        assert_within_1_ulp(&film(&parts.concat()).radiance(), &in_order)?;
    }
}
