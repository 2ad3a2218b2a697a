//! A scene in the worker, and the camera that looks at it.

use crate::prepare::{Kept, Prepared, Reuse};
use crate::render::{Settings, prepare_scene_again};
use crate::scene::load::Decoded;
use crate::scene::{Camera, Scene};
use crate::watch::messages::{CameraEntry, Pose, View};
use crate::{Error, Result};

/// Reads the scene, with the images of earlier calls; called anew for each reload.
pub type LoadScene = Box<dyn Fn(&Decoded) -> std::result::Result<Scene, String> + Send>;

/// A scene and what is made of it for the device.
pub(super) struct Loaded {
    pub(super) scene: Scene,
    pub(super) prepared: Prepared,
}

impl Loaded {
    pub(super) fn new(scene: Scene, settings: &Settings, view: &View, kept: &Kept) -> Result<Self> {
        let prepared = prepare_scene_again(&scene, &camera_of(&scene, view)?, settings, kept)?;
        Ok(Self { scene, prepared })
    }

    pub(super) fn cameras(&self) -> Vec<CameraEntry> {
        let centre = self.scene.bounds().map(|(low, high)| (low + high) / 2.0);
        let entry = |camera: &Camera| CameraEntry { name: camera.name.clone(), pose: pose_of(camera, centre) };
        self.scene.cameras.iter().map(entry).collect()
    }
}

/// Loads the scene again and again, and makes nothing anew of what has not changed.
pub(super) struct Loader {
    load: LoadScene,
    decoded: Decoded,
    kept: Kept,
}

impl Loader {
    pub(super) fn new(load: LoadScene) -> Self {
        Self { load, decoded: Decoded::keeping(), kept: Kept::keeping() }
    }

    /// The scene as its files are now, and what of it was made anew.
    pub(super) fn load(&self, settings: &Settings, view: &View) -> Result<(Loaded, String)> {
        let scene = (self.load)(&self.decoded).map_err(Error::Usage);
        let loaded = scene.and_then(|scene| Loaded::new(scene, settings, view, &self.kept));
        if loaded.is_err() {
            // What is kept still fits the scene that is shown.
            self.decoded.count_anew();
            self.kept.count_anew();
        }
        Ok((loaded?, said(self.decoded.sweep(), self.kept.sweep())))
    }
}

/// For people: how many of the scene's parts were made anew, of how many.
fn said(images: (u32, u32), Reuse { trees, environments, .. }: Reuse) -> String {
    let said = |(made, all): (u32, u32), done: &str, one: &str, many: &str| match (made, all) {
        (_, 0) => None,
        (0, 1) => Some(format!("{one} kept")),
        (0, _) => Some(format!("{many} kept")),
        (_, 1) => Some(format!("{one} {done}")),
        _ => Some(format!("{made} of {all} {many} {done}")),
    };
    let parts = [
        said(images, "decoded", "image", "images"),
        said(environments, "prepared", "environment", "environments"),
        said(trees, "built", "tree", "trees"),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
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
