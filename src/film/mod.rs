//! The film: sums of samples on the host, and what is made of them (images, merges, error estimates).
//!
//! It knows nothing of the GPU and nothing of scenes. Pixels are stored row by row from the top left.

pub mod aov;
pub mod aov_picture;
pub mod exr;
pub mod merge;
pub mod metadata;
pub mod metrics;
pub mod output;
pub mod png;
pub mod replicates;
pub mod tev;
pub mod tev_feed;
pub mod tonemap;

/// Weights of linear Rec.709 red, green and blue in the luminance (ITU-R BT.709).
pub const REC709_LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Keeps the relative error of a black pixel finite: [`Film::estimated_error`] and [`metrics`] divide by
/// luminance² + ε² with this ε.
pub const RELATIVE_ERROR_EPSILON: f64 = 0.01;

/// Luminance of linear Rec.709 radiance.
pub fn luminance(rgb: [f64; 3]) -> f64 {
    REC709_LUMINANCE[0] * rgb[0] + REC709_LUMINANCE[1] * rgb[1] + REC709_LUMINANCE[2] * rgb[2]
}

/// Sums of radiance samples per pixel, in f64, with their counts. One box-filtered pixel is the mean of its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    pixels: Vec<PixelSums>,
}

/// What one pixel has received.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelSums {
    /// Sum of the samples' radiance, linear Rec.709.
    pub rgb: [f64; 3],
    /// Sum of the squares of the samples' luminances.
    pub luminance_squared: f64,
    /// How many samples were summed.
    pub count: u32,
}

impl Film {
    /// A film of `width` × `height` pixels without samples.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![PixelSums::default(); width as usize * height as usize] }
    }

    /// A film from its pixels' sums, row by row from the top left.
    ///
    /// # Panics
    /// If the number of pixels is not `width` × `height`.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<PixelSums>) -> Self {
        assert_eq!(pixels.len(), width as usize * height as usize, "a film has width × height pixels");
        Self { width, height, pixels }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The sums of all pixels, row by row from the top left.
    pub fn pixels(&self) -> &[PixelSums] {
        &self.pixels
    }

    /// Adds the sums of `count` samples to a pixel. Blocks of one pixel are to come in the order of their sample
    /// indices: f64 addition is not associative, and an image is to be the same bits every time.
    ///
    /// # Panics
    /// If `pixel` is outside the film.
    pub fn add_block(&mut self, pixel: usize, sum_rgb: [f64; 3], sum_luminance_squared: f64, count: u32) {
        self.pixels[pixel].add(&PixelSums { rgb: sum_rgb, luminance_squared: sum_luminance_squared, count });
    }

    /// Adds another film's samples to this one's. The samples must be disjoint: nothing here can tell.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn merge(&mut self, other: &Film) {
        assert_eq!((self.width, self.height), (other.width, other.height), "films of different sizes");
        for (mine, theirs) in self.pixels.iter_mut().zip(&other.pixels) {
            mine.add(theirs);
        }
    }

    /// Mean radiance of a pixel; black where there is no sample.
    ///
    /// # Panics
    /// If `pixel` is outside the film.
    pub fn mean(&self, pixel: usize) -> [f64; 3] {
        self.pixels[pixel].mean()
    }

    /// Mean radiance of all pixels, rounded once to f32.
    pub fn radiance(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|p| p.mean().map(|c| c as f32)).collect()
    }

    /// Samples of an average pixel.
    pub fn mean_samples_per_pixel(&self) -> f64 {
        let total: u64 = self.pixels.iter().map(|p| u64::from(p.count)).sum();
        total as f64 / self.pixels.len().max(1) as f64
    }

    /// Number of pixels whose sums hold a NaN or an infinity.
    pub fn non_finite_pixels(&self) -> usize {
        self.pixels.iter().filter(|p| !p.is_finite()).count()
    }

    /// Relative standard error of the image: √ mean over pixels of Var(mean luminance) / (luminance² + 0.01²).
    ///
    /// The samples of a pixel must be independent; of a low-discrepancy sequence this is an upper bound only.
    /// `None` where a pixel has fewer than two samples (no variance can be known) or holds a non-finite sum.
    pub fn estimated_error(&self) -> Option<f64> {
        if self.pixels.is_empty() {
            return None;
        }
        let mut sum = 0.0;
        for pixel in &self.pixels {
            let mean = luminance(pixel.mean());
            sum += pixel.variance_of_mean()? / (mean * mean + RELATIVE_ERROR_EPSILON * RELATIVE_ERROR_EPSILON);
        }
        Some((sum / self.pixels.len() as f64).sqrt()).filter(|e| e.is_finite())
    }
}

impl PixelSums {
    fn add(&mut self, other: &PixelSums) {
        for channel in 0..3 {
            self.rgb[channel] += other.rgb[channel];
        }
        self.luminance_squared += other.luminance_squared;
        self.count += other.count;
    }

    /// Mean radiance; black without samples.
    pub fn mean(&self) -> [f64; 3] {
        if self.count == 0 { [0.0; 3] } else { self.rgb.map(|sum| sum / f64::from(self.count)) }
    }

    /// Unbiased estimate of the variance of the pixel's mean luminance, from independent samples:
    /// (Σ Y² − (Σ Y)²/n) / (n (n − 1)). `None` below two samples.
    pub fn variance_of_mean(&self) -> Option<f64> {
        if self.count < 2 {
            return None;
        }
        let n = f64::from(self.count);
        let sum = luminance(self.rgb);
        let squared_deviations = self.luminance_squared - sum * sum / n;
        // Rounding can leave a tiny negative number where all samples are equal. A NaN must stay one: `max` would hide it.
        let squared_deviations = if squared_deviations < 0.0 { 0.0 } else { squared_deviations };
        Some(squared_deviations / (n * (n - 1.0)))
    }

    /// The sums of `count` samples that have this mean and this variance of their mean luminance: the inverse of
    /// [`PixelSums::mean`] and [`PixelSums::variance_of_mean`].
    pub fn from_mean(mean: [f64; 3], variance_of_mean: f64, count: u32) -> Self {
        let n = f64::from(count);
        let mean_luminance = luminance(mean);
        let squared_deviations = variance_of_mean * n * (n - 1.0).max(0.0);
        Self {
            rgb: mean.map(|c| c * n),
            luminance_squared: squared_deviations + n * mean_luminance * mean_luminance,
            count,
        }
    }

    fn is_finite(&self) -> bool {
        self.rgb.iter().all(|c| c.is_finite()) && self.luminance_squared.is_finite()
    }
}
