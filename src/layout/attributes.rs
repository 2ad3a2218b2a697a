//! What shading needs of triangles and vertices beyond positions.

use bytemuck::{Pod, Zeroable};

/// Bit of a triangle's `kind`: its index is that of a light, of which it is the triangle, and whose record has the material;
/// in an instanced mesh, relative to the instance's first light.
pub const TRIANGLE_LIGHT: u32 = 1 << 31;
/// Bit of `kind`: the material's alpha decides whether a ray meets it.
pub const TRIANGLE_ALPHA: u32 = 1 << 30;
/// Bit of `kind`: the vertices carry colours.
pub const TRIANGLE_COLORS: u32 = 1 << 29;
/// Bit of `kind`: the vertices carry tangents.
pub const TRIANGLE_TANGENTS: u32 = 1 << 28;
/// Bit of `kind`: the vertices carry texture coordinates.
pub const TRIANGLE_TEXCOORDS: u32 = 1 << 27;
/// Bit of `kind`: the vertices carry normals.
pub const TRIANGLE_NORMALS: u32 = 1 << 26;
/// Bits of `kind` that say what the vertices carry.
pub const TRIANGLE_ATTRIBUTES: u32 = 0x3c000000;
/// Bits of `kind` that hold the index of the material or light.
pub const TRIANGLE_INDEX_MASK: u32 = (1 << 26) - 1;

/// What shading needs of a triangle beyond its positions, by its number. Where the kernel reads no attributes of vertices
/// (`vertex_texels` of [`RenderConstants`](super::RenderConstants) is 0), the `kind`s alone are stored, four a texel.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// Indices of [`Vertex`] records.
    pub vertices: [u32; 3],
    /// `TRIANGLE_*` bits and index.
    pub kind: u32,
}

/// Shading attributes of a vertex, in the space of its mesh (world for baked meshes). A scene stores of each vertex
/// `vertex_texels` of [`RenderConstants`](super::RenderConstants) texels: the first; the second where it has texture
/// coordinates or tangents; the third where it has tangents; and as the last the colour where it has colours.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Vertex {
    /// Unit shading normal.
    pub normal: [f32; 3],
    /// Texture coordinate u of set 0.
    pub u: f32,
    /// Texture coordinate v of set 0.
    pub v: f32,
    /// Texture coordinate u of set 1.
    pub u_1: f32,
    /// Texture coordinate v of set 1.
    pub v_1: f32,
    /// Unused, zero.
    pub unused: f32,
    /// Unit tangent, or zero.
    pub tangent: [f32; 3],
    /// The bitangent is this sign, 1 or −1, times normal × tangent.
    pub bitangent_sign: f32,
    /// Linear colour and alpha, in [0, 1].
    pub color: [f32; 4],
}
