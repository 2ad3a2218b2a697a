//! The environment: radiance arriving from infinitely far away.

use std::sync::Arc;

/// What a ray that leaves the scene sees.
#[derive(Clone, Debug, Default)]
pub enum Environment {
    /// Black.
    #[default]
    None,
    /// The same radiance from every direction.
    Constant([f32; 3]),
    /// A latitude/longitude image: the top row is north (0, 1, 0), u = atan2(z, x)/2π.
    Image {
        /// File name, for messages.
        name: String,
        /// Width in texels, ≥ 1.
        width: u32,
        /// Height in texels, ≥ 1.
        height: u32,
        /// Linear radiance, row by row from the top; finite and ≥ 0.
        texels: Arc<Vec<[f32; 3]>>,
        /// Factor on all texels, ≥ 0.
        strength: f32,
        /// Rotation about +Y in radians, counter-clockwise seen from above.
        rotation_radians: f64,
    },
}
