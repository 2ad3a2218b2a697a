//! Two sides (builds or settings) rendered in alternation: ratios B over A with intervals, and what they mean in words.

use serde::Serialize;

use super::jackknife::{jackknife, mean_without, stays_positive};
use super::statistics::Interval;

/// One image of one side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Samples per pixel.
    pub spp: f64,
    /// Seconds of rendering.
    pub render_seconds: f64,
    /// Seconds of the whole process, start-up included.
    pub process_seconds: f64,
    /// MSE to the reference, its noise subtracted.
    pub mse: f64,
}

/// Images of the same seed from both sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// The seed.
    pub seed: u32,
    /// Side A.
    pub a: Sample,
    /// Side B.
    pub b: Sample,
}

/// Ratios B over A with jackknife intervals over the pairs; `None` where a value has no logarithm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratios {
    /// Of the seconds of rendering: the geometric mean of the pairs' ratios, in which a drift of the machine cancels.
    pub render_seconds: Option<Interval>,
    /// Of the seconds of the process, likewise.
    pub process_seconds: Option<Interval>,
    /// Of the mean MSEs.
    pub mse: Option<Interval>,
    /// Of 1 / (MSE · render seconds): one over the product of the two ratios.
    pub efficiency: Option<Interval>,
}

/// The ratios of every row and of all.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// One entry a row.
    pub rows: Vec<Ratios>,
    /// Geometric means over the rows, those of MSE and efficiency over the rows that have them.
    pub overall: Ratios,
}

impl Comparison {
    /// From the pairs of every row, of the same seeds in the same order. `common_error` is the standard error that all
    /// MSEs share, since they have one reference.
    ///
    /// # Panics
    /// If rows have different numbers of pairs.
    pub fn of(rows: &[Vec<Pair>], common_error: f64) -> Self {
        let of_row = |pairs| Ratios::of(&[pairs], common_error);
        Self { rows: rows.iter().map(of_row).collect(), overall: Ratios::of(rows, common_error) }
    }
}

impl Ratios {
    /// The geometric means over the rows. The rows of one seed share samples and depend on each other; so it is seeds that
    /// the jackknife leaves out, from all rows at once.
    fn of<P: AsRef<[Pair]>>(rows: &[P], common_error: f64) -> Self {
        let rows: Vec<&[Pair]> = rows.iter().map(AsRef::as_ref).collect();
        let seeds = rows.first().map_or(0, |pairs| pairs.len());
        assert!(rows.iter().all(|pairs| pairs.len() == seeds), "every row has one pair a seed");
        let with_error: Vec<_> = rows.iter().copied().filter(|pairs| errors_stay_positive(pairs)).collect();
        let mean = |rows: &[&[Pair]], of: &dyn Fn(&[Pair]) -> f64| {
            rows.iter().map(|pairs| of(pairs)).sum::<f64>() / rows.len() as f64
        };
        let interval = |rows: &[&[Pair]], log_ratio: &dyn Fn(&[Pair], Option<usize>) -> f64, derivative: f64| {
            let estimate = jackknife(seeds, |left_out| mean(rows, &|pairs| log_ratio(pairs, left_out)))?;
            Some(estimate.with_common_error(derivative, common_error).interval().map(f64::exp))
        };
        // Of the logarithm of the ratio of MSEs in a common shift of them.
        let derivative = mean(&with_error, &|pairs| {
            let [a, b] = errors(pairs).map(|mse| 1.0 / mean_without(&mse, None));
            b - a
        });
        let render = |pairs: &[Pair], left_out| log_time_ratio(pairs, left_out, |sample| sample.render_seconds);
        Self {
            render_seconds: interval(&rows, &render, 0.0),
            process_seconds: interval(
                &rows,
                &|pairs, left_out| log_time_ratio(pairs, left_out, |sample| sample.process_seconds),
                0.0,
            ),
            mse: interval(&with_error, &log_error_ratio, derivative),
            efficiency: interval(
                &with_error,
                &|pairs, left_out| -log_error_ratio(pairs, left_out) - render(pairs, left_out),
                derivative,
            ),
        }
    }

    /// Which side is better, in words: by efficiency, and only where its interval is free of 1.
    pub fn verdict(&self) -> String {
        match self.efficiency {
            None => "no verdict: no MSE is above the reference's noise; use a longer reference".to_owned(),
            Some(ratio) if ratio.contains(1.0) => format!(
                "no difference seen: the efficiency of B is {:.3} to {:.3} times that of A",
                ratio.low, ratio.high
            ),
            Some(ratio) if ratio.low > 1.0 => better("B", "A", ratio.low, ratio.high),
            Some(ratio) => better("A", "B", 1.0 / ratio.high, 1.0 / ratio.low),
        }
    }
}

fn log_time_ratio(pairs: &[Pair], left_out: Option<usize>, seconds: fn(&Sample) -> f64) -> f64 {
    let logs: Vec<f64> = pairs.iter().map(|pair| (seconds(&pair.b) / seconds(&pair.a)).ln()).collect();
    mean_without(&logs, left_out)
}

fn errors(pairs: &[Pair]) -> [Vec<f64>; 2] {
    [pairs.iter().map(|pair| pair.a.mse).collect(), pairs.iter().map(|pair| pair.b.mse).collect()]
}

/// Of the means, since a single MSE may be negative once the reference's noise is subtracted.
fn log_error_ratio(pairs: &[Pair], left_out: Option<usize>) -> f64 {
    let [a, b] = errors(pairs).map(|mse| mean_without(&mse, left_out).ln());
    b - a
}

fn errors_stay_positive(pairs: &[Pair]) -> bool {
    errors(pairs).iter().all(|mse| stays_positive(mse))
}

fn better(one: &str, other: &str, low: f64, high: f64) -> String {
    format!("{one} is better: it reaches equal error in 1/{low:.3} to 1/{high:.3} of the time of {other}")
}

/// Which side goes first with the `n`-th seed: A B, B A, A B, …, so that a drift of the machine's speed cancels.
pub fn a_first(n: usize) -> bool {
    n.is_multiple_of(2)
}
