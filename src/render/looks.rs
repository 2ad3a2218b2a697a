//! When a run that is to end at an error looks at what it has: after whole rounds over all pixels, each time where the
//! error should be reached by its law 1/√n, but no further than twice the samples, so that a bad first guess costs little.
//!
//! A run that looks often ends where the estimate happens to be low. Looks are therefore few: the first at
//! [`FIRST_LOOK`] samples, each later one at least [`GROWTH`] times as many.

use std::ops::Range;

use crate::layout::BLOCK_SAMPLES;

/// Samples per pixel at the first look: four replicates of one block each.
const FIRST_LOOK: u32 = 4 * BLOCK_SAMPLES;
/// Least factor between the samples at one look and at the next.
const GROWTH: f64 = 1.125;
/// What is aimed at beyond the prediction, lest every other look be in vain.
const MARGIN: f64 = 1.02;

/// The looks of one run.
pub(super) struct Looks {
    samples: Range<u32>,
    target: Option<f64>,
}

impl Looks {
    /// Without a target there is one look, at the end.
    pub(super) fn new(samples: Range<u32>, target: Option<f64>) -> Self {
        Self { samples, target }
    }

    /// One past the last sample index before the first look.
    pub(super) fn first_end(&self) -> u32 {
        if self.target.is_some() { self.end_at(FIRST_LOOK) } else { self.samples.end }
    }

    /// Whether an error is low enough.
    pub(super) fn is_reached(&self, error: f64) -> bool {
        self.target.is_some_and(|target| error <= target)
    }

    /// Samples per pixel that the error at `end` lets expect for the target.
    pub(super) fn expected_samples(&self, end: u32, error: f64) -> Option<u32> {
        let done = f64::from(end - self.samples.start);
        let wanted = (error / self.target?).powi(2) * done * MARGIN;
        // A float beyond the range of u32 becomes its largest value.
        Some((wanted.ceil() as u32).min(self.samples.end - self.samples.start))
    }

    /// One past the last sample index before the next look, after one at `end` that showed `error` (`None`: unknown).
    pub(super) fn next_end(&self, end: u32, error: Option<f64>) -> u32 {
        let done = f64::from(end - self.samples.start);
        let wanted = error.and_then(|error| self.expected_samples(end, error)).map_or(2.0 * done, f64::from);
        self.end_at(wanted.clamp(GROWTH * done, 2.0 * done).ceil() as u32)
    }

    /// At least that many samples, up to the end of a block.
    fn end_at(&self, samples: u32) -> u32 {
        let end = self.samples.start.saturating_add(samples);
        end.checked_next_multiple_of(BLOCK_SAMPLES).unwrap_or(u32::MAX).min(self.samples.end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The counts at which a run looks whose error is exactly 1/√n.
    fn counts(samples: Range<u32>, target: f64) -> Vec<u32> {
        let looks = Looks::new(samples.clone(), Some(target));
        let mut ends = vec![looks.first_end()];
        loop {
            let end = ends[ends.len() - 1];
            let error = 1.0 / f64::from(end - samples.start).sqrt();
            if looks.is_reached(error) || end == samples.end {
                return ends;
            }
            ends.push(looks.next_end(end, Some(error)));
        }
    }

    #[test]
    fn looks_are_few_and_land_just_behind_the_target() {
        assert_eq!(counts(0..u32::MAX, 0.5), [64]);
        // 10⁴ samples are needed: doubled until they are near.
        assert_eq!(counts(0..u32::MAX, 0.01), [64, 128, 256, 512, 1024, 2048, 4096, 8192, 10208]);
        assert_eq!(counts(0..5000, 0.01).last(), Some(&5000));
        assert_eq!(counts(8..40, 0.01), [40]);
        assert_eq!(counts(8..u32::MAX, 0.5), [80]);
    }

    #[test]
    fn without_a_target_there_is_one_look() {
        let looks = Looks::new(3..77, None);
        assert_eq!(looks.first_end(), 77);
        assert!(!looks.is_reached(0.0));
    }

    #[test]
    fn an_unknown_or_endless_error_doubles_the_samples() {
        let looks = Looks::new(0..u32::MAX, Some(0.1));
        assert_eq!([None, Some(f64::INFINITY)].map(|error| looks.next_end(64, error)), [128, 128]);
        assert_eq!(looks.next_end(u32::MAX - 20, None), u32::MAX);
    }
}
