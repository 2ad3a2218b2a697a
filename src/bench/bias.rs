//! Whether a mean image has another expectation than the reference: Welch's t-test of the whole image and of every
//! 8×8 tile, each channel on its own, with Šidák's correction.

use serde::Serialize;

use super::mean_image::MeanImage;
use super::statistics::{sidak, t_quantile, t_two_sided};

/// Edge of a tile in pixels.
pub const TILE: u32 = 8;
/// The chance that an image without bias is called biased.
pub const ALPHA: f64 = 0.01;
/// "Would have been seen" means: with this probability.
pub const POWER: f64 = 0.95;

/// Radiance is summed and stored in 32-bit floats: half an ulp each for the sum and for the stored mean, on both sides.
/// It keeps two constant regions equal (a lamp that fills a tile) although their variance is zero.
const ROUNDING: f64 = 2.0 * f32::EPSILON as f64;

/// The verdict on one image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BiasVerdict {
    /// Whether any test fails.
    pub biased: bool,
    /// Tests in all: three channels of the image and of every tile.
    pub tests: usize,
    /// Below this p-value a single test fails.
    pub level: f64,
    /// Tests that fail.
    pub failures: usize,
    /// The region with the smallest p-value.
    pub worst: Region,
    /// The bias of the image's mean that would have been seen, as a part of the mean; the largest of the channels.
    pub detectable_image: f64,
    /// The same for a tile of median noise, as a part of the image's mean.
    pub detectable_tile: f64,
    /// Pixels left out because they are not finite on one side.
    pub skipped_pixels: usize,
}

/// One test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Region {
    /// First pixel of the tile from the left and from the top; `None` is the whole image.
    pub tile: Option<[u32; 2]>,
    /// 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// Mean of the image in question.
    pub mean: f64,
    /// Mean of the reference.
    pub reference: f64,
    /// Standard error of the difference.
    pub standard_error: f64,
    /// Degrees of freedom of that (Welch-Satterthwaite).
    pub degrees_of_freedom: f64,
    /// The p-value, of this test alone.
    pub p_value: f64,
}

/// Compares an image with the reference.
///
/// Where light comes from few bright samples, a short run may have met none of them: then its mean is low, and its variance,
/// which is taken from it, far too low. The reference has met them, and its variance says what they do to fewer samples; see
/// `expected_of_fewer`.
///
/// # Panics
/// If the sizes differ or are zero.
pub fn find_bias(image: &MeanImage, reference: &MeanImage) -> BiasVerdict {
    assert_eq!((image.width, image.height), (reference.width, reference.height), "images of different sizes");
    let whole = regions(image, reference, None, (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y))));
    let mut all = whole.to_vec();
    for top in (0..image.height).step_by(TILE as usize) {
        for left in (0..image.width).step_by(TILE as usize) {
            let (right, bottom) = ((left + TILE).min(image.width), (top + TILE).min(image.height));
            let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
            all.extend(regions(image, reference, Some([left, top]), pixels));
        }
    }
    let level = sidak(ALPHA, all.len());
    // A p-value that is not a number speaks for nothing.
    let failures = all.iter().filter(|region| region.p_value.is_nan() || region.p_value < level).count();
    let worst = all.iter().copied().min_by(|a, b| a.p_value.total_cmp(&b.p_value)).unwrap_or(whole[0]);
    let relative = |region: &Region| detectable(region, level) / whole[region.channel].reference.abs();
    let mut tiles: Vec<f64> = all[3..].iter().map(relative).filter(|share| share.is_finite()).collect();
    tiles.sort_by(f64::total_cmp);
    BiasVerdict {
        biased: failures > 0,
        tests: all.len(),
        level,
        failures,
        worst,
        detectable_image: whole.iter().map(relative).filter(|share| share.is_finite()).fold(0.0, f64::max),
        detectable_tile: tiles.get(tiles.len() / 2).copied().unwrap_or(0.0),
        skipped_pixels: (0..image.mean.len()).filter(|&p| !image.is_finite(p) || !reference.is_finite(p)).count(),
    }
}

/// The difference at which the test fails with probability [`POWER`].
fn detectable(region: &Region, level: f64) -> f64 {
    let quantile = |p| t_quantile(p, region.degrees_of_freedom);
    (quantile(1.0 - 0.5 * level) + quantile(POWER)) * region.standard_error
}

/// Sums of one side of one channel over a region.
#[derive(Clone, Copy, Default)]
struct Sums {
    pixels: f64,
    mean: f64,
    variance: f64,
    variance_squared: f64,
}

/// One test a channel of the pixels of a region that are finite on both sides.
fn regions(
    image: &MeanImage,
    reference: &MeanImage,
    tile: Option<[u32; 2]>,
    pixels: impl Iterator<Item = (u32, u32)>,
) -> [Region; 3] {
    let mut sums = [[Sums::default(); 2]; 3];
    for (x, y) in pixels {
        let pixel = y as usize * image.width as usize + x as usize;
        if !image.is_finite(pixel) || !reference.is_finite(pixel) {
            continue;
        }
        for (channel, sides) in sums.iter_mut().enumerate() {
            for (sum, side) in sides.iter_mut().zip([image, reference]) {
                let variance = side.variance[pixel][channel];
                sum.pixels += 1.0;
                sum.mean += side.mean[pixel][channel];
                sum.variance += variance;
                sum.variance_squared += variance * variance / side.degrees_of_freedom;
            }
        }
    }
    let ratio = image.spp.zip(reference.spp).map(|(own, other)| other / own).filter(|ratio| *ratio > 1.0);
    [0, 1, 2].map(|channel| {
        let [own, other] = sums[channel];
        let own = ratio.map_or(own, |ratio| expected_of_fewer(own, other, ratio));
        welch(tile, channel, [own, other])
    })
}

/// The image's sums, with the variance of the reference for as few samples as the image has where that is more: the variance
/// of a mean falls at least as fast as one over the samples, so for fewer of them it is at least that much larger. Two ways to
/// sample the same light differ in variance, but neither lacks what the other has met.
fn expected_of_fewer(own: Sums, reference: Sums, ratio: f64) -> Sums {
    let variance = ratio * reference.variance;
    if variance <= own.variance {
        return own;
    }
    Sums { variance, variance_squared: ratio * ratio * reference.variance_squared, ..own }
}

/// Welch's test. Pixels share no random number, so that the variances of a region's pixels add up; the degrees of
/// freedom are Satterthwaite's (1946) for all pixels of both sides.
fn welch(tile: Option<[u32; 2]>, channel: usize, [a, b]: [Sums; 2]) -> Region {
    let n = a.pixels;
    let (mean, reference) = (a.mean / n, b.mean / n);
    let variance = (a.variance + b.variance) / (n * n);
    let rounding = ROUNDING * mean.abs().max(reference.abs());
    let standard_error = (variance + rounding * rounding).sqrt();
    let parts = (a.variance_squared + b.variance_squared) / n.powi(4);
    let degrees_of_freedom = if parts > 0.0 { variance * variance / parts } else { f64::INFINITY };
    let difference = mean - reference;
    // Two regions that are black everywhere are equal; a region without a finite pixel says nothing.
    let t = if difference == 0.0 || n == 0.0 { 0.0 } else { difference / standard_error };
    let p_value = t_two_sided(t, degrees_of_freedom);
    Region { tile, channel, mean, reference, standard_error, degrees_of_freedom, p_value }
}
