//! What a scene lacks and needs to be rendered: a camera that frames it, and light.

use std::f64::consts::{FRAC_PI_4, FRAC_PI_8};

use glam::{DAffine3, DMat3, DVec3};

use super::{Bsdf, Camera, Environment, Material, Projection, Scene};

/// From the scene's centre to the added camera: a three-quarter view from slightly above.
const VIEW_DIRECTION: DVec3 = DVec3::new(0.55, 0.35, 1.0);

impl Scene {
    /// The corners of the axis-aligned box around all instances in world space, (minimum, maximum); `None` without
    /// geometry. Exact: every vertex is transformed in f64.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut bounds: Option<(DVec3, DVec3)> = None;
        for instance in &self.instances {
            let Some(mesh) = self.meshes.get(instance.mesh) else { continue };
            for primitive in &mesh.primitives {
                for &position in &primitive.positions {
                    let point = instance.object_to_world.transform_point3(DVec3::from(position.map(f64::from)));
                    let (low, high) = bounds.unwrap_or((point, point));
                    bounds = Some((low.min(point), high.max(point)));
                }
            }
        }
        bounds
    }

    /// The materials that some instance shows.
    pub fn materials_in_use(&self) -> impl Iterator<Item = &Material> {
        let mut used = vec![false; self.materials.len()];
        for mesh in self.instances.iter().filter_map(|instance| self.meshes.get(instance.mesh)) {
            for primitive in mesh.primitives.iter().filter(|primitive| !primitive.triangles.is_empty()) {
                if let Some(flag) = used.get_mut(primitive.material) {
                    *flag = true;
                }
            }
        }
        self.materials.iter().zip(used).filter_map(|(material, used)| used.then_some(material))
    }

    /// Adds a camera that frames the scene if there is none, and says so in [`Scene::notes`]. The bounding sphere fits
    /// the film's height, so it fits every film that is at least as wide as high.
    pub fn frame_if_no_camera(&mut self) {
        if !self.cameras.is_empty() {
            return;
        }
        let (low, high) = self.bounds().unwrap_or((-DVec3::ONE, DVec3::ONE));
        let centre = 0.5 * (low + high);
        let radius = Some(0.5 * (high - low).length()).filter(|&radius| radius > 0.0).unwrap_or(1.0);
        let distance = radius / FRAC_PI_8.sin();
        let back = VIEW_DIRECTION.normalize();
        self.cameras.push(Camera {
            name: String::from("framed"),
            camera_to_world: look_along(centre + distance * back, back),
            projection: Projection::Perspective { yfov_radians: FRAC_PI_4 },
            lens_radius: 0.0,
            focus_distance: distance,
        });
        self.notes.push(String::from(
            "the scene has no camera: one that frames it was added (45° high, from the front right)",
        ));
    }

    /// Adds a constant white environment if nothing in the scene is there to light it, and says so in
    /// [`Scene::notes`]. An emission texture does not count: it paints glowing details on an object (the dial of a
    /// watch) and would leave the object itself black. A scene of unlit materials alone is left as it is: they show
    /// their colours without light.
    pub fn light_if_dark(&mut self) {
        let environment = !matches!(self.environment, Environment::None);
        let lamp = |material: &Material| material.is_emissive() && material.emission_texture.is_none();
        let emitting = self.materials_in_use().any(lamp);
        let shaded = self.materials_in_use().any(|material| material.bsdf != Bsdf::Unlit);
        let unlit = !shaded && self.materials_in_use().next().is_some();
        if environment || emitting || unlit || !self.lights.is_empty() {
            return;
        }
        self.environment = Environment::Constant([1.0; 3]);
        let glow = self.materials_in_use().any(Material::is_emissive);
        let why = if glow { "no light but emission textures" } else { "no light" };
        self.notes.push(format!(
            "the scene has {why}: a white environment of radiance 1 was added (--env-strength changes it, 0 removes it)"
        ));
    }
}

/// Camera space to world space for a camera at `origin` whose +Z axis is the unit vector `back`, upright towards +Y.
fn look_along(origin: DVec3, back: DVec3) -> DAffine3 {
    let right = DVec3::Y.cross(back).normalize();
    DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), origin)
}
