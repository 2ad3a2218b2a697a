//! Renders the images of a bench one after the other, and reports their progress as that of the whole.

use std::time::{Duration, Instant};

use super::plan::Budget;
use crate::render::{PathTracer, Progress, ProgressUpdate, Run, RunPlan, StopReason};
use crate::{Error, Result};

/// Counts what is done.
pub(super) struct Work<'a> {
    progress: Progress<'a>,
    start: Instant,
    samples_done: u64,
    samples_total: Option<u64>,
    time_limit: Option<Duration>,
    /// Samples that were NaN or infinite.
    pub(super) non_finite_samples: u64,
}

impl<'a> Work<'a> {
    pub(super) fn new(progress: Progress<'a>) -> Self {
        Self {
            progress,
            start: Instant::now(),
            samples_done: 0,
            samples_total: None,
            time_limit: None,
            non_finite_samples: 0,
        }
    }

    /// What comes next, all of it ended by samples or all by time: progress starts anew.
    pub(super) fn begin(&mut self, pixels: u64, budgets: impl Iterator<Item = Budget>) {
        (self.start, self.samples_done) = (Instant::now(), 0);
        (self.samples_total, self.time_limit) = (None, None);
        for budget in budgets {
            match budget {
                Budget::Samples(spp) => *self.samples_total.get_or_insert(0) += u64::from(spp) * pixels,
                Budget::Time(time) => *self.time_limit.get_or_insert(Duration::ZERO) += time,
            }
        }
    }

    /// Renders one image, after a `pilot` if adaptively.
    ///
    /// # Errors
    /// Those of a render; [`Error::Interrupted`] if the caller says so; [`Error::Usage`] if the time was too short for a
    /// sample in every pixel.
    pub(super) fn render(
        &mut self,
        tracer: &mut PathTracer,
        seed: u32,
        pilot: Option<u32>,
        budget: Budget,
    ) -> Result<Run> {
        let (spp, time) = match budget {
            Budget::Samples(spp) => (spp, None),
            Budget::Time(time) => (u32::MAX, Some(time)),
        };
        let plan = RunPlan { samples: 0..spp, time, pilot, ..RunPlan::default() };
        let run = tracer.run_plan(seed, &plan, &mut |update| {
            (self.progress)(&ProgressUpdate {
                samples_done: self.samples_done + update.samples_done,
                samples_total: self.samples_total,
                elapsed: self.start.elapsed(),
                time_limit: self.time_limit,
                run: None,
            })
        })?;
        if run.stopped_by == StopReason::Interrupted {
            return Err(Error::Interrupted);
        }
        if run.film.pixels().iter().any(|pixel| pixel.count == 0) {
            return Err(too_short(budget));
        }
        self.samples_done += run.paths;
        self.non_finite_samples += run.non_finite_samples;
        Ok(run)
    }
}

/// Pixels without a sample have no error to measure.
pub fn too_short(budget: Budget) -> Error {
    Error::Usage(format!("--times: in {budget} not every pixel gets a sample; begin with a longer time"))
}
