//! The path-tracing kernel for one scene on one device: built once, run for any seed and range of samples.

use std::collections::VecDeque;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk::BufferUsageFlags as Usage;
use glam::DVec3;

use super::bake::{Bake, BakeReport};
use super::kernel_key::KernelKey;
use super::looks::Looks;
use super::run::SliceResults;
use super::scene_buffers::{SceneBuffers, array_binding, choose_array_form};
use super::schedule::Schedule;
use super::slices::{SLICES_IN_FLIGHT, Slice, SliceSizes};
use super::{Integrator, ProgressUpdate, Run, RunPlan, SamplerKind, Settings, StopReason};
use crate::film::aov::Aov;
use crate::film::replicates::ReplicateSums;
use crate::gpu::{
    ArrayForm, BindingResource, Buffer, Gpu, Kernel, KernelDescription, MemoryUse, TraceBackend, embedded,
    shader_compiler,
};
use crate::layout::{RenderConstants, SliceConstants};
use crate::prepare::{Prepared, camera_constants};
use crate::scene::Camera;
use crate::{Error, Result};

/// How a [`PathTracer`] is bound, where the device's own choice is not wanted (tests try every form).
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
    /// The driver puts in the specialisation constants, not [`crate::gpu::specialize`].
    pub driver_specializes: bool,
}

/// A scene on a device, ready to be rendered.
pub struct PathTracer {
    key: KernelKey,
    kernel: Kernel,
    constants: RenderConstants,
    /// Where rebased space has its zero.
    origin: DVec3,
    constants_buffer: Buffer,
    slices: Vec<Slice>,
    buffers: SceneBuffers,
    overrides: BindingOverride,
    bake: BakeReport,
    /// Seconds that compiling and uploading took.
    pub compile_seconds: f64,
    /// See `compile_seconds`.
    pub upload_seconds: f64,
}

impl PathTracer {
    /// Uploads the scene and compiles its kernel.
    ///
    /// # Errors
    /// Out of memory, a shader that does not compile, a limit of the device that the scene does not fit; an AOV that the
    /// back end cannot give.
    pub fn new(
        gpu: &Arc<Gpu>,
        trace: TraceBackend,
        prepared: &Prepared,
        camera: &Camera,
        settings: &Settings,
        overrides: BindingOverride,
    ) -> Result<Self> {
        check_aovs(&settings.aovs, trace)?;
        let start = Instant::now();
        let lengths: Vec<usize> = prepared.arrays.iter().map(Vec::len).collect();
        let form = match overrides.array_form {
            Some(form) => form,
            None => choose_array_form(&gpu.info, &lengths)?,
        };
        let buffers = SceneBuffers::upload(gpu, prepared, trace, form)?;
        let mut constants = prepared.constants;
        camera_constants(camera, prepared.origin, settings.width, settings.height, &mut constants);
        constants.max_bounces = effective_max_bounces(settings);
        constants.clamp_indirect = settings.clamp_indirect.unwrap_or(0.0);
        let constants_buffer = Buffer::new(
            gpu,
            "render constants",
            size_of::<RenderConstants>() as u64,
            Usage::UNIFORM_BUFFER,
            MemoryUse::Upload,
        )?;
        let slice_atoms = overrides.slice_atoms.unwrap_or_else(|| SliceSizes::largest(gpu.info.kind));
        let mut key = KernelKey::new(prepared, camera, settings, trace, form);
        let slices: Result<Vec<_>> = (0..SLICES_IN_FLIGHT).map(|_| Slice::new(gpu, slice_atoms, &key)).collect();
        let mut slices = slices?;
        let upload_seconds = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let (spirv, bake) = baked_spirv(gpu, prepared, settings, overrides, &mut key)?;
        let kernel = build_kernel(gpu, &key, &spirv, overrides, &buffers, &constants_buffer, &slices)?;
        slices[0].warm_up(&kernel)?;
        let compile_seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            key,
            kernel,
            constants,
            origin: prepared.origin,
            constants_buffer,
            slices,
            buffers,
            overrides,
            bake,
            compile_seconds,
            upload_seconds,
        })
    }

    /// What the kernel was built with.
    pub fn key(&self) -> &KernelKey {
        &self.key
    }

    /// What of the scene is compiled in.
    pub fn bake_report(&self) -> &BakeReport {
        &self.bake
    }

    /// Builds the kernel anew, for other settings or shaders, and keeps the scene on the device. `prepared` is the scene
    /// that was uploaded; AOVs and statistics stay those that it was made for. On an error the tracer is as it was.
    ///
    /// # Errors
    /// A shader that does not compile, a lost device.
    pub fn rebuild(&mut self, gpu: &Arc<Gpu>, prepared: &Prepared, camera: &Camera, settings: &Settings) -> Result<()> {
        let start = Instant::now();
        let form = (self.key.array_form, self.key.chunk_shift);
        let mut key = KernelKey::new(prepared, camera, settings, self.key.trace, form);
        (key.aovs, key.statistics) = (self.key.aovs, self.key.statistics);
        let (spirv, bake) = baked_spirv(gpu, prepared, settings, self.overrides, &mut key)?;
        let kernel =
            build_kernel(gpu, &key, &spirv, self.overrides, &self.buffers, &self.constants_buffer, &self.slices)?;
        self.slices[0].warm_up(&kernel)?;
        (self.key, self.kernel, self.bake) = (key, kernel, bake);
        self.constants.max_bounces = effective_max_bounces(settings);
        self.constants.clamp_indirect = settings.clamp_indirect.unwrap_or(0.0);
        self.compile_seconds = start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Looks through another camera of the same kind (lens, projection), on a film of another size.
    pub fn look_through(&mut self, camera: &Camera, origin: DVec3, width: u32, height: u32) {
        camera_constants(camera, origin, width, height, &mut self.constants);
    }

    /// Bytes of device memory in use.
    pub fn gpu_bytes(&self) -> u64 {
        self.buffers.bytes + self.slices.iter().map(Slice::bytes).sum::<u64>() + self.constants_buffer.size
    }

    /// Renders a range of sample indices of every pixel.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn run(
        &mut self,
        seed: u32,
        samples: Range<u32>,
        time: Option<Duration>,
        progress: &mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>,
    ) -> Result<Run> {
        self.run_plan(seed, &RunPlan { samples, time, target_error: None, estimate: false }, progress)
    }

    /// Renders what the plan says. The image of a run that ends at an error is, bit for bit, that of the same range.
    ///
    /// # Errors
    /// When the device is lost, or the plan asks for an error that the tracer's samples cannot give: those of the Sobol'
    /// sampler are replicates only if its settings had asked for the error too.
    pub fn run_plan(
        &mut self,
        seed: u32,
        plan: &RunPlan,
        progress: &mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>,
    ) -> Result<Run> {
        if plan.estimates_error() && self.key.sampler != SamplerKind::Independent && !self.key.replicates {
            return Err(Error::Usage(String::from("the path tracer was not built to estimate its error")));
        }
        self.constants.seed = seed;
        let looks = Looks::new(plan.samples.clone(), plan.target_error);
        let mut sizes = SliceSizes::new(self.overrides, self.slices[0].atoms());
        let mut run = Run::new(&self.constants, plan, &self.key);
        // An open end is no total.
        let mut expected = (plan.samples.end < u32::MAX).then(|| plan.samples.end - plan.samples.start);
        let (start, mut done, mut end) = (Instant::now(), plan.samples.start, looks.first_end());
        loop {
            self.constants.first_sample = done;
            self.constants.end_sample = end;
            let limits = Limits { start, time: plan.time, samples_total: expected.map(|n| self.total_samples(n)) };
            self.run_range(&mut run, &mut sizes, &limits, progress)?;
            if run.stopped_by != StopReason::Samples || plan.target_error.is_none() {
                break;
            }
            let error = run.replicates.as_ref().and_then(ReplicateSums::estimate).map(|estimate| estimate.error);
            if error.is_some_and(|error| looks.is_reached(error)) {
                run.stop(StopReason::TargetError);
            }
            if run.stopped_by != StopReason::Samples || end == plan.samples.end {
                break;
            }
            expected = error.and_then(|error| looks.expected_samples(end, error));
            (done, end) = (end, looks.next_end(end, error));
        }
        run.seconds = start.elapsed().as_secs_f64();
        Ok(run)
    }

    /// Renders the range of samples that stands in the constants, and adds it to the run.
    fn run_range(
        &mut self,
        run: &mut Run,
        sizes: &mut SliceSizes,
        limits: &Limits,
        progress: &mut dyn FnMut(&ProgressUpdate) -> ControlFlow<()>,
    ) -> Result<()> {
        self.constants_buffer.write(&[self.constants])?;
        let mut schedule = Schedule::new(&self.constants);
        let mut in_flight = VecDeque::new();
        let mut free: Vec<usize> = (0..self.slices.len()).collect();
        let mut last_end = Instant::now();
        loop {
            if limits.time.is_some_and(|limit| limits.start.elapsed() >= limit) && !schedule.is_done() {
                run.stop(StopReason::Time);
            }
            while run.stopped_by == StopReason::Samples && !schedule.is_done() {
                let Some(slot) = free.pop() else { break };
                let constants = schedule.next(sizes.next_atoms(), self.slices[slot].lanes(), sizes.ray_budget());
                self.slices[slot].submit(&self.kernel, slot, constants)?;
                in_flight.push_back(slot);
            }
            // In the order of submission, so that a pixel's blocks are joined by their index.
            let Some(slot) = in_flight.pop_front() else { return Ok(()) };
            let outcome = self.slices[slot].finish(&self.kernel, slot, last_end)?;
            last_end = Instant::now();
            sizes.observe(&outcome);
            let (slice, atoms) = (&self.slices[slot], outcome.constants.atoms);
            let brought = SliceResults {
                results: slice.results(atoms)?,
                aovs: slice.aovs(atoms)?,
                counters: slice.counters(atoms)?,
            };
            run.add(&self.constants, &outcome, &brought, self.origin);
            free.push(slot);
            let update = ProgressUpdate {
                samples_done: run.paths,
                samples_total: limits.samples_total,
                elapsed: limits.start.elapsed(),
                time_limit: limits.time,
            };
            if progress(&update).is_break() {
                run.stop(StopReason::Interrupted);
            }
        }
    }

    fn total_samples(&self, per_pixel: u32) -> u64 {
        u64::from(per_pixel) * u64::from(self.constants.width) * u64::from(self.constants.height)
    }
}

/// What ends a range before its samples do, and what its progress is measured by.
struct Limits {
    start: Instant,
    time: Option<Duration>,
    samples_total: Option<u64>,
}

/// A driver does not say what its ray queries visit.
fn check_aovs(aovs: &[Aov], trace: TraceBackend) -> Result<()> {
    if aovs.contains(&Aov::Cost) && trace == TraceBackend::RayQuery {
        return Err(Error::Usage(String::from(
            "--aov cost: nobody can tell what ray queries visit; add --trace bvh, or leave cost out",
        )));
    }
    Ok(())
}

/// An integrator that adds nothing behind the first scattering events need not look there.
fn effective_max_bounces(settings: &Settings) -> u32 {
    let needed = match settings.integrator {
        Integrator::Emission => 0,
        Integrator::Direct => 1,
        Integrator::Path | Integrator::Indirect => u32::MAX,
    };
    settings.max_bounces.unwrap_or(u32::MAX).min(needed)
}

/// The kernel with what of the scene is to be compiled in; the key says so from then on.
fn baked_spirv(
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

fn build_kernel(
    gpu: &Arc<Gpu>,
    key: &KernelKey,
    spirv: &[u32],
    overrides: BindingOverride,
    buffers: &SceneBuffers,
    constants: &Buffer,
    slices: &[Slice],
) -> Result<Kernel> {
    let arrays = buffers.bindings();
    let array_binding = array_binding(buffers, key.array_form, &arrays);
    let sets: Vec<Vec<(u32, BindingResource<'_>)>> = slices
        .iter()
        .map(|slice| {
            // What the kernel does not keep it does not declare, unless the driver specialises it: then it does not use it.
            let mut set = vec![
                (0, BindingResource::Uniform(constants)),
                (1, BindingResource::Storage(&slice.results)),
                (2, BindingResource::Storage(&slice.lane_states)),
                (3, array_binding),
            ];
            set.extend(buffers.acceleration.as_ref().map(|a| (4, BindingResource::AccelerationStructure(a))));
            set.push((5, BindingResource::Storage(slice.aovs.as_ref().unwrap_or(&slice.results))));
            set.push((6, BindingResource::Storage(slice.counters.as_ref().unwrap_or(&slice.results))));
            set.push((7, BindingResource::Storage(&slice.queue)));
            set
        })
        .collect();
    let sets: Vec<&[(u32, BindingResource<'_>)]> = sets.iter().map(Vec::as_slice).collect();
    let workgroup_size = overrides.workgroup_size.unwrap_or(64).min(gpu.info.limits.workgroup_invocations);
    Ok(Kernel::new(
        gpu,
        &KernelDescription {
            name: "path_trace",
            spirv,
            workgroup_size,
            constants: &key.specialization(),
            driver_specializes: overrides.driver_specializes,
            push_constant_bytes: u32::try_from(size_of::<SliceConstants>()).unwrap_or(0),
            sets: &sets,
        },
    )?)
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
