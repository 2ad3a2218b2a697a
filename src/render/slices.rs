//! Slices: dispatches short enough that no driver's watchdog fires and an interrupt is answered at once. The first is
//! tiny, growth is at most twofold, two are in flight. The lanes take a slice's atoms one after the other, so that none waits
//! for another's while there are more. A lane that has used up its ray budget is resumed.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk::BufferUsageFlags as Usage;

use super::kernel_build::BindingOverride;
use super::kernel_key::KernelKey;
use crate::Result;
use crate::gpu::{Buffer, DeviceKind, Dispatch, Gpu, Kernel, MemoryUse, Submission};
use crate::layout::{
    AovSums, Atom, BLOCK_SAMPLES, BlockResult, DEBUG_RECORDS, LANE_STATE_BYTES, RayCounters, SliceConstants, SliceQueue,
};

/// Slices that are submitted before the oldest is read.
pub(super) const SLICES_IN_FLIGHT: usize = 2;
/// Time a slice should take.
const TARGET: Duration = Duration::from_millis(75);
/// Paths of a kernel's first slice.
const FIRST_PATHS: u64 = 1 << 12;
/// Atoms of the smallest slice.
const FEWEST_ATOMS: u32 = 256;
/// Most lanes of a slice on a CPU: its threads run workgroups one after the other, so the first take nearly all atoms. More
/// would find none left, fewer would not reach all threads.
const MOST_CPU_LANES: u32 = 1 << 13;

/// Buffers and the submission of one slice.
pub(super) struct Slice {
    pub(super) results: Buffer,
    /// [`Atom`]s.
    pub(super) atoms: Buffer,
    pub(super) lane_states: Buffer,
    pub(super) queue: Buffer,
    /// [`AovSums`] an atom, if the kernel sums AOVs.
    pub(super) aovs: Option<Buffer>,
    /// [`RayCounters`] an atom, if it counts.
    pub(super) counters: Option<Buffer>,
    submission: Submission,
    constants: SliceConstants,
    submitted: Instant,
    most_atoms: u32,
    lanes: u32,
}

/// A finished slice.
pub(super) struct SliceOutcome {
    pub(super) constants: SliceConstants,
    pub(super) seconds: f64,
    /// The part of it after the slice before it had ended.
    pub(super) own_seconds: f64,
    pub(super) dispatches: u64,
    pub(super) rays: u64,
}

impl Slice {
    /// A slice of at most so many atoms.
    pub(super) fn new(gpu: &Arc<Gpu>, atoms: u32, key: &KernelKey) -> Result<Self> {
        let lanes = if gpu.info.kind == DeviceKind::Cpu { atoms.min(MOST_CPU_LANES) } else { atoms };
        let readback = |name, atoms: u32, each: usize| {
            Buffer::new(gpu, name, u64::from(atoms) * each as u64, Usage::STORAGE_BUFFER, MemoryUse::Readback)
        };
        // Behind the result of the lane that prints there is room for what it prints.
        let results = readback("block results", atoms.max(2 + DEBUG_RECORDS), size_of::<BlockResult>())?;
        let list = u64::from(atoms) * size_of::<Atom>() as u64;
        Ok(Self {
            results,
            atoms: Buffer::new(gpu, "atoms", list, Usage::STORAGE_BUFFER, MemoryUse::Upload)?,
            aovs: (key.aovs != 0).then(|| readback("AOVs", atoms, size_of::<AovSums>())).transpose()?,
            counters: key.statistics.then(|| readback("counters", atoms, size_of::<RayCounters>())).transpose()?,
            lane_states: Buffer::new(
                gpu,
                "lane states",
                u64::from(lanes) * LANE_STATE_BYTES as u64,
                Usage::STORAGE_BUFFER,
                MemoryUse::Device,
            )?,
            queue: Buffer::new(
                gpu,
                "slice queue",
                size_of::<SliceQueue>() as u64,
                Usage::STORAGE_BUFFER | Usage::TRANSFER_DST,
                MemoryUse::Readback,
            )?,
            submission: Submission::new(gpu, "path_trace")?,
            constants: SliceConstants::default(),
            submitted: Instant::now(),
            most_atoms: atoms,
            lanes,
        })
    }

    /// Most atoms it can hold.
    pub(super) fn most_atoms(&self) -> u32 {
        self.most_atoms
    }

    pub(super) fn bytes(&self) -> u64 {
        let extras = [&self.aovs, &self.counters].into_iter().flatten().map(|buffer| buffer.size).sum::<u64>();
        self.results.size + self.atoms.size + self.lane_states.size + self.queue.size + extras
    }

    /// Renders atoms, whose number the constants then say.
    pub(super) fn submit(
        &mut self,
        kernel: &Kernel,
        set: usize,
        atoms: &[Atom],
        constants: SliceConstants,
    ) -> Result<()> {
        self.atoms.write(atoms)?;
        let count = u32::try_from(atoms.len()).unwrap_or(u32::MAX);
        let most_samples = atoms.iter().map(|atom| atom.end_sample - atom.first_sample).max().unwrap_or(0);
        self.constants = SliceConstants { lanes: self.lanes.min(count), atoms: count, most_samples, ..constants };
        self.submitted = Instant::now();
        self.dispatch(kernel, set)
    }

    /// Runs the kernel with nothing to do: lavapipe compiles at the first dispatch, and that is no part of rendering.
    pub(super) fn warm_up(&mut self, kernel: &Kernel) -> Result<()> {
        let push = bytemuck::bytes_of(&SliceConstants { lanes: 0, ..SliceConstants::default() }).to_vec();
        self.submission.submit(&[Dispatch::Run { kernel, set: 0, push: &push, lanes: 1 }])?;
        Ok(self.submission.wait()?)
    }

    fn dispatch(&mut self, kernel: &Kernel, set: usize) -> Result<()> {
        let push = bytemuck::bytes_of(&self.constants);
        let run = Dispatch::Run { kernel, set, push, lanes: self.constants.lanes };
        if self.constants.resume == 1 {
            self.submission.submit(&[run])?;
        } else {
            self.submission.submit(&[Dispatch::Clear(&self.queue), run])?;
        }
        Ok(())
    }

    /// Waits until every atom is done, resuming the lanes that have used up their budget. `before` is when the slice before it
    /// ended.
    pub(super) fn finish(&mut self, kernel: &Kernel, set: usize, before: Instant) -> Result<SliceOutcome> {
        let mut dispatches = 1;
        loop {
            self.submission.wait()?;
            if self.queue.read::<SliceQueue>(1)?[0].done == self.constants.atoms {
                break;
            }
            self.constants.resume = 1;
            dispatches += 1;
            self.dispatch(kernel, set)?;
        }
        let rays = self.results(self.constants.atoms)?.iter().map(|result| u64::from(result.rays())).sum();
        Ok(SliceOutcome {
            constants: self.constants,
            seconds: self.submitted.elapsed().as_secs_f64(),
            own_seconds: self.submitted.max(before).elapsed().as_secs_f64(),
            dispatches,
            rays,
        })
    }

    pub(super) fn aovs(&self, atoms: u32) -> Result<Option<&[AovSums]>> {
        Ok(self.aovs.as_ref().map(|buffer| buffer.read(atoms as usize)).transpose()?)
    }

    pub(super) fn counters(&self, atoms: u32) -> Result<Option<&[RayCounters]>> {
        Ok(self.counters.as_ref().map(|buffer| buffer.read(atoms as usize)).transpose()?)
    }

    pub(super) fn results(&self, atoms: u32) -> Result<&[BlockResult]> {
        Ok(self.results.read(atoms as usize)?)
    }
}

/// How large the next slice may be, from how long the last ones took, those of earlier runs of the kernel too.
pub(super) struct SliceSizes {
    /// Paths of the next slice.
    paths: u64,
    /// Paths of an atom in the run that goes on.
    atom_paths: u32,
    largest: u32,
    ray_budget: u32,
    target: Duration,
    fixed_atoms: Option<u32>,
    fixed_budget: bool,
}

impl SliceSizes {
    /// Most atoms of a slice on a class of devices.
    pub(super) fn largest(kind: DeviceKind) -> u32 {
        if kind == DeviceKind::Cpu { 1 << 15 } else { 1 << 19 }
    }

    /// For a kernel that has not run.
    pub(super) fn new(overrides: BindingOverride, largest: u32) -> Self {
        Self {
            paths: FIRST_PATHS,
            atom_paths: BLOCK_SAMPLES,
            largest,
            ray_budget: overrides.ray_budget.unwrap_or(1024),
            target: overrides.slice_time.unwrap_or(TARGET),
            fixed_atoms: overrides.slice_atoms,
            fixed_budget: overrides.ray_budget.is_some(),
        }
    }

    /// What is rendered next is so many samples of each pixel.
    pub(super) fn begin(&mut self, samples: u32) {
        self.atom_paths = samples.clamp(1, BLOCK_SAMPLES);
    }

    pub(super) fn next_atoms(&self) -> u32 {
        let atoms = self.fixed_atoms.unwrap_or_else(|| {
            // Whole workgroups, of whatever size they are: none runs with lanes that have nothing to do.
            let wanted = self.paths / u64::from(self.atom_paths) / u64::from(FEWEST_ATOMS) * u64::from(FEWEST_ATOMS);
            u32::try_from(wanted).unwrap_or(u32::MAX).max(FEWEST_ATOMS)
        });
        atoms.min(self.largest)
    }

    pub(super) fn ray_budget(&self) -> u32 {
        self.ray_budget
    }

    /// Grows or shrinks towards the target. A slice waits for the one before it, so its time is at most twice its own.
    pub(super) fn observe(&mut self, outcome: &SliceOutcome) {
        let own = outcome.seconds / SLICES_IN_FLIGHT as f64;
        let factor = (self.target.as_secs_f64() / own.max(1e-6)).clamp(0.25, 2.0);
        let paths = u64::from(outcome.constants.atoms) * u64::from(self.atom_paths);
        self.paths = (paths as f64 * factor) as u64;
        if !self.fixed_budget {
            // Most atoms end within a few times the mean; the rest go on in another dispatch.
            let mean = outcome.rays / u64::from(outcome.constants.atoms.max(1));
            self.ray_budget = u32::try_from(8 * mean).unwrap_or(u32::MAX).clamp(256, 1 << 16);
        }
    }
}
