//! A scene in the worker, and the camera that looks at it.

use crate::prepare::Prepared;
use crate::render::{Settings, prepare_scene};
use crate::scene::{Camera, Scene};
use crate::watch::messages::{CameraEntry, Pose, View};
use crate::{Error, Result};

/// Reads the scene; called anew for each reload.
pub type LoadScene = Box<dyn Fn() -> std::result::Result<Scene, String> + Send>;

/// A scene and what is made of it for the device.
pub(super) struct Loaded {
    pub(super) scene: Scene,
    pub(super) prepared: Prepared,
}

impl Loaded {
    pub(super) fn new(scene: Scene, settings: &Settings, view: &View) -> Result<Self> {
        let prepared = prepare_scene(&scene, &camera_of(&scene, view)?, settings)?;
        Ok(Self { scene, prepared })
    }

    pub(super) fn cameras(&self) -> Vec<CameraEntry> {
        let centre = self.scene.bounds().map(|(low, high)| (low + high) / 2.0);
        let entry = |camera: &Camera| CameraEntry { name: camera.name.clone(), pose: pose_of(camera, centre) };
        self.scene.cameras.iter().map(entry).collect()
    }
}

/// The camera of a view; one that the scene does not have is its first.
pub(super) fn camera_of(scene: &Scene, view: &View) -> Result<Camera> {
    let camera = scene.cameras.get(view.camera).or(scene.cameras.first());
    let mut camera = camera.ok_or_else(|| Error::Usage(format!("{} has no camera", scene.name)))?.clone();
    if let Some(to_world) = view.pose.and_then(|pose| pose.camera_to_world()) {
        camera.camera_to_world = to_world;
    }
    Ok(camera)
}

/// A scene's camera turns around the point on its axis that is nearest to the middle of the scene.
fn pose_of(camera: &Camera, centre: Option<glam::DVec3>) -> Pose {
    let eye = camera.camera_to_world.translation;
    let forward = -camera.camera_to_world.matrix3.z_axis.normalize_or(glam::DVec3::Z);
    let distance = centre.map(|centre| (centre - eye).dot(forward)).filter(|d| *d > 0.0).unwrap_or(1.0);
    Pose {
        eye: eye.to_array(),
        target: (eye + forward * distance).to_array(),
        up: camera.camera_to_world.matrix3.y_axis.to_array(),
    }
}
