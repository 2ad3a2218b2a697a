//! The statistics of `sunfleck bench` on synthetic data with a known answer.

use sunfleck::bench::bias::{ALPHA, find_bias};
use sunfleck::bench::mean_image::{ImageAccumulator, MeanImage};
use sunfleck::bench::pairs::{Pair, Ratios, Sample, a_first};
use sunfleck::bench::reference::Reference;
use sunfleck::bench::statistics::{fit_power_law, mean_interval, sidak, t_quantile};

/// SplitMix64 (Steele, Lea and Flood 2014): the tests' own random numbers, the same every time.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Standard normal, by Box and Muller.
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// An image of this mean whose pixels are means of `spp` exponential samples: skewed, as radiance is.
    fn image(&mut self, side: u32, spp: u32, mean: impl Fn(u32, u32) -> f64) -> Vec<[f32; 3]> {
        let mut pixel = |mean: f64| {
            let sum: f64 = (0..spp).map(|_| -(1.0 - self.uniform()).ln()).sum();
            (mean * sum / f64::from(spp)) as f32
        };
        (0..side * side).map(|i| [0; 3].map(|_: i32| pixel(mean(i % side, i / side)))).collect()
    }

    fn mean_image(&mut self, side: u32, images: u32, spp: u32, mean: impl Fn(u32, u32) -> f64) -> MeanImage {
        let mut accumulator = ImageAccumulator::new((side, side));
        for _ in 0..images {
            accumulator.add(&self.image(side, spp, &mean));
        }
        accumulator.finish()
    }
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
        mean_interval(&values).unwrap().contains(3.0)
    });
    // Binomial with n 4000 and p 0.95: its standard deviation is 13.8, the bound four of them.
    let hits = hits.count();
    assert!((3745..=3855).contains(&hits), "{hits} of 4000");
}

#[test]
fn the_slope_is_recovered_and_its_interval_covers() {
    let mut random = Random(2);
    let mut hits = 0;
    for _ in 0..1000 {
        let seeds: Vec<Vec<(f64, f64)>> = (0..8)
            .map(|_| [4.0, 8.0, 16.0, 32.0].map(|x: f64| (x, 5.0 / x * (0.1 * random.normal()).exp())).to_vec())
            .collect();
        let law = fit_power_law(&seeds).unwrap();
        assert!((law.slope.estimate + 1.0).abs() < 0.15, "{law:?}");
        hits += u32::from(law.slope.contains(-1.0));
    }
    // Binomial with n 1000 and p 0.95: its standard deviation is 6.9, the bound four of them.
    assert!((922..=978).contains(&hits), "{hits} of 1000");
    let exact = fit_power_law(&vec![vec![(1.0, 2.0), (4.0, 1.0)]; 2]).unwrap();
    assert!((exact.slope.estimate + 0.5).abs() < 1e-12 && (exact.at(16.0) - 0.5).abs() < 1e-12);
    assert!(fit_power_law(&vec![vec![(1.0, 2.0), (4.0, -1.0)]; 2]).is_none(), "no logarithm, no law");
    assert!(fit_power_law(&vec![vec![(1.0, 2.0)]; 2]).is_none(), "one count has no slope");
}

#[test]
fn no_bias_is_found_where_there_is_none() {
    let mut random = Random(3);
    let found = (0..100).filter(|_| {
        let image = random.mean_image(24, 8, 64, |_, _| 0.5);
        let reference = random.mean_image(24, 8, 128, |_, _| 0.5);
        find_bias(&image, &reference).biased
    });
    // At the level 0.01 more than 5 of 100 happen with probability 5e-4.
    let found = found.count();
    assert!(found <= 5, "{found} of 100");
}

#[test]
fn a_bias_in_one_tile_is_found_there() {
    let mut random = Random(4);
    let reference = random.mean_image(24, 8, 128, |_, _| 0.5);
    let in_tile = |x, y| if (8..16).contains(&x) && y >= 16 { 0.54 } else { 0.5 };
    let verdict = find_bias(&random.mean_image(24, 8, 64, in_tile), &reference);
    assert!(verdict.biased && verdict.worst.tile == Some([8, 16]), "{verdict:?}");
    let same = find_bias(&random.mean_image(24, 8, 64, |_, _| 0.5), &reference);
    assert!(!same.biased && same.tests == 3 * 10, "{same:?}");
}

#[test]
fn what_would_have_been_seen_is_seen() {
    let mut random = Random(5);
    let mut seen = 0;
    for _ in 0..40 {
        let reference = random.mean_image(24, 8, 128, |_, _| 0.5);
        let share = find_bias(&random.mean_image(24, 8, 64, |_, _| 0.5), &reference).detectable_image;
        let biased = random.mean_image(24, 8, 64, |_, _| 0.5 * (1.0 + share));
        seen += u32::from(find_bias(&biased, &reference).biased);
    }
    // Any of the three channels shows it, so the chance is above POWER = 0.95; less than 33 of 40 has probability 1e-4.
    assert!(seen >= 33, "{seen} of 40");
}

#[test]
fn equal_constants_are_no_bias_and_different_ones_are() {
    let constant = |value: f32| {
        let mut image = ImageAccumulator::new((8, 8));
        image.add(&[[value; 3]; 64]);
        image.add(&[[value; 3]; 64]);
        image.finish()
    };
    assert!(!find_bias(&constant(0.3), &constant(0.3)).biased);
    assert!(!find_bias(&constant(0.0), &constant(0.0)).biased);
    assert!(find_bias(&constant(0.3), &constant(0.300_01)).biased);
}

#[test]
fn the_noise_of_the_reference_is_subtracted() {
    let mut random = Random(6);
    let (side, runs) = (32, 40);
    let mut corrected = Vec::new();
    for _ in 0..runs {
        // Variance of a pixel: 0.25 / 32 of the image, 0.25 / (8 · 8) of the reference.
        let reference = random.mean_image(side, 8, 8, |_, _| 0.5);
        let reference = Reference::from_images(reference, String::new(), 64.0, 1.0);
        corrected.push(reference.errors_of(&random.image(side, 32, |_, _| 0.5)).mse);
    }
    let (truth, biased) = (0.25 / 32.0, 0.25 / 32.0 + 0.25 / 64.0);
    let interval = mean_interval(&corrected).unwrap();
    // The interval at 95 %, widened to four standard errors: 4 / 2.02 (t with 39 degrees of freedom).
    let half = (interval.high - interval.estimate) * 4.0 / 2.02;
    assert!((interval.estimate - truth).abs() < half, "{interval:?}, {truth}");
    assert!((interval.estimate - biased).abs() > half, "the test could not tell: {interval:?}, {biased}");
}

#[test]
fn pairs_give_ratios_and_a_verdict() {
    let mut random = Random(7);
    let mut pairs = |mse_ratio: f64| -> Vec<Pair> {
        (0..8)
            .map(|n| {
                let drift = 1.0 + 0.2 * f64::from(n);
                let mut sample = |seconds: f64, mse: f64| Sample {
                    render_seconds: seconds * drift * (0.02 * random.normal()).exp(),
                    process_seconds: seconds * drift,
                    mse: mse * (0.02 * random.normal()).exp(),
                };
                Pair { seed: n as u32, a: sample(2.0, 0.1), b: sample(1.0, 0.1 * mse_ratio) }
            })
            .collect()
    };
    let better = Ratios::of(&pairs(0.5));
    assert!(better.render_seconds.unwrap().contains(0.5) && better.mse.unwrap().contains(0.5), "{better:?}");
    assert!((better.process_seconds.unwrap().estimate - 0.5).abs() < 1e-12, "a drift cancels within a pair");
    assert!(better.verdict().starts_with("B is better"), "{}", better.verdict());
    assert!(Ratios::of(&pairs(8.0)).verdict().starts_with("A is better"));
    assert!(Ratios::of(&pairs(2.0)).verdict().starts_with("no difference seen"));
    assert!(Ratios::of(&pairs(-1.0)).verdict().starts_with("no verdict"));
    assert_eq!([0, 1, 2, 3].map(a_first), [true, false, true, false]);
}
