//! The statistics that the other tests rely on, held against SciPy, and shown to reject what they must reject.

use crate::common::random::Random;
use crate::common::reference::{RESOLUTION, Reference, TILE};
use crate::common::statistics::{
    Comparison, Estimate, TileStatistics, beta_regularised, binomial_two_sided, chi_square_test, chi_square_upper_tail,
    gamma_upper, ln_gamma, normal_cdf, normal_quantile, normal_upper_tail, sidak, student_two_sided,
};

/// Both numbers to seven significant digits, as SciPy printed them.
#[track_caller]
fn assert_close(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 5e-8 * expected.abs(), "found {found:.10e}, expected {expected:.10e}");
}

#[test]
fn special_functions_equal_scipy() {
    for (x, expected) in [(0.5, 0.5723649429), (3.7, 1.4280723266), (100.5, 361.4355404678)] {
        assert_close(ln_gamma(x), expected);
    }
    let gamma = [(0.5, 0.3, 0.4385780261), (2.5, 10.0, 1.2497305631e-3), (50.0, 40.0, 0.9296649334)];
    for (a, x, expected) in gamma {
        assert_close(gamma_upper(a, x), expected);
    }
    assert_close(beta_regularised(0.4, 2.0, 3.0), 0.5248);
    assert_close(beta_regularised(0.01, 0.5, 0.5), 0.06376856086);
}

#[test]
fn tail_probabilities_equal_scipy() {
    assert_close(normal_upper_tail(1.959963984540054), 0.025);
    assert_close(normal_upper_tail(5.0), 2.866515719e-7);
    assert_close(normal_upper_tail(8.0), 6.220960574e-16);
    assert_close(normal_cdf(1.0), 0.8413447461);
    assert_close(chi_square_upper_tail(3.841458820694124, 1.0), 0.05);
    assert_close(student_two_sided(4.2, 31.0), 2.08901449e-4);
    assert_close(student_two_sided(6.0, 62.7), 1.07662317e-7);
    assert_close(student_two_sided(1.959963984540054, f64::INFINITY), 0.05);
}

#[test]
fn the_quantile_inverts_the_cdf() {
    assert_close(normal_quantile(0.975), 1.959963985);
    assert_close(normal_quantile(1e-12), -7.034483825);
    for p in [1e-14, 1e-6, 0.02, 0.3, 0.5 + 1e-9, 0.8, 1.0 - 1e-6] {
        let back = normal_cdf(normal_quantile(p));
        assert!((back - p).abs() <= 1e-10 * p, "{p} came back as {back}");
    }
}

#[test]
fn sidak_keeps_the_level_of_the_whole() {
    assert_close(sidak(0.01, 3072), 3.271588351e-6);
    assert_eq!(sidak(0.05, 1), 0.05);
}

#[test]
fn binomial_equals_scipy() {
    assert_close(binomial_two_sided(3, 10, 0.5), 0.34375);
    assert_close(binomial_two_sided(30, 1000, 0.04), 0.11597675392);
    assert_close(binomial_two_sided(10_400, 100_000, 0.1), 2.81433645e-5);
    assert_eq!(binomial_two_sided(0, 20, 0.01), 1.0);
    assert_eq!(binomial_two_sided(20, 20, 1.0), 1.0);
    assert_eq!(binomial_two_sided(1, 20, 0.0), 0.0);
}

#[test]
fn chi_square_test_equals_scipy() {
    let result = chi_square_test(&[18, 22, 16, 25, 19], &[20.0; 5], 100);
    assert_eq!(result.degrees_of_freedom, 4);
    assert_close(result.statistic, 2.5);
    assert_close(result.p_value, 0.6446357929);
}

#[test]
fn small_cells_are_pooled() {
    let expected = [50.0, 40.0, 3.0, 3.0, 2.0, 2.0];
    let result = chi_square_test(&[50, 40, 10, 0, 0, 0], &expected, 100);
    assert_eq!((result.degrees_of_freedom, result.p_value), (2, 1.0));
    // A rest too small to stand alone joins the smallest large cell.
    let result = chi_square_test(&[50, 46, 4], &[50.0, 46.0, 4.0], 100);
    assert_eq!((result.degrees_of_freedom, result.p_value), (1, 1.0));
}

#[test]
fn samples_that_no_cell_expects_are_found() {
    assert_eq!(chi_square_test(&[50, 49, 1], &[50.0, 50.0, 0.0], 100).p_value, 0.0);
    // Samples in no cell at all, where the pdf integrates to one.
    assert!(chi_square_test(&[450, 450], &[500.0, 500.0], 1000).p_value < 1e-9);
    // A pdf that integrates to 0.8 with samples that all land somewhere.
    assert!(chi_square_test(&[500, 500], &[400.0, 400.0], 1000).p_value < 1e-9);
    // And one that is right: a fifth of the samples fails.
    assert_eq!(chi_square_test(&[400, 400], &[400.0, 400.0], 1000).p_value, 1.0);
}

#[test]
fn chi_square_rejects_the_wrong_density_and_keeps_its_level() {
    let mut uniform = Random(1);
    let expected = vec![1000.0; 64];
    let (mut rejected, trials) = (0, 400);
    for _ in 0..trials {
        let mut counts = [0; 64];
        (0..64_000).for_each(|_| counts[(uniform.unit() * 64.0) as usize] += 1);
        rejected += u64::from(chi_square_test(&counts, &expected, 64_000).p_value < 0.05);
    }
    assert!(binomial_two_sided(rejected, trials, 0.05) > 1e-3, "{rejected} of {trials} rejected at 5 %");

    let mut counts = [0; 64];
    (0..64_000).for_each(|_| counts[(uniform.unit().powf(1.05) * 64.0) as usize] += 1);
    assert!(chi_square_test(&counts, &expected, 64_000).p_value < 1e-6);
}

#[test]
fn welch_equals_scipy() {
    let a = Estimate::from_values(&[1.0, 2.0, 3.0, 4.5]);
    let b = Estimate::from_values(&[2.5, 3.5, 5.0, 4.0, 7.0]);
    assert_close(a.deviation(&b), 1.660771384);
    assert_close(a.welch(&b), 0.141332115);
}

#[test]
fn estimates_without_variance_are_compared_to_rounding() {
    let lamp = Estimate::exact(18.387);
    assert!(lamp.welch(&Estimate::exact(18.387 * (1.0 + 1e-7))) > 0.5);
    assert!(lamp.welch(&Estimate::exact(18.387 * (1.0 + 1e-4))) < 1e-9);
    assert_eq!(Estimate::exact(0.0).welch(&Estimate::exact(0.0)), 1.0);
    assert!(Estimate::exact(0.0).welch(&Estimate::exact(1e-6)) < 1e-9);
    assert_eq!(Estimate::exact(0.0).welch(&Estimate::exact(f64::NAN)), 0.0);
}

#[test]
fn tiles_are_means_over_pixels_and_seeds() {
    // 3×2 pixels in tiles of 2: a full tile and one of a single column.
    let image = |scale: f32| -> Vec<[f32; 3]> { (0..6).map(|i| [scale * i as f32, 1.0, 0.0]).collect() };
    let mut statistics = TileStatistics::new(3, 2, 2);
    statistics.add(&image(1.0));
    statistics.add(&image(3.0));
    let tiles = statistics.tiles();
    assert_eq!(tiles.len(), 6);
    assert_eq!(tiles[0], Estimate { mean: 4.0, variance: 4.0, count: 2.0 }); // pixels 0, 1, 3, 4
    assert_eq!(tiles[3].mean, 7.0); // pixels 2, 5
    assert_eq!((tiles[4].mean, tiles[4].variance), (1.0, 0.0));
    assert_eq!(statistics.image()[0].mean, 5.0);
}

/// Tiles with the means of the reference and noise of the size of its own errors, `scale` times as bright.
fn simulated(reference: &Reference, scale: f64, random: &mut Random) -> Vec<Estimate> {
    let noisy = |tile: &Estimate| {
        let deviation = (tile.variance * tile.count).sqrt();
        let values: Vec<f64> = (0..32).map(|_| scale * tile.mean + deviation * random.normal()).collect();
        Estimate::from_values(&values)
    };
    reference.tiles.iter().map(noisy).collect()
}

#[test]
fn the_comparison_accepts_equals_and_rejects_one_percent() {
    let reference = Reference::reflected(Some(1));
    let mut random = Random(7);
    let same = Comparison::new(&reference.tiles, &simulated(&reference, 1.0, &mut random), 0.01);
    assert!(same.passed(), "{same}");
    let brighter = Comparison::new(&reference.tiles, &simulated(&reference, 1.01, &mut random), 0.01);
    assert!(brighter.failures > 100, "{brighter}");
}

#[test]
fn the_references_hold_together() {
    let tiles = (RESOLUTION / TILE).pow(2);
    let emission = Reference::everything(Some(0)).image();
    let mut before = emission;
    for bounces in [Some(1), Some(2), Some(7), None] {
        let (everything, reflected) = (Reference::everything(bounces), Reference::reflected(bounces));
        assert_eq!(everything.tiles.len(), 3 * tiles);
        for channel in 0..3 {
            let (all, part) = (everything.image()[channel], reflected.image()[channel]);
            assert!(part.relative_error() < 2e-4, "{bounces:?}: {:.1e}", part.relative_error());
            // Emission and the rest come from different seeds than the sum's own emission.
            let sum = Estimate {
                mean: emission[channel].mean + part.mean,
                variance: emission[channel].variance + part.variance,
                count: part.count,
            };
            assert!(sum.deviation(&all) < 4.0, "{bounces:?}, channel {channel}: {sum:?} and {all:?}");
            assert!(all.mean > before[channel].mean, "{bounces:?} is darker than fewer bounces");
        }
        before = everything.image();
    }
}
