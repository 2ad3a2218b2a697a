//! The jackknife (Quenouille 1956; Tukey 1958): the standard error of anything that is computed from all seeds, by
//! leaving out one seed after the other.
//!
//! It asks for independent seeds and nothing else. The images of one seed may depend on each other: they share samples.

use serde::Serialize;

use super::statistics::{CONFIDENCE, Interval, t_quantile};

/// A statistic of all seeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Its value.
    pub estimate: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Seeds less one.
    #[serde(skip)]
    pub degrees_of_freedom: f64,
}

impl Estimate {
    /// With an independent error that all seeds share (that of the reference), by its standard error and the statistic's
    /// derivative in it.
    #[must_use]
    pub fn with_common_error(self, derivative: f64, standard_error: f64) -> Self {
        Self { standard_error: self.standard_error.hypot(derivative * standard_error), ..self }
    }

    /// Student's t interval.
    pub fn interval(&self) -> Interval {
        let half = t_quantile(0.5 + 0.5 * CONFIDENCE, self.degrees_of_freedom) * self.standard_error;
        Interval { estimate: self.estimate, low: self.estimate - half, high: self.estimate + half }
    }
}

/// Computes a statistic from all seeds, and its standard error, √((n − 1)/n Σ (θᵢ − θ̄)²), from those without seed i.
/// `statistic` is told which seed is left out, if any.
///
/// `None` below two seeds, or where the statistic is not finite for one of these sets.
pub fn jackknife(seeds: usize, statistic: impl Fn(Option<usize>) -> f64) -> Option<Estimate> {
    if seeds < 2 {
        return None;
    }
    let n = seeds as f64;
    let estimate = statistic(None);
    let parts: Vec<f64> = (0..seeds).map(|seed| statistic(Some(seed))).collect();
    let mean = parts.iter().sum::<f64>() / n;
    let squares: f64 = parts.iter().map(|part| (part - mean).powi(2)).sum();
    let standard_error = ((n - 1.0) / n * squares).sqrt();
    let degrees_of_freedom = n - 1.0;
    (estimate.is_finite() && standard_error.is_finite()).then_some(Estimate {
        estimate,
        standard_error,
        degrees_of_freedom,
    })
}

/// The mean of the values, one a seed, without that of the seed left out.
pub fn mean_without(values: &[f64], left_out: Option<usize>) -> f64 {
    let kept = values.iter().enumerate().filter(|(seed, _)| Some(*seed) != left_out);
    let (sum, count) = kept.fold((0.0, 0.0), |(sum, count), (_, value)| (sum + value, count + 1.0));
    sum / count
}

/// Whether the mean of the values, one a seed, has a logarithm that the jackknife can tell the error of: it is above
/// zero with all seeds, and whichever of them is left out.
pub fn stays_positive(values: &[f64]) -> bool {
    let sets = std::iter::once(None).chain((0..values.len()).map(Some));
    values.len() >= 2 && sets.into_iter().all(|left_out| mean_without(values, left_out) > 0.0)
}
