//! Slices: dispatches short enough that no driver's watchdog fires and an interrupt is answered at once. The first is
//! tiny, growth is at most twofold, two are in flight. A lane that has used up its ray budget is resumed.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk::BufferUsageFlags as Usage;

use super::kernel_build::BindingOverride;
use super::kernel_key::KernelKey;
use crate::Result;
use crate::gpu::{Buffer, DeviceKind, Dispatch, Gpu, Kernel, MemoryUse, Submission};
use crate::layout::{AovSums, BlockResult, DEBUG_RECORDS, LANE_STATE_BYTES, RayCounters, SliceConstants};

/// Slices that are submitted before the oldest is read.
pub(super) const SLICES_IN_FLIGHT: usize = 2;
/// Time a slice should take.
const TARGET: Duration = Duration::from_millis(75);
/// Lanes of the first slice, and of the smallest.
const FIRST_LANES: u32 = 256;

/// Buffers and the submission of one slice.
pub(super) struct Slice {
    pub(super) results: Buffer,
    pub(super) lane_states: Buffer,
    /// [`AovSums`] a lane, if the kernel sums AOVs.
    pub(super) aovs: Option<Buffer>,
    /// [`RayCounters`] a lane, if it counts.
    pub(super) counters: Option<Buffer>,
    submission: Submission,
    constants: SliceConstants,
    submitted: Instant,
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
    pub(super) fn new(gpu: &Arc<Gpu>, lanes: u32, key: &KernelKey) -> Result<Self> {
        let bytes = |each: usize| u64::from(lanes) * each as u64;
        let readback = |name, lanes: u32, each: usize| {
            Buffer::new(gpu, name, u64::from(lanes) * each as u64, Usage::STORAGE_BUFFER, MemoryUse::Readback)
        };
        // Behind the result of the lane that prints there is room for what it prints.
        let results = readback("block results", lanes.max(2 + DEBUG_RECORDS), size_of::<BlockResult>())?;
        Ok(Self {
            results,
            aovs: (key.aovs != 0).then(|| readback("AOVs", lanes, size_of::<AovSums>())).transpose()?,
            counters: key.statistics.then(|| readback("counters", lanes, size_of::<RayCounters>())).transpose()?,
            lane_states: Buffer::new(
                gpu,
                "lane states",
                bytes(LANE_STATE_BYTES),
                Usage::STORAGE_BUFFER,
                MemoryUse::Device,
            )?,
            submission: Submission::new(gpu, "path_trace")?,
            constants: SliceConstants::default(),
            submitted: Instant::now(),
            lanes,
        })
    }

    /// Most lanes it can hold.
    pub(super) fn lanes(&self) -> u32 {
        self.lanes
    }

    pub(super) fn bytes(&self) -> u64 {
        let extras = [&self.aovs, &self.counters].into_iter().flatten().map(|buffer| buffer.size).sum::<u64>();
        self.results.size + self.lane_states.size + extras
    }

    pub(super) fn submit(&mut self, kernel: &Kernel, set: usize, constants: SliceConstants) -> Result<()> {
        self.constants = constants;
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
        self.submission.submit(&[Dispatch::Run { kernel, set, push, lanes: self.constants.lanes }])?;
        Ok(())
    }

    /// Waits until every lane is done, resuming those that have used up their budget. `before` is when the slice before it
    /// ended.
    pub(super) fn finish(&mut self, kernel: &Kernel, set: usize, before: Instant) -> Result<SliceOutcome> {
        let mut dispatches = 1;
        loop {
            self.submission.wait()?;
            if self.results(self.constants.lanes)?.iter().all(|result| result.complete == 1) {
                break;
            }
            self.constants.resume = 1;
            dispatches += 1;
            self.dispatch(kernel, set)?;
        }
        let rays = self.results(self.constants.lanes)?.iter().map(|result| u64::from(result.rays)).sum();
        Ok(SliceOutcome {
            constants: self.constants,
            seconds: self.submitted.elapsed().as_secs_f64(),
            own_seconds: self.submitted.max(before).elapsed().as_secs_f64(),
            dispatches,
            rays,
        })
    }

    pub(super) fn aovs(&self, lanes: u32) -> Result<Option<&[AovSums]>> {
        Ok(self.aovs.as_ref().map(|buffer| buffer.read(lanes as usize)).transpose()?)
    }

    pub(super) fn counters(&self, lanes: u32) -> Result<Option<&[RayCounters]>> {
        Ok(self.counters.as_ref().map(|buffer| buffer.read(lanes as usize)).transpose()?)
    }

    pub(super) fn results(&self, lanes: u32) -> Result<&[BlockResult]> {
        Ok(self.results.read(lanes as usize)?)
    }
}

/// How large the next slice may be, from how long the last ones took.
pub(super) struct SliceSizes {
    lanes: u32,
    largest: u32,
    ray_budget: u32,
    target: Duration,
    fixed_lanes: bool,
    fixed_budget: bool,
}

impl SliceSizes {
    /// Most lanes that are of use on a class of devices.
    pub(super) fn largest(kind: DeviceKind) -> u32 {
        if kind == DeviceKind::Cpu { 1 << 15 } else { 1 << 19 }
    }

    pub(super) fn new(overrides: BindingOverride, largest: u32) -> Self {
        Self {
            lanes: overrides.slice_lanes.unwrap_or(FIRST_LANES).min(largest),
            largest,
            ray_budget: overrides.ray_budget.unwrap_or(1024),
            target: overrides.slice_time.unwrap_or(TARGET),
            fixed_lanes: overrides.slice_lanes.is_some(),
            fixed_budget: overrides.ray_budget.is_some(),
        }
    }

    pub(super) fn next_lanes(&self) -> u32 {
        self.lanes
    }

    pub(super) fn ray_budget(&self) -> u32 {
        self.ray_budget
    }

    /// Grows or shrinks towards the target. A slice waits for the one before it, so its time is at most twice its own.
    pub(super) fn observe(&mut self, outcome: &SliceOutcome) {
        let own = outcome.seconds / SLICES_IN_FLIGHT as f64;
        if !self.fixed_lanes {
            let factor = (self.target.as_secs_f64() / own.max(1e-6)).clamp(0.25, 2.0);
            let wanted = f64::from(outcome.constants.lanes) * factor;
            self.lanes = (wanted as u32).clamp(FIRST_LANES.min(self.largest), self.largest);
        }
        if !self.fixed_budget {
            // Most atoms end within a few times the mean; the rest go on in another dispatch.
            let mean = outcome.rays / u64::from(outcome.constants.lanes.max(1));
            self.ray_budget = u32::try_from(8 * mean).unwrap_or(u32::MAX).clamp(256, 1 << 16);
        }
    }
}
