//! Calls single shader functions: a kernel of `shaders/test/` reads numbers, calls the function and writes numbers. It is
//! bound like the path tracer, with the scene's arrays and constants, so that every include works in it.

use std::sync::Arc;

use ash::vk::BufferUsageFlags as Usage;

use super::bake::Bake;
use super::scene_buffers::{SceneBuffers, array_binding, choose_array_form};
use crate::Result;
use crate::gpu::{
    ArrayForm, BindingResource, Buffer, Dispatch, Gpu, GpuError, GpuResult, Kernel, KernelDescription, MemoryUse,
    Submission, TraceBackend, shader_compiler,
};
use crate::layout::{RenderConstants, Texel};
use crate::prepare::Prepared;

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
    pub fn run(&self, gpu: &Arc<Gpu>, inputs: &[Texel], lanes: u32, outputs_per_lane: u32) -> Result<Vec<Texel>> {
        let mut kernel = FunctionKernel::new(gpu, self, inputs.len(), lanes as usize * outputs_per_lane as usize)?;
        Ok(kernel.run(inputs, lanes, outputs_per_lane)?)
    }

    fn compile(&self, form: ArrayForm) -> GpuResult<Vec<u32>> {
        let mut defines =
            vec![("TRACE_BACKEND", (self.trace as u32).to_string()), ("ARRAY_FORM", (form as u32).to_string())];
        defines.extend(self.defines.iter().map(|(name, value)| (*name, value.clone())));
        Ok(shader_compiler::compile(self.sources, self.file, &defines)?)
    }
}

/// A kernel that is compiled and bound, to be called many times.
pub struct FunctionKernel {
    submission: Submission,
    kernel: Kernel,
    input: Buffer,
    output: Buffer,
    // What the kernel is bound to.
    _constants: Buffer,
    _scene: SceneBuffers,
}

impl FunctionKernel {
    /// Compiles the kernel of `call` and binds its scene, for calls with at most `inputs` texels in and `outputs` texels out.
    ///
    /// # Errors
    /// [`GpuError::Shader`] for a kernel that does not compile, and errors of the device.
    pub fn new(gpu: &Arc<Gpu>, call: &FunctionCall<'_>, inputs: usize, outputs: usize) -> GpuResult<Self> {
        let lengths: Vec<usize> = call.prepared.arrays.iter().map(Vec::len).collect();
        let form = choose_array_form(&gpu.info, &lengths)?;
        let scene = SceneBuffers::upload(gpu, call.prepared, call.trace, form)?;
        let (spirv, baked) = call.bake.apply(call.compile(form.0)?);
        let constants = Buffer::with_data(gpu, "constants", &[call.constants], Usage::UNIFORM_BUFFER)?;
        let buffer = |name, texels: usize, memory| {
            Buffer::new(gpu, name, (size_of::<Texel>() * texels) as u64, Usage::STORAGE_BUFFER, memory)
        };
        let input = buffer("inputs", inputs, MemoryUse::Upload)?;
        let output = buffer("outputs", outputs, MemoryUse::Readback)?;
        let arrays = scene.bindings();
        let mut set = vec![
            (0, BindingResource::Uniform(&constants)),
            (1, BindingResource::Storage(&input)),
            (2, BindingResource::Storage(&output)),
            (3, array_binding(&scene, form.0, &arrays)),
        ];
        set.extend(scene.acceleration.as_ref().map(|a| (4, BindingResource::AccelerationStructure(a))));
        let mut specialization = vec![(1, form.1), (12, baked.parts)];
        specialization.extend_from_slice(call.specialization);
        let kernel = Kernel::new(
            gpu,
            &KernelDescription {
                name: call.file,
                spirv: &spirv,
                workgroup_size: 64,
                constants: &specialization,
                driver_specializes: false,
                push_constant_bytes: 4,
                sets: &[&set],
            },
        )?;
        let submission = Submission::new(gpu, call.file)?;
        Ok(Self { submission, kernel, input, output, _constants: constants, _scene: scene })
    }

    /// As [`FunctionCall::run`].
    ///
    /// # Errors
    /// More texels than the kernel was made for, and errors of the device.
    pub fn run(&mut self, inputs: &[Texel], lanes: u32, outputs_per_lane: u32) -> GpuResult<Vec<Texel>> {
        let texels = lanes as usize * outputs_per_lane as usize;
        if (size_of::<Texel>() * texels) as u64 > self.output.size {
            let what = format!("the outputs of {}", self.kernel.name);
            return Err(GpuError::OutOfMemory { what, bytes: (size_of::<Texel>() * texels) as u64 });
        }
        self.input.write(inputs)?;
        let push = lanes.to_le_bytes();
        self.submission.submit(&[Dispatch::Run { kernel: &self.kernel, set: 0, push: &push, lanes }])?;
        self.submission.wait()?;
        Ok(self.output.read::<Texel>(texels)?.to_vec())
    }
}
