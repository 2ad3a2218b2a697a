//! Two sides (builds or settings) rendered in alternation: ratios B over A with intervals, and what they mean in words.

use serde::Serialize;

use super::statistics::{Interval, ratio_interval};

/// One image of one side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
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

/// Ratios B over A: geometric means over the pairs with t intervals; `None` where a value has no logarithm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratios {
    /// Of the seconds of rendering.
    pub render_seconds: Option<Interval>,
    /// Of the seconds of the process.
    pub process_seconds: Option<Interval>,
    /// Of MSE.
    pub mse: Option<Interval>,
    /// Of 1 / (MSE · render seconds).
    pub efficiency: Option<Interval>,
}

impl Ratios {
    /// From all pairs.
    pub fn of(pairs: &[Pair]) -> Self {
        let ratio = |value: fn(&Sample) -> f64| {
            ratio_interval(&pairs.iter().map(|pair| (value(&pair.b) / value(&pair.a)).ln()).collect::<Vec<_>>())
        };
        Self {
            render_seconds: ratio(|s| s.render_seconds),
            process_seconds: ratio(|s| s.process_seconds),
            mse: ratio(|s| s.mse),
            efficiency: ratio(|s| 1.0 / (s.mse * s.render_seconds)),
        }
    }

    /// Which side is better, in words: by efficiency, and only where its interval is free of 1.
    pub fn verdict(&self) -> String {
        match self.efficiency {
            None => "no verdict: an MSE is not above the reference's noise; use a longer reference".to_owned(),
            Some(ratio) if ratio.contains(1.0) => format!(
                "no difference seen: the efficiency of B is {:.3} to {:.3} times that of A",
                ratio.low, ratio.high
            ),
            Some(ratio) if ratio.low > 1.0 => better("B", "A", ratio.low, ratio.high),
            Some(ratio) => better("A", "B", 1.0 / ratio.high, 1.0 / ratio.low),
        }
    }
}

fn better(one: &str, other: &str, low: f64, high: f64) -> String {
    format!("{one} is better: it reaches equal error in 1/{low:.3} to 1/{high:.3} of the time of {other}")
}

/// Which side goes first with the `n`-th seed: A B, B A, A B, …, so that a drift of the machine's speed cancels.
pub fn a_first(n: usize) -> bool {
    n.is_multiple_of(2)
}
