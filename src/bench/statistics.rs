//! Means with standard errors and intervals from independent repetitions (seeds), by Student's t, and the
//! distributions behind them. What is no mean is in [`super::jackknife`].

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// A mean over repetitions with its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean; NaN (`null` in JSON) below two repetitions.
    pub standard_error: f64,
}

impl Summary {
    /// Of the values of all repetitions.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Self { mean, standard_error: (squares / (n - 1.0) / n).sqrt() }
    }

    /// The standard error as a part of the mean.
    pub fn relative_error(&self) -> f64 {
        self.standard_error / self.mean.abs()
    }
}

/// An estimate with the interval that holds the true value with [`CONFIDENCE`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The estimate.
    pub estimate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Whether a value lies in it.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// The interval of a rising function of the value.
    #[must_use]
    pub fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self { estimate: f(self.estimate), low: f(self.low), high: f(self.high) }
    }
}

/// The value below which a share `p` of Student's t distribution lies; infinite degrees of freedom are the normal one.
///
/// Above 10⁴ degrees of freedom by the expansion about the normal quantile z (Abramowitz and Stegun 26.7.5; the first term left
/// out is below 10⁻⁹ there): `statrs` loses digits from 10⁶ on.
pub fn t_quantile(p: f64, degrees_of_freedom: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, degrees_of_freedom) {
        Ok(distribution) if degrees_of_freedom <= 1e4 => distribution.inverse_cdf(p),
        _ => {
            let (z, n) = (Normal::standard().inverse_cdf(p), degrees_of_freedom);
            z + (z.powi(3) + z) / (4.0 * n) + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * n * n)
        }
    }
}

/// The two-sided p-value of a t statistic.
pub fn t_two_sided(t: f64, degrees_of_freedom: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, degrees_of_freedom) {
        Ok(distribution) if degrees_of_freedom.is_finite() => 2.0 * distribution.sf(t.abs()),
        _ => 2.0 * Normal::standard().sf(t.abs()),
    }
}

/// The level of each of `tests` independent tests that gives all of them together the level `alpha`
/// (Šidák 1967): 1 − (1 − α)^(1/n).
pub fn sidak(alpha: f64, tests: usize) -> f64 {
    -((-alpha).ln_1p() / tests as f64).exp_m1()
}
