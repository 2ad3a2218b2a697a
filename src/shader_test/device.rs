//! The device that kernels are tested on, with a scene bound that does not matter.

use std::path::Path;

use glam::DAffine3;

use crate::gpu::shader_compiler::Sources;
use crate::gpu::{DeviceInfo, GpuError};
use crate::layout::RenderConstants;
use crate::prepare::{LightChoice, Prepared, camera_constants};
use crate::render::{
    Bake, DeviceChoice, FunctionCall, FunctionKernel, OpenDevice, Settings, open_device, prepare_scene,
};
use crate::scene::{Camera, Instance, Material, Mesh, Primitive, Projection, Scene, Volume};
use crate::watch::diagnostic::diagnose;
use crate::{Error, Result};

/// Lanes of a dispatch, at most.
pub(super) const MOST_LANES: usize = 1 << 20;
/// Texels that a dispatch reads besides one a lane: the configurations.
const MORE_INPUTS: usize = 1 << 18;
/// Texels that a lane writes, at most, where there are [`MOST_LANES`].
const OUTPUTS_A_LANE: usize = 2;

/// An open device.
pub struct TestDevice {
    open: OpenDevice,
    prepared: Prepared,
    constants: RenderConstants,
}

impl TestDevice {
    /// Opens the device that is asked for.
    ///
    /// # Errors
    /// [`Error::Device`] if there is none.
    pub fn open(device: DeviceChoice) -> Result<Self> {
        let settings = Settings { device, ..Settings::default() };
        let open = open_device(&settings)?;
        let scene = scene_with_all_tables();
        let camera = &scene.cameras[0];
        let prepared = prepare_scene(&scene, camera, &settings)?;
        let mut constants = prepared.constants;
        camera_constants(camera, prepared.origin, settings.width, settings.height, &mut constants);
        Ok(Self { open, prepared, constants })
    }

    /// What it is.
    pub fn info(&self) -> &DeviceInfo {
        &self.open.gpu.info
    }

    /// Compiles a kernel, which messages name by `told`.
    ///
    /// # Errors
    /// [`Error::Input`] with the compiler's messages, each with file, line, column and the line itself; errors of the device.
    pub(super) fn kernel(&self, sources: &Sources, file: &str, told: &Path) -> Result<FunctionKernel> {
        let by_bvh = self.prepared.features.light_choice == LightChoice::Bvh;
        let call = FunctionCall {
            sources,
            file,
            trace: self.open.trace,
            prepared: &self.prepared,
            constants: self.constants,
            specialization: &[(11, by_bvh.into())],
            bake: &Bake::default(),
            defines: &[],
        };
        let kernel = FunctionKernel::new(&self.open.gpu, &call, MOST_LANES + MORE_INPUTS, OUTPUTS_A_LANE * MOST_LANES);
        kernel.map_err(|error| match error {
            GpuError::Shader(error) => {
                let messages: Vec<_> = diagnose(&error, sources).iter().map(ToString::to_string).collect();
                Error::input(told, format!("does not compile:\n{}", messages.join("\n")))
            }
            other => other.into(),
        })
    }
}

/// A triangle that is an anisotropic, rough boundary of a volume: all albedo tables are there, so that every include works.
fn scene_with_all_tables() -> Scene {
    let material = Material {
        roughness: 0.5,
        anisotropy: 0.5,
        transmission: 1.0,
        volume: Some(Volume { attenuation_color: [1.0; 3], attenuation_distance: f32::INFINITY }),
        ..Material::default()
    };
    let triangle = Primitive {
        positions: vec![[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 1.0, -1.0]],
        normals: Some(vec![[0.0, 0.0, 1.0]; 3]),
        tangents: Some(vec![[1.0, 0.0, 0.0, 1.0]; 3]),
        triangles: vec![[0, 1, 2]],
        material: 0,
        ..Primitive::default()
    };
    let camera = Camera {
        name: String::from("camera"),
        camera_to_world: DAffine3::IDENTITY,
        projection: Projection::Perspective { yfov_radians: 1.0 },
        lens_radius: 0.0,
        focus_distance: 1.0,
    };
    let name = String::from("triangle");
    Scene {
        name: name.clone(),
        cameras: vec![camera],
        meshes: vec![Mesh { name: name.clone(), primitives: vec![triangle] }],
        materials: vec![material],
        instances: vec![Instance { mesh: 0, object_to_world: DAffine3::IDENTITY, name }],
        ..Scene::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_scene_has_every_albedo_table() {
        let scene = scene_with_all_tables();
        let prepared = prepare_scene(&scene, &scene.cameras[0], &Settings::default()).unwrap();
        assert!(prepared.constants.ggx_albedo > 0, "that of dielectrics stands before it");
        assert!(prepared.features.anisotropy && prepared.features.volume, "{:?}", prepared.features);
    }
}
