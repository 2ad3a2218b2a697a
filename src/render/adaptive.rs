//! Adaptive sampling: a pilot, a render of few samples that are no part of the image, finds the pixels that are noisy, and there
//! each sample of the image is several of the pixel's own.
//!
//! What decides how many samples a pixel has is independent of their values: the mean stays what it was. To stop where the
//! samples so far happen to agree would make the image too dark (Kirk and Arvo 1991, "Unbiased Sampling Techniques for Image
//! Synthesis", whose remedy this is). And as nothing but the pilot decides, ranges of samples and merges stay exact.

use std::collections::BTreeMap;
use std::ops::{Add, Range};

use serde::Serialize;

use crate::film::{Film, PixelSums};

/// log2 of the most samples of a pixel for one of the image.
const MOST_LOG2: u8 = 5;
/// A sample of the image has at most so many times the rays that it has without, so that the quiet pixels go on at nearly the
/// same pace (docs/benchmarks).
const MOST_RAYS: f64 = 1.25;
/// The variance of a pixel is taken from the pixels at most so far away in both directions: its own few samples say little.
const RADIUS: usize = 3;
/// Cost over that of even sampling below which pixels are treated differently: what is expected of less is not kept.
const WORTH: f64 = 0.7;
/// Steps of the threshold in a factor of 2 of the standard deviation.
const STEPS: f64 = 4.0;

/// How many samples of a pixel's own stand for one of the image: powers of two.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct SampleFactors {
    /// Their log2, row by row; empty: 1 in every pixel.
    log2: Vec<u8>,
}

impl SampleFactors {
    #[cfg(test)]
    pub(super) fn from_log2(log2: Vec<u8>) -> Self {
        Self { log2 }
    }

    /// Where two pilots have found noise.
    pub(super) fn from_pilots(pilots: &[PilotFilm; 2]) -> Self {
        let size = (pilots[0].film.width() as usize, pilots[0].film.height() as usize);
        let [a, b] = pilots.each_ref().map(PilotFilm::noise);
        let [from_a, from_b] = [&a, &b].map(|noise| levels(noise, size));
        let Some(threshold) = best_threshold(&[(&from_a, &b), (&from_b, &a)]) else { return Self::default() };
        let both: Vec<Noise> = a.iter().zip(&b).map(|(&a, &b)| a + b).collect();
        Self { log2: levels(&both, size).into_iter().map(|level| log2_factor(level, threshold)).collect() }
    }

    /// The indices of a pixel's own samples that stand for samples of the image. Beyond the last index there are none.
    pub(super) fn own_samples(&self, pixel: usize, samples: &Range<u32>) -> Range<u32> {
        let log2 = self.log2.get(pixel).copied().unwrap_or(0);
        let own = |sample: u32| u32::try_from(u64::from(sample) << log2).unwrap_or(u32::MAX);
        own(samples.start)..own(samples.end)
    }

    /// All pixels' own samples for one of the image.
    pub(super) fn samples(&self, pixels: usize) -> u64 {
        let sum: u64 = self.log2.iter().map(|log2| 1 << log2).sum();
        if self.log2.is_empty() { pixels as u64 } else { sum }
    }

    /// In numbers.
    pub(super) fn report(&self) -> FactorReport {
        let pixels = self.log2.len().max(1);
        FactorReport {
            noisy_pixels: self.log2.iter().filter(|&&log2| log2 > 0).count(),
            most_samples: 1 << self.log2.iter().copied().max().unwrap_or(0),
            mean_samples: self.samples(pixels) as f64 / pixels as f64,
        }
    }
}

/// How samples are shared out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FactorReport {
    /// Pixels with more samples than the image.
    pub noisy_pixels: usize,
    /// Most samples of a pixel for one of the image.
    pub most_samples: u32,
    /// Samples of an average pixel for one of the image.
    pub mean_samples: f64,
}

/// What a pilot has brought.
pub(super) struct PilotFilm {
    /// Its samples; a pixel with less than two says nothing.
    pub(super) film: Film,
    /// The rays of each pixel, which the time goes with.
    pub(super) rays: Vec<u64>,
}

impl PilotFilm {
    fn noise(&self) -> Vec<Noise> {
        let pixels = self.film.pixels().iter().zip(&self.rays);
        // What is not known, or not finite, says nothing.
        let noise = |(pixel, &rays): (&PixelSums, &u64)| match pixel.variance_of_mean() {
            Some(variance) if variance.is_finite() => Noise { variance, rays: rays as f64 },
            _ => Noise::default(),
        };
        pixels.map(noise).collect()
    }
}

/// What is known of a pixel, or of several: sums.
#[derive(Clone, Copy, Debug, Default)]
struct Noise {
    variance: f64,
    rays: f64,
}

impl Add for Noise {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { variance: self.variance + other.variance, rays: self.rays + other.rays }
    }
}

impl Noise {
    /// The root of the variance over the rays, on a scale of powers of two; `None` without noise.
    fn level(&self) -> Option<i32> {
        let gain = self.variance / self.rays;
        (gain > 0.0 && gain.is_finite()).then(|| (STEPS * gain.sqrt().log2()).round() as i32)
    }

    /// With so many times the samples.
    fn sampled(&self, factor: f64) -> Self {
        Self { variance: self.variance / factor, rays: self.rays * factor }
    }

    /// Variance times rays: what is least at the best use of time.
    fn cost(&self) -> f64 {
        self.variance * self.rays
    }
}

/// The level of each pixel, by the square of pixels around it.
fn levels(noise: &[Noise], (width, height): (usize, usize)) -> Vec<Option<i32>> {
    let rows = sums_along(noise, width, height, 1, width);
    let squares = sums_along(&rows, height, width, width, 1);
    squares.iter().map(Noise::level).collect()
}

/// Sums over the neighbours along lines of `length` pixels that are `step` apart; the lines begin `between` apart.
fn sums_along(values: &[Noise], length: usize, lines: usize, step: usize, between: usize) -> Vec<Noise> {
    let mut sums = vec![Noise::default(); values.len()];
    for line in 0..lines {
        let at = |i: usize| line * between + i * step;
        for i in 0..length {
            let near = i.saturating_sub(RADIUS)..(i + RADIUS + 1).min(length);
            sums[at(i)] = near.map(|j| values[at(j)]).fold(Noise::default(), Noise::add);
        }
    }
    sums
}

/// The factor of a pixel grows with its level, from a threshold on: the variance at equal time is least if samples go with the
/// root of the variance over the time of one (Neyman 1934, optimum allocation; Cochran 1977, "Sampling Techniques", §5.5).
fn log2_factor(level: Option<i32>, threshold: i32) -> u8 {
    let Some(level) = level else { return 0 };
    let log2 = (f64::from(level - threshold) / STEPS).round();
    // A float below 0 becomes 0.
    (log2 as u8).min(MOST_LOG2)
}

/// The threshold that makes the best use of time, by what it does to the noise that one pilot has found at the levels of the
/// other: a few bright samples that one has met by chance are no reason. `None`: it is not worth while.
fn best_threshold(halves: &[(&[Option<i32>], &[Noise]); 2]) -> Option<i32> {
    let mut by_level: BTreeMap<Option<i32>, Noise> = BTreeMap::new();
    for (levels, noise) in halves {
        for (&level, &noise) in levels.iter().zip(*noise) {
            let sum = by_level.entry(level).or_default();
            *sum = *sum + noise;
        }
    }
    let with = |threshold: i32| {
        let sampled =
            by_level.iter().map(|(&level, noise)| noise.sampled(f64::from(1_u32 << log2_factor(level, threshold))));
        sampled.fold(Noise::default(), Noise::add)
    };
    let (lowest, highest) = (*by_level.keys().flatten().next()?, *by_level.keys().flatten().next_back()?);
    let even = with(highest);
    let candidates = (lowest..highest).map(|threshold| (threshold, with(threshold)));
    let affordable = candidates.filter(|(_, noise)| noise.rays <= MOST_RAYS * even.rays);
    let best = affordable.min_by(|(_, a), (_, b)| a.cost().total_cmp(&b.cost()));
    best.filter(|(_, noise)| noise.cost() < WORTH * even.cost()).map(|(threshold, _)| threshold)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: u32 = 100;

    /// A film whose pixels have these variances.
    fn film(variance: impl Fn(u32, u32) -> f64) -> Film {
        let pixels = (0..WIDTH * WIDTH).map(|i| PixelSums::from_mean([0.5; 3], variance(i % WIDTH, i / WIDTH), 4));
        Film::from_pixels(WIDTH, WIDTH, pixels.collect())
    }

    fn from_film(film: &Film) -> SampleFactors {
        let pilot = || PilotFilm { film: film.clone(), rays: vec![20; film.pixels().len()] };
        SampleFactors::from_pilots(&[pilot(), pilot()])
    }

    fn mean(factors: &SampleFactors) -> f64 {
        factors.report().mean_samples
    }

    fn factor(factors: &SampleFactors, x: u32, y: u32) -> u32 {
        factors.own_samples((y * WIDTH + x) as usize, &(0..1)).end
    }

    #[test]
    fn even_noise_is_sampled_evenly() {
        for variance in [0.0, 1e-12, 1.0, 1e30] {
            let factors = from_film(&film(|_, _| variance));
            assert_eq!(mean(&factors), 1.0, "{variance}");
        }
    }

    #[test]
    fn noisy_pixels_get_the_samples() {
        let noisy = |x: u32, y: u32| (10..14).contains(&x) && (20..24).contains(&y);
        let factors = from_film(&film(|x, y| if noisy(x, y) { 1e6 } else { 1.0 }));
        assert!(factor(&factors, 11, 21) >= 16);
        assert_eq!(factor(&factors, 30, 30), 1);
        assert!(mean(&factors) <= MOST_RAYS, "{}", mean(&factors));
    }

    #[test]
    fn samples_are_as_the_standard_deviation() {
        let square = |x: u32, y: u32, at: u32| x / 8 == at && y / 8 == at;
        let factors = from_film(&film(|x, y| match (square(x, y, 0), square(x, y, 8)) {
            (true, _) => 1024.0,
            (_, true) => 64.0,
            _ => 1.0,
        }));
        assert_eq!([2, 68, 40].map(|at| factor(&factors, at, at)), [16, 4, 1]);
    }

    #[test]
    fn what_one_pilot_alone_has_found_is_chance() {
        let with_bright = |at: u32| film(move |x, y| if (x, y) == (at, at) { 1e6 } else { 1.0 });
        let pilot = |at: u32| PilotFilm { film: with_bright(at), rays: vec![20; (WIDTH * WIDTH) as usize] };
        assert_eq!(mean(&SampleFactors::from_pilots(&[pilot(5), pilot(30)])), 1.0);
        assert!(mean(&SampleFactors::from_pilots(&[pilot(5), pilot(5)])) > 1.0);
    }

    #[test]
    fn dear_samples_are_fewer() {
        let inside = |x: u32, y: u32| x < 8 && y < 8;
        let noisy = film(|x, y| if inside(x, y) { 256.0 } else { 1.0 });
        let factors = [10, 40].map(|dear| {
            let rays = (0..WIDTH * WIDTH).map(|i| if inside(i % WIDTH, i / WIDTH) { dear } else { 10 });
            let pilot = || PilotFilm { film: noisy.clone(), rays: rays.clone().collect() };
            SampleFactors::from_pilots(&[pilot(), pilot()])
        });
        assert_eq!(factors.map(|factors| factor(&factors, 2, 2)), [16, 8]);
    }

    #[test]
    fn it_never_costs_more_than_it_may() {
        // A slope in the noise over the whole image.
        let factors = from_film(&film(|x, y| 1.5_f64.powi((x + y).cast_signed())));
        assert!(mean(&factors) > 1.1 && mean(&factors) <= MOST_RAYS, "{}", mean(&factors));
    }

    #[test]
    fn what_is_not_finite_says_nothing() {
        let factors = from_film(&film(|x, y| match (x, y) {
            (3, 3) => f64::NAN,
            (9, 9) => f64::INFINITY,
            _ => 1.0,
        }));
        assert_eq!(mean(&factors), 1.0);
    }

    #[test]
    fn own_samples_are_whole_ranges_side_by_side() {
        let factors = SampleFactors::from_log2(vec![0, 3]);
        assert_eq!(factors.own_samples(0, &(5..9)), 5..9);
        assert_eq!(factors.own_samples(1, &(5..9)), 40..72);
        assert_eq!(factors.own_samples(1, &(9..u32::MAX)), 72..u32::MAX);
        assert_eq!(factors.own_samples(1, &(u32::MAX - 1..u32::MAX)), u32::MAX..u32::MAX);
        assert_eq!(SampleFactors::default().own_samples(7, &(5..9)), 5..9);
    }
}
