//! The albedo table of GGX: how much light one scattering keeps, by direction and roughness.
//!
//! The nodes are made and checked by tests/host/ggx_albedo.rs; shaders/include/ggx.glsl says what its coordinates are.

use crate::layout::{GGX_ALBEDO_SIZE, Texel};

/// Node (x, y) is two little-endian f32 at (y · size + x): the albedo, and the offset of Schlick's mean cosine.
const NODES: &[u8] = include_bytes!("ggx_albedo.bin");

/// The table as the shader reads it: a texel holds a node and its neighbour along x.
pub(super) fn albedo_table() -> Vec<Texel> {
    let size = GGX_ALBEDO_SIZE as usize;
    let node = |x: usize, y: usize| {
        let at = 8 * (y * size + x.min(size - 1));
        let word = |at: usize| u32::from_le_bytes([NODES[at], NODES[at + 1], NODES[at + 2], NODES[at + 3]]);
        [word(at), word(at + 4)]
    };
    let texel = |i: usize| {
        let ([a, b], [c, d]) = (node(i % size, i / size), node(i % size + 1, i / size));
        [a, b, c, d]
    };
    (0..size * size).map(texel).collect()
}
