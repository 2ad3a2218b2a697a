//! Directions that lights emit to: a cone of normals, and a cone of light about each of them.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DQuat, DVec3};

/// Normals within `spread` of `axis`, and light within `emission` of a normal, of an intensity that is at most as the
/// cosine of the angle between them where `emission` is π/2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightCone {
    /// Unit.
    pub axis: DVec3,
    /// Radians, 0 to π.
    pub spread: f64,
    /// Radians, 0 to π/2.
    pub emission: f64,
    /// The same light goes to the opposite directions.
    pub two_sided: bool,
}

impl LightCone {
    /// A flat surface.
    pub fn lambertian(normal: DVec3, two_sided: bool) -> Self {
        Self { axis: normal, spread: 0.0, emission: FRAC_PI_2, two_sided }
    }

    /// The same to all directions.
    pub const EVERYWHERE: Self = Self { axis: DVec3::Y, spread: PI, emission: FRAC_PI_2, two_sided: false };

    /// A spot light: the bright inside is its normals' cone (PBR, 4th ed., §12.6.1).
    pub fn spot(direction: DVec3, inner: f64, outer: f64) -> Self {
        Self { axis: direction, spread: inner, emission: (outer - inner).clamp(0.0, FRAC_PI_2), two_sided: false }
    }

    /// The smallest cone about both (Conty Estevez and Kulla 2018, algorithm 1).
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let emission = self.emission.max(other.emission);
        let two_sided = self.two_sided || other.two_sided;
        let (wide, mut narrow) = if self.spread >= other.spread { (self, other) } else { (other, self) };
        // Where both directions count, either axis describes the cone.
        if two_sided && wide.axis.dot(narrow.axis) < 0.0 {
            narrow.axis = -narrow.axis;
        }
        let between = wide.axis.angle_between(narrow.axis);
        if between + narrow.spread <= wide.spread {
            return Self { emission, two_sided, ..wide };
        }
        let spread = 0.5 * (wide.spread + between + narrow.spread);
        let turn = wide.axis.cross(narrow.axis);
        if spread >= PI || turn.length_squared() == 0.0 {
            return Self {
                axis: wide.axis,
                spread: if between > 0.0 { PI } else { spread.min(PI) },
                emission,
                two_sided,
            };
        }
        let axis = (DQuat::from_axis_angle(turn.normalize(), spread - wide.spread) * wide.axis).normalize();
        Self { axis, spread, emission, two_sided }
    }

    /// See [`super::light_bvh::cone_measure`].
    pub(super) fn measure(&self) -> f64 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        sides * super::light_bvh::cone_measure(self.spread, self.emission)
    }

    /// The axis on the octahedron (see [`crate::layout::LightNode::axes`]), and the sine of half the angle by which normals
    /// lie off it as decoded, of 255, rounded up. 2⁻²⁰ stands for the roundings of the shader's decoding.
    pub fn packed_axis(&self) -> (u32, u32) {
        let flat = self.axis / self.axis.abs().element_sum();
        let signed = |x: f64, sign: f64| if sign < 0.0 { -x } else { x };
        let (x, y) = if flat.z >= 0.0 {
            (flat.x, flat.y)
        } else {
            (signed(1.0 - flat.y.abs(), flat.x), signed(1.0 - flat.x.abs(), flat.y))
        };
        let [x, y] = [x, y].map(|v| (v * 32767.0).round() as i16);
        let off = unpacked_axis(x, y).angle_between(self.axis) + 1.0 / 1_048_576.0;
        let spread = ((0.5 * (self.spread + off).min(PI)).sin() * 255.0).ceil() as u32;
        (u32::from(x as u16) | u32::from(y as u16) << 16, spread)
    }
}

/// The axis that is stored as x and y.
pub fn unpacked_axis(x: i16, y: i16) -> DVec3 {
    let [x, y] = [x, y].map(|v| f64::from(v) / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let folded = |v: f64| if v < 0.0 { v + fold } else { v - fold };
    DVec3::new(folded(x), folded(y), z).normalize()
}
