//! The error of an image from independently scrambled replicates, with an interval for it.
//!
//! The samples of every pixel are dealt to [`REPLICATES`] replicates by blocks of consecutive indices. Each replicate is an
//! image of its own, independent of the others whatever the sampler does within it, so what the replicates differ by is
//! the error of their mean: also for a low-discrepancy sequence, whose samples are not independent of each other.
//! The derivation stands in docs/accuracy/error-estimate.md.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::{RELATIVE_ERROR_EPSILON, luminance};

/// Replicates that the blocks of a pixel are dealt to.
pub const REPLICATES: usize = 8;

/// Least probability with which [`ErrorEstimate::interval`] holds the true error.
pub const CONFIDENCE: f64 = 0.95;

/// Sums of luminance per pixel and replicate.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplicateSums {
    pixels: Vec<[Sum; REPLICATES]>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sum {
    luminance: f64,
    count: u32,
}

/// How far an image is from the converged one, and how well that is known. Errors are the root of the mean over pixels of
/// (Y − T)² / (T² + 0.01²), with Y the pixel's luminance and T the converged one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ErrorEstimate {
    /// The expected error.
    pub error: f64,
    /// Holds the error of this very image with a probability of at least [`CONFIDENCE`].
    pub interval: [f64; 2],
    /// Replicates that hold samples, 2 to [`REPLICATES`].
    pub replicates: usize,
}

/// The mean luminance of an image, and what is left of it if each pixel is the median of its replicates' means (Nemirovsky
/// and Yudin 1983; in rendering: Jung, Meyer and DeLong 2015): a few bright samples cannot move that, so the
/// difference is the light that hangs on them. The median of a skewed distribution is below its mean: it is no better image.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RobustMean {
    /// Mean over pixels of the luminance.
    pub mean: f64,
    /// Mean over pixels of the median over replicates of the luminance.
    pub median_of_means: f64,
}

/// Σ and Σ of squares over pixels of their squared relative errors.
#[derive(Clone, Copy, Debug, Default)]
struct Terms {
    sum: f64,
    sum_of_squares: f64,
}

impl ReplicateSums {
    /// For an image of that many pixels, without samples.
    pub fn new(pixels: usize) -> Self {
        Self { pixels: vec![Default::default(); pixels] }
    }

    /// Adds the sum of `count` samples of a block. Blocks go to the replicates in turn.
    ///
    /// # Panics
    /// If `pixel` is outside the image.
    pub fn add_block(&mut self, pixel: usize, block: u32, sum_rgb: [f64; 3], count: u32) {
        let sum = &mut self.pixels[pixel][block as usize % REPLICATES];
        sum.luminance += luminance(sum_rgb);
        sum.count += count;
    }

    /// The image's mean luminance, plain and by medians. `None` where a pixel has samples in fewer than three replicates
    /// (of two, the median is the mean) or a sum is not finite.
    pub fn robust_mean(&self) -> Option<RobustMean> {
        let (mut mean, mut median) = (0.0, 0.0);
        for sums in &self.pixels {
            let mut means = Vec::with_capacity(REPLICATES);
            means.extend(sums.iter().filter(|s| s.count > 0).map(|s| s.luminance / f64::from(s.count)));
            if means.len() < 3 {
                return None;
            }
            means.sort_by(f64::total_cmp);
            median += 0.5 * (means[(means.len() - 1) / 2] + means[means.len() / 2]);
            let (luminance, count) =
                sums.iter().fold((0.0, 0.0), |(l, n), s| (l + s.luminance, n + f64::from(s.count)));
            mean += luminance / count;
        }
        let pixels = self.pixels.len() as f64;
        let robust = RobustMean { mean: mean / pixels, median_of_means: median / pixels };
        (robust.mean.is_finite() && robust.median_of_means.is_finite()).then_some(robust)
    }

    /// The error of the mean image. `None` where a pixel has samples in fewer than two replicates or a sum is not
    /// finite.
    ///
    /// T is unknown, and a noisy pixel's own luminance is a poor stand-in: a lone bright sample makes the pixel bright, so
    /// that its error looks small. The luminance of the *other* replicates errs on the other side. Where pixels are well
    /// known the two agree; the estimate is their geometric mean, and the interval reaches from the one to the other.
    pub fn estimate(&self) -> Option<ErrorEstimate> {
        let (mut low, mut high) = (Terms::default(), Terms::default());
        let mut replicates = REPLICATES;
        for sums in &self.pixels {
            let (by_own, by_others, n) = squared_errors(sums)?;
            low.add(by_own);
            high.add(by_others);
            replicates = replicates.min(n);
        }
        let pixels = self.pixels.len() as f64;
        let (own, others) = (low.sum / pixels, high.sum / pixels);
        let interval =
            [low.quantile(0.5 - 0.5 * CONFIDENCE, replicates), high.quantile(0.5 + 0.5 * CONFIDENCE, replicates)];
        let estimate = ErrorEstimate {
            error: (own * others).sqrt().sqrt(),
            interval: [(own * interval[0]).sqrt(), (others * interval[1]).sqrt()],
            replicates,
        };
        (estimate.error.is_finite() && estimate.interval.iter().all(|x| x.is_finite())).then_some(estimate)
    }
}

/// The squared relative error of a pixel's mean, over its own luminance and over that of the other replicates, and how
/// many replicates say so (`None` below two). A replicate with n_r of the N samples and the mean m_r differs from the mean m
/// of the others by a variance of σ²·N/(n_r (N − n_r)), so (m_r − m)²·n_r (N − n_r)/N² estimates that of the pixel's mean, σ²/N.
fn squared_errors(sums: &[Sum; REPLICATES]) -> Option<(f64, f64, usize)> {
    let all =
        sums.iter().fold(Sum::default(), |a, b| Sum { luminance: a.luminance + b.luminance, count: a.count + b.count });
    let relative_to = |mean: f64| mean * mean + RELATIVE_ERROR_EPSILON * RELATIVE_ERROR_EPSILON;
    let (mut variance, mut by_others, mut n) = (0.0, 0.0, 0);
    for sum in sums.iter().filter(|sum| sum.count > 0) {
        let (own, rest) = (f64::from(sum.count), f64::from(all.count - sum.count));
        let mean = (all.luminance - sum.luminance) / rest;
        let difference = sum.luminance / own - mean;
        let share = own * rest / ((own + rest) * (own + rest));
        variance += difference * difference * share;
        by_others += difference * difference * share / relative_to(mean);
        n += 1;
    }
    let replicates = f64::from(n);
    let by_own = variance / replicates / relative_to(all.luminance / f64::from(all.count));
    (n >= 2).then_some((by_own, by_others / replicates, n as usize))
}

impl Terms {
    fn add(&mut self, term: f64) {
        self.sum += term;
        self.sum_of_squares += term * term;
    }

    /// The factor by which the squared error of the image exceeds its estimate with probability 1 − p.
    ///
    /// (Y − T)² less its estimate has the variance 2V²R/(R − 1) for any distribution, so the ratio of the sums over
    /// independent pixels is about F(ν, (R − 1)ν), where ν = (Σ q)² / Σ q² counts the pixels that matter (Satterthwaite 1946).
    fn quantile(&self, p: f64, replicates: usize) -> f64 {
        if self.sum == 0.0 {
            return 1.0;
        }
        let pixels = self.sum / self.sum_of_squares * self.sum;
        FisherSnedecor::new(pixels, pixels * (replicates - 1) as f64).map_or(f64::NAN, |ratio| ratio.inverse_cdf(p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    const PIXELS: usize = 400;
    const SAMPLES: u32 = 16;

    /// An image of `blocks` blocks; pixel p has luminance 1 + p/PIXELS and samples of uniform noise between 0 and twice
    /// that. Returns the sums and the true error.
    fn noisy(random: &mut SplitMix, blocks: u32) -> (ReplicateSums, f64) {
        let mut sums = ReplicateSums::new(PIXELS);
        let mut square = 0.0;
        for pixel in 0..PIXELS {
            let truth = 1.0 + pixel as f64 / PIXELS as f64;
            let mut total = 0.0;
            for block in 0..blocks {
                let sum: f64 = (0..SAMPLES).map(|_| 2.0 * truth * random.unit()).sum();
                sums.add_block(pixel, block, [sum; 3], SAMPLES);
                total += sum;
            }
            square += (total / f64::from(blocks * SAMPLES) - truth).powi(2) / (truth * truth + 1e-4);
        }
        (sums, (square / PIXELS as f64).sqrt())
    }

    #[test]
    fn the_estimate_is_unbiased_and_its_interval_holds_the_error() {
        let mut random = SplitMix(5);
        for blocks in [4, 8, 12, 40] {
            let (mut covered, mut ratio) = (0, 0.0);
            const RUNS: usize = 200;
            for _ in 0..RUNS {
                let (sums, truth) = noisy(&mut random, blocks);
                let estimate = sums.estimate().unwrap();
                covered += usize::from((estimate.interval[0]..=estimate.interval[1]).contains(&truth));
                // Uniform noise between 0 and 2T has the variance T²/3.
                ratio += (estimate.error.powi(2) * f64::from(3 * SAMPLES * blocks)) / RUNS as f64;
            }
            assert!((ratio - 1.0).abs() < 0.03, "{blocks} blocks: {ratio}");
            // 200 · 0.95 = 190 with a standard deviation of 3.1.
            assert!((182..=199).contains(&covered), "{blocks} blocks: {covered} of {RUNS}");
        }
    }

    #[test]
    fn unequal_counts_are_weighed() {
        let mut sums = ReplicateSums::new(1);
        // Means 1 and 3, of 10 and 30 samples; the difference 2 has the variance of a mean of 40 times 40²/(10·30).
        sums.add_block(0, 0, [10.0; 3], 10);
        sums.add_block(0, 1, [90.0; 3], 30);
        let term = 4.0 * 300.0 / 1600.0;
        let by_own = term / (2.5 * 2.5 + 1e-4);
        let by_others = 0.5 * (term / (9.0 + 1e-4) + term / (1.0 + 1e-4));
        let estimate = sums.estimate().unwrap();
        assert!((estimate.error.powi(4) - by_own * by_others).abs() < 1e-12, "{estimate:?}");
        assert_eq!(estimate.replicates, 2);
    }

    #[test]
    fn a_lone_firefly_does_not_move_the_median_of_means() {
        let mut sums = ReplicateSums::new(2);
        for block in 0..8 {
            sums.add_block(0, block, [if block == 3 { 1600.0 } else { 1.6 }; 3], 16);
            // Means 1 to 8: the median is between 4 and 5.
            sums.add_block(1, block, [16.0 * f64::from(block + 1); 3], 16);
        }
        let robust = sums.robust_mean().unwrap();
        assert!((robust.mean - 0.5 * ((7.0 * 0.1 + 100.0) / 8.0 + 4.5)).abs() < 1e-9, "{robust:?}");
        assert!((robust.median_of_means - 0.5 * (0.1 + 4.5)).abs() < 1e-9, "{robust:?}");
        let mut two = ReplicateSums::new(1);
        (0..2).for_each(|block| two.add_block(0, block, [1.0; 3], 16));
        assert_eq!(two.robust_mean(), None);
    }

    #[test]
    fn a_lone_firefly_makes_the_interval_wide() {
        let mut sums = ReplicateSums::new(1);
        (0..8).for_each(|block| sums.add_block(0, block, [if block == 3 { 1600.0 } else { 1.6 }; 3], 16));
        // The mean is 12.6 where the truth is about 0.1: an error of 125 that the pixel's own luminance makes 1.
        let [low, high] = sums.estimate().unwrap().interval;
        assert!(low < 1.0 && high > 125.0, "{low} {high}");
    }

    /// Large images have many degrees of freedom: the quantiles must still be found.
    #[test]
    fn the_interval_narrows_with_the_pixels() {
        let terms = |n: f64| Terms { sum: n, sum_of_squares: n };
        for (pixels, width) in [(1e2, 0.30), (1e4, 0.030), (1e6, 0.0030), (1e8, 0.000_30)] {
            // Twice the standard deviation √(2/ν·R/(R − 1)).
            let [low, high] = [0.025, 0.975].map(|p| terms(pixels).quantile(p, 8));
            assert!((0.9..1.2).contains(&((high - low) / 2.0 / width)), "{pixels}: {low} {high}");
        }
    }

    #[test]
    fn what_cannot_be_known_is_not_said() {
        let mut sums = ReplicateSums::new(2);
        sums.add_block(0, 0, [1.0; 3], 16);
        sums.add_block(1, 0, [1.0; 3], 16);
        assert_eq!(sums.estimate(), None);
        sums.add_block(0, 1, [1.0; 3], 16);
        assert_eq!(sums.estimate(), None, "the second pixel has one replicate");
        sums.add_block(1, 1, [1.0; 3], 16);
        assert_eq!(sums.estimate().unwrap().error, 0.0);
        sums.add_block(1, 1, [f64::NAN; 3], 16);
        assert_eq!(sums.estimate(), None);
        assert_eq!(ReplicateSums::new(0).estimate(), None);
    }
}
