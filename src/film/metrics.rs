//! How much two images differ: MSE, relMSE, mean difference, FLIP.

use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageFloat, FlipImageRgb8, FlipPool};

use super::RELATIVE_ERROR_EPSILON;
use super::png::tone_map_srgb8;
use super::tonemap::ToneMap;

/// The differences of a test image from a reference. All but FLIP are taken in linear radiance, over the pixels that
/// are finite in both images, in f64; without such a pixel the means are NaN (`null` in JSON).
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Mean squared error: the mean over pixels and channels of (a − b)².
    pub mse: f64,
    /// Relative mean squared error: the mean over pixels and channels of (a − b)² / (b² + 0.01²).
    pub rel_mse: f64,
    /// Mean of a − b for red, green, blue: the bias, once noise has averaged out.
    pub mean_difference: [f64; 3],
    /// Mean of the test image.
    pub mean_a: [f64; 3],
    /// Mean of the reference.
    pub mean_b: [f64; 3],
    /// Largest |a − b| of any channel.
    pub max_difference: f64,
    /// Pixels of the test image with a NaN or an infinity.
    pub non_finite_a: usize,
    /// Pixels of the reference with a NaN or an infinity.
    pub non_finite_b: usize,
    /// Pixels that were compared: those finite in both.
    pub compared_pixels: usize,
}

/// Compares `a` with the reference `b`, pixel by pixel.
///
/// # Panics
/// If the lengths differ.
pub fn compare(a: &[[f32; 3]], b: &[[f32; 3]]) -> Difference {
    assert_eq!(a.len(), b.len(), "images of different sizes");
    let finite = |pixel: &[f32; 3]| pixel.iter().all(|c| c.is_finite());
    let mut sums = Difference {
        mse: 0.0,
        rel_mse: 0.0,
        mean_difference: [0.0; 3],
        mean_a: [0.0; 3],
        mean_b: [0.0; 3],
        max_difference: 0.0,
        non_finite_a: a.iter().filter(|p| !finite(p)).count(),
        non_finite_b: b.iter().filter(|p| !finite(p)).count(),
        compared_pixels: 0,
    };
    for (a, b) in a.iter().zip(b).filter(|(a, b)| finite(a) && finite(b)) {
        sums.compared_pixels += 1;
        for channel in 0..3 {
            let (a, b) = (f64::from(a[channel]), f64::from(b[channel]));
            let square = (a - b) * (a - b);
            sums.mse += square;
            sums.rel_mse += square / (b * b + RELATIVE_ERROR_EPSILON * RELATIVE_ERROR_EPSILON);
            sums.mean_difference[channel] += a - b;
            sums.mean_a[channel] += a;
            sums.mean_b[channel] += b;
            sums.max_difference = sums.max_difference.max((a - b).abs());
        }
    }
    // Of no pixel at all nothing is known: 0/0 makes the means NaN rather than a flattering 0.
    let n = sums.compared_pixels as f64;
    sums.mse /= 3.0 * n;
    sums.rel_mse /= 3.0 * n;
    for means in [&mut sums.mean_difference, &mut sums.mean_a, &mut sums.mean_b] {
        *means = means.map(|sum| sum / n);
    }
    sums
}

/// What FLIP says: one error in [0, 1] per pixel, and its mean, which the authors recommend as the one number.
#[derive(Debug)]
pub struct Flip {
    /// Mean of the error map.
    pub mean: f64,
    /// Error per pixel, row by row from the top left.
    pub error_map: Vec<f32>,
}

/// LDR-FLIP (Andersson et al. 2020, NVIDIA's implementation) of two images of radiance, which are tone-mapped to
/// 8-bit sRGB first and looked at with 67 pixels per degree. Pixels that are not finite are magenta in it.
/// `None` if the image is too large for the implementation (2³² bytes).
///
/// # Panics
/// If the lengths are not `width` × `height`.
pub fn flip(
    (width, height): (u32, u32),
    a: &[[f32; 3]],
    b: &[[f32; 3]],
    exposure_ev: f32,
    tone_map: ToneMap,
) -> Option<Flip> {
    let bytes = width.checked_mul(height)?.checked_mul(3)?;
    assert!(a.len() * 3 == bytes as usize && b.len() == a.len(), "an image has width × height pixels");
    if bytes == 0 {
        return None;
    }
    let encode = |image: &[[f32; 3]]| {
        FlipImageRgb8::with_data(width, height, tone_map_srgb8(image, exposure_ev, tone_map).0.as_flattened())
    };
    let map = nv_flip::flip(encode(b), encode(a), DEFAULT_PIXELS_PER_DEGREE);
    let mean = f64::from(FlipPool::from_image(&map).mean());
    Some(Flip { mean, error_map: map.to_vec() })
}

/// Colours values in [0, 1] by matplotlib's *magma* map, black to yellowish white.
///
/// # Panics
/// If the number of values is not `width` × `height`.
pub fn magma(width: u32, height: u32, values: &[f32]) -> Vec<[u8; 3]> {
    assert_eq!(values.len(), width as usize * height as usize, "an image has width × height pixels");
    let coloured = FlipImageFloat::with_data(width, height, values).apply_color_lut(&nv_flip::magma_lut());
    coloured.to_vec().chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}
