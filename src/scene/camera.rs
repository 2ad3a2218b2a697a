//! Cameras.

use glam::DAffine3;

/// A camera. It looks down its local −Z with +Y up; film rows run downwards.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name from the file; may be empty.
    pub name: String,
    /// Camera space to world space.
    pub camera_to_world: DAffine3,
    /// How directions or origins spread over the film.
    pub projection: Projection,
    /// Radius of the thin lens in metres; 0 is a pinhole. Perspective only.
    pub lens_radius: f64,
    /// Distance of the plane in focus along −Z, in metres; used when `lens_radius > 0`.
    pub focus_distance: f64,
}

/// The projection of a [`Camera`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical field of view in radians, in (0, π). The horizontal one follows from the film's aspect ratio.
    Perspective {
        /// Vertical field of view, radians.
        yfov_radians: f64,
    },
    /// Half height of the view in metres; the half width follows from the film's aspect ratio.
    Orthographic {
        /// Half height of the film in world units.
        ymag: f64,
    },
}
