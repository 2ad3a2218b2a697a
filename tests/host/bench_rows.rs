//! What `sunfleck bench` makes of its rows, on synthetic errors and times with a known answer: slopes, efficiencies,
//! ratios, and what is left of an interrupted run.

use sunfleck::bench::jackknife::{jackknife, mean_without, stays_positive};
use sunfleck::bench::measure::keep_common_seeds;
use sunfleck::bench::pairs::{Comparison, Pair, Ratios, Sample, a_first};
use sunfleck::bench::point::{Point, SeedRun, mse_over};
use sunfleck::bench::power_law::{Row, fit_power_law};
use sunfleck::bench::reference::Errors;

use crate::common::random::Random;

const SEEDS: u32 = 8;

/// Rows at 4, 8, 16 and 32 samples whose errors are those of a variance estimate from `k` squares: skewed as an MSE is,
/// with a standard deviation of √(2/k) of the mean. `noise` is what was subtracted too much or too little.
fn rows(random: &mut Random, k: u32, noise: f64) -> Vec<Row> {
    let mut error = |x: f64| {
        let squares: f64 = (0..k).map(|_| random.normal().powi(2)).sum();
        5.0 / x * squares / f64::from(k) + noise * random.normal()
    };
    [4.0, 8.0, 16.0, 32.0]
        .map(|x| Row { x: vec![x; SEEDS as usize], y: (0..SEEDS).map(|_| error(x)).collect() })
        .to_vec()
}

/// Binomial with n 1000 and p 0.95: its standard deviation is 6.9, the bound four of them.
fn assert_covers(hits: u32) {
    assert!((922..=978).contains(&hits), "{hits} of 1000");
}

#[test]
fn the_jackknife_of_a_mean_is_its_standard_error() {
    let values = [1.0, 2.0, 4.0, 9.0];
    let found = jackknife(4, |left_out| mean_without(&values, left_out)).unwrap();
    // Mean 4, squared deviations 9 + 4 + 0 + 25 = 38, over n (n - 1) = 12.
    assert!((found.estimate - 4.0).abs() < 1e-12 && (found.standard_error - (38.0_f64 / 12.0).sqrt()).abs() < 1e-12);
    assert!(jackknife(1, |_| 1.0).is_none() && jackknife(3, |left_out| left_out.map_or(1.0, |_| f64::NAN)).is_none());
}

#[test]
fn the_slope_is_recovered_and_its_interval_covers() {
    let mut random = Random(2);
    let mut hits = 0;
    for _ in 0..1000 {
        let law = fit_power_law(&rows(&mut random, 100, 0.0), 0.0).unwrap();
        assert!((law.slope.estimate + 1.0).abs() < 0.25, "{law:?}");
        hits += u32::from(law.slope.contains(-1.0));
    }
    assert_covers(hits);
    let row = |x: f64, y: f64| Row { x: vec![x; 2], y: vec![y; 2] };
    let exact = fit_power_law(&[row(1.0, 2.0), row(4.0, 1.0)], 0.0).unwrap();
    assert!((exact.slope.estimate + 0.5).abs() < 1e-12 && (exact.at(16.0) - 0.5).abs() < 1e-12, "{exact:?}");
    assert!(fit_power_law(&[row(1.0, 2.0)], 0.0).is_none(), "one row has no slope");
    assert!(fit_power_law(&[Row { x: vec![1.0], y: vec![1.0] }, Row { x: vec![2.0], y: vec![1.0] }], 0.0).is_none());
}

#[test]
fn an_error_below_zero_does_not_take_the_slope_away() {
    let mut random = Random(8);
    let (mut hits, mut with_negative) = (0, 0);
    for _ in 0..1000 {
        // The mean at 32 samples per pixel is 0.156: there noise of 0.12 makes one error in ten negative.
        let rows = rows(&mut random, 100, 0.12);
        with_negative += u32::from(rows.iter().any(|row| row.y.iter().any(|y| *y <= 0.0)));
        let law = fit_power_law(&rows, 0.0).unwrap();
        hits += u32::from(law.slope.contains(-1.0));
    }
    assert!(with_negative > 500, "{with_negative} of 1000 have an error below zero");
    assert_covers(hits);
}

#[test]
fn the_error_of_the_reference_widens_the_interval_of_the_slope() {
    let mut random = Random(12);
    // At 32 samples per pixel the mean is 0.156; the shift that all rows share is 15 % of that.
    let common_error = 0.023;
    let (mut hits, mut without) = (0, 0);
    for _ in 0..1000 {
        let shift = common_error * random.normal();
        let mut rows = rows(&mut random, 1000, 0.0);
        rows.iter_mut().flat_map(|row| &mut row.y).for_each(|y| *y += shift);
        hits += u32::from(fit_power_law(&rows, common_error).unwrap().slope.contains(-1.0));
        without += u32::from(fit_power_law(&rows, 0.0).unwrap().slope.contains(-1.0));
    }
    // By Student's t with 7 degrees of freedom, where the shift is normal: more often than 95 of 100.
    assert!((940..=1000).contains(&hits), "{hits} of 1000");
    assert!(without < 800, "the test could not tell: {without} of 1000");
}

#[test]
fn the_error_of_the_reference_widens_the_interval_of_a_ratio() {
    let mut random = Random(13);
    let (common_error, mut hits, mut without) = (0.01, 0, 0);
    for _ in 0..1000 {
        let shift = common_error * random.normal();
        let mut pairs = pairs(&mut random, 0.5);
        pairs.iter_mut().flat_map(|pair| [&mut pair.a, &mut pair.b]).for_each(|sample| sample.mse += shift);
        let holds = |error: f64| {
            let Ratios { mse, efficiency, .. } = Comparison::of(&[pairs.clone()], error).overall;
            mse.unwrap().contains(0.5) && efficiency.unwrap().contains(4.0)
        };
        hits += u32::from(holds(common_error));
        without += u32::from(holds(0.0));
    }
    assert!((940..=1000).contains(&hits), "{hits} of 1000");
    assert!(without < 800, "the test could not tell: {without} of 1000");
}

#[test]
fn a_row_whose_mean_is_not_above_zero_is_left_out() {
    assert!(stays_positive(&[1.0, -0.1, 0.2]) && !stays_positive(&[1.0, -0.5, -0.2]));
    assert!(!stays_positive(&[-1.0, -2.0]) && !stays_positive(&[1.0]));
    assert!(!stays_positive(&[2.0, -0.5, -0.5]), "its mean is below zero without the first");
    let row = |x: f64, y: [f64; 2]| Row { x: vec![x; 2], y: y.to_vec() };
    let rows = [row(1.0, [8.0, 8.0]), row(4.0, [2.0, 2.0]), row(16.0, [0.5, -0.6])];
    let law = fit_power_law(&rows, 0.0).unwrap();
    assert!((law.slope.estimate + 1.0).abs() < 1e-12 && law.rows == 2, "{law:?}");
    assert!(fit_power_law(&rows[1..], 0.0).is_none());
}

fn errors(mse: f64) -> Errors {
    Errors { mse, rel_mse: mse, uncorrected_mse: mse, uncorrected_rel_mse: mse, flip: None, mean_difference: [0.0; 3] }
}

fn run(seed: u32, spp: f64, seconds: f64, mse: f64) -> SeedRun {
    SeedRun { seed, spp, seconds, errors: errors(mse) }
}

#[test]
fn the_efficiency_has_a_standard_error() {
    // MSE · seconds has the mean 0.02 with independent relative errors of 10 % and 5 % a seed.
    let mut random = Random(9);
    let mut hits = 0;
    for _ in 0..1000 {
        let mut value = |mean: f64, scatter: f64| mean * (1.0 + scatter * random.normal());
        let runs: Vec<_> = (0..SEEDS).map(|seed| run(seed, 16.0, value(2.0, 0.05), value(0.01, 0.1))).collect();
        let efficiency = Point::new(runs).efficiency.unwrap();
        // By the delta method the relative standard error is √((0.1² + 0.05²) / 8) = 0.0395; its estimate has 7 degrees of
        // freedom and stays within a factor of 5 of it.
        let relative = efficiency.standard_error / efficiency.estimate;
        assert!((0.0395 / 5.0..0.0395 * 5.0).contains(&relative), "{relative}");
        hits += u32::from(efficiency.interval().contains(50.0));
    }
    assert_covers(hits);
    let below = Point::new(vec![run(0, 16.0, 1.0, -0.1), run(1, 16.0, 1.0, 0.05)]);
    assert!(below.efficiency.is_none() && !below.in_fit);
}

#[test]
fn a_row_of_times_has_the_samples_it_reached() {
    let point = |n: f64| Point::new(vec![run(0, 10.0 * n, 1.0 * n, 0.2 / n), run(1, 15.5 * n, 1.1 * n, 0.1 / n)]);
    let points = [point(1.0), point(2.0)];
    assert_eq!((points[0].spp_label(), points[1].spp_label()), ("12.8".to_owned(), "25.5".to_owned()));
    for law in [mse_over(&points, |run| run.spp, 0.0), mse_over(&points, |run| run.seconds, 0.0)] {
        assert!((law.unwrap().slope.estimate + 1.0).abs() < 1e-12, "{law:?}");
    }
    assert_eq!(Point::new(vec![run(0, 64.0, 1.0, 0.1)]).spp_label(), "64");
}

#[test]
fn an_interrupted_run_keeps_the_seeds_that_all_rows_have() {
    let kept = |counts: &[usize]| {
        let mut rows: Vec<Vec<()>> = counts.iter().map(|&count| vec![(); count]).collect();
        keep_common_seeds(&mut rows);
        rows.iter().map(Vec::len).collect::<Vec<_>>()
    };
    assert_eq!(kept(&[8, 8, 8]), [8, 8, 8]);
    assert_eq!(kept(&[4, 4, 3]), [3, 3, 3]);
    assert_eq!(kept(&[1, 1, 0]), [1, 1]);
    assert!(kept(&[0, 0]).is_empty());
}

/// Pairs of one row; the machine gets slower from seed to seed.
fn pairs(random: &mut Random, mse_ratio: f64) -> Vec<Pair> {
    (0..SEEDS)
        .map(|n| {
            let drift = 1.0 + 0.2 * f64::from(n);
            let mut sample = |seconds: f64, mse: f64| Sample {
                spp: 64.0,
                render_seconds: seconds * drift * (0.02 * random.normal()).exp(),
                process_seconds: seconds * drift,
                mse: mse * (0.02 * random.normal()).exp(),
            };
            Pair { seed: n, a: sample(2.0, 0.1), b: sample(1.0, 0.1 * mse_ratio) }
        })
        .collect()
}

#[test]
fn pairs_give_ratios_and_a_verdict() {
    let mut random = Random(7);
    let mut ratios = |mse_ratio: f64| Comparison::of(&[pairs(&mut random, mse_ratio)], 0.0).overall;
    let better = ratios(0.5);
    assert!(better.render_seconds.unwrap().contains(0.5) && better.mse.unwrap().contains(0.5), "{better:?}");
    assert!((better.process_seconds.unwrap().estimate - 0.5).abs() < 1e-12, "a drift cancels within a pair");
    assert!(better.verdict().starts_with("B is better"), "{}", better.verdict());
    assert!(ratios(8.0).verdict().starts_with("A is better"));
    assert!(ratios(2.0).verdict().starts_with("no difference seen"));
    assert!(ratios(-1.0).verdict().starts_with("no verdict"));
    assert_eq!([0, 1, 2, 3].map(a_first), [true, false, true, false]);
}

#[test]
fn the_overall_ratio_is_the_geometric_mean_over_rows() {
    let mut random = Random(10);
    let rows = [0.5, 2.0, -1.0].map(|ratio| pairs(&mut random, ratio));
    let Comparison { rows, overall } = Comparison::of(&rows, 0.0);
    assert!(rows[0].mse.unwrap().contains(0.5) && rows[1].mse.unwrap().contains(2.0), "{rows:?}");
    assert!(rows[2].mse.is_none() && rows[2].efficiency.is_none() && rows[2].render_seconds.is_some());
    let product = rows[0].mse.unwrap().estimate * rows[1].mse.unwrap().estimate;
    assert!((overall.mse.unwrap().estimate - product.sqrt()).abs() < 1e-12, "{overall:?}");
    let interval = overall.mse.unwrap();
    assert!(interval.contains(1.0) && interval.high / interval.low < 1.1, "{interval:?}");
    assert!(overall.efficiency.unwrap().contains(2.0), "{overall:?}");
}

#[test]
fn the_interval_of_the_overall_ratio_covers_where_rows_share_their_samples() {
    let mut random = Random(11);
    let mut hits = 0;
    for _ in 0..1000 {
        // The error of a seed's image is mostly that of the seed, in all rows.
        let seeds: Vec<[f64; 2]> = (0..SEEDS).map(|_| [0; 2].map(|_: i32| 1.0 + 0.2 * random.normal())).collect();
        let rows = [1.0, 0.5, 0.25].map(|mse| {
            let sample =
                |factor: f64| Sample { spp: 1.0, render_seconds: 1.0, process_seconds: 1.0, mse: mse * factor };
            let pair = |(seed, factors): (usize, &[f64; 2])| {
                let [a, b] = factors.map(|factor| sample(factor + 0.05 * random.normal()));
                Pair { seed: seed as u32, a, b }
            };
            seeds.iter().enumerate().map(pair).collect()
        });
        hits += u32::from(Comparison::of(&rows, 0.0).overall.mse.unwrap().contains(1.0));
    }
    assert_covers(hits);
}
