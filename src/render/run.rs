//! A run of the kernel: what it is to render, and what has come back of it.

use std::ops::Range;
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};
use serde::Serialize;

use super::adaptive::FactorReport;
use super::slices::SliceOutcome;
use super::{KernelKey, NonFiniteSample, Settings, Statistics, StopReason};
use crate::film::Film;
use crate::film::aov::{AovFilm, AovSample};
use crate::film::replicates::ReplicateSums;
use crate::layout::{AovSums, Atom, BLOCK_SAMPLES, BlockResult, RayCounters, RenderConstants};

/// What a run renders and what ends it.
#[derive(Clone, Debug, Default)]
pub struct RunPlan {
    /// Sample indices.
    pub samples: Range<u32>,
    /// Wall time after which the run ends.
    pub time: Option<Duration>,
    /// Relative error at which it ends.
    pub target_error: Option<f64>,
    /// Keep the sums of replicates, which an error estimate is made of; a target implies it.
    pub estimate: bool,
    /// Samples of a pilot, at least 4, which finds the noisy pixels; they then have more samples of their own. Those of it
    /// that are not finite are not counted: they are in no image.
    pub pilot: Option<u32>,
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
            pilot: settings.adaptive,
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
    /// Those of the image that it holds; a run that ended early has the first ones, of the last block not in every pixel.
    pub samples: Range<u32>,
    /// What the pilot found, if there was one.
    pub pilot: Option<Pilot>,
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
    /// Rays traced, those of the pilot too.
    pub rays: u64,
    /// Paths traced, those of the pilot too.
    pub paths: u64,
    /// Samples that were NaN or infinite.
    pub non_finite_samples: u64,
    /// The first few of them.
    pub first_non_finite: Vec<NonFiniteSample>,
    /// Samples with a path that the cap on bounces cut off.
    pub capped_samples: u64,
    /// Wall time.
    pub seconds: f64,
    /// Rays of each pixel; empty if nobody asks.
    pub(super) pixel_rays: Vec<u64>,
}

/// What the pilot of adaptive sampling was, and what it found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pilot {
    /// Its samples of every pixel; none of them is in the image.
    pub samples: u32,
    /// False if it took too much of the run's time, or was interrupted: then it found nothing.
    pub is_complete: bool,
    /// Its paths.
    pub paths: u64,
    /// Its wall time.
    pub seconds: f64,
    /// How samples are shared out after it.
    #[serde(flatten)]
    pub found: FactorReport,
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
            samples: plan.samples.start..plan.samples.start,
            pilot: None,
            stopped_by: StopReason::Samples,
            rays: 0,
            paths: 0,
            non_finite_samples: 0,
            first_non_finite: Vec::new(),
            capped_samples: 0,
            seconds: 0.0,
            pixel_rays: Vec::new(),
        }
    }

    /// What a pilot has cost.
    pub(super) fn add_pilot(&mut self, pilot: &Run) {
        // Its time is a part of the run's.
        if pilot.stopped_by != StopReason::Time {
            self.stop(pilot.stopped_by);
        }
        self.rays += pilot.rays;
        self.paths += pilot.paths;
        if let (Some(mine), Some(its)) = (&mut self.statistics, &pilot.statistics) {
            mine.merge(its);
        }
    }

    /// What a slice has brought. `origin` is the world's point at which rebased space has its zero.
    pub(super) fn add(&mut self, outcome: &SliceOutcome, slice: &SliceResults<'_>, origin: DVec3) {
        if let (Some(statistics), Some(counters)) = (&mut self.statistics, slice.counters) {
            statistics.add(outcome, counters);
        }
        for (index, (atom, result)) in slice.atoms.iter().zip(slice.results).enumerate() {
            let (x, y) = atom.place();
            let sum = [0, 1, 2].map(|c| f64::from(result.sum[c]) + compensation(result, c));
            let pixel = y as usize * self.film.width() as usize + x as usize;
            let block = atom.block();
            self.film.add_block(pixel, sum, f64::from(result.luminance_squared), result.samples());
            if let (Some(film), Some(aovs)) = (&mut self.aovs, slice.aovs) {
                film.add_block(pixel, &aov_sample(&aovs[index], origin));
                self.saturated_costs += u64::from(aovs[index].visits == u32::MAX);
            }
            if let Some(replicates) = &mut self.replicates {
                replicates.add_block(pixel, block, sum, result.samples());
            }
            self.rays += u64::from(result.rays());
            if let Some(rays) = self.pixel_rays.get_mut(pixel) {
                *rays += u64::from(result.rays());
            }
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
    pub(super) atoms: &'a [Atom],
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
