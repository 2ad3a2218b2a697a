//! Punctual lights (KHR_lights_punctual). `range` is ignored, see the module above.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{DAffine3, DVec3};

use super::Loader;
use super::json::Json;
use crate::scene::{PunctualKind, PunctualLight, SceneResult};

impl Loader<'_> {
    /// Adds the light that a node refers to; one without power is left out.
    pub(super) fn load_light(&mut self, reference: &Json<'_>, node: &Json<'_>, to_world: DAffine3) -> SceneResult<()> {
        let index_place = reference.require("light")?;
        let index = index_place.unsigned()?;
        let lights = match self.document.root().extension("KHR_lights_punctual")? {
            Some(extension) => extension.list("lights")?,
            None => Vec::new(),
        };
        let light = lights.get(index).ok_or_else(|| {
            index_place.fail(format!("index {index} is out of range: the file has {} punctual lights", lights.len()))
        })?;
        let color = light.color("color", [1.0; 3], f64::MAX)?;
        let strength = light.number_in("intensity", 1.0, 0.0, f64::MAX)?;
        let intensity = color.map(|c| (c * strength) as f32);
        if !intensity.iter().all(|i| i.is_finite()) {
            return Err(light.fail("the intensity is too large for a 32-bit float"));
        }
        let kind = read_kind(light)?;
        if intensity == [0.0; 3] {
            return Ok(());
        }
        let direction = match to_world.transform_vector3(DVec3::NEG_Z).try_normalize() {
            Some(direction) => direction,
            None if kind == PunctualKind::Point => DVec3::NEG_Z,
            None => return Err(node.fail("a light is at this node, but its transform is singular: it shines nowhere")),
        };
        let named = Some(light.name()).filter(|name| !name.is_empty());
        let name = named.unwrap_or_else(|| node.name());
        self.scene.lights.push(PunctualLight { name, kind, intensity, position: to_world.translation, direction });
        Ok(())
    }
}

fn read_kind(light: &Json<'_>) -> SceneResult<PunctualKind> {
    let kind = light.require("type")?;
    match kind.string()? {
        "point" => Ok(PunctualKind::Point),
        "directional" => Ok(PunctualKind::Directional),
        "spot" => {
            let spot = light.require("spot")?;
            // A cone of exactly π/2 may have been rounded up on its way through a 32-bit float.
            let outer = spot.number_in("outerConeAngle", FRAC_PI_4, 0.0, FRAC_PI_2 + 1e-6)?.min(FRAC_PI_2);
            let inner = spot.number_in("innerConeAngle", 0.0, 0.0, FRAC_PI_2)?;
            if inner >= outer {
                return Err(
                    spot.fail(format!("the inner cone ({inner} rad) must be smaller than the outer ({outer} rad)"))
                );
            }
            Ok(PunctualKind::Spot { inner_cone_radians: inner, outer_cone_radians: outer })
        }
        other => Err(kind.fail(format!("\"{other}\" is no light type")).hint("use point, spot or directional")),
    }
}
