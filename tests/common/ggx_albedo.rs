//! The directional albedo of GGX in f64, by quadrature over its visible normals: what src/prepare/ggx_albedo.bin holds.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

use glam::DVec3;
use sunfleck::layout::GGX_ALBEDO_SIZE;

use super::bsdf::gauss_legendre;

/// Albedo of the single-scattering lobe towards a direction.
#[derive(Clone, Copy, Debug)]
pub struct Albedo {
    /// With a Fresnel term of 1.
    pub white: f64,
    /// With a Fresnel term of (1 − wo·h)⁵.
    pub schlick: f64,
}

/// ∫ f cos over the hemisphere for a surface of roughness `alpha` along x and z (+Y is the normal), with height-correlated
/// masking and shadowing (Heitz 2014, eq. 99). Visible normals are parametrised as in Heitz 2018; the disk's radius as a
/// sine, so that nodes lie dense where normals are nearly horizontal.
pub fn albedo(wo: DVec3, alpha: [f64; 2], order: usize) -> Albedo {
    let [ax, az] = alpha;
    let lambda = |w: DVec3| 0.5 * ((1.0 + ((ax * w.x).powi(2) + (az * w.z).powi(2)) / (w.y * w.y)).sqrt() - 1.0);
    let stretched = DVec3::new(ax * wo.x, wo.y, az * wo.z).normalize();
    let horizontal = stretched.x.hypot(stretched.z);
    let t1 = if horizontal > 0.0 { DVec3::new(-stretched.z, 0.0, stretched.x) / horizontal } else { DVec3::X };
    let t2 = t1.cross(stretched);
    let lambda_o = lambda(wo);
    let (radial, angular) = (gauss_legendre(order), gauss_legendre(order));
    let mut result = Albedo { white: 0.0, schlick: 0.0 };
    for (x, radial_weight) in &radial {
        let (sine, cosine) = (x * FRAC_PI_2).sin_cos();
        // d(r²) = 2 sin ψ cos ψ dψ
        let weight = radial_weight * PI * sine * cosine;
        for (y, angular_weight) in &angular {
            let (sin_angle, cos_angle) = (2.0 * PI * y).sin_cos();
            let (a, b) = (sine * cos_angle, sine * sin_angle);
            let s = 0.5 * (1.0 + stretched.y);
            let b = (1.0 - s) * (1.0 - a * a).max(0.0).sqrt() + s * b;
            let h = t1 * a + t2 * b + stretched * (1.0 - a * a - b * b).max(0.0).sqrt();
            let h = DVec3::new(ax * h.x, h.y.max(0.0), az * h.z).normalize();
            let cosine = wo.dot(h);
            let wi = h * (2.0 * cosine) - wo;
            if wi.y > 0.0 {
                let share = weight * angular_weight * (1.0 + lambda_o) / (1.0 + lambda_o + lambda(wi));
                result.white += share;
                result.schlick += share * (1.0 - cosine).powi(5);
            }
        }
    }
    result
}

/// A node of the table as stored: what `ggx_albedo` in shaders/include/ggx.glsl reads.
pub fn entry(x: f64, y: f64, order: usize) -> [f32; 2] {
    let alpha = (y * y).max(2.0_f64.powi(-12));
    let wo = direction(x, alpha);
    let a = albedo(wo, [alpha; 2], order);
    let length = (wo.y * wo.y + alpha * alpha * (1.0 - wo.y * wo.y)).sqrt();
    // (1 − c)⁵ is the mean of Schlick's weight for c = cos θo + length · second entry.
    let cosine = 1.0 - (a.schlick / a.white).powf(0.2);
    [a.white as f32, ((cosine - wo.y) / length) as f32]
}

/// The direction at the table's first coordinate: the stretched direction's polar angle φ has tan(π/4 − φ/2) = x².
pub fn direction(x: f64, alpha: f64) -> DVec3 {
    let w = (x * x).max(1e-7);
    let (sine, cosine) = ((1.0 - w * w) / (1.0 + w * w), 2.0 * w / (1.0 + w * w));
    let (s, c) = (sine, alpha * cosine);
    DVec3::new(s, c, 0.0) / s.hypot(c)
}

/// The table as it is stored, between its nodes: what the shader's `ggx_albedo` computes.
pub fn stored(wo: DVec3, alpha: [f64; 2]) -> Albedo {
    static NODES: OnceLock<Vec<f64>> = OnceLock::new();
    let nodes = NODES.get_or_init(|| {
        let bytes = include_bytes!("../../src/prepare/ggx_albedo.bin");
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into()).collect()
    });
    let size = GGX_ALBEDO_SIZE as usize;
    let [ax, az] = alpha;
    let horizontal = (ax * wo.x).hypot(az * wo.z);
    let length = horizontal.hypot(wo.y);
    let x = (wo.y / (length + horizontal)).sqrt() * (size - 1) as f64;
    let difference = 0.125 * (az * az - ax * ax) * (wo.x * wo.x - wo.z * wo.z);
    let equal = (0.5 * (ax * ax + az * az) + difference).sqrt();
    let y = equal.sqrt() * (size - 1) as f64;
    let (i, j) = ((x as usize).min(size - 2), (y as usize).min(size - 2));
    let (u, v) = (x - i as f64, y - j as f64);
    let node = |i: usize, j: usize, k: usize| nodes[2 * (j * size + i) + k];
    let mixed = |k| {
        (node(i, j, k) * (1.0 - u) + node(i + 1, j, k) * u) * (1.0 - v)
            + (node(i, j + 1, k) * (1.0 - u) + node(i + 1, j + 1, k) * u) * v
    };
    let white = (mixed(0) + 0.065 * (ax - az).abs() / (ax + az)).min(1.0);
    Albedo { white, schlick: white * (1.0 - wo.y - length * mixed(1)).powi(5) }
}
