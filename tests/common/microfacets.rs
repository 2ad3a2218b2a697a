//! GGX, Smith's function, visible normals and Fresnel's reflectance in f64.

use std::f64::consts::PI;

use glam::DVec3;

/// GGX for roughness along x and z.
pub fn ggx_distribution(h: DVec3, [x, z]: [f64; 2]) -> f64 {
    1.0 / (PI * x * z * ((h.x / x).powi(2) + (h.z / z).powi(2) + h.y * h.y).powi(2))
}

/// Smith's Λ of GGX.
pub fn smith_lambda(w: DVec3, [x, z]: [f64; 2]) -> f64 {
    0.5 * ((1.0 + ((x * w.x).powi(2) + (z * w.z).powi(2)) / (w.y * w.y)).sqrt() - 1.0)
}

/// The disk in which the normals that a direction sees are uniform (Heitz 2018, "Sampling the GGX Distribution of Visible
/// Normals").
pub struct VisibleNormalDisk {
    alpha: [f64; 2],
    stretched: DVec3,
    axes: [DVec3; 2],
}

impl VisibleNormalDisk {
    pub fn new(wo: DVec3, alpha: [f64; 2]) -> Self {
        let stretched = DVec3::new(alpha[0] * wo.x, wo.y, alpha[1] * wo.z).normalize();
        let horizontal = stretched.x.hypot(stretched.z);
        let across = DVec3::new(-stretched.z, 0.0, stretched.x);
        let first = if horizontal > 0.0 { across / horizontal } else { DVec3::X };
        Self { alpha, stretched, axes: [first, first.cross(stretched)] }
    }

    /// The normal at a point of the unit disk, before half of the disk is pressed together.
    pub fn normal(&self, a: f64, b: f64) -> DVec3 {
        let s = 0.5 * (1.0 + self.stretched.y);
        let b = (1.0 - s) * (1.0 - a * a).max(0.0).sqrt() + s * b;
        let h = self.axes[0] * a + self.axes[1] * b + self.stretched * (1.0 - a * a - b * b).max(0.0).sqrt();
        DVec3::new(self.alpha[0] * h.x, h.y.max(0.0), self.alpha[1] * h.z).normalize()
    }
}

/// Unpolarised reflectance for a cosine and the refracted one (PBR, 4th ed., eq. 9.12).
pub fn fresnel(cosine: f64, transmitted: f64, eta: f64) -> f64 {
    let parallel = (eta * cosine - transmitted) / (eta * cosine + transmitted);
    let perpendicular = (cosine - eta * transmitted) / (cosine + eta * transmitted);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// The refracted cosine; none where reflection is total.
pub fn refracted_cosine(cosine: f64, eta: f64) -> Option<f64> {
    let squared = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    (squared > 0.0).then(|| squared.sqrt() / eta)
}
