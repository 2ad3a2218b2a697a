//! A scene's camera as the shader's constants.

use glam::DVec3;

use crate::layout::{PROJECTION_ORTHOGRAPHIC, PROJECTION_PERSPECTIVE, RenderConstants};
use crate::scene::{Camera, Projection};

/// Fills the camera and film size of `constants`. `origin` is where the rebased space has its zero
/// ([`super::Prepared::origin`]). The axes are made orthonormal, so scale and shear of the camera's node do not matter;
/// a mirrored node mirrors the picture.
pub fn camera_constants(camera: &Camera, origin: DVec3, width: u32, height: u32, constants: &mut RenderConstants) {
    let [right, up, forward] = axes(camera);
    let aspect = f64::from(width) / f64::from(height);
    let (half_height, projection) = match camera.projection {
        Projection::Perspective { yfov_radians } => ((0.5 * yfov_radians).tan(), PROJECTION_PERSPECTIVE),
        Projection::Orthographic { ymag } => (ymag, PROJECTION_ORTHOGRAPHIC),
    };
    constants.camera_origin = (camera.camera_to_world.translation - origin).as_vec3().into();
    constants.camera_right = (right * half_height * aspect).as_vec3().into();
    constants.camera_up = (up * half_height).as_vec3().into();
    constants.camera_forward = forward.as_vec3().into();
    constants.lens_radius = camera.lens_radius as f32;
    constants.focus_distance = camera.focus_distance as f32;
    constants.projection = projection;
    constants.width = width;
    constants.height = height;
}

/// Right, up and forward: the viewing direction is kept, right is made orthogonal to it, up to both.
fn axes(camera: &Camera) -> [DVec3; 3] {
    let matrix = camera.camera_to_world.matrix3;
    let forward = (-matrix.z_axis).normalize_or(DVec3::NEG_Z);
    let right = matrix.x_axis.normalize_or_zero();
    let right = (right - forward * right.dot(forward)).try_normalize().unwrap_or(forward.any_orthonormal_vector());
    let up = right.cross(forward);
    [right, if up.dot(matrix.y_axis) < 0.0 { -up } else { up }, forward]
}
