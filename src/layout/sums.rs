//! What a kernel sums for AOVs and statistics. AOVs have the numbers `AOV_*`: bits of `AOVS` in
//! `shaders/include/features.glsl`.

use bytemuck::{Pod, Zeroable};

/// Base colour.
pub const AOV_ALBEDO: u32 = 0;
/// Shading normal.
pub const AOV_NORMAL: u32 = 1;
/// Depth along the camera's axis.
pub const AOV_DEPTH: u32 = 2;
/// Position.
pub const AOV_POSITION: u32 = 3;
/// Share of the camera's rays that meet a surface.
pub const AOV_COVERAGE: u32 = 4;
/// What searches visit.
pub const AOV_COST: u32 = 5;

/// The AOVs of one atom: sums over its samples of what the camera's rays meet. What is not asked for is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AovSums {
    /// Base colours.
    pub albedo: [f32; 3],
    /// Camera rays that met a surface.
    pub hits: u32,
    /// Shading normals, world space, on the side that is seen.
    pub normal: [f32; 3],
    /// Distances along the camera's viewing direction.
    pub depth: f32,
    /// Positions in rebased world space.
    pub position: [f32; 3],
    /// Nodes and triangles visited by all rays of the samples; stops at the largest number.
    pub visits: u32,
}

/// Counters of one atom, for statistics. Triples are by kind of ray: camera, scattered, shadow. Each stops at the largest
/// number.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RayCounters {
    /// Rays traced.
    pub rays: [u32; 3],
    /// Steps of searches that the lane took part in.
    pub search_steps: u32,
    /// Nodes visited.
    pub nodes: [u32; 3],
    /// Steps that its subgroup ran, where this lane was the one to count them.
    pub search_vectors: u32,
    /// Triangles tested.
    pub triangles: [u32; 3],
    /// Times that its subgroup shaded surfaces, where this lane was the one to count them.
    pub shading_vectors: u32,
    /// Lanes of a subgroup.
    pub vector_width: u32,
    /// Surfaces shaded.
    pub shadings: u32,
    /// Unused, zero.
    pub unused: [u32; 2],
}
