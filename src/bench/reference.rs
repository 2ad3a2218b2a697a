//! What images are measured against: an image with known noise, and the errors of another image with that noise
//! subtracted.

use std::path::Path;

use serde::Serialize;

use super::mean_image::MeanImage;
use crate::film::RELATIVE_ERROR_EPSILON;
use crate::film::exr::{VARIANCE_CHANNEL, read_exr};
use crate::film::metrics::{compare, flip};
use crate::film::tonemap::ToneMap;
use crate::render::SamplerKind;
use crate::{Error, Result};

/// A reference image.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The image with its variance.
    pub image: MeanImage,
    radiance: Vec<[f32; 3]>,
    /// What it is and how well it is known.
    pub about: ReferenceInfo,
}

/// What a report says about its reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReferenceInfo {
    /// In words: the file, or the estimator, its samples per pixel and its seeds.
    pub description: String,
    /// How its noise is known, in words.
    pub noise: String,
    /// Its seed, if it is a file that says so.
    pub seed: Option<u32>,
    /// Samples per pixel; `None` if the file does not say.
    pub spp: Option<f64>,
    /// Seconds that rendering took; `None` for a file.
    pub seconds: Option<f64>,
    /// Mean of its variance over pixels and channels: this is subtracted from every measured MSE.
    pub noise_mse: f64,
    /// The same for relMSE.
    pub noise_rel_mse: f64,
    /// Standard error that is common to all corrected MSEs, since they share one reference. `None` for a file.
    pub mse_standard_error: Option<f64>,
}

/// The errors of one image. MSE and relMSE are corrected: the reference's noise is subtracted, so that they may be
/// negative where they are not above it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// MSE without the reference's noise.
    pub mse: f64,
    /// relMSE without the reference's noise.
    pub rel_mse: f64,
    /// MSE as `sunfleck compare` gives it.
    pub uncorrected_mse: f64,
    /// relMSE as `sunfleck compare` gives it.
    pub uncorrected_rel_mse: f64,
    /// Mean FLIP, with the reference's noise in it; `None` if the image is too large for it.
    pub flip: Option<f64>,
    /// Mean of image less reference, for red, green and blue.
    pub mean_difference: [f64; 3],
}

impl ReferenceInfo {
    /// Standard error that all corrected MSEs share; 0 where it is not known.
    pub fn common_error(&self) -> f64 {
        self.mse_standard_error.unwrap_or(0.0)
    }
}

impl Reference {
    /// The reference in an EXR file. Its `variance` channel is used if the file says that its samples are independent.
    ///
    /// # Errors
    /// A file that is missing or no image, has no colours, another resolution than `size`, or no finite pixel.
    pub fn read(path: &Path, size: (u32, u32)) -> Result<Self> {
        let file = read_exr(path)?;
        if (file.width, file.height) != size {
            let message = format!(
                "is {}x{}, but the images to measure are {}x{}; give --resolution {0}x{1}, or another reference",
                file.width, file.height, size.0, size.1
            );
            return Err(Error::input(path, message));
        }
        let mut image = MeanImage::from_exr(&file).ok_or_else(|| Error::input(path, "has no channels R, G, B"))?;
        if !(0..image.mean.len()).any(|pixel| image.is_finite(pixel)) {
            return Err(Error::input(path, "has no finite pixel"));
        }
        // Of samples that complete each other the layer is an upper bound, which must not be subtracted.
        let sampler = file.metadata.sampler.as_deref().and_then(|name| name.parse().ok());
        let independent = sampler == Some(SamplerKind::Independent);
        if !independent {
            image.variance.fill([0.0; 3]);
        }
        let noise = match file.values(VARIANCE_CHANNEL) {
            None => "the file has no variance layer: it is taken as exact, and nothing is subtracted",
            Some(_) if independent => {
                "variance from the file's own layer, taken as grey in proportion to each pixel, and subtracted"
            }
            Some(_) => {
                "the file does not say that its samples are independent: it is taken as exact, and nothing is subtracted"
            }
        };
        let spp = file.metadata.samples_per_pixel.map(f64::from);
        let mut reference = Self::new(image, path.display().to_string(), noise.to_owned(), spp, None);
        reference.about.seed = file.metadata.seed;
        Ok(reference)
    }

    /// A reference from the mean of independent images.
    pub fn from_images(image: MeanImage, description: String, spp: f64, seconds: f64) -> Self {
        let parts = image.degrees_of_freedom + 1.0;
        let noise = format!("variance from {parts:.0} independent parts, subtracted");
        let mut reference = Self::new(image, description, noise, Some(spp), Some(seconds));
        reference.about.mse_standard_error = Some(reference.correction_error());
        reference
    }

    fn new(image: MeanImage, description: String, noise: String, spp: Option<f64>, seconds: Option<f64>) -> Self {
        let mut sums = (0.0, 0.0, 0.0);
        for pixel in (0..image.mean.len()).filter(|&pixel| image.is_finite(pixel)) {
            for (mean, variance) in image.mean[pixel].iter().zip(image.variance[pixel]) {
                sums.0 += variance;
                sums.1 += variance / (mean * mean + RELATIVE_ERROR_EPSILON * RELATIVE_ERROR_EPSILON);
                sums.2 += 1.0;
            }
        }
        let about = ReferenceInfo {
            description,
            noise,
            seed: None,
            spp,
            seconds,
            noise_mse: sums.0 / sums.2,
            noise_rel_mse: sums.1 / sums.2,
            mse_standard_error: None,
        };
        Self { radiance: image.radiance(), image, about }
    }

    /// Standard error of (reference − truth)² − its estimated variance, over pixels and channels.
    ///
    /// With R parts whose errors are eᵢ a pixel's term is Σ_{i≠j} eᵢeⱼ / (R(R−1)), of mean 0 and of variance
    /// 2R/(R−1) v², where v is the variance of the mean; for normal errors v² (R+1)/(R−1) is the mean of v's squared
    /// estimate. Errors with longer tails make it larger, on the safe side.
    fn correction_error(&self) -> f64 {
        let parts = self.image.degrees_of_freedom + 1.0;
        let finite = (0..self.image.mean.len()).filter(|&pixel| self.image.is_finite(pixel));
        let (sum, count) = finite.fold((0.0, 0.0), |(sum, count), pixel| {
            (sum + self.image.variance[pixel].map(|v| v * v).iter().sum::<f64>(), count + 3.0)
        });
        (2.0 * parts / (parts + 1.0) * sum).sqrt() / count
    }

    /// The errors of an image of the same size.
    ///
    /// # Panics
    /// If it has another size.
    pub fn errors_of(&self, radiance: &[[f32; 3]]) -> Errors {
        let difference = compare(radiance, &self.radiance);
        let flip = flip((self.image.width, self.image.height), radiance, &self.radiance, 0.0, ToneMap::Clip);
        Errors {
            mse: difference.mse - self.about.noise_mse,
            rel_mse: difference.rel_mse - self.about.noise_rel_mse,
            uncorrected_mse: difference.mse,
            uncorrected_rel_mse: difference.rel_mse,
            flip: flip.map(|flip| flip.mean),
            mean_difference: difference.mean_difference,
        }
    }
}
