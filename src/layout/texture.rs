//! Headers of textures; their texels are an array of their own.

use bytemuck::{Pod, Zeroable};

/// `sampling`: texels are sRGB-encoded (alpha never is).
pub const TEXTURE_SRGB: u32 = 1;
/// `sampling`: 16 bits a channel (two words a texel, R | G << 16 first) instead of 8 (R | G << 8 | B << 16 | A << 24).
pub const TEXTURE_16_BIT: u32 = 2;
/// `sampling`: nearest texel instead of bilinear.
pub const TEXTURE_NEAREST: u32 = 4;
/// `sampling`: looked up by the second set of texture coordinates.
pub const TEXTURE_SET_1: u32 = 8;
/// `sampling`: shift of the wrap mode along u; 0 repeat, 1 mirrored repeat, 2 clamp to edge.
pub const TEXTURE_WRAP_U_SHIFT: u32 = 4;
/// `sampling`: shift of the wrap mode along v.
pub const TEXTURE_WRAP_V_SHIFT: u32 = 6;
/// `sampling`: the transform is not the identity.
pub const TEXTURE_TRANSFORMED: u32 = 1 << 8;
/// `sampling`: lookups by a ray cone use the mip chain.
pub const TEXTURE_MIPS: u32 = 1 << 9;

/// Where a texture's texels are, by which coordinates and how they are read.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct TextureHeader {
    /// First word in [`SceneArray::Texels`](super::SceneArray::Texels).
    pub first_word: u32,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `TEXTURE_*` bits.
    pub sampling: u32,
    /// u′ of the lookup is the dot product with (u, v, 1).
    pub u_row: [f32; 3],
    /// With [`TEXTURE_MIPS`]: word in [`SceneArray::Texels`](super::SceneArray::Texels) of the list of the first words of
    /// the levels 1, 2, … to the one of a single texel. Level l has max(1, ⌊size/2ˡ⌋) texels along each side, of 16 bits a
    /// channel, linear.
    pub mips: u32,
    /// v′ of the lookup is the dot product with (u, v, 1).
    pub v_row: [f32; 3],
    /// Unused, zero.
    pub unused: u32,
}

/// Texels a texture header takes.
pub const TEXTURE_TEXELS: u32 = 3;
