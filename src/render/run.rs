//! A run of the kernel: what it is to render, and what has come back of it.

use std::ops::Range;
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};

use super::schedule::{padded_pixels, pixel_of_index};
use super::slices::SliceOutcome;
use super::{KernelKey, NonFiniteSample, Settings, Statistics, StopReason};
use crate::film::Film;
use crate::film::aov::{AovFilm, AovSample};
use crate::film::replicates::ReplicateSums;
use crate::layout::{AovSums, BLOCK_SAMPLES, BlockResult, RayCounters, RenderConstants};

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

/// What ends a range before its samples do, and what its progress is measured by.
pub(super) struct Limits {
    pub(super) start: Instant,
    pub(super) time: Option<Duration>,
    pub(super) samples_total: Option<u64>,
}

/// What a run of the kernel returns.
#[derive(Clone, Debug)]
pub struct Run {
    /// The samples.
    pub film: Film,
    /// AOVs, if the kernel sums any.
    pub aovs: Option<AovFilm>,
    /// Blocks in which the count behind [`crate::film::aov::Aov::Cost`] stopped at the largest number.
    pub saturated_costs: u64,
    /// Counters, if the kernel counts.
    pub statistics: Option<Statistics>,
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

    pub(super) fn new(constants: &RenderConstants, plan: &RunPlan, key: &KernelKey) -> Self {
        let film = Film::new(constants.width, constants.height);
        let replicates = plan.estimates_error();
        let aovs = key.aovs();
        Self {
            aovs: (!aovs.is_empty()).then(|| AovFilm::new(&aovs, film.pixels().len())),
            saturated_costs: 0,
            statistics: key.statistics.then(|| Statistics::new(key.trace)),
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

    /// What a slice has brought. `origin` is the world's point at which rebased space has its zero.
    pub(super) fn add(
        &mut self,
        constants: &RenderConstants,
        outcome: &SliceOutcome,
        slice: &SliceResults<'_>,
        origin: DVec3,
    ) {
        let pixels = padded_pixels(constants);
        if let (Some(statistics), Some(counters)) = (&mut self.statistics, slice.counters) {
            statistics.add(outcome, counters);
        }
        for (index, result) in slice.results.iter().enumerate() {
            if result.samples() == 0 {
                continue;
            }
            let atom = u64::from(outcome.constants.first_atom) + index as u64;
            let (x, y) = pixel_of_index(constants, atom % pixels);
            let sum = [0, 1, 2].map(|c| f64::from(result.sum[c]) + compensation(result, c));
            let pixel = y as usize * constants.width as usize + x as usize;
            let block = outcome.constants.first_block + u32::try_from(atom / pixels).unwrap_or(0);
            self.film.add_block(pixel, sum, f64::from(result.luminance_squared), result.samples());
            if let (Some(film), Some(aovs)) = (&mut self.aovs, slice.aovs) {
                film.add_block(pixel, &aov_sample(&aovs[index], origin));
                self.saturated_costs += u64::from(aovs[index].visits == u32::MAX);
            }
            if let Some(replicates) = &mut self.replicates {
                replicates.add_block(pixel, block, sum, result.samples());
            }
            self.rays += u64::from(result.rays());
            self.paths += u64::from(result.samples());
            self.capped_samples += u64::from(result.capped().count_ones());
            self.non_finite_samples += u64::from(result.non_finite().count_ones());
            for bit in (0..BLOCK_SAMPLES).filter(|bit| result.non_finite() >> bit & 1 == 1) {
                if self.first_non_finite.len() < REPORTED_NON_FINITE {
                    self.first_non_finite.push(NonFiniteSample { x, y, sample: block * BLOCK_SAMPLES + bit });
                }
            }
        }
    }
}

/// What the atoms of a slice have brought.
pub(super) struct SliceResults<'a> {
    pub(super) results: &'a [BlockResult],
    pub(super) aovs: Option<&'a [AovSums]>,
    pub(super) counters: Option<&'a [RayCounters]>,
}

/// The sums of a block, positions in world space.
fn aov_sample(sums: &AovSums, origin: DVec3) -> AovSample {
    let hits = f64::from(sums.hits);
    AovSample {
        albedo: sums.albedo.map(f64::from),
        normal: sums.normal.map(f64::from),
        depth: sums.depth.into(),
        position: (Vec3::from(sums.position).as_dvec3() + origin * hits).to_array(),
        hits,
        visits: sums.visits.into(),
    }
}

/// The low part of the sum; meaningless (NaN) where the sum itself is not finite.
fn compensation(result: &BlockResult, channel: usize) -> f64 {
    if result.sum[channel].is_finite() { f64::from(result.compensation[channel]) } else { 0.0 }
}
