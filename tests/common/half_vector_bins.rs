//! Bins of scattered directions for χ² tests, and a quadrature over them.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::DVec3;
pub use sunfleck::shader_test::quadrature::gauss_legendre;

/// Bins of directions that resolve a lobe however narrow: rings of the half vector's polar angle around the normal, cut
/// into sectors of its azimuth counted from wo's. Where the roughness along x and z differs, the half vector is scaled
/// first, so that its distribution is round.
pub struct HalfVectorBins {
    wo: DVec3,
    /// By what the slopes along x were multiplied, and those along z divided.
    stretch: f64,
    azimuth: f64,
    /// Ascending polar angles, 0 to π/2.
    rings: Vec<f64>,
}

/// A point of the quadrature over a bin: its weight is a solid angle of wi.
pub struct Node {
    pub bin: usize,
    pub wi: DVec3,
    pub weight: f64,
}

const SECTORS: usize = 8;

impl HalfVectorBins {
    pub fn new(alpha: f64, stretch: f64, wo: DVec3) -> Self {
        let tangents = (1..10).map(|i| f64::from(i) / 10.0).map(|t| alpha * (t / (1.0 - t)).sqrt());
        // Rings of equal probability for the GGX lobe, rings of equal width for what is broad.
        let mut rings: Vec<f64> = tangents.map(f64::atan).filter(|angle| *angle > 0.0).collect();
        rings.extend((1..=8).map(|i| f64::from(i) / 8.0 * FRAC_PI_2));
        rings.sort_by(f64::total_cmp);
        rings.dedup_by(|a, b| (*a - *b).abs() < 1e-3 * *b);
        // A lobe's tail falls by powers of the angle: no ring may span too many of them.
        let mut angle = rings[0];
        while angle < rings[rings.len() - 1] {
            let next = rings[rings.partition_point(|ring| *ring <= angle)];
            angle = next.min(4.0 * angle);
            if angle < next {
                rings.insert(rings.partition_point(|ring| *ring < angle), angle);
            }
        }
        rings.insert(0, 0.0);
        Self { wo, stretch, azimuth: (wo.z * stretch).atan2(wo.x / stretch), rings }
    }

    pub fn len(&self) -> usize {
        (self.rings.len() - 1) * SECTORS
    }

    pub fn bin(&self, wi: DVec3) -> usize {
        let h = self.wo + wi;
        let h = DVec3::new(h.x / self.stretch, h.y, h.z * self.stretch);
        let polar = h.x.hypot(h.z).atan2(h.y);
        let turns = ((h.z.atan2(h.x) - self.azimuth) / (2.0 * PI) + 0.5).rem_euclid(1.0);
        let ring = self.rings.partition_point(|ring| *ring <= polar).clamp(1, self.rings.len() - 1) - 1;
        ring * SECTORS + ((turns * SECTORS as f64) as usize).min(SECTORS - 1)
    }

    /// Nodes of a Gauss-Legendre rule over every bin, `order` of them along the polar angle for a smooth piece.
    pub fn nodes(&self, order: usize) -> Vec<Node> {
        let polar_rule = gauss_legendre(order);
        let azimuth_rule = gauss_legendre(4);
        // Where a ring of half vectors begins and ends to be cut by the horizon of wi.
        let tilt = 0.5 * self.wo.y.clamp(-1.0, 1.0).acos();
        let mut nodes = Vec::new();
        for (ring, limits) in self.rings.windows(2).enumerate() {
            if self.stretch != 1.0 {
                self.add_stretched(&mut nodes, ring, [limits[0], limits[1]], order, &azimuth_rule);
                continue;
            }
            let mut pieces = vec![limits[0], limits[1]];
            pieces.extend([FRAC_PI_4 - tilt, FRAC_PI_4 + tilt].iter().filter(|t| limits[0] < **t && **t < limits[1]));
            pieces.sort_by(f64::total_cmp);
            for piece in pieces.windows(2) {
                for (x, weight) in &polar_rule {
                    let polar = piece[0] + (piece[1] - piece[0]) * x;
                    self.add_ring(&mut nodes, ring, polar, weight * (piece[1] - piece[0]), &azimuth_rule);
                }
            }
        }
        nodes
    }

    fn add_ring(&self, nodes: &mut Vec<Node>, ring: usize, polar: f64, weight: f64, rule: &[(f64, f64)]) {
        let (sin_h, cos_h) = polar.sin_cos();
        let sine = self.wo.x.hypot(self.wo.z);
        // wi.y = 2 (wo·h) cos θh − wo.y > 0, solved for the azimuth.
        let limit = (self.wo.y / (2.0 * cos_h) - self.wo.y * cos_h) / (sine * sin_h);
        let widest = if limit <= -1.0 {
            PI
        } else if limit < 1.0 {
            limit.acos()
        } else {
            0.0
        };
        for sector in 0..SECTORS {
            let step = 2.0 * PI / SECTORS as f64;
            let low = (sector as f64 * step - PI).max(-widest);
            let high = ((sector + 1) as f64 * step - PI).min(widest);
            for (x, azimuth_weight) in rule.iter().filter(|_| low < high) {
                let angle = self.azimuth + low + (high - low) * x;
                let h = DVec3::new(sin_h * angle.cos(), cos_h, sin_h * angle.sin());
                let cosine = self.wo.dot(h);
                let solid_angle = 4.0 * cosine * sin_h * weight * azimuth_weight * (high - low);
                nodes.push(Node {
                    bin: ring * SECTORS + sector,
                    wi: h * (2.0 * cosine) - self.wo,
                    weight: solid_angle,
                });
            }
        }
    }
}

/// Where the roughness is unequal, the horizon of wi has no closed form.
impl HalfVectorBins {
    /// The half vector, not of unit length, whose scaled form has these angles.
    fn half_vector(&self, polar: f64, azimuth: f64) -> DVec3 {
        let ((sin_m, cos_m), angle) = (polar.sin_cos(), self.azimuth + azimuth);
        DVec3::new(sin_m * angle.cos() * self.stretch, cos_m, sin_m * angle.sin() / self.stretch)
    }

    /// What has the sign of wi.y.
    fn height(&self, polar: f64, azimuth: f64) -> f64 {
        let h = self.half_vector(polar, azimuth);
        2.0 * self.wo.dot(h) * h.y - self.wo.y * h.length_squared()
    }

    /// The nodes of a ring: many where the horizon may cut it, few where it is all above.
    fn add_stretched(&self, nodes: &mut Vec<Node>, ring: usize, limits: [f64; 2], order: usize, rule: &[(f64, f64)]) {
        let whole = limits.iter().all(|&polar| (0..64).all(|i| self.height(polar, PI * f64::from(i) / 32.0) > 0.0));
        let (pieces, steps) = if whole { (1, 2) } else { (6, 12) };
        let width = (limits[1] - limits[0]) / f64::from(pieces);
        let polar_rule = gauss_legendre(order);
        for (piece, (x, weight)) in (0..pieces).flat_map(|piece| polar_rule.iter().map(move |node| (piece, node))) {
            let polar = limits[0] + width * (f64::from(piece) + x);
            for i in 0..SECTORS * steps {
                let step = 2.0 * PI / (SECTORS * steps) as f64;
                let Some([low, high]) = self.above([i as f64 * step - PI, (i + 1) as f64 * step - PI], polar) else {
                    continue;
                };
                for (x, azimuth_weight) in rule {
                    let weight = weight * width * azimuth_weight * (high - low);
                    nodes.extend(self.node(ring * SECTORS + i / steps, polar, low + (high - low) * x, weight));
                }
            }
        }
    }

    /// The part of a range of azimuths in which wi is above its horizon, by bisection where that begins or ends inside.
    fn above(&self, [mut low, mut high]: [f64; 2], polar: f64) -> Option<[f64; 2]> {
        let (above_low, above_high) = (self.height(polar, low) > 0.0, self.height(polar, high) > 0.0);
        if above_low != above_high {
            let (mut above, mut below) = if above_low { (low, high) } else { (high, low) };
            for _ in 0..40 {
                let middle = 0.5 * (above + below);
                *(if self.height(polar, middle) > 0.0 { &mut above } else { &mut below }) = middle;
            }
            *(if above_low { &mut high } else { &mut low }) = above;
        }
        (above_low || above_high).then_some([low, high])
    }

    /// A half vector h = A·m/|A·m| takes |det A|/|A·m|³ of the solid angle of m, and det A = 1.
    fn node(&self, bin: usize, polar: f64, azimuth: f64, weight: f64) -> Option<Node> {
        let h = self.half_vector(polar, azimuth);
        let length = h.length();
        let cosine = self.wo.dot(h) / length;
        let wi = h * (2.0 * cosine / length) - self.wo;
        let weight = 4.0 * cosine * polar.sin() * weight / length.powi(3);
        (wi.y > 0.0).then_some(Node { bin, wi, weight })
    }
}
