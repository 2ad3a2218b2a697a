//! Punctual lights (KHR_lights_punctual). glTF's candela and lux are taken as W/sr and W/m² one to one.

use glam::DVec3;

/// A light without extent, in world space.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    /// Name from the file; may be empty.
    pub name: String,
    /// Shape of its emission.
    pub kind: PunctualKind,
    /// Radiant intensity in W/sr (point, spot), or irradiance in W/m² on a surface facing it (directional); RGB, ≥ 0.
    pub intensity: [f32; 3],
    /// Position (unused by directional lights).
    pub position: DVec3,
    /// Unit direction in which the light travels (unused by point lights).
    pub direction: DVec3,
}

/// The kinds of [`PunctualLight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// Equal intensity in all directions.
    Point,
    /// Full inside the inner cone, smooth to zero at the outer one, as KHR_lights_punctual recommends.
    Spot {
        /// Half angle at which the falloff begins, radians, in [0, outer).
        inner_cone_radians: f64,
        /// Half angle at which the light ends, radians, in (0, π/2].
        outer_cone_radians: f64,
    },
    /// Parallel light from infinitely far away.
    Directional,
}
