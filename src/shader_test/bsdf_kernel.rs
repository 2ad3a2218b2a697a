//! Calls of a BSDF's kernel, by the protocol of `shaders/include/test_bsdf.glsl`.

use glam::DVec3;

use super::configuration::Configuration;
use super::device::MOST_LANES;
use super::report::{number, vector};
use crate::Result;
use crate::layout::Texel;
use crate::render::FunctionKernel;

/// Flag of a sample of a delta lobe, as in `shaders/include/bsdf.glsl`.
const SCATTERED_DELTA: u32 = 1;
/// Flag of a sample that goes through the surface.
const SCATTERED_THROUGH: u32 = 2;
/// Configurations of a dispatch, at most: their parameters have to fit beside a million directions.
const MOST_CONFIGURATIONS: usize = 256;

/// The functions of a BSDF.
pub(super) struct BsdfKernel {
    kernel: FunctionKernel,
}

/// What `test_scatter` gave.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) wi: DVec3,
    pub(super) weight: DVec3,
    pub(super) pdf: f64,
    flags: u32,
}

impl Sample {
    pub(super) fn is_delta(&self) -> bool {
        self.flags & SCATTERED_DELTA != 0
    }

    pub(super) fn goes_through(&self) -> bool {
        self.flags & SCATTERED_THROUGH != 0
    }

    /// Whether it is none: absorbed, or a direction that the lobe could not draw.
    pub(super) fn is_absorbed(&self) -> bool {
        !self.is_delta() && self.pdf == 0.0
    }

    /// What is not finite or is negative of it, in words.
    pub(super) fn fault(&self) -> Option<String> {
        let fine = self.wi.is_finite() && is_amount(self.weight) && is_amount(DVec3::splat(self.pdf));
        (!fine).then(|| {
            let [wi, weight, pdf] = [vector(self.wi), vector(self.weight), number(self.pdf)];
            format!("a sample is negative or not finite: wi {wi}, weight {weight}, pdf {pdf}")
        })
    }
}

/// What `test_evaluate` gave.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    pub(super) f: DVec3,
    pub(super) pdf: f64,
    /// f with the directions exchanged, where that was asked for and wi is above the surface; else zero.
    pub(super) reverse_f: DVec3,
}

impl Value {
    /// What is not finite or is negative of it, in words.
    pub(super) fn fault(&self, wi: DVec3) -> Option<String> {
        let fine = is_amount(self.f) && is_amount(DVec3::splat(self.pdf)) && is_amount(self.reverse_f);
        (!fine).then(|| {
            let [wi, f, pdf] = [vector(wi), vector(self.f), number(self.pdf)];
            let reverse = if is_amount(self.reverse_f) { "" } else { " (or with the directions exchanged)" };
            format!("a value is negative or not finite towards wi {wi}{reverse}: f {f}, pdf {pdf}")
        })
    }
}

/// Finite and not negative.
fn is_amount(v: DVec3) -> bool {
    v.is_finite() && v.min_element() >= 0.0
}

impl BsdfKernel {
    pub(super) fn new(kernel: FunctionKernel) -> Self {
        Self { kernel }
    }

    /// `samples` samples of each configuration, one after the other.
    pub(super) fn scatter(&mut self, all: &[Configuration], samples: u32, seed: u32) -> Result<Vec<Sample>> {
        let group = (MOST_LANES / samples as usize).clamp(1, MOST_CONFIGURATIONS);
        let mut result = Vec::with_capacity(all.len() * samples as usize);
        for (index, configurations) in (0_u32..).zip(all.chunks(group)) {
            // Numbers of their own for every group.
            let inputs = header(configurations, samples, seed ^ index << 16);
            let lanes = configurations.len() as u32 * samples;
            let sample = |texels: &[Texel]| Sample {
                wi: unpacked(texels[0]),
                weight: unpacked(texels[1]),
                pdf: f32::from_bits(texels[1][3]).into(),
                flags: texels[0][3],
            };
            result.extend(self.kernel.run(&inputs, lanes, 2)?.chunks_exact(2).map(sample));
        }
        Ok(result)
    }

    /// Values at (index of the configuration, wi); f with the directions exchanged too, if it is asked for.
    pub(super) fn evaluate(
        &mut self,
        all: &[Configuration],
        at: &[(usize, DVec3)],
        reverse: bool,
    ) -> Result<Vec<Value>> {
        let mut result = Vec::with_capacity(at.len());
        for (index, configurations) in all.chunks(MOST_CONFIGURATIONS).enumerate() {
            let first = index * MOST_CONFIGURATIONS;
            let own = first..first + configurations.len();
            // In order of the configuration, as all callers give them.
            let [start, end] = [own.start, own.end].map(|limit| at.partition_point(|(index, _)| *index < limit));
            for at in at[start..end].chunks(MOST_LANES) {
                let mut inputs = header(configurations, 0, reverse.into());
                inputs.extend(at.iter().map(|(index, wi)| vector_texel(*wi, (index - first) as u32)));
                let value = |texels: &[Texel]| Value {
                    f: unpacked(texels[0]),
                    pdf: f32::from_bits(texels[0][3]).into(),
                    reverse_f: unpacked(texels[1]),
                };
                result.extend(self.kernel.run(&inputs, at.len() as u32, 2)?.chunks_exact(2).map(value));
            }
        }
        Ok(result)
    }
}

/// The first texel, and those of the configurations.
fn header(configurations: &[Configuration], samples: u32, word: u32) -> Vec<Texel> {
    let texels_each = 1 + configurations.first().map_or(0, |c| c.parameters.len().div_ceil(4));
    let mut texels = vec![[configurations.len() as u32, samples, word, texels_each as u32]];
    for configuration in configurations {
        texels.push(vector_texel(configuration.wo, 0));
        let bits = |four: &[f32]| std::array::from_fn(|i| four.get(i).map_or(0, |value| value.to_bits()));
        texels.extend(configuration.parameters.chunks(4).map(bits));
    }
    texels
}

fn unpacked([x, y, z, _]: Texel) -> DVec3 {
    DVec3::from([x, y, z].map(|bits| f64::from(f32::from_bits(bits))))
}

fn vector_texel(v: DVec3, word: u32) -> Texel {
    let [x, y, z] = v.as_vec3().to_array().map(f32::to_bits);
    [x, y, z, word]
}
