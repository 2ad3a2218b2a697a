//! What one scattering by a rough dielectric keeps of the light, in f64, by quadrature over visible normals: what
//! src/prepare/dielectric_albedo.bin holds.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

use glam::DVec3;
use sunfleck::layout::DIELECTRIC_ALBEDO_SIZE;

use super::ggx_albedo::direction;
use super::microfacets::{VisibleNormalDisk, fresnel, refracted_cosine, smith_lambda};

/// The table's range of |η − 1|/(η + 1), as in shaders/include/bsdf_dielectric.glsl.
const CONTRASTS: [f64; 2] = [0.005, 0.98];

/// ∫ f·|cos| over the sphere, flux for refracted radiance, and the same where nothing is reflected that can be refracted.
/// `wo` has no z; masking and shadowing are height-correlated, (1 + Λ(wo) + Λ(wi))⁻¹ on both sides (PBR §9.7.3).
/// `rule` is Gauss and Legendre's in [0, 1].
pub fn albedo(wo: DVec3, alpha: f64, eta: f64, rule: &[(f64, f64)]) -> [f64; 2] {
    let order = rule.len();
    let alpha = [alpha; 2];
    let lambda_o = smith_lambda(wo, alpha);
    let masked = |wi: DVec3| (1.0 + lambda_o) / (1.0 + lambda_o + smith_lambda(wi, alpha));
    let disk = VisibleNormalDisk::new(wo, alpha);
    let mut sums = [0.0; 2];
    for (x, radial_weight) in rule {
        let (sine, cosine) = (x * FRAC_PI_2).sin_cos();
        // d(r²) = 2 sin ψ cos ψ dψ; half of the disk, which is symmetric.
        let weight = radial_weight * PI * sine * cosine / order as f64;
        for k in 0..order {
            let (a, b) = ((k as f64 + 0.5) * PI / order as f64 - FRAC_PI_2).sin_cos();
            let h = disk.normal(sine * b, sine * a);
            let cosine = wo.dot(h);
            let reflected = h * (2.0 * cosine) - wo;
            let up = if reflected.y > 0.0 { masked(reflected) } else { 0.0 };
            let Some(transmitted) = refracted_cosine(cosine, eta) else {
                sums = sums.map(|sum| sum + weight * up);
                continue;
            };
            let reflectance = fresnel(cosine, transmitted, eta);
            let refracted = h * (cosine / eta - transmitted) - wo / eta;
            let down = if refracted.y < 0.0 { masked(refracted) } else { 0.0 };
            sums[0] += weight * (reflectance * up + (1.0 - reflectance) * down);
            sums[1] += weight * down;
        }
    }
    sums
}

/// What a point of the table's coordinates stands for: the direction, α and η.
pub fn parameters(coordinates: [f64; 3], inside: bool) -> (DVec3, f64, f64) {
    let [x, y, z] = coordinates;
    let alpha = (y * y).max(2.0_f64.powi(-12));
    let contrast = CONTRASTS[0] * (CONTRASTS[1] / CONTRASTS[0]).powf(z);
    let eta = (1.0 + contrast) / (1.0 - contrast);
    (direction(x, 0.0, [alpha; 2]), alpha, if inside { 1.0 / eta } else { eta })
}

/// A table, node after node: x fastest, then y, z, and which side.
#[derive(Clone, Debug)]
pub struct Table(pub Vec<[f64; 2]>);

impl Table {
    /// Index of a node and the coordinates in [0, 1] that it stands at.
    pub fn nodes() -> impl Iterator<Item = (usize, [f64; 3], bool)> {
        let [nx, ny, nz] = DIELECTRIC_ALBEDO_SIZE.map(|n| n as usize);
        let unit = |i: usize, n: usize| i as f64 / (n - 1) as f64;
        (0..2 * nx * ny * nz).map(move |i| {
            let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
            (i, [unit(x, nx), unit(y, ny), unit(z % nz, nz)], z >= nz)
        })
    }

    /// The eight nodes around a point, with their weights.
    pub fn corners(coordinates: [f64; 3], inside: bool) -> [(usize, f64); 8] {
        let size = DIELECTRIC_ALBEDO_SIZE.map(|n| n as usize);
        let at: [f64; 3] = std::array::from_fn(|k| coordinates[k] * (size[k] - 1) as f64);
        let cell: [usize; 3] = std::array::from_fn(|k| (at[k] as usize).min(size[k] - 2));
        std::array::from_fn(|corner| {
            let step: [usize; 3] = std::array::from_fn(|k| corner >> k & 1);
            let weight: f64 = (0..3)
                .map(|k| {
                    let f = at[k] - cell[k] as f64;
                    if step[k] == 1 { f } else { 1.0 - f }
                })
                .product();
            let [x, y, z]: [usize; 3] = std::array::from_fn(|k| cell[k] + step[k]);
            let slice = z + if inside { size[2] } else { 0 };
            ((slice * size[1] + y) * size[0] + x, weight)
        })
    }

    /// The value between nodes.
    pub fn interpolate(&self, coordinates: [f64; 3], inside: bool) -> [f64; 2] {
        Self::corners(coordinates, inside)
            .into_iter()
            .fold([0.0; 2], |sum, (i, weight)| [sum[0] + weight * self.0[i][0], sum[1] + weight * self.0[i][1]])
    }

    /// The table that is built in.
    pub fn stored() -> &'static Self {
        static TABLE: OnceLock<Table> = OnceLock::new();
        TABLE.get_or_init(|| {
            let bytes = include_bytes!("../../src/prepare/dielectric_albedo.bin");
            let number = |b: &[u8]| f64::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0;
            Table(bytes.chunks_exact(4).map(|b| [number(&b[..2]), number(&b[2..])]).collect())
        })
    }

    /// What the shader looks up for a direction without z.
    pub fn look_up(&self, wo: DVec3, alpha: f64, eta: f64) -> [f64; 2] {
        let horizontal = alpha * wo.x.abs();
        let x = (wo.y / (horizontal.hypot(wo.y) + horizontal)).sqrt();
        let contrast = ((eta - 1.0) / (eta + 1.0)).abs();
        let z = (contrast / CONTRASTS[0]).ln() / (CONTRASTS[1] / CONTRASTS[0]).ln();
        self.interpolate([x, alpha.sqrt(), z.clamp(0.0, 1.0)], eta < 1.0)
    }
}
