//! The pilot of adaptive sampling: two renders of few samples, each with a seed of its own.

use std::ops::ControlFlow;

use super::adaptive::{PilotFilm, SampleFactors};
use super::run::Limits;
use super::{PathTracer, Pilot, ProgressUpdate, Run, RunPlan};
use crate::Result;

/// By what bits the seeds of its halves differ from the image's: by no small number, as seeds of users do.
const SEEDS: [u32; 2] = [0x9e37_79b9, 0x6a09_e667];

/// Called after every slice; says whether to go on.
type Progress<'a> = &'a mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>;

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
        let factors = SampleFactors::from_pilots(&[first, second]);
        run.pilot = Some(Pilot {
            samples,
            paths: run.paths,
            seconds: limits.start.elapsed().as_secs_f64(),
            found: factors.report(),
        });
        Ok(factors)
    }

    /// What the run has is what the halves before it have cost.
    fn half_pilot(
        &mut self,
        run: &mut Run,
        seed: u32,
        samples: u32,
        limits: &Limits,
        progress: Progress<'_>,
    ) -> Result<PilotFilm> {
        self.constants.seed = seed;
        let mut pilot = Run::new(&self.constants, &RunPlan::default(), &self.key);
        pilot.stop(run.stopped_by);
        pilot.pixel_rays = vec![0; pilot.film.pixels().len()];
        let before = run.paths;
        self.run_range(&mut pilot, 0..samples, &SampleFactors::default(), limits, &mut |update| {
            progress(&ProgressUpdate { samples_done: before + update.samples_done, run: None, ..*update })
        })?;
        run.add_pilot(&pilot);
        Ok(PilotFilm { film: pilot.film, rays: pilot.pixel_rays })
    }
}
