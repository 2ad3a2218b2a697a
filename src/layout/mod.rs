//! Every struct and constant that a shader reads or writes, one subject a file. The other half is
//! `shaders/include/layout.glsl`; `tests/gpu/layout.rs` holds the two together.
//!
//! Scene data lies in a few arrays of 16-byte texels, which the shader reads through one accessor (`load4(array, index)`,
//! see `shaders/include/arrays.glsl`) as texel buffer, storage buffer or device address. A record of theirs is a whole
//! number of texels.

mod attributes;
mod bvh;
mod light;
mod material;
mod render_constants;
mod slice;
mod sums;
mod texture;

pub use self::attributes::*;
pub use self::bvh::*;
pub use self::light::*;
pub use self::material::*;
pub use self::render_constants::*;
pub use self::slice::*;
pub use self::sums::*;
pub use self::texture::*;

/// "No index": no texture, no light, no hit.
pub const NONE: u32 = u32::MAX;

/// One 16-byte element of a scene array.
pub type Texel = [u32; 4];

/// The scene arrays, in binding order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum SceneArray {
    /// BVH slots: [`InnerSlot`], [`LeafSlot`], [`InstanceSlot`].
    Slots = 0,
    /// [`Triangle`] records or their kinds, then [`Vertex`] records.
    Attributes = 1,
    /// Small tables: materials, texture headers, lights, the light CDF, instances.
    Tables = 2,
    /// Texels of all images, packed words.
    Texels = 3,
    /// Environment radiance, its marginal and its conditional CDFs.
    Environment = 4,
}

/// Number of [`SceneArray`]s.
pub const SCENE_ARRAYS: usize = 5;
/// An array larger than a device's limit is split into at most this many chunks.
pub const MAX_CHUNKS: usize = 4;
