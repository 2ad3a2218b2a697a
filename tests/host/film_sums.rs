//! The film's sums: means, variances, the error estimate, and merges that equal the single run.

use proptest::prelude::*;
use sunfleck::film::exr::ExrImage;
use sunfleck::film::merge::merge;
use sunfleck::film::metadata::Metadata;
use sunfleck::film::{Film, PixelSums, luminance};

type Sample = [f32; 3];

/// A film whose one pixel holds these samples.
fn film_of(samples: &[Sample]) -> Film {
    let mut film = Film::new(1, 1);
    for sample in samples {
        let rgb = sample.map(f64::from);
        film.add_block(0, rgb, luminance(rgb).powi(2), 1);
    }
    film
}

fn part(samples: &[Sample], start: u32) -> (std::path::PathBuf, ExrImage) {
    let range = start..start + samples.len() as u32;
    let metadata = Metadata { seed: Some(1), sample_ranges: vec![range], ..Metadata::default() };
    (format!("part{start}.exr").into(), ExrImage::from_film(&film_of(samples), metadata))
}

/// Distance of two positive floats in steps from one float to the next.
fn ulps(a: f32, b: f32) -> u32 {
    a.to_bits().abs_diff(b.to_bits())
}

#[test]
fn means_and_variance_of_known_samples() {
    let film = film_of(&[[1.0, 1.0, 1.0], [3.0, 3.0, 3.0]]);
    assert_eq!(film.mean(0), [2.0; 3]);
    // The samples' variance is 2, that of their mean 1.
    let variance = film.pixels()[0].variance_of_mean().unwrap();
    assert!((variance - 1.0).abs() < 1e-12, "{variance}");
    let expected = (1.0f64 / (4.0 + 1e-4)).sqrt();
    assert!((film.estimated_error().unwrap() - expected).abs() < 1e-12);
    assert_eq!(film.mean_samples_per_pixel(), 2.0);
}

#[test]
fn estimated_error_is_unknown_where_no_variance_can_be_known() {
    assert_eq!(Film::new(1, 1).estimated_error(), None);
    assert_eq!(Film::new(0, 0).estimated_error(), None);
    assert_eq!(film_of(&[[1.0; 3]]).estimated_error(), None);
    let mut film = film_of(&[[1.0; 3]; 2]);
    assert_eq!(film.estimated_error(), Some(0.0));
    film.add_block(0, [f64::NAN, 0.0, 0.0], f64::NAN, 1);
    assert_eq!(film.estimated_error(), None);
    assert_eq!(film.non_finite_pixels(), 1);
}

#[test]
fn estimated_error_agrees_with_the_spread_of_many_runs() {
    // 400 runs of 16 samples that are 0 or 2 with equal chance: the spread of their means is the standard error.
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 63) as f32 * 2.0
    };
    let films: Vec<Film> = (0..400).map(|_| film_of(&(0..16).map(|_| [random(); 3]).collect::<Vec<_>>())).collect();
    let estimated = films.iter().map(|f| f.pixels()[0].variance_of_mean().unwrap()).sum::<f64>() / 400.0;
    let observed = films.iter().map(|f| (f.mean(0)[1] - 1.0).powi(2)).sum::<f64>() / 400.0;
    // Both are 1/16 in expectation; 400 runs know the observed one to about 7 %.
    assert!((estimated * 16.0 - 1.0).abs() < 0.02, "{estimated}");
    assert!((observed / estimated - 1.0).abs() < 0.28, "{observed} {estimated}");
}

#[test]
fn merging_the_same_samples_twice_is_refused() {
    let overlapping = vec![part(&[[1.0; 3]; 4], 0), part(&[[2.0; 3]; 4], 3)];
    let message = merge(overlapping).unwrap_err().to_string();
    assert!(message.contains("part3.exr") && message.contains("3..4") && message.contains("part0.exr"), "{message}");
}

#[test]
fn merged_ranges_are_joined() {
    let parts = vec![part(&[[1.0; 3]; 4], 4), part(&[[2.0; 3]; 4], 0), part(&[[2.0; 3]; 2], 16)];
    let merged = merge(parts).unwrap();
    assert_eq!(merged.image.metadata.sample_ranges, vec![0..8, 16..18]);
    assert_eq!(merged.image.metadata.samples_per_pixel, Some(10.0));
    assert_eq!(merged.warnings, Vec::<String>::new());
}

#[test]
fn merge_refuses_other_sizes_integrators_and_bounds() {
    let mut other = part(&[[1.0; 3]], 8);
    other.1.metadata.integrator = Some("direct".to_owned());
    assert!(merge(vec![part(&[[1.0; 3]], 0), other]).unwrap_err().to_string().contains("integrator"));
    let mut cut = part(&[[1.0; 3]], 8);
    cut.1.metadata.clamp_indirect = Some(2.0);
    let message = merge(vec![part(&[[1.0; 3]], 0), cut]).unwrap_err().to_string();
    assert!(message.contains("--clamp-indirect 2"), "{message}");
    let wide = ExrImage::from_film(&Film::new(2, 1), Metadata::default());
    let message = merge(vec![part(&[[1.0; 3]], 0), ("wide.exr".into(), wide)]).unwrap_err().to_string();
    assert!(message.contains("1x1") && message.contains("2x1"), "{message}");
}

/// Radiance over twelve decades, with black among it.
fn radiance() -> impl Strategy<Value = f32> {
    prop_oneof![9 => (-20.0f32..20.0).prop_map(f32::exp2), 1 => Just(0.0f32)]
}

proptest! {
    /// However a run is cut into parts, the parts' f32 means with their counts merge to the run's to 1 ulp.
    #[test]
    fn merged_parts_equal_the_single_run_to_1_ulp(
        samples in prop::collection::vec([radiance(), radiance(), radiance()], 2..200),
        cuts in prop::collection::vec(0.0f64..1.0, 0..6),
    ) {
        let mut ends: Vec<usize> = cuts.iter().map(|cut| (cut * samples.len() as f64) as usize).collect();
        ends.extend([0, samples.len()]);
        ends.sort_unstable();
        ends.dedup();
        let parts = ends.windows(2).map(|w| part(&samples[w[0]..w[1]], w[0] as u32)).collect();
        let merged = merge(parts).unwrap().image;
        let single = ExrImage::from_film(&film_of(&samples), Metadata::default());
        for (a, b) in merged.rgb().unwrap().iter().flatten().zip(single.rgb().unwrap().iter().flatten()) {
            prop_assert!(ulps(*a, *b) <= 1, "{a:?} {b:?}");
        }
        prop_assert_eq!(merged.values("samples"), single.values("samples"));
        let variance = |image: &ExrImage| image.values("variance").unwrap().to_f32()[0];
        prop_assert!((variance(&merged) / variance(&single).max(1e-30) - 1.0).abs() < 1e-4);
    }

    /// Films merge by adding sums; a film taken from its mean and variance has them again.
    #[test]
    fn sums_come_back_from_mean_and_variance(samples in prop::collection::vec([radiance(), radiance(), radiance()], 2..50)) {
        let film = film_of(&samples);
        let sums = film.pixels()[0];
        let again = PixelSums::from_mean(sums.mean(), sums.variance_of_mean().unwrap(), sums.count);
        prop_assert_eq!(again.count, sums.count);
        prop_assert!((again.luminance_squared / sums.luminance_squared.max(1e-30) - 1.0).abs() < 1e-9);
    }
}
