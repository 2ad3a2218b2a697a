//! Means with standard errors, ratios and slopes with intervals, all from independent repetitions (seeds) by Student's t.
//!
//! Every interval here is the t interval over one number a seed: the slope that seed's images have, the logarithm of
//! the ratio that seed's pair has. That asks for independent seeds and nothing else; the scatter may differ from one
//! sample count to the next, as it does.

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

    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self { estimate: f(self.estimate), low: f(self.low), high: f(self.high) }
    }
}

/// The t interval of the mean. `None` below two values, or if one is not finite.
pub fn mean_interval(values: &[f64]) -> Option<Interval> {
    if values.len() < 2 || values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let Summary { mean, standard_error } = Summary::of(values);
    let half = t_quantile(0.5 + 0.5 * CONFIDENCE, values.len() as f64 - 1.0) * standard_error;
    Some(Interval { estimate: mean, low: mean - half, high: mean + half })
}

/// The interval of a ratio from the logarithms of the ratios of independent pairs: their geometric mean.
pub fn ratio_interval(log_ratios: &[f64]) -> Option<Interval> {
    mean_interval(log_ratios).map(|interval| interval.map(f64::exp))
}

/// A power law y = e^`intercept` · x^`slope`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PowerLaw {
    /// Exponent.
    pub slope: Interval,
    /// Logarithm of y at x = 1.
    pub intercept: f64,
}

impl PowerLaw {
    /// y at x.
    pub fn at(&self, x: f64) -> f64 {
        (self.intercept + self.slope.estimate * x.ln()).exp()
    }
}

/// Fits a power law to the points (x, y) of every seed: one straight line a seed in the logarithms, by least squares.
/// The law is the mean line, and its slope's interval the t interval over the seeds' slopes.
///
/// `None` if there is no such law: fewer than two seeds, a seed with fewer than two different x, or a number that has
/// no logarithm (an error that is not above the noise of its reference).
pub fn fit_power_law(seeds: &[Vec<(f64, f64)>]) -> Option<PowerLaw> {
    let lines: Option<Vec<_>> = seeds.iter().map(|points| log_line(points)).collect();
    let lines = lines?;
    let slopes: Vec<f64> = lines.iter().map(|(slope, _)| *slope).collect();
    let intercepts: Vec<f64> = lines.iter().map(|(_, intercept)| *intercept).collect();
    Some(PowerLaw { slope: mean_interval(&slopes)?, intercept: Summary::of(&intercepts).mean })
}

/// Slope and intercept of the least-squares line through (ln x, ln y).
fn log_line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let (x_mean, y_mean) = logs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / n, sum.1 + y / n));
    let (xx, xy) =
        logs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + (x - x_mean).powi(2), sum.1 + (x - x_mean) * (y - y_mean)));
    let (slope, intercept) = (xy / xx, y_mean - xy / xx * x_mean);
    (slope.is_finite() && intercept.is_finite()).then_some((slope, intercept))
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
