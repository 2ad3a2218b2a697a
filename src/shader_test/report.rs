//! What came of the checks.

use glam::DVec3;
use serde::Serialize;
use serde_json::{Map, Value};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::bench::statistics::sidak;

/// More failures of one check are counted, not told.
const MOST_TOLD: usize = 4;

/// A check and what came of it.
#[derive(Clone, Debug, Serialize)]
pub struct CheckReport {
    /// The kind of check, e.g. `chi2`.
    pub check: &'static str,
    /// What the file calls it; may be empty.
    pub name: String,
    /// Whether everything was as expected.
    pub passed: bool,
    /// What was expected and what came out, in a line.
    pub summary: String,
    /// Of what was not as expected: where, what was expected and what came out. The first few.
    pub failures: Vec<String>,
    /// How many failures there are.
    pub failed: usize,
    /// The numbers of the summary, by name.
    pub numbers: Map<String, Value>,
}

/// The checks of a file.
#[derive(Clone, Debug, Serialize)]
pub struct FileReport {
    /// The file with the expectations.
    pub file: String,
    /// The kernel.
    pub kernel: String,
    /// What is tested, in a line; may be empty.
    pub about: String,
    /// Whether all checks passed.
    pub passed: bool,
    /// The checks, in the file's order.
    pub checks: Vec<CheckReport>,
}

impl CheckReport {
    pub(super) fn new(check: &'static str, name: &str, summary: String, failures: Vec<String>, numbers: Value) -> Self {
        let failed = failures.len();
        Self {
            check,
            name: name.to_owned(),
            passed: failed == 0,
            summary,
            failures: failures.into_iter().take(MOST_TOLD).collect(),
            failed,
            numbers: if let Value::Object(numbers) = numbers { numbers } else { Map::new() },
        }
    }
}

/// The level of a statistical check and that of each of the tests it is made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    /// Of all together.
    pub(super) all: f64,
    /// Of each (Šidák 1967).
    pub(super) each: f64,
}

impl Level {
    pub(super) fn new(all: f64, tests: usize) -> Self {
        Self { all, each: sidak(all, tests.max(1)) }
    }

    /// As words.
    pub(super) fn told(self, tests: usize) -> String {
        if tests == 1 {
            return format!("level {}", self.all);
        }
        format!("level {} for {tests} tests together, {:.1e} each", self.all, self.each)
    }
}

/// The two-sided p-value of a deviation that exceeds a tolerance, by a normal error; 0 where there is no error to explain it.
pub(super) fn p_of_excess(deviation: f64, tolerance: f64, standard_error: f64) -> f64 {
    let excess = deviation.abs() - tolerance;
    if excess <= 0.0 {
        1.0
    } else if excess.is_nan() || standard_error == 0.0 {
        0.0
    } else {
        2.0 * Normal::standard().sf(excess / standard_error)
    }
}

/// A p-value as text.
pub(super) fn p_text(p: f64) -> String {
    if p >= 1e-3 { format!("p = {p:.3}") } else { format!("p = {}", error_text(p)) }
}

/// Whether an error is allowed; NaN is not.
pub(super) fn within(error: f64, allowed: f64) -> bool {
    error <= allowed
}

/// A number as text, with six significant digits at most.
pub(super) fn number(x: f64) -> String {
    let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    if !rounded.is_finite() || rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// An error as text, with two significant digits.
pub(super) fn error_text(x: f64) -> String {
    if x == 0.0 { String::from("0") } else { format!("{x:.1e}") }
}

/// A vector as text.
pub(super) fn vector(v: DVec3) -> String {
    format!("({}, {}, {})", number(v.x), number(v.y), number(v.z))
}

/// The index of the smallest; NaN counts as the smallest of all.
pub(super) fn worst(values: impl Iterator<Item = f64>) -> usize {
    let rank = |value: f64| if value.is_nan() { f64::NEG_INFINITY } else { value };
    values.map(rank).enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_held_against_tolerance_and_standard_error() {
        assert_eq!(p_of_excess(0.5e-3, 1e-3, 0.0), 1.0);
        assert_eq!(p_of_excess(2e-3, 1e-3, 0.0), 0.0);
        assert_eq!(p_of_excess(f64::NAN, 1e-3, 1.0), 0.0);
        // 1.96 standard errors.
        assert!((p_of_excess(-1.96e-3 - 1e-3, 1e-3, 1e-3) - 0.05).abs() < 1e-4);
        assert_eq!(worst([0.3, f64::NAN, 0.1].into_iter()), 1);
        for (x, text) in
            [(0.1_f32.into(), "0.1"), (-2.0, "-2"), (1e-6, "1e-6"), (1.0 / 3.0, "0.333333"), (1e20, "1e20")]
        {
            assert_eq!(number(x), text);
        }
        assert_eq!((number(0.0).as_str(), number(f64::NAN).as_str(), p_text(0.0).as_str()), ("0", "NaN", "p = 0"));
        let level = Level::new(0.01, 10);
        assert!((1.0 - (1.0 - level.each).powi(10) - 0.01).abs() < 1e-12);
    }
}
