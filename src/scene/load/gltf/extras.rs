//! The environment, by a scene's extras:
//! `{"sunfleck": {"environment": {"color": [r, g, b]}}}` or
//! `{"sunfleck": {"environment": {"file": "x.hdr", "strength": 1, "rotation_degrees": 0}}}`.

use super::Loader;
use super::buffer::file_of_uri;
use super::json::Json;
use crate::scene::{Environment, SceneResult};

impl Loader<'_> {
    /// Reads the extras of the scene that is shown.
    pub(super) fn load_scene_extras(&mut self, scene: &Json<'_>) -> SceneResult<()> {
        let Some(extras) = scene.sunfleck_extras(&["environment"])? else { return Ok(()) };
        let Some(place) = extras.get("environment")? else { return Ok(()) };
        const KNOWN: &[&str] = &["color", "file", "strength", "rotation_degrees"];
        if let Some(key) = place.keys()?.find(|key| !KNOWN.contains(&key.as_str())) {
            return Err(place.fail(format!("\"{key}\" is not known")).hint(format!("known are {}", KNOWN.join(", "))));
        }
        let strength = place.number_in("strength", 1.0, 0.0, f64::from(f32::MAX))?;
        self.scene.environment = match (place.get("color")?, place.get("file")?) {
            (Some(_), None) => {
                let color = place.color("color", [0.0; 3], f64::from(f32::MAX))?;
                let radiance = color.map(|c| (c * strength) as f32);
                if !radiance.iter().all(|c| c.is_finite()) {
                    return Err(place.fail("the radiance is too large for a 32-bit float"));
                }
                Environment::Constant(radiance)
            }
            (None, Some(file)) => {
                let rotation_degrees = place.number_or("rotation_degrees", 0.0)?;
                let path = file_of_uri(&file)?
                    .ok_or_else(|| file.fail("an environment cannot be a data URI").hint("name a file"))?;
                self.decoded
                    .environment(&path, strength as f32, rotation_degrees)
                    .map_err(|error| file.fail(error.to_string()))?
            }
            _ => return Err(place.fail("an environment needs either \"color\" or \"file\"")),
        };
        Ok(())
    }
}
