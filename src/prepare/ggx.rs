//! The albedo tables of GGX: how much light one scattering keeps, by direction and roughness.
//!
//! The nodes are made and checked by tests/host/ggx_albedo.rs and tests/host/dielectric_albedo.rs; their coordinates are
//! those of shaders/include/ggx.glsl and shaders/include/bsdf_dielectric.glsl.

use crate::layout::{DIELECTRIC_ALBEDO_SIZE, GGX_ALBEDO_SIZE, GGX_ANISOTROPIC_SIZES, Texel};

/// Node (x, y) is two little-endian f32 at (y · size + x): the albedo, and the offset of Schlick's mean cosine.
const NODES: &[u8] = include_bytes!("ggx_albedo.bin");

/// For unequal roughness: a node is the same two numbers as little-endian i16, in units of 2/32767 and 8/32767; the first
/// coordinate runs fastest.
const ANISOTROPIC_NODES: &[u8] = include_bytes!("ggx_albedo_anisotropic.bin");

/// The table as the shader reads it: a texel holds a node and its neighbour along x.
pub(super) fn albedo_table() -> Vec<Texel> {
    let size = GGX_ALBEDO_SIZE as usize;
    let node = |x: usize, y: usize| {
        let at = 8 * (y * size + x.min(size - 1));
        [word(NODES, at), word(NODES, at + 4)]
    };
    let texel = |i: usize| {
        let ([a, b], [c, d]) = (node(i % size, i / size), node(i % size + 1, i / size));
        [a, b, c, d]
    };
    (0..size * size).map(texel).collect()
}

/// The table for unequal roughness: a texel holds a node and its neighbours along the first two coordinates.
pub(super) fn anisotropic_albedo_table() -> Vec<Texel> {
    let [directions, azimuths, ..] = GGX_ANISOTROPIC_SIZES.map(|size| size as usize);
    let texel = |i: usize| {
        let (x, y) = (i % directions, i / directions % azimuths);
        let right = usize::from(x + 1 < directions);
        let below = if y + 1 < azimuths { directions } else { 0 };
        [i, i + right, i + below, i + below + right].map(|node| word(ANISOTROPIC_NODES, 4 * node))
    };
    (0..ANISOTROPIC_NODES.len() / 4).map(texel).collect()
}

/// Node (x, y, z) of the rough dielectric's table is two little-endian u16 at ((z · size y) + y) · size x + x: the albedo and
/// that without reflection, in units of 1/65535. First for η > 1, then for η < 1.
const DIELECTRIC_NODES: &[u8] = include_bytes!("dielectric_albedo.bin");

/// The table as the shader reads it: a texel holds the nodes (x, y), (x + 1, y), (x, y + 1) and (x + 1, y + 1).
pub(super) fn dielectric_albedo_table() -> Vec<Texel> {
    let [nx, ny, nz] = DIELECTRIC_ALBEDO_SIZE.map(|size| size as usize);
    let node =
        |x: usize, y: usize, z: usize| word(DIELECTRIC_NODES, 4 * ((z * ny + y.min(ny - 1)) * nx + x.min(nx - 1)));
    let texel = |i: usize| {
        let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
        [node(x, y, z), node(x + 1, y, z), node(x, y + 1, z), node(x + 1, y + 1, z)]
    };
    (0..2 * nx * ny * nz).map(texel).collect()
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
