//! A run of the kernel: what it is to render, and what has come back of it.

use std::ops::Range;
use std::time::Duration;

use super::schedule::{padded_pixels, pixel_of_index};
use super::slices::SliceOutcome;
use super::{NonFiniteSample, Settings, StopReason};
use crate::film::Film;
use crate::film::replicates::ReplicateSums;
use crate::layout::{BLOCK_SAMPLES, BlockResult, RenderConstants};

/// What a run renders and what ends it.
#[derive(Clone, Debug)]
pub struct RunPlan {
    /// Sample indices.
    pub samples: Range<u32>,
    /// Wall time after which the run ends.
    pub time: Option<Duration>,
    /// Relative error at which it ends.
    pub target_error: Option<f64>,
    /// Keep the sums of replicates, which an error estimate is made of; a target implies it.
    pub estimate: bool,
}

impl RunPlan {
    /// Whether the error is estimated from replicates.
    pub fn estimates_error(&self) -> bool {
        self.estimate || self.target_error.is_some()
    }

    /// What the settings ask for.
    pub fn new(settings: &Settings) -> Self {
        Self {
            samples: settings.samples(),
            time: settings.time,
            target_error: settings.target_error,
            estimate: settings.estimate,
        }
    }
}

/// What a run of the kernel returns.
#[derive(Clone, Debug)]
pub struct Run {
    /// The samples.
    pub film: Film,
    /// Which rule ended it.
    pub stopped_by: StopReason,
    /// The sums of replicates, if they were asked for.
    pub replicates: Option<ReplicateSums>,
    /// Rays traced.
    pub rays: u64,
    /// Paths traced.
    pub paths: u64,
    /// Samples that were NaN or infinite.
    pub non_finite_samples: u64,
    /// The first few of them.
    pub first_non_finite: Vec<NonFiniteSample>,
    /// Samples with a path that the cap on bounces cut off.
    pub capped_samples: u64,
    /// Wall time.
    pub seconds: f64,
}

/// Non-finite samples whose place is kept.
const REPORTED_NON_FINITE: usize = 16;

impl Run {
    /// The first reason stays.
    pub(super) fn stop(&mut self, reason: StopReason) {
        if self.stopped_by == StopReason::Samples {
            self.stopped_by = reason;
        }
    }

    pub(super) fn new(constants: &RenderConstants, plan: &RunPlan) -> Self {
        let film = Film::new(constants.width, constants.height);
        let replicates = plan.estimates_error();
        Self {
            replicates: replicates.then(|| ReplicateSums::new(film.pixels().len())),
            film,
            stopped_by: StopReason::Samples,
            rays: 0,
            paths: 0,
            non_finite_samples: 0,
            first_non_finite: Vec::new(),
            capped_samples: 0,
            seconds: 0.0,
        }
    }

    pub(super) fn add(&mut self, constants: &RenderConstants, outcome: &SliceOutcome, results: &[BlockResult]) {
        let pixels = padded_pixels(constants);
        for (result, lane) in results.iter().zip(0_u64..) {
            if result.samples == 0 {
                continue;
            }
            let atom = u64::from(outcome.constants.first_atom) + lane;
            let (x, y) = pixel_of_index(constants, atom % pixels);
            let sum = [0, 1, 2].map(|c| f64::from(result.sum[c]) + compensation(result, c));
            let pixel = y as usize * constants.width as usize + x as usize;
            let block = outcome.constants.first_block + u32::try_from(atom / pixels).unwrap_or(0);
            self.film.add_block(pixel, sum, f64::from(result.luminance_squared), result.samples);
            if let Some(replicates) = &mut self.replicates {
                replicates.add_block(pixel, block, sum, result.samples);
            }
            self.rays += u64::from(result.rays);
            self.paths += u64::from(result.samples);
            self.capped_samples += u64::from(result.capped.count_ones());
            self.non_finite_samples += u64::from(result.non_finite.count_ones());
            for bit in (0..BLOCK_SAMPLES).filter(|bit| result.non_finite >> bit & 1 == 1) {
                if self.first_non_finite.len() < REPORTED_NON_FINITE {
                    self.first_non_finite.push(NonFiniteSample { x, y, sample: block * BLOCK_SAMPLES + bit });
                }
            }
        }
    }
}

/// The low part of the sum; meaningless (NaN) where the sum itself is not finite.
fn compensation(result: &BlockResult, channel: usize) -> f64 {
    if result.sum[channel].is_finite() { f64::from(result.compensation[channel]) } else { 0.0 }
}
