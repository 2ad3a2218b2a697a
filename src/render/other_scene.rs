//! Another scene for a kernel that is built: what is saved while a scene is watched seldom changes the code.

use std::sync::Arc;

use glam::DVec3;

use super::bake::BakeReport;
use super::emission_pixels::EmissionPixels;
use super::kernel_build::{BindingOverride, ViewBuffers, baked_spirv, scene_constants, with_sets};
use super::kernel_key::KernelKey;
use super::scene_buffers::{SceneBuffers, choose_array_form};
use super::{PathTracer, Settings};
use crate::Result;
use crate::layout::RenderConstants;
use crate::prepare::Prepared;
use crate::scene::Camera;

/// A scene on the device of a tracer, whose kernel is the one that it takes.
pub struct OtherScene {
    pub(super) buffers: Arc<SceneBuffers>,
    pub(super) view: ViewBuffers,
    pub(super) constants: RenderConstants,
    pub(super) origin: DVec3,
    pub(super) bake: BakeReport,
}

impl OtherScene {
    /// Uploads a scene to where the scene of a tracer is. `None`: it takes another kernel than that with the tracer's `key`.
    ///
    /// # Errors
    /// Those of [`PathTracer::new`].
    pub fn upload(
        key: &KernelKey,
        beside: &SceneBuffers,
        prepared: &Prepared,
        camera: &Camera,
        settings: &Settings,
        overrides: BindingOverride,
    ) -> Result<Option<Self>> {
        let lengths: Vec<usize> = prepared.arrays.iter().map(Vec::len).collect();
        let form = overrides.array_form.map_or_else(|| choose_array_form(&beside.gpu.info, &lengths), Ok)?;
        let emission = EmissionPixels::choose(prepared, camera, settings);
        let mut its_key = KernelKey::new(prepared, camera, settings, beside.trace, form);
        its_key.emission_rays = emission.rays > 0;
        let (_, bake) = baked_spirv(&beside.gpu, prepared, settings, overrides, &mut its_key)?;
        if its_key != *key {
            return Ok(None);
        }
        let buffers = Arc::new(SceneBuffers::upload(&beside.gpu, prepared, beside.trace, form)?);
        let constants = scene_constants(prepared, camera, settings, &emission);
        let view = ViewBuffers::new(&beside.gpu, &emission)?;
        Ok(Some(Self { buffers, view, constants, origin: prepared.origin, bake }))
    }
}

impl PathTracer {
    /// Renders another scene from now on. After an error the tracer is as it was.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn take_scene(&mut self, other: OtherScene) -> Result<()> {
        let kernel = &mut self.kernel;
        with_sets(&self.key, &other.buffers, &other.view, &self.slices, |sets| kernel.rebind(sets))?;
        self.view = other.view;
        self.constants = other.constants;
        self.origin = other.origin;
        self.buffers = other.buffers;
        self.bake = other.bake;
        self.forget_sizes();
        Ok(())
    }
}
