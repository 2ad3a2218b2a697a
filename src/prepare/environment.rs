//! The environment's radiance and, for an image, the CDFs by which its texels are picked.
//!
//! The bilinear image is a sum over texels of their radiance times a tent, two texels wide along u and v. The edge rows are
//! repeated beyond the poles, so their tents are folded there. A texel is picked by what its tent holds, and a point under
//! the tent: the density of (u, v) is then the interpolated probability.
//!
//! The array holds the texels as (r, g, b, p), row by row from the top, p the probability of picking the texel times
//! width·height/2π² (0 if texels are not picked), then in words the marginal CDF over rows (`height + 1`) with its guide, and
//! a conditional CDF (`width + 1`) with its guide for each row. Where RGBE is exact, quads of the radiance and, if texels are
//! picked, quads of p take the texels' place.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::environment_quads::{quads, rgbe_words};
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
    /// Its texels are in RGBE, as quads.
    pub rgbe: bool,
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

/// Prepares the environment; CDFs are made of images only, and not for [`EnvironmentSampling::Uniform`].
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
    let cdf_words = guided_words(height) + u64::from(height) * guided_words(width);
    if texel_words + cdf_words + 3 > u64::from(u32::MAX) {
        return Err(PrepareError::EnvironmentTooLarge { width, height });
    }
    let tents = Tents::new(width, height, texels, sampling);
    let rgbe = rgbe_words(texels);
    let mut prepared = PreparedEnvironment {
        kind: EnvironmentKind::Image,
        array: match &rgbe {
            Some(words) => quads(width as usize, words),
            None => texels.iter().map(|&[r, g, b]| [r.to_bits(), g.to_bits(), b.to_bits(), 0]).collect(),
        },
        rgbe: rgbe.is_some(),
        width,
        height,
        radiance: [strength; 3],
        rotation_radians,
        mean_luminance: tents.mean * f64::from(strength),
        ..PreparedEnvironment::default()
    };
    if sampling != EnvironmentSampling::Uniform {
        let quads = if prepared.rgbe { prepared.array.len() } else { 0 };
        prepared.array.resize(prepared.array.len() + quads, Texel::default());
        prepared.marginal_word = 4 * prepared.array.len() as u32;
        prepared.conditional_word = prepared.marginal_word + guided_words(height) as u32;
        prepared.array.extend(super::pack_words(&tents.cdf_words()));
        prepared.store_probabilities();
    }
    Ok(prepared)
}

/// Words of a CDF over so many bins and of its guide.
fn guided_words(bins: u32) -> u64 {
    u64::from(bins) + 1 + cdf::guide_words(bins as usize) as u64
}

/// The share of its luminance that a texel below the mean keeps under [`EnvironmentSampling::Compensated`]. Without it
/// (Karlík et al. 2019) a direction that no BSDF sample takes would be lost: to `--light-sampling nee`, and to lobes whose
/// light is all in a place where their own density is next to nothing.
const KEPT_BELOW_THE_MEAN: f64 = 1.0 / 16.0;

/// What the texels' tents hold: weight times the integral of the tent and sin θ.
struct Tents<'a> {
    width: usize,
    texels: &'a [[f32; 3]],
    /// Mean over the sphere of the interpolated luminance.
    mean: f64,
    sampling: EnvironmentSampling,
    /// Weight times [`tent_sine`], a row's sum.
    rows: Vec<f64>,
}

impl<'a> Tents<'a> {
    fn new(width: u32, height: u32, texels: &'a [[f32; 3]], sampling: EnvironmentSampling) -> Self {
        let (width, height) = (width as usize, height as usize);
        let mut tents = Self { width, texels, mean: 0.0, sampling, rows: Vec::new() };
        // dω = 2π² sin θ du dv.
        let sum: f64 = tents.row_sums(luminance).iter().sum();
        tents.mean = sum * PI / (2.0 * (width * height) as f64);
        tents.rows = tents.row_sums(|texel| tents.weight(texel));
        tents
    }

    fn row_sums(&self, of: impl Fn([f32; 3]) -> f64) -> Vec<f64> {
        let height = self.texels.len() / self.width;
        let row = |(y, row): (usize, &[[f32; 3]])| row.iter().map(|t| of(*t)).sum::<f64>() * tent_sine(y, height);
        self.texels.chunks_exact(self.width).enumerate().map(row).collect()
    }

    /// By what a texel is picked.
    fn weight(&self, texel: [f32; 3]) -> f64 {
        let light = luminance(texel);
        match self.sampling {
            EnvironmentSampling::Compensated => (light - self.mean).max(KEPT_BELOW_THE_MEAN * light),
            _ => light,
        }
    }

    /// The marginal CDF, then the conditional ones, each with its guide.
    fn cdf_words(&self) -> Vec<u32> {
        let mut words = Vec::new();
        let mut add = |weights: &[f64]| {
            let cdf = cdf::build(weights);
            words.extend_from_slice(&cdf);
            words.extend(cdf::guide(&cdf));
        };
        add(&self.rows);
        let mut weights = Vec::with_capacity(self.width);
        for row in self.texels.chunks_exact(self.width) {
            weights.clear();
            weights.extend(row.iter().map(|t| self.weight(*t)));
            add(&weights);
        }
        words
    }
}

/// ∫ tent·sin θ of a row, in rows: with Δ = π/height the angle of one, sin θ·(sin(Δ/2)/(Δ/2))² about its middle θ. What
/// lies beyond a pole is folded back, where the sine is positive: twice ∫₀^½ (½ − x)·sin(xΔ) dx = (Δ − 2·sin(Δ/2))/Δ².
pub fn tent_sine(row: usize, height: usize) -> f64 {
    let step = PI / height as f64;
    let half = 0.5 * step;
    let poles = usize::from(row == 0) + usize::from(row + 1 == height);
    let folded = 2.0 * (half - half.sin()) / (step * step);
    ((row as f64 + 0.5) * step).sin() * (half.sin() / half).powi(2) + poles as f64 * folded
}

impl PreparedEnvironment {
    fn words(&self) -> &[u32] {
        self.array.as_flattened()
    }

    /// The fourth word of each texel, or the quads of it, from the CDFs as they are stored.
    fn store_probabilities(&mut self) {
        let (width, height) = (self.width as usize, self.height as usize);
        let factor = (width * height) as f64 / (2.0 * PI * PI);
        let word = |(y, x)| ((self.texel_probability(x, y) * factor) as f32).to_bits();
        let words: Vec<u32> = (0..height).flat_map(|y| (0..width).map(move |x| (y, x))).map(word).collect();
        if self.rgbe {
            let quads = quads(width, &words);
            self.array[quads.len()..][..quads.len()].copy_from_slice(&quads);
        } else {
            self.array.iter_mut().zip(words).for_each(|(texel, word)| texel[3] = word);
        }
    }

    /// Density in solid angle of drawing `direction` (unit, world space): the reference for the shader's.
    /// It is the texels' probability, interpolated bilinearly, times width · height / (2π² sin θ).
    pub fn pdf_solid_angle(&self, direction: DVec3) -> f64 {
        if self.kind != EnvironmentKind::Image || self.conditional_word == 0 {
            return if self.kind == EnvironmentKind::None { 0.0 } else { 1.0 / (4.0 * PI) };
        }
        let (u, v) = direction_to_uv(direction, self.rotation_radians);
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let texel = |i: i64, j: i64| {
            let (x, y) = ((x.floor() as i64 + i).rem_euclid(width), (y.floor() as i64 + j).clamp(0, height - 1));
            self.texel_probability(x as usize, y as usize)
        };
        let row = |j: i64| texel(0, j) * (1.0 - fx) + texel(1, j) * fx;
        let probability = row(0) * (1.0 - fy) + row(1) * fy;
        if probability == 0.0 {
            return 0.0;
        }
        probability * (width * height) as f64 / (2.0 * PI * PI * (v * PI).sin())
    }

    /// The CDF over rows, `height + 1` words.
    pub fn marginal(&self) -> &[u32] {
        &self.words()[self.marginal_word as usize..][..self.height as usize + 1]
    }

    /// The CDF over the texels of a row, `width + 1` words.
    pub fn conditional(&self, row: usize) -> &[u32] {
        let first = self.conditional_word as usize + row * guided_words(self.width) as usize;
        &self.words()[first..][..self.width as usize + 1]
    }

    /// Probability of picking a texel.
    pub fn texel_probability(&self, x: usize, y: usize) -> f64 {
        cdf::probability(self.marginal(), y) * cdf::probability(self.conditional(y), x)
    }
}

/// (u, v) in [0, 1)² of a unit world direction: u = atan2(z, x)/2π in the image's own frame, v = θ/π from the north pole.
/// The image is rotated by `rotation_radians` counter-clockwise seen from above, so the direction is turned back.
pub fn direction_to_uv(direction: DVec3, rotation_radians: f64) -> (f64, f64) {
    let (sin, cos) = rotation_radians.sin_cos();
    let x = direction.x * cos - direction.z * sin;
    let z = direction.x * sin + direction.z * cos;
    let u = (z.atan2(x) / TAU).rem_euclid(1.0);
    // Not by acos, which near the poles would amplify the rounding of a direction that comes from f32.
    (if u < 1.0 { u } else { 0.0 }, x.hypot(z).atan2(direction.y) / PI)
}
