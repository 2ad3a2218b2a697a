//! Irradiance in closed form.

use glam::DVec3;

/// Irradiance at a point from a polygon of radiance 1 that lies above the point's horizon (Lambert 1760; Arvo 1994, §2.2).
pub fn polygon_irradiance(polygon: &[DVec3], point: DVec3, normal: DVec3) -> f64 {
    let unit: Vec<DVec3> = polygon.iter().map(|v| (*v - point).normalize()).collect();
    let edge = |i: usize| {
        let (a, b) = (unit[i], unit[(i + 1) % unit.len()]);
        let cross = a.cross(b);
        cross.length().atan2(a.dot(b)) * cross.normalize().dot(normal)
    };
    0.5 * (0..unit.len()).map(edge).sum::<f64>().abs()
}
