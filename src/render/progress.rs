//! What a running render tells its caller.

use std::ops::ControlFlow;
use std::time::Duration;

use super::Run;

/// Called after every slice; says whether to go on.
pub type Progress<'a> = &'a mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>;

/// The state of a render, given to the caller's [`Progress`]. That answers with
/// [`ControlFlow::Break`] to stop: the render then returns what it has, as [`super::StopReason::Interrupted`].
#[derive(Clone, Copy, Debug)]
pub struct ProgressUpdate<'a> {
    /// Samples done so far, over all pixels, those of a pilot too.
    pub samples_done: u64,
    /// Samples to do, over all pixels; `None` if only time or an error ends the render.
    pub samples_total: Option<u64>,
    /// Time since rendering began.
    pub elapsed: Duration,
    /// The time limit, if there is one.
    pub time_limit: Option<Duration>,
    /// What there is so far, for whoever wants to show it; `None` if what goes on is more than one image.
    pub run: Option<&'a Run>,
}

impl ProgressUpdate<'_> {
    /// Samples per second so far.
    pub fn samples_per_second(&self) -> f64 {
        self.samples_done as f64 / self.elapsed.as_secs_f64().max(1e-9)
    }

    /// The share that is done, in [0, 1]: of the samples or of the time, whichever is further.
    pub fn fraction(&self) -> f64 {
        let samples = self.samples_total.map_or(0.0, |total| self.samples_done as f64 / total.max(1) as f64);
        let time = self.time_limit.map_or(0.0, |limit| self.elapsed.as_secs_f64() / limit.as_secs_f64().max(1e-9));
        samples.max(time).clamp(0.0, 1.0)
    }

    /// The time that is left if it goes on like this; `None` before there is anything to go by.
    pub fn remaining(&self) -> Option<Duration> {
        let fraction = self.fraction();
        (fraction > 0.0).then(|| self.elapsed.mul_f64(((1.0 - fraction) / fraction).min(1e9)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_follows_from_what_is_further() {
        let update = ProgressUpdate {
            samples_done: 25,
            samples_total: Some(100),
            elapsed: Duration::from_secs(10),
            time_limit: Some(Duration::from_secs(20)),
            run: None,
        };
        assert_eq!(update.fraction(), 0.5);
        assert_eq!(update.remaining(), Some(Duration::from_secs(10)));
        assert_eq!(update.samples_per_second(), 2.5);
        let start = ProgressUpdate { samples_done: 0, time_limit: None, ..update };
        assert_eq!(start.remaining(), None);
    }
}
