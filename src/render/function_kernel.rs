//! Calls single shader functions: a kernel of `shaders/test/` reads numbers, calls the function and writes numbers. It is
//! bound like the path tracer, with the scene's arrays and constants, so that every include works in it.

use std::sync::Arc;

use ash::vk::BufferUsageFlags as Usage;

use super::bake::Bake;
use super::scene_buffers::{SceneBuffers, array_binding, choose_array_form};
use crate::gpu::{
    ArrayForm, BindingResource, Buffer, Dispatch, Gpu, Kernel, KernelDescription, MemoryUse, Submission, TraceBackend,
    shader_compiler,
};
use crate::layout::RenderConstants;
use crate::prepare::Prepared;
use crate::{Error, Result};

/// What to call.
pub struct FunctionCall<'a> {
    /// Shader sources by path.
    pub sources: &'a shader_compiler::Sources,
    /// The kernel's file among them, e.g. `test/fresnel.comp`.
    pub file: &'a str,
    /// Trace back end for kernels that trace.
    pub trace: TraceBackend,
    /// The scene that is bound.
    pub prepared: &'a Prepared,
    /// The render constants (usually those of `prepared` with a camera).
    pub constants: RenderConstants,
    /// Specialisation constants, as in shaders/include/features.glsl; missing ones keep "everything on".
    pub specialization: &'a [(u32, u32)],
    /// What is compiled in of the scene.
    pub bake: &'a Bake,
    /// Further macro definitions.
    pub defines: &'a [(&'a str, String)],
}

impl FunctionCall<'_> {
    /// Runs the kernel once for each of the `lanes` lanes. `inputs` is the whole input buffer, however the kernel divides
    /// it among lanes; the result has `outputs_per_lane` texels a lane.
    ///
    /// # Errors
    /// A kernel that does not compile, and errors of the device.
    pub fn run(&self, gpu: &Arc<Gpu>, inputs: &[[u32; 4]], lanes: u32, outputs_per_lane: u32) -> Result<Vec<[u32; 4]>> {
        let lengths: Vec<usize> = self.prepared.arrays.iter().map(Vec::len).collect();
        let form = choose_array_form(&gpu.info, &lengths)?;
        let buffers = SceneBuffers::upload(gpu, self.prepared, self.trace, form)?;
        let (spirv, baked) = self.bake.apply(self.compile(form.0)?);
        let constants = Buffer::with_data(gpu, "constants", &[self.constants], Usage::UNIFORM_BUFFER)?;
        let input = Buffer::with_data(gpu, "inputs", inputs, Usage::STORAGE_BUFFER)?;
        let count = lanes as usize * outputs_per_lane as usize;
        let output = Buffer::new(gpu, "outputs", 16 * count as u64, Usage::STORAGE_BUFFER, MemoryUse::Readback)?;
        let arrays = buffers.bindings();
        let array_binding = array_binding(&buffers, form.0, &arrays);
        let mut set = vec![
            (0, BindingResource::Uniform(&constants)),
            (1, BindingResource::Storage(&input)),
            (2, BindingResource::Storage(&output)),
            (3, array_binding),
        ];
        set.extend(buffers.acceleration.as_ref().map(|a| (4, BindingResource::AccelerationStructure(a))));
        let mut specialization = vec![(1, form.1), (12, baked.parts)];
        specialization.extend_from_slice(self.specialization);
        let kernel = Kernel::new(
            gpu,
            &KernelDescription {
                name: self.file,
                spirv: &spirv,
                workgroup_size: 64,
                constants: &specialization,
                driver_specializes: false,
                push_constant_bytes: 4,
                sets: &[&set],
            },
        )?;
        let mut submission = Submission::new(gpu, self.file)?;
        let push = lanes.to_le_bytes();
        submission.submit(&[Dispatch::Run { kernel: &kernel, set: 0, push: &push, lanes }])?;
        submission.wait()?;
        Ok(output.read::<[u32; 4]>(count)?.to_vec())
    }

    fn compile(&self, form: ArrayForm) -> Result<Vec<u32>> {
        let mut defines =
            vec![("TRACE_BACKEND", (self.trace as u32).to_string()), ("ARRAY_FORM", (form as u32).to_string())];
        defines.extend(self.defines.iter().map(|(name, value)| (*name, value.clone())));
        shader_compiler::compile(self.sources, self.file, &defines).map_err(|e| Error::Usage(e.to_string()))
    }
}
