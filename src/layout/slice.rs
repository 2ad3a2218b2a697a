//! A slice of a render: what a dispatch is asked for, and the sums of radiance that it brings.

use bytemuck::{Pod, Zeroable};

/// What a slice renders: a list of `atoms` [`Atom`]s. Lanes `0..lanes` take them from a [`SliceQueue`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct SliceConstants {
    /// Number of lanes.
    pub lanes: u32,
    /// Number of atoms.
    pub atoms: u32,
    /// Most samples that one of them has.
    pub most_samples: u32,
    /// A lane saves its state after this many rays of an atom and goes on in the next dispatch.
    pub ray_budget: u32,
    /// 1 if the lanes go on from their saved state.
    pub resume: u32,
    /// 1 if the only lane writes what it prints behind its result (shaders/include/debug.glsl).
    pub prints: u32,
}

/// What a lane renders at a time: sample indices of one pixel, all in one block of [`BLOCK_SAMPLES`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Atom {
    /// Column | row << 16.
    pub pixel: u32,
    /// First sample index.
    pub first_sample: u32,
    /// One past the last.
    pub end_sample: u32,
}

impl Atom {
    /// Column and row of its pixel.
    pub fn place(&self) -> (u32, u32) {
        (self.pixel & 0xffff, self.pixel >> 16)
    }

    /// The block of its samples.
    pub fn block(&self) -> u32 {
        self.first_sample / BLOCK_SAMPLES
    }
}

/// The atoms of a slice, of which a lane takes the next when it has finished one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct SliceQueue {
    /// Times that an atom was asked for; beyond `atoms` there was none.
    pub taken: u32,
    /// Atoms that are complete.
    pub done: u32,
}

/// Most values that a lane prints.
pub const DEBUG_RECORDS: u32 = 64;

/// Samples of an aligned block.
pub const BLOCK_SAMPLES: u32 = 16;

/// The result of one atom: the sums over the samples of one pixel and block.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BlockResult {
    /// Sum of radiance; the exact sum is `sum + compensation`.
    pub sum: [f32; 3],
    /// Sum of squared sample luminance.
    pub luminance_squared: f32,
    /// Low part of the compensated sum.
    pub compensation: [f32; 3],
    /// See [`BlockResult::rays`] and [`BlockResult::samples`].
    pub rays_and_samples: u32,
    /// See [`BlockResult::non_finite`] and [`BlockResult::capped`].
    pub non_finite_and_capped: u32,
}

impl BlockResult {
    /// Rays traced; stops at 2^27 − 1.
    pub fn rays(&self) -> u32 {
        self.rays_and_samples >> 5
    }

    /// Samples that were ended in this block: 0 to 16.
    pub fn samples(&self) -> u32 {
        self.rays_and_samples & 31
    }

    /// Bit i: sample i of the block was not finite.
    pub fn non_finite(&self) -> u32 {
        self.non_finite_and_capped & 0xffff
    }

    /// Bit i: a path of sample i was cut off by the safety cap on bounces.
    pub fn capped(&self) -> u32 {
        self.non_finite_and_capped >> 16
    }
}

/// Bytes of a lane's saved state (`LaneState` in shaders/include/lane.glsl), which only shaders look into.
pub const LANE_STATE_BYTES: usize = 304;
