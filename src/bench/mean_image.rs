//! An image that is the mean of several, with the variance of that mean for every pixel and channel.

use crate::film::exr::{ChannelValues, ExrImage, VARIANCE_CHANNEL};
use crate::film::luminance;

/// A mean image. Pixels are stored row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Mean radiance, linear Rec.709.
    pub mean: Vec<[f64; 3]>,
    /// Variance of the mean.
    pub variance: Vec<[f64; 3]>,
    /// Degrees of freedom of each variance: independent images less one; infinite where it is known well.
    pub degrees_of_freedom: f64,
    /// Samples per pixel behind the mean; `None` if that is not known.
    pub spp: Option<f64>,
}

impl MeanImage {
    /// The mean as 32-bit floats.
    pub fn radiance(&self) -> Vec<[f32; 3]> {
        self.mean.iter().map(|pixel| pixel.map(|c| c as f32)).collect()
    }

    /// Whether all of a pixel is finite.
    pub fn is_finite(&self, pixel: usize) -> bool {
        let finite = |values: &[f64; 3]| values.iter().all(|c| c.is_finite());
        finite(&self.mean[pixel]) && finite(&self.variance[pixel])
    }

    /// The image of a file. Its `variance` channel is of the mean luminance alone, so the noise is taken as grey in
    /// proportion to the pixel: Var(c) = Var(Y) (c/Y)². Without that channel the image counts as exact. `None` without
    /// channels R, G, B.
    pub fn from_exr(image: &ExrImage) -> Option<Self> {
        let mean: Vec<_> = image.rgb()?.into_iter().map(|pixel| pixel.map(f64::from)).collect();
        let variance = match image.values(VARIANCE_CHANNEL) {
            Some(ChannelValues::F32(values)) => {
                mean.iter().zip(values).map(|(mean, variance)| spread(*mean, f64::from(*variance))).collect()
            }
            _ => vec![[0.0; 3]; mean.len()],
        };
        let (width, height) = (image.width, image.height);
        let spp = image.metadata.samples_per_pixel.map(f64::from);
        Some(Self { width, height, mean, variance, degrees_of_freedom: f64::INFINITY, spp })
    }
}

/// The channels' variances of noise that is grey in proportion to the pixel's colour.
fn spread(mean: [f64; 3], luminance_variance: f64) -> [f64; 3] {
    if luminance_variance == 0.0 {
        return [0.0; 3];
    }
    let y = luminance(mean);
    mean.map(|c| luminance_variance * (c / y).powi(2))
}

/// Takes in one image after the other (Welford 1962).
#[derive(Clone, Debug)]
pub struct ImageAccumulator {
    width: u32,
    height: u32,
    count: f64,
    spp: f64,
    mean: Vec<[f64; 3]>,
    squares: Vec<[f64; 3]>,
}

impl ImageAccumulator {
    /// Without an image yet.
    pub fn new((width, height): (u32, u32)) -> Self {
        let pixels = width as usize * height as usize;
        Self { width, height, count: 0.0, spp: 0.0, mean: vec![[0.0; 3]; pixels], squares: vec![[0.0; 3]; pixels] }
    }

    /// Takes in one image of so many samples per pixel.
    ///
    /// # Panics
    /// If it has another number of pixels.
    pub fn add(&mut self, radiance: &[[f32; 3]], spp: f64) {
        assert_eq!(radiance.len(), self.mean.len(), "images of different sizes");
        self.count += 1.0;
        self.spp += spp;
        for ((mean, squares), value) in self.mean.iter_mut().zip(&mut self.squares).zip(radiance) {
            for channel in 0..3 {
                let value = f64::from(value[channel]);
                let delta = value - mean[channel];
                mean[channel] += delta / self.count;
                squares[channel] += delta * (value - mean[channel]);
            }
        }
    }

    /// Images taken in.
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// The mean of at least two images.
    ///
    /// # Panics
    /// If there are fewer: a variance needs two.
    pub fn finish(self) -> MeanImage {
        assert!(self.count >= 2.0, "a variance needs two images, there are {}", self.count);
        let divisor = self.count * (self.count - 1.0);
        MeanImage {
            width: self.width,
            height: self.height,
            mean: self.mean,
            variance: self.squares.iter().map(|pixel| pixel.map(|c| c / divisor)).collect(),
            degrees_of_freedom: self.count - 1.0,
            spp: Some(self.spp),
        }
    }
}
