//! From a kernel's key to a kernel: the shader that fits, with what of the scene is compiled in.

use std::sync::Arc;
use std::time::Duration;

use ash::vk::BufferUsageFlags as Usage;

use super::bake::{Bake, BakeReport};
use super::emission_pixels::EmissionPixels;
use super::kernel_key::KernelKey;
use super::scene_buffers::{SceneBuffers, array_binding};
use super::slices::Slice;
use super::{Integrator, Settings};
use crate::film::aov::Aov;
use crate::gpu::{
    ArrayForm, BindingResource, Buffer, Gpu, Kernel, KernelDescription, MemoryUse, TraceBackend, embedded,
    shader_compiler,
};
use crate::layout::{RenderConstants, SliceConstants};
use crate::prepare::{Prepared, camera_constants};
use crate::scene::Camera;
use crate::{Error, Result};

/// How a [`super::PathTracer`] is bound, where the device's own choice is not wanted (tests try every form).
#[derive(Clone, Copy, Debug, Default)]
pub struct BindingOverride {
    /// Form and log2 of the texels of a chunk.
    pub array_form: Option<(ArrayForm, u32)>,
    /// Lanes of a workgroup.
    pub workgroup_size: Option<u32>,
    /// Atoms of every slice.
    pub slice_atoms: Option<u32>,
    /// Rays of an atom that a lane may trace in one dispatch.
    pub ray_budget: Option<u32>,
    /// Time a slice should take, where another than the usual is wanted.
    pub slice_time: Option<Duration>,
    /// The driver puts in the specialisation constants, not [`crate::gpu::specialize`].
    pub driver_specializes: bool,
}

/// A driver does not say what its ray queries visit.
pub(super) fn check_aovs(aovs: &[Aov], trace: TraceBackend) -> Result<()> {
    if aovs.contains(&Aov::Cost) && trace == TraceBackend::RayQuery {
        return Err(Error::Usage(String::from(
            "--aov cost: nobody can tell what ray queries visit; add --trace bvh, or leave cost out",
        )));
    }
    Ok(())
}

/// An integrator that adds nothing behind the first scattering events need not look there.
pub(super) fn effective_max_bounces(settings: &Settings) -> u32 {
    let needed = match settings.integrator {
        Integrator::Emission => 0,
        Integrator::Direct => 1,
        Integrator::Path | Integrator::Indirect => u32::MAX,
    };
    settings.max_bounces.unwrap_or(u32::MAX).min(needed)
}

/// The constants of a scene, a camera and settings; seed and samples come later.
pub(super) fn scene_constants(
    prepared: &Prepared,
    camera: &Camera,
    settings: &Settings,
    emission: &EmissionPixels,
) -> RenderConstants {
    let mut constants = prepared.constants;
    camera_constants(camera, prepared.origin, settings.width, settings.height, &mut constants);
    constants.max_bounces = effective_max_bounces(settings);
    constants.clamp_indirect = settings.clamp_indirect.unwrap_or(0.0);
    constants.emission_rays = emission.rays;
    constants
}

/// The kernel with what of the scene is to be compiled in; the key says so from then on.
pub(super) fn baked_spirv(
    gpu: &Gpu,
    prepared: &Prepared,
    settings: &Settings,
    overrides: BindingOverride,
    key: &mut KernelKey,
) -> Result<(Vec<u32>, BakeReport)> {
    let bake = Bake::choose(prepared, gpu.info.kind, key.trace, settings.bake && !overrides.driver_specializes);
    let (spirv, baked) = bake.apply(kernel_spirv(key, settings)?);
    key.baked = baked;
    Ok((spirv, bake.report(baked)))
}

pub(super) fn build_kernel(
    gpu: &Arc<Gpu>,
    key: &KernelKey,
    spirv: &[u32],
    overrides: BindingOverride,
    buffers: &SceneBuffers,
    view: &ViewBuffers,
    slices: &[Slice],
) -> Result<Kernel> {
    let workgroup_size = overrides.workgroup_size.unwrap_or(64).min(gpu.info.limits.workgroup_invocations);
    let kernel = with_sets(key, buffers, view, slices, |sets| {
        Kernel::new(
            gpu,
            &KernelDescription {
                name: "path_trace",
                spirv,
                workgroup_size,
                constants: &key.specialization(),
                driver_specializes: overrides.driver_specializes,
                push_constant_bytes: u32::try_from(size_of::<SliceConstants>()).unwrap_or(0),
                sets,
            },
        )
    });
    Ok(kernel?)
}

/// What depends on the camera and the film.
pub(super) struct ViewBuffers {
    /// [`RenderConstants`].
    pub(super) constants: Buffer,
    /// A bit a pixel, if the kernel has emission rays.
    pub(super) emission_pixels: Option<Buffer>,
}

impl ViewBuffers {
    pub(super) fn new(gpu: &Arc<Gpu>, emission: &EmissionPixels) -> Result<Self> {
        let bytes = size_of::<RenderConstants>() as u64;
        Ok(Self {
            constants: Buffer::new(gpu, "render constants", bytes, Usage::UNIFORM_BUFFER, MemoryUse::Upload)?,
            emission_pixels: emission.upload(gpu)?,
        })
    }

    pub(super) fn bytes(&self) -> u64 {
        self.constants.size + self.emission_pixels.as_ref().map_or(0, |pixels| pixels.size)
    }
}

/// Does something with what is bound: a set for each slice.
pub(super) fn with_sets<T>(
    key: &KernelKey,
    buffers: &SceneBuffers,
    view: &ViewBuffers,
    slices: &[Slice],
    work: impl FnOnce(&[&[(u32, BindingResource<'_>)]]) -> T,
) -> T {
    let arrays = buffers.bindings();
    let array_binding = array_binding(buffers, key.array_form, &arrays);
    let sets: Vec<Vec<(u32, BindingResource<'_>)>> = slices
        .iter()
        .map(|slice| {
            // What the kernel does not keep it does not declare, unless the driver specialises it: then it does not use it.
            let mut set = vec![
                (0, BindingResource::Uniform(&view.constants)),
                (1, BindingResource::Storage(&slice.results)),
                (2, BindingResource::Storage(&slice.lane_states)),
                (3, array_binding),
            ];
            set.extend(buffers.acceleration.as_ref().map(|a| (4, BindingResource::AccelerationStructure(a))));
            set.push((5, BindingResource::Storage(slice.aovs.as_ref().unwrap_or(&slice.results))));
            set.push((6, BindingResource::Storage(slice.counters.as_ref().unwrap_or(&slice.results))));
            set.push((7, BindingResource::Storage(&slice.queue)));
            set.push((8, BindingResource::Storage(view.emission_pixels.as_ref().unwrap_or(&slice.results))));
            set.push((9, BindingResource::Storage(&slice.atoms)));
            set
        })
        .collect();
    let sets: Vec<&[(u32, BindingResource<'_>)]> = sets.iter().map(Vec::as_slice).collect();
    work(&sets)
}

/// What the shader loop has compiled, else the embedded variant, or one compiled from `--shaders`.
fn kernel_spirv(key: &KernelKey, settings: &Settings) -> Result<Vec<u32>> {
    if let Some(spirv) = &settings.kernel_spirv {
        return Ok(spirv.to_vec());
    }
    let Some(folder) = &settings.shaders_dir else {
        let bytes = embedded::PATH_TRACE[key.trace as usize][key.array_form as usize];
        return Ok(bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect());
    };
    let sources = shader_compiler::read_sources(folder).map_err(|e| Error::io(folder, "read the shader folder", e))?;
    let defines =
        [("TRACE_BACKEND", (key.trace as u32).to_string()), ("ARRAY_FORM", (key.array_form as u32).to_string())];
    shader_compiler::compile(&sources, "path_trace.comp", &defines).map_err(|e| Error::input(folder, e.to_string()))
}
