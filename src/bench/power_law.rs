//! Power laws, which are straight lines in a log-log plot, fitted to means over seeds.

use serde::Serialize;

use super::jackknife::{jackknife, mean_without, stays_positive};
use super::statistics::Interval;

/// A power law y = e^`intercept` · x^`slope`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PowerLaw {
    /// Exponent.
    pub slope: Interval,
    /// Logarithm of y at x = 1.
    pub intercept: f64,
    /// Rows that it is fitted to.
    pub rows: usize,
}

impl PowerLaw {
    /// y at x.
    pub fn at(&self, x: f64) -> f64 {
        (self.intercept + self.slope.estimate * x.ln()).exp()
    }
}

/// One point of the plot: the x and y of each seed, in the same order in every row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Samples per pixel or seconds, above zero.
    pub x: Vec<f64>,
    /// Errors. A single one may be negative where noise was subtracted.
    pub y: Vec<f64>,
}

/// Fits a power law to the means over seeds of every row: a straight line in their logarithms, by least squares. The
/// interval of the slope is the jackknife's over seeds, widened by an error that all y share: its standard error is
/// `common_error`.
///
/// Rows whose mean y does not stay above zero ([`stays_positive`]) have no logarithm and are left out. `None` where
/// fewer than two rows with different x are left, or there are fewer than two seeds.
///
/// # Panics
/// If rows have different numbers of seeds.
pub fn fit_power_law(rows: &[Row], common_error: f64) -> Option<PowerLaw> {
    let seeds = rows.first()?.y.len();
    assert!(rows.iter().all(|row| (row.x.len(), row.y.len()) == (seeds, seeds)), "every row has one x and y a seed");
    let rows: Vec<_> = rows.iter().filter(|row| stays_positive(&row.y)).collect();
    let line = |left_out| {
        let log_mean = |values: &[f64]| mean_without(values, left_out).ln();
        straight_line(&rows.iter().map(|row| (log_mean(&row.x), log_mean(&row.y))).collect::<Vec<_>>())
    };
    // The slope is linear in the ln y, so its derivative in a common shift of the y is the slope of the 1/y.
    let derivative = |row: &&Row| (mean_without(&row.x, None).ln(), 1.0 / mean_without(&row.y, None));
    let derivative = straight_line(&rows.iter().map(derivative).collect::<Vec<_>>()).0;
    let slope = jackknife(seeds, |left_out| line(left_out).0)?.with_common_error(derivative, common_error);
    Some(PowerLaw { slope: slope.interval(), intercept: line(None).1, rows: rows.len() })
}

/// Slope and intercept of the least-squares line through the points; NaN if all x are equal.
fn straight_line(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let (x_mean, y_mean) = points.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / n, sum.1 + y / n));
    let (xx, xy) = points
        .iter()
        .fold((0.0, 0.0), |sum, (x, y)| (sum.0 + (x - x_mean).powi(2), sum.1 + (x - x_mean) * (y - y_mean)));
    (xy / xx, y_mean - xy / xx * x_mean)
}
