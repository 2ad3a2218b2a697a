//! The path-tracing kernel for one scene on one device: built once, run for any seed and range of samples.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;

use super::adaptive::SampleFactors;
use super::bake::BakeReport;
use super::emission_pixels::EmissionPixels;
use super::kernel_build::{
    BindingOverride, ViewBuffers, baked_spirv, build_kernel, check_aovs, effective_max_bounces, scene_constants,
};
use super::kernel_key::KernelKey;
use super::looks::Looks;
use super::run::{Limits, SliceResults};
use super::scene_buffers::{SceneBuffers, choose_array_form};
use super::schedule::Schedule;
use super::slices::{SLICES_IN_FLIGHT, Slice, SliceSizes};
use super::{Progress, ProgressUpdate, Run, RunPlan, SamplerKind, Settings, StopReason};
use crate::film::replicates::ReplicateSums;
use crate::gpu::{Gpu, Kernel, TraceBackend};
use crate::layout::{RenderConstants, SliceConstants};
use crate::prepare::{Prepared, camera_constants};
use crate::scene::Camera;
use crate::{Error, Result};

/// A scene on a device, ready to be rendered.
pub struct PathTracer {
    pub(super) key: KernelKey,
    pub(super) kernel: Kernel,
    pub(super) constants: RenderConstants,
    /// Where rebased space has its zero.
    pub(super) origin: DVec3,
    pub(super) view: ViewBuffers,
    pub(super) slices: Vec<Slice>,
    pub(super) sizes: SliceSizes,
    pub(super) buffers: Arc<SceneBuffers>,
    overrides: BindingOverride,
    pub(super) bake: BakeReport,
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
        let buffers = Arc::new(SceneBuffers::upload(gpu, prepared, trace, form)?);
        let mut tracer = Self::on_buffers(buffers, prepared, camera, settings, overrides)?;
        tracer.upload_seconds = (start.elapsed().as_secs_f64() - tracer.compile_seconds).max(0.0);
        Ok(tracer)
    }

    /// Another tracer of a scene that is on a device: on the same device its arrays are shared, on another they are uploaded
    /// again.
    ///
    /// # Errors
    /// Those of [`PathTracer::new`].
    pub fn beside(
        buffers: &Arc<SceneBuffers>,
        gpu: &Arc<Gpu>,
        prepared: &Prepared,
        camera: &Camera,
        settings: &Settings,
        overrides: BindingOverride,
    ) -> Result<Self> {
        let buffers = if Arc::ptr_eq(gpu, &buffers.gpu) {
            Arc::clone(buffers)
        } else {
            Arc::new(SceneBuffers::upload(gpu, prepared, buffers.trace, buffers.form)?)
        };
        Self::on_buffers(buffers, prepared, camera, settings, overrides)
    }

    /// The scene's arrays on the device.
    pub fn buffers(&self) -> &Arc<SceneBuffers> {
        &self.buffers
    }

    fn on_buffers(
        buffers: Arc<SceneBuffers>,
        prepared: &Prepared,
        camera: &Camera,
        settings: &Settings,
        overrides: BindingOverride,
    ) -> Result<Self> {
        let gpu = &buffers.gpu;
        let emission = EmissionPixels::choose(prepared, camera, settings);
        let constants = scene_constants(prepared, camera, settings, &emission);
        let view = ViewBuffers::new(gpu, &emission)?;
        let slice_atoms = overrides.slice_atoms.unwrap_or_else(|| SliceSizes::largest(gpu.info.kind));
        let mut key = KernelKey::new(prepared, camera, settings, buffers.trace, buffers.form);
        key.emission_rays = emission.rays > 0;
        let mut slices = new_slices(gpu, slice_atoms, &key)?;
        let start = Instant::now();
        let (spirv, bake) = baked_spirv(gpu, prepared, settings, overrides, &mut key)?;
        let kernel = build_kernel(gpu, &key, &spirv, overrides, &buffers, &view, &slices)?;
        slices[0].warm_up(&kernel)?;
        let compile_seconds = start.elapsed().as_secs_f64();
        let sizes = SliceSizes::new(overrides, slices[0].most_atoms());
        Ok(Self {
            key,
            kernel,
            constants,
            origin: prepared.origin,
            view,
            slices,
            sizes,
            buffers,
            overrides,
            bake,
            compile_seconds,
            upload_seconds: 0.0,
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
    /// that was uploaded. On an error the tracer is as it was.
    ///
    /// # Errors
    /// A shader that does not compile, an AOV that the back end cannot give, a lost device.
    pub fn rebuild(&mut self, prepared: &Prepared, camera: &Camera, settings: &Settings) -> Result<()> {
        check_aovs(&settings.aovs, self.buffers.trace)?;
        let start = Instant::now();
        let gpu = &self.buffers.gpu;
        let mut key = self.key_for(prepared, camera, settings);
        let emission = EmissionPixels::choose(prepared, camera, settings);
        key.emission_rays = emission.rays > 0;
        let (spirv, bake) = baked_spirv(gpu, prepared, settings, self.overrides, &mut key)?;
        // Other sums lie in other buffers.
        let mut others = ((key.aovs, key.statistics) != (self.key.aovs, self.key.statistics))
            .then(|| new_slices(gpu, self.slices[0].most_atoms(), &key))
            .transpose()?;
        let slices = others.as_ref().unwrap_or(&self.slices);
        let view = ViewBuffers::new(gpu, &emission)?;
        let kernel = build_kernel(gpu, &key, &spirv, self.overrides, &self.buffers, &view, slices)?;
        others.as_mut().unwrap_or(&mut self.slices)[0].warm_up(&kernel)?;
        (self.key, self.kernel, self.bake, self.view) = (key, kernel, bake, view);
        if let Some(slices) = others {
            self.slices = slices;
        }
        self.forget_sizes();
        self.constants.max_bounces = effective_max_bounces(settings);
        self.constants.emission_rays = emission.rays;
        self.constants.clamp_indirect = settings.clamp_indirect.unwrap_or(0.0);
        self.compile_seconds = start.elapsed().as_secs_f64();
        Ok(())
    }

    /// What slices of another kernel or scene have taken says nothing.
    pub(super) fn forget_sizes(&mut self) {
        self.sizes = SliceSizes::new(self.overrides, self.slices[0].most_atoms());
    }

    /// The key of the kernel that [`PathTracer::rebuild`] would build, but for what it would compile in, and emission rays.
    pub fn key_for(&self, prepared: &Prepared, camera: &Camera, settings: &Settings) -> KernelKey {
        KernelKey::new(prepared, camera, settings, self.buffers.trace, self.buffers.form)
    }

    /// Looks through another camera of the same kind (lens, projection), on a film of another size. Emission rays were for
    /// the pixels of the one before: there are none from then on.
    pub fn look_through(&mut self, camera: &Camera, origin: DVec3, width: u32, height: u32) {
        camera_constants(camera, origin, width, height, &mut self.constants);
        self.constants.emission_rays = 0;
    }

    /// Bytes of device memory in use.
    pub fn gpu_bytes(&self) -> u64 {
        self.buffers.bytes + self.slices.iter().map(Slice::bytes).sum::<u64>() + self.view.bytes()
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
        progress: Progress<'_>,
    ) -> Result<Run> {
        let plan = RunPlan { samples, time, ..RunPlan::default() };
        self.run_plan(seed, &plan, progress)
    }

    /// Renders what the plan says. The image of a run that ends at an error is, bit for bit, that of the same range.
    ///
    /// # Errors
    /// When the device is lost, or the plan asks for an error that the tracer's samples cannot give: those of the Sobol'
    /// sampler are replicates only if its settings had asked for the error too.
    pub fn run_plan(&mut self, seed: u32, plan: &RunPlan, progress: Progress<'_>) -> Result<Run> {
        if plan.estimates_error() && self.key.sampler != SamplerKind::Independent && !self.key.replicates {
            return Err(Error::Usage(String::from("the path tracer was not built to estimate its error")));
        }
        let start = Instant::now();
        let looks = Looks::new(plan.samples.clone(), plan.target_error);
        let mut run = Run::new(&self.constants, plan, &self.key);
        // An open end is no total.
        let mut expected = (plan.samples.end < u32::MAX).then(|| plan.samples.end - plan.samples.start);
        let mut limits = Limits { start, time: plan.time, samples_total: None };
        let mut factors = SampleFactors::default();
        let pixels = run.film.pixels().len();
        if let Some(samples) = plan.pilot {
            limits.samples_total = expected.map(|n| u64::from(n + samples) * pixels as u64);
            factors = self.pilot(&mut run, seed, samples, &limits, progress)?;
        }
        let before = run.paths;
        let per_sample = factors.samples(pixels);
        self.constants.seed = seed;
        let (mut done, mut end) = (plan.samples.start, looks.first_end());
        loop {
            limits.samples_total = expected.map(|n| before + u64::from(n) * per_sample);
            self.run_range(&mut run, done..end, &factors, &limits, progress)?;
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

    /// Renders a range of the image's samples, and adds it to the run.
    pub(super) fn run_range(
        &mut self,
        run: &mut Run,
        samples: Range<u32>,
        factors: &SampleFactors,
        limits: &Limits,
        progress: Progress<'_>,
    ) -> Result<()> {
        self.view.constants.write(&[self.constants])?;
        self.sizes.begin(samples.end - samples.start);
        let mut schedule = Schedule::new(&self.constants, samples);
        let mut in_flight = VecDeque::new();
        let mut free: Vec<usize> = (0..self.slices.len()).collect();
        let mut last_end = Instant::now();
        loop {
            if limits.time.is_some_and(|limit| limits.start.elapsed() >= limit) && !schedule.is_done() {
                run.stop(StopReason::Time);
            }
            while run.stopped_by == StopReason::Samples && !schedule.is_done() {
                let Some(slot) = free.pop() else { break };
                let atoms = schedule.next(self.sizes.next_atoms(), factors);
                let constants = SliceConstants { ray_budget: self.sizes.ray_budget(), ..SliceConstants::default() };
                self.slices[slot].submit(&self.kernel, slot, &atoms, constants)?;
                in_flight.push_back((slot, atoms, schedule.reached()));
            }
            // In the order of submission, so that a pixel's blocks are joined by their index.
            let Some((slot, atoms, reached)) = in_flight.pop_front() else { return Ok(()) };
            let outcome = self.slices[slot].finish(&self.kernel, slot, last_end)?;
            last_end = Instant::now();
            self.sizes.observe(&outcome);
            let (slice, count) = (&self.slices[slot], outcome.constants.atoms);
            let brought = SliceResults {
                atoms: &atoms,
                results: slice.results(count)?,
                aovs: slice.aovs(count)?,
                counters: slice.counters(count)?,
            };
            run.add(&outcome, &brought, self.origin);
            run.samples.end = reached;
            free.push(slot);
            let update = ProgressUpdate {
                samples_done: run.paths,
                samples_total: limits.samples_total,
                elapsed: limits.start.elapsed(),
                time_limit: limits.time,
                run: Some(&*run),
            };
            if progress(&update).is_break() {
                run.stop(StopReason::Interrupted);
            }
        }
    }
}

fn new_slices(gpu: &Arc<Gpu>, atoms: u32, key: &KernelKey) -> Result<Vec<Slice>> {
    (0..SLICES_IN_FLIGHT).map(|_| Slice::new(gpu, atoms, key)).collect()
}
