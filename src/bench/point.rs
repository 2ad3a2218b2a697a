//! All images of one row of a bench, and the slopes over all rows.

use serde::Serialize;

use super::jackknife::{Estimate, stays_positive};
use super::power_law::{PowerLaw, Row, fit_power_law};
use super::reference::Errors;
use super::statistics::Summary;

/// All images of one row.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Samples per pixel: the mean over the images where time ended them.
    pub spp: f64,
    /// Seconds of rendering.
    pub seconds: Summary,
    /// MSE without the reference's noise.
    pub mse: Summary,
    /// relMSE without the reference's noise.
    pub rel_mse: Summary,
    /// FLIP, the reference's noise included; `None` if the images are too large for it.
    pub flip: Option<Summary>,
    /// 1 / (MSE · seconds), with the standard error of the delta method; `None` where `in_fit` is false.
    pub efficiency: Option<Estimate>,
    /// Whether the mean MSE is above zero, whichever seed is left out. If not, it is not above the reference's noise, and
    /// the row is left out of the slopes.
    pub in_fit: bool,
    /// The raw numbers.
    pub runs: Vec<SeedRun>,
}

/// One image.
#[derive(Clone, Debug, Serialize)]
pub struct SeedRun {
    /// Its seed.
    pub seed: u32,
    /// Its samples per pixel.
    pub spp: f64,
    /// Seconds of rendering.
    pub seconds: f64,
    /// Its errors.
    #[serde(flatten)]
    pub errors: Errors,
}

impl Point {
    /// From at least one image.
    pub fn new(runs: Vec<SeedRun>) -> Self {
        let values = |of: fn(&SeedRun) -> f64| runs.iter().map(of).collect::<Vec<_>>();
        let flips: Option<Vec<f64>> = runs.iter().map(|run| run.errors.flip).collect();
        let (seconds, mse) = (values(|run| run.seconds), values(|run| run.errors.mse));
        let in_fit = stays_positive(&mse);
        Self {
            spp: Summary::of(&values(|run| run.spp)).mean,
            seconds: Summary::of(&seconds),
            mse: Summary::of(&mse),
            rel_mse: Summary::of(&values(|run| run.errors.rel_mse)),
            flip: flips.map(|flips| Summary::of(&flips)),
            efficiency: in_fit.then(|| efficiency(&mse, &seconds)),
            in_fit,
            runs,
        }
    }

    /// Samples per pixel for people: whole, or with one decimal.
    pub fn spp_label(&self) -> String {
        let decimals = if self.spp.fract() == 0.0 { 0 } else { 1 };
        format!("{:.decimals$}", self.spp)
    }
}

/// 1 / (mean MSE · mean seconds). By the delta method its relative standard error is that of the mean over seeds of
/// MSE / mean MSE + seconds / mean seconds, which has their covariance in it. (The jackknife would do, were it not for MSEs
/// that a single seed makes: without that seed 1/MSE is larger by orders.)
fn efficiency(mse: &[f64], seconds: &[f64]) -> Estimate {
    let (mean_mse, mean_seconds) = (Summary::of(mse).mean, Summary::of(seconds).mean);
    let relative: Vec<_> = mse.iter().zip(seconds).map(|(m, s)| m / mean_mse + s / mean_seconds).collect();
    let estimate = 1.0 / (mean_mse * mean_seconds);
    let standard_error = estimate * Summary::of(&relative).standard_error;
    Estimate { estimate, standard_error, degrees_of_freedom: mse.len() as f64 - 1.0 }
}

/// MSE over x as a power law; `None` where none fits ([`fit_power_law`]). `common_error` is the standard error that all
/// MSEs share, since they have one reference.
pub fn mse_over(points: &[Point], x: fn(&SeedRun) -> f64, common_error: f64) -> Option<PowerLaw> {
    let row = |point: &Point| Row {
        x: point.runs.iter().map(x).collect(),
        y: point.runs.iter().map(|run| run.errors.mse).collect(),
    };
    fit_power_law(&points.iter().map(row).collect::<Vec<_>>(), common_error)
}
