//! Cameras. A lens is given by the extras `{"sunfleck": {"lens_radius": metres, "focus_distance": metres}}`.

use glam::{DAffine3, DMat3, DVec3};

use super::Loader;
use super::json::Json;
use crate::scene::{Camera, Projection, SceneResult};

impl Loader<'_> {
    /// Adds a camera at a node. Clipping planes and aspect ratios are ignored: rays need none, and the film has its own.
    pub(super) fn load_camera(&mut self, place: &Json<'_>, node: &Json<'_>, to_world: DAffine3) -> SceneResult<()> {
        let kind = place.require("type")?;
        let projection = match kind.string()? {
            "perspective" => {
                let yfov = place.require("perspective")?.require("yfov")?;
                let yfov_radians = yfov.number()?;
                if !(yfov_radians > 0.0 && yfov_radians < std::f64::consts::PI) {
                    return Err(yfov.fail(format!("a field of view of {yfov_radians} radians is not between 0 and π")));
                }
                Projection::Perspective { yfov_radians }
            }
            "orthographic" => {
                let ymag = place.require("orthographic")?.require("ymag")?;
                // A negative height would turn the picture over; the specification advises against it.
                let half_height = ymag.number()?.abs();
                if half_height == 0.0 {
                    return Err(ymag.fail("the height of an orthographic view cannot be 0"));
                }
                Projection::Orthographic { ymag: half_height }
            }
            other => {
                return Err(kind
                    .fail(format!("\"{other}\" is no camera type"))
                    .hint("use perspective or orthographic"));
            }
        };
        let (lens_radius, focus_distance) = read_lens(place)?;
        if lens_radius > 0.0 && matches!(projection, Projection::Orthographic { .. }) {
            self.warnings.add("orthographic cameras have no lens: lens_radius is ignored", &place.pointer);
        }
        let camera_to_world = upright_frame(to_world)
            .ok_or_else(|| node.fail("a camera is at this node, but its transform is singular: it looks nowhere"))?;
        let named = Some(place.name()).filter(|name| !name.is_empty());
        let name = named.unwrap_or_else(|| node.name());
        self.scene.cameras.push(Camera { name, camera_to_world, projection, lens_radius, focus_distance });
        Ok(())
    }
}

fn read_lens(place: &Json<'_>) -> SceneResult<(f64, f64)> {
    let Some(extras) = place.sunfleck_extras(&["lens_radius", "focus_distance"])? else { return Ok((0.0, 1.0)) };
    let lens_radius = extras.number_in("lens_radius", 0.0, 0.0, f64::MAX)?;
    let Some(focus) = extras.get("focus_distance")? else {
        if lens_radius > 0.0 {
            return Err(extras.fail("\"focus_distance\" is missing: a lens needs one"));
        }
        return Ok((lens_radius, 1.0));
    };
    match focus.number()? {
        distance if distance > 0.0 => Ok((lens_radius, distance)),
        distance => Err(focus.fail(format!("a focus distance of {distance} is not greater than 0"))),
    }
}

/// The node's frame without scale, shear and mirroring: a camera has a place, a direction and an up side.
fn upright_frame(to_world: DAffine3) -> Option<DAffine3> {
    let back = to_world.matrix3.z_axis.try_normalize()?;
    let up: DVec3 = to_world.matrix3.y_axis.try_normalize()?;
    let right = up.cross(back).try_normalize()?;
    Some(DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), to_world.translation))
}
