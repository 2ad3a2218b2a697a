//! The pilot of adaptive sampling: two renders of few samples, each with a seed of its own.
//!
//! It may take [`TIME_SHARE`] of a run's time. If that is up before, all pixels are sampled alike.

use super::adaptive::{PilotFilm, SampleFactors};
use super::run::Limits;
use super::{PathTracer, Pilot, Progress, ProgressUpdate, Run, RunPlan, StopReason};
use crate::Result;

/// By what bits the seeds of its halves differ from the image's: by no small number, as seeds of users do.
const SEEDS: [u32; 2] = [0x9e37_79b9, 0x6a09_e667];

/// Of the time that a run has, the pilot's is one over this.
const TIME_SHARE: u32 = 4;

impl PathTracer {
    /// Finds how many samples of its own each pixel is to have for one of the image, by so many that are no part of it.
    pub(super) fn pilot(
        &mut self,
        run: &mut Run,
        seed: u32,
        samples: u32,
        limits: &Limits,
        progress: Progress<'_>,
    ) -> Result<SampleFactors> {
        let half = samples / 2;
        let first = self.half_pilot(run, seed ^ SEEDS[0], half, limits, progress)?;
        let second = self.half_pilot(run, seed ^ SEEDS[1], samples - half, limits, progress)?;
        let halves = first.zip(second);
        let is_complete = halves.is_some();
        let factors = halves.map_or_else(SampleFactors::default, |(a, b)| SampleFactors::from_pilots(&[a, b]));
        run.pilot = Some(Pilot {
            samples,
            is_complete,
            paths: run.paths,
            seconds: limits.start.elapsed().as_secs_f64(),
            found: factors.report(),
        });
        Ok(factors)
    }

    /// `None` if it was not completed. What the run has is what the half before it has cost.
    fn half_pilot(
        &mut self,
        run: &mut Run,
        seed: u32,
        samples: u32,
        limits: &Limits,
        progress: Progress<'_>,
    ) -> Result<Option<PilotFilm>> {
        self.constants.seed = seed;
        let mut pilot = Run::new(&self.constants, &RunPlan::default(), &self.key);
        pilot.stop(run.stopped_by);
        let own_limits = Limits { time: limits.time.map(|time| time / TIME_SHARE), ..*limits };
        pilot.pixel_rays = vec![0; pilot.film.pixels().len()];
        let before = run.paths;
        self.run_range(&mut pilot, 0..samples, &SampleFactors::default(), &own_limits, &mut |update| {
            let samples_done = before + update.samples_done;
            progress(&ProgressUpdate { samples_done, time_limit: limits.time, run: None, ..*update })
        })?;
        run.add_pilot(&pilot);
        let is_complete = pilot.stopped_by == StopReason::Samples;
        Ok(is_complete.then_some(PilotFilm { film: pilot.film, rays: pilot.pixel_rays }))
    }
}
