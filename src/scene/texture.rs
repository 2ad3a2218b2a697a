//! Images and how they are sampled.

/// A decoded image; row 0 is the top, which texture coordinate v = 0 addresses.
#[derive(Clone, Debug)]
pub struct Image {
    /// File name or URI, for messages.
    pub name: String,
    /// Width in texels, ≥ 1.
    pub width: u32,
    /// Height in texels, ≥ 1.
    pub height: u32,
    /// `width × height` texels, row by row.
    pub texels: Texels,
}

/// RGBA texels as stored in the file (not yet linearised: that depends on what a texture is used for).
#[derive(Clone, Debug)]
pub enum Texels {
    /// 8 bits a channel.
    Rgba8(Vec<[u8; 4]>),
    /// 16 bits a channel.
    Rgba16(Vec<[u16; 4]>),
}

/// How coordinates outside [0, 1) are mapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Repeat.
    #[default]
    Repeat,
    /// Repeat, mirrored every other time.
    MirroredRepeat,
    /// Clamp to the edge texel.
    ClampToEdge,
}

/// Magnification filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Nearest texel.
    Nearest,
    /// Bilinear.
    #[default]
    Linear,
}

/// An image with its sampler.
#[derive(Clone, Copy, Debug)]
pub struct Texture {
    /// Index into `Scene::images`.
    pub image: usize,
    /// Wrap mode along u.
    pub wrap_u: Wrap,
    /// Wrap mode along v.
    pub wrap_v: Wrap,
    /// Filter between texels.
    pub filter: Filter,
}

/// A texture as a material refers to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureBinding {
    /// Index into `Scene::textures`.
    pub texture: usize,
}
