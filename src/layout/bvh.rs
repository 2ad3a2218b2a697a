//! Slots of the BVH, and the instances that they stand for.

use bytemuck::{Pod, Zeroable};

/// `kind` of an inner slot. Read as a float it is NaN, which the last word of a [`LeafSlot`] never is.
pub const SLOT_INNER: u32 = 0xffffffff;
/// `kind` of an instance.
pub const SLOT_INSTANCE: u32 = 0xfffffffe;
/// The least last word of a slot that is no leaf: the bits of −∞, above those of every finite float.
pub const SLOT_NO_LEAF: u32 = 0xff800000;
/// Slots stand in groups of this many: the children of one inner slot.
pub const SLOT_GROUP: u32 = 4;

/// An inner node of the four-wide BVH, with its children's boxes quantised to 8 bits on a grid of its own.
/// Box k spans, on each axis, `origin + lower.k · 2^(e−127)` to `origin + upper.k · 2^(e−127)`, with child k's 8 bits at
/// bit 8k. An absent child has lower 255 and upper 0, and its slot is all zero.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct InnerSlot {
    /// Origin of the grid.
    pub origin: [f32; 3],
    /// Biased exponents of the grid's steps: x at bit 0, y at bit 8, z at bit 16.
    pub exponents: u32,
    /// Lower bounds, one word an axis.
    pub lower: [u32; 3],
    /// Upper bounds, one word an axis.
    pub upper: [u32; 3],
    /// The children are slots `4·child_group` to `4·child_group + 3`.
    pub child_group: u32,
    /// [`SLOT_INNER`].
    pub kind: u32,
}

/// One triangle, or two that share an edge and turn the same way: (0, 1, 2) and (0, 2, 3), vertices as they are (so that
/// neighbours test a shared edge alike). Where there is one, vertex 3 is vertex 0. Its triangles have the numbers
/// twice its slot and one more. In a scene with alpha, they have it where the words of vertex 0 are larger than those of
/// vertex 2, x before y before z.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LeafSlot {
    /// Vertices, finite, counter-clockwise seen from the front.
    pub vertices: [[f32; 3]; 4],
}

/// A placed mesh: traversal goes on at the instance's root with the ray in object space.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct InstanceSlot {
    /// Unused, zero.
    pub unused: [u32; 9],
    /// Index of the [`InstanceRecord`].
    pub instance: u32,
    /// Unused, zero.
    pub unused_too: u32,
    /// [`SLOT_INSTANCE`].
    pub kind: u32,
}

/// Texels a slot takes.
pub const SLOT_TEXELS: u32 = 3;

/// A placed mesh.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct InstanceRecord {
    /// Rows of the 3×4 matrix from object to (rebased) world space.
    pub object_to_world: [[f32; 4]; 3],
    /// Rows of its inverse.
    pub world_to_object: [[f32; 4]; 3],
    /// Slot of the mesh's root.
    pub root_slot: u32,
    /// First of the instance's lights.
    pub first_light: u32,
    /// 1 if the transform mirrors, so that the winding's front is the other side.
    pub mirrored: u32,
    /// Unused, zero.
    pub unused: u32,
}

/// Texels an instance takes.
pub const INSTANCE_TEXELS: u32 = 7;
