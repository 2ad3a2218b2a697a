//! The directional albedo of GGX in f64, by quadrature over its visible normals: what src/prepare/ggx_albedo.bin and
//! ggx_albedo_anisotropic.bin hold.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

use glam::{DVec2, DVec3};
use sunfleck::layout::{GGX_ALBEDO_SIZE, GGX_ANISOTROPIC_SIZES};

use super::half_vector_bins::gauss_legendre;
use super::microfacets::{VisibleNormalDisk, smith_lambda};

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
    let lambda_o = smith_lambda(wo, alpha);
    let disk = VisibleNormalDisk::new(wo, alpha);
    let rule = gauss_legendre(order);
    let mut result = Albedo { white: 0.0, schlick: 0.0 };
    for (x, radial_weight) in &rule {
        let (sine, cosine) = (x * FRAC_PI_2).sin_cos();
        // d(r²) = 2 sin ψ cos ψ dψ
        let weight = radial_weight * PI * sine * cosine;
        for (y, angular_weight) in &rule {
            let (sin_angle, cos_angle) = (2.0 * PI * y).sin_cos();
            let h = disk.normal(sine * cos_angle, sine * sin_angle);
            let cosine = wo.dot(h);
            let wi = h * (2.0 * cosine) - wo;
            if wi.y > 0.0 {
                let share = weight * angular_weight * (1.0 + lambda_o) / (1.0 + lambda_o + smith_lambda(wi, alpha));
                result.white += share;
                result.schlick += share * (1.0 - cosine).powi(5);
            }
        }
    }
    result
}

/// A node of the table as stored: what `ggx_albedo` in shaders/include/ggx.glsl reads.
pub fn entry(x: f64, y: f64, order: usize) -> [f32; 2] {
    let alpha = (y * y).max(SMALLEST_ALPHA);
    let [white, offset] = numbers(direction(x, 0.0, [alpha; 2]), [alpha; 2], order);
    [white as f32, offset as f32]
}

/// A node of the table of unequal roughness: (polar angle, azimuth, ratio, larger roughness), each in [0, 1]. The albedo is
/// raised, and the offset lowered, by as much as the table can be wrong between its nodes, so that what is given back is never
/// too much.
///
/// At a polar angle of zero the offset is that of directions near it. The one along the normal itself is that of the few
/// facets that are tilted most, which the fifth power leaves there, and wo's that are as near to it once they are
/// stretched, though they may be nearly at the horizon, see another. Along the normal Schlick's albedo is nearly zero with
/// either.
pub fn anisotropic_entry([x, azimuth, ratio, y]: [f64; 4], order: usize) -> [i16; 2] {
    let larger = (y * y).max(SMALLEST_ALPHA);
    let alpha = [larger, (larger * ratio * ratio).max(SMALLEST_ALPHA)];
    let at = |x: f64| numbers(direction(x, stretched_azimuth(azimuth, alpha), alpha), alpha, order);
    let narrow = (1.0 - 10.0 * larger).max(0.0);
    let [white, offset] = at(x);
    let offset = if x == 1.0 { at(0.981 + 0.004 * narrow)[1] } else { offset };
    // Towards the horizon it grows faster than the table's coordinate tells.
    let horizon = (1.0 - 10.0 * x).max(0.0);
    let lowered = offset * (1.0 - horizon * (0.005 + 0.036 * narrow)) - 0.005 - 0.006 * narrow;
    [white * 1.0029 / UNITS[0], lowered / UNITS[1]].map(|number| {
        assert!(number.abs() <= 1.0, "{number} cannot be stored");
        (number * SNORM).round() as i16
    })
}

/// What a stored number is divided by.
const SNORM: f64 = 32767.0;
/// Of the table of unequal roughness: what is raised passes 1, and the largest offset is some 7, of the narrowest lobe at
/// the horizon.
const UNITS: [f64; 2] = [2.0, 8.0];
const SMALLEST_ALPHA: f64 = 1.0 / 4096.0;

/// The albedo, and the offset of the cosine whose weight is the mean of Schlick's: (1 − c)⁵ for c = cos θo +
/// |stretched wo| · offset.
fn numbers(wo: DVec3, alpha: [f64; 2], order: usize) -> [f64; 2] {
    let a = albedo(wo, alpha, order);
    let length = DVec3::new(alpha[0] * wo.x, wo.y, alpha[1] * wo.z).length();
    let cosine = 1.0 - (a.schlick / a.white).powf(0.2);
    [a.white, (cosine - wo.y) / length]
}

/// The azimuth ψ of the stretched direction at the coordinate (φ + ψ)/π, where φ is that of the direction itself: tan ψ =
/// tan φ · smaller/larger.
fn stretched_azimuth(coordinate: f64, [larger, smaller]: [f64; 2]) -> f64 {
    let sum = coordinate * PI;
    let stretched = |azimuth: f64| (azimuth.sin() * smaller / larger).atan2(azimuth.cos());
    if coordinate >= 1.0 {
        return FRAC_PI_2;
    }
    let mut bounds = [0.0, FRAC_PI_2];
    for _ in 0..64 {
        let middle = 0.5 * (bounds[0] + bounds[1]);
        bounds[usize::from(middle + stretched(middle) > sum)] = middle;
    }
    sum - bounds[0]
}

/// The direction at a table's coordinates: the stretched direction's polar angle φ has tan(π/4 − φ/2) = x², and it has the
/// given azimuth from +X on.
pub fn direction(x: f64, azimuth: f64, alpha: [f64; 2]) -> DVec3 {
    let w = (x * x).max(1e-7);
    let (sine, cosine) = ((1.0 - w * w) / (1.0 + w * w), 2.0 * w / (1.0 + w * w));
    let (s, c) = azimuth.sin_cos();
    DVec3::new(sine * c / alpha[0], cosine, sine * s / alpha[1]).normalize()
}

/// The tables as they are stored, between their nodes: what the shader's `ggx_albedo` computes.
pub fn stored(wo: DVec3, alpha: [f64; 2]) -> Albedo {
    let [ax, az] = alpha;
    let own = DVec2::new(wo.x.abs(), wo.z.abs());
    let horizontal = own * DVec2::new(ax, az);
    let length = horizontal.length().hypot(wo.y);
    let x = (wo.y / (length + horizontal.length())).sqrt();
    let [white, offset] = if ax == az {
        let size = GGX_ALBEDO_SIZE as usize;
        interpolate(nodes(), [size, size], [x, ax.sqrt()])
    } else {
        let (larger, smaller) = (ax.max(az), ax.min(az));
        let azimuth = |v: DVec2| if ax < az { v.x.atan2(v.y) } else { v.y.atan2(v.x) };
        let at = [x, (azimuth(horizontal) + azimuth(own)) / PI, (smaller / larger).sqrt(), larger.sqrt()];
        interpolate(anisotropic_nodes(), GGX_ANISOTROPIC_SIZES.map(|size| size as usize), at)
    };
    Albedo { white, schlick: white.min(1.0) * (1.0 - wo.y - length * offset).powi(5) }
}

fn nodes() -> &'static [[f64; 2]] {
    static NODES: OnceLock<Vec<[f64; 2]>> = OnceLock::new();
    NODES.get_or_init(|| {
        let bytes = include_bytes!("../../src/prepare/ggx_albedo.bin");
        let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into();
        bytes.chunks_exact(8).map(|b| [number(b), number(&b[4..])]).collect()
    })
}

fn anisotropic_nodes() -> &'static [[f64; 2]] {
    static NODES: OnceLock<Vec<[f64; 2]>> = OnceLock::new();
    NODES.get_or_init(|| {
        let bytes = include_bytes!("../../src/prepare/ggx_albedo_anisotropic.bin");
        let number = |b: &[u8]| f64::from(i16::from_le_bytes([b[0], b[1]])) / SNORM;
        bytes.chunks_exact(4).map(|b| [number(b) * UNITS[0], number(&b[2..]) * UNITS[1]]).collect()
    })
}

/// Multilinear; `at` is in [0, 1], the first coordinate runs fastest.
fn interpolate<const N: usize>(nodes: &[[f64; 2]], sizes: [usize; N], at: [f64; N]) -> [f64; 2] {
    let mut result = [0.0; 2];
    for corner in 0..1 << N {
        let (mut index, mut stride, mut weight) = (0, 1, 1.0);
        for axis in 0..N {
            let place = at[axis] * (sizes[axis] - 1) as f64;
            let cell = (place as usize).min(sizes[axis] - 2);
            let upper = corner >> axis & 1;
            index += stride * (cell + upper);
            stride *= sizes[axis];
            weight *= if upper == 1 { place - cell as f64 } else { 1.0 - (place - cell as f64) };
        }
        (0..2).for_each(|k| result[k] += weight * nodes[index][k]);
    }
    result
}
