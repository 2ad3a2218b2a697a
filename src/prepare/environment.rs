//! The environment's radiance and, for an image, the CDFs by which its texels are picked.
//!
//! The array holds the texels as (r, g, b, 0), row by row from the top, then in words the marginal CDF over rows
//! (`height + 1`) and one conditional CDF a row (`width + 1` each).

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{EnvironmentSampling, PrepareError, cdf, luminance};
use crate::layout::Texel;
use crate::scene::Environment;

/// The environment as the shader reads it.
#[derive(Clone, Debug, Default)]
pub struct PreparedEnvironment {
    /// What it is; a black one is none.
    pub kind: EnvironmentKind,
    /// Contents of the environment array.
    pub array: Vec<Texel>,
    /// Image width.
    pub width: u32,
    /// Image height.
    pub height: u32,
    /// First word of the marginal CDF, 0 without one.
    pub marginal_word: u32,
    /// First word of the conditional CDFs, 0 without them.
    pub conditional_word: u32,
    /// Constant radiance, or the factor on the image.
    pub radiance: [f32; 3],
    /// Rotation of an image about +Y in radians.
    pub rotation_radians: f64,
    /// Mean over the sphere of the radiance's luminance.
    pub mean_luminance: f64,
}

/// The kinds of environment a kernel is built for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum EnvironmentKind {
    /// Black.
    #[default]
    None,
    /// The same radiance from every direction.
    Constant,
    /// A latitude/longitude image.
    Image,
}

/// Prepares the environment; CDFs are made for [`EnvironmentSampling::Importance`] of images only.
///
/// # Errors
/// If the image has more words than 32 bits can address.
pub fn prepare(environment: &Environment, sampling: EnvironmentSampling) -> Result<PreparedEnvironment, PrepareError> {
    match environment {
        Environment::None => Ok(PreparedEnvironment::default()),
        Environment::Constant(radiance) => Ok(constant(*radiance)),
        Environment::Image { texels, strength, .. }
            if *strength == 0.0 || texels.iter().all(|texel| *texel == [0.0; 3]) =>
        {
            Ok(PreparedEnvironment::default())
        }
        Environment::Image { width, height, texels, strength, rotation_radians, .. } => {
            image(*width, *height, texels, *strength, *rotation_radians, sampling)
        }
    }
}

fn constant(radiance: [f32; 3]) -> PreparedEnvironment {
    if radiance == [0.0; 3] {
        return PreparedEnvironment::default();
    }
    PreparedEnvironment {
        kind: EnvironmentKind::Constant,
        radiance,
        mean_luminance: luminance(radiance),
        ..PreparedEnvironment::default()
    }
}

fn image(
    width: u32,
    height: u32,
    texels: &[[f32; 3]],
    strength: f32,
    rotation_radians: f64,
    sampling: EnvironmentSampling,
) -> Result<PreparedEnvironment, PrepareError> {
    let texel_words = 4 * u64::from(width) * u64::from(height);
    let cdf_words = u64::from(height) + 1 + u64::from(height) * (u64::from(width) + 1);
    if texel_words + cdf_words + 3 > u64::from(u32::MAX) {
        return Err(PrepareError::EnvironmentTooLarge { width, height });
    }
    let mut array: Vec<Texel> = texels.iter().map(|&[r, g, b]| [r.to_bits(), g.to_bits(), b.to_bits(), 0]).collect();
    let weights = Weights::new(width, height, texels);
    let mut prepared = PreparedEnvironment {
        kind: EnvironmentKind::Image,
        width,
        height,
        radiance: [strength; 3],
        rotation_radians,
        mean_luminance: weights.mean() * f64::from(strength),
        ..PreparedEnvironment::default()
    };
    if sampling == EnvironmentSampling::Importance {
        prepared.marginal_word = texel_words as u32;
        prepared.conditional_word = prepared.marginal_word + height + 1;
        array.extend(super::pack_words(&weights.cdf_words()));
    }
    prepared.array = array;
    Ok(prepared)
}

/// What each texel's cell is worth: the mean over the cell of the luminance that the shader looks up, and its row's
/// share of the sphere.
struct Weights {
    width: usize,
    cells: Vec<f64>,
    /// Solid angle of a texel of each row.
    solid_angles: Vec<f64>,
}

impl Weights {
    /// The lookup is bilinear between texel centres. Along one axis a texel's tent covers 6/8 of its own cell and 1/8 of
    /// each neighbour's, so the exact mean over a cell is the filter (1, 6, 1)/8 on both axes, wrapping around in u and
    /// repeating the edge row in v as the lookup does. A cell that is positive anywhere has a positive weight.
    fn new(width: u32, height: u32, texels: &[[f32; 3]]) -> Self {
        let (width, height) = (width as usize, height as usize);
        let filter = |before: f64, own: f64, after: f64| (before + 6.0 * own + after) / 8.0;
        let mut along_u = vec![0.0; width * height];
        for (row, out) in texels.chunks_exact(width).zip(along_u.chunks_exact_mut(width)) {
            for (x, value) in out.iter_mut().enumerate() {
                let [before, own, after] = [(x + width - 1) % width, x, (x + 1) % width].map(|x| luminance(row[x]));
                *value = filter(before, own, after);
            }
        }
        let mut cells = vec![0.0; width * height];
        for (y, out) in cells.chunks_exact_mut(width).enumerate() {
            let (above, below) = (y.saturating_sub(1) * width, (y + 1).min(height - 1) * width);
            for (x, value) in out.iter_mut().enumerate() {
                *value = filter(along_u[above + x], along_u[y * width + x], along_u[below + x]);
            }
        }
        let solid_angles = (0..height).map(|row| TAU / width as f64 * row_height(row, height)).collect();
        Self { width, cells, solid_angles }
    }

    fn row_sums(&self) -> Vec<f64> {
        self.cells
            .chunks_exact(self.width)
            .zip(&self.solid_angles)
            .map(|(row, solid_angle)| row.iter().sum::<f64>() * solid_angle)
            .collect()
    }

    fn mean(&self) -> f64 {
        self.row_sums().iter().sum::<f64>() / (4.0 * PI)
    }

    /// The marginal CDF, then the conditional ones.
    fn cdf_words(&self) -> Vec<u32> {
        let mut words = cdf::build(&self.row_sums());
        for row in self.cells.chunks_exact(self.width) {
            words.extend(cdf::build(row));
        }
        words
    }
}

/// cos θ₀ − cos θ₁ of a row, as a product that does not cancel at the poles.
fn row_height(row: usize, height: usize) -> f64 {
    let step = PI / height as f64;
    2.0 * ((row as f64 + 0.5) * step).sin() * (0.5 * step).sin()
}

impl PreparedEnvironment {
    fn words(&self) -> &[u32] {
        self.array.as_flattened()
    }

    /// Density in solid angle of picking `direction` (unit, world space) by the CDFs: the reference for the shader's.
    /// A texel (probability p) is picked, then a uniform point in its (u, v) cell: pdf = p · width · height / (2π² sin θ).
    pub fn pdf_solid_angle(&self, direction: DVec3) -> f64 {
        if self.kind != EnvironmentKind::Image || self.conditional_word == 0 {
            return if self.kind == EnvironmentKind::None { 0.0 } else { 1.0 / (4.0 * PI) };
        }
        let (u, v) = direction_to_uv(direction, self.rotation_radians);
        let (width, height) = (self.width as usize, self.height as usize);
        let x = ((u * width as f64) as usize).min(width - 1);
        let y = ((v * height as f64) as usize).min(height - 1);
        let sin_theta = (v * PI).sin();
        let probability = self.texel_probability(x, y);
        if probability == 0.0 {
            return 0.0;
        }
        probability * (width * height) as f64 / (2.0 * PI * PI * sin_theta)
    }

    /// Probability of picking a texel.
    pub fn texel_probability(&self, x: usize, y: usize) -> f64 {
        let words = self.words();
        let marginal = &words[self.marginal_word as usize..];
        let conditional = &words[self.conditional_word as usize + y * (self.width as usize + 1)..];
        cdf::probability(marginal, y) * cdf::probability(conditional, x)
    }
}

/// (u, v) in [0, 1)² of a unit world direction: u = atan2(z, x)/2π in the image's own frame, v = θ/π from the north pole.
/// The image is rotated by `rotation_radians` counter-clockwise seen from above, so the direction is turned back.
pub fn direction_to_uv(direction: DVec3, rotation_radians: f64) -> (f64, f64) {
    let (sin, cos) = rotation_radians.sin_cos();
    let x = direction.x * cos - direction.z * sin;
    let z = direction.x * sin + direction.z * cos;
    let u = (z.atan2(x) / TAU).rem_euclid(1.0);
    (if u < 1.0 { u } else { 0.0 }, direction.y.clamp(-1.0, 1.0).acos() / PI)
}
