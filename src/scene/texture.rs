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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureBinding {
    /// Index into `Scene::textures`.
    pub texture: usize,
    /// Which of the primitive's sets of texture coordinates is looked up: 0 or 1.
    pub set: usize,
    /// What happens to the coordinates before the lookup.
    pub transform: TextureTransform,
}

impl TextureBinding {
    /// The texture on set 0, untransformed.
    pub const fn new(texture: usize) -> Self {
        Self { texture, set: 0, transform: TextureTransform::IDENTITY }
    }
}

/// An affine map of texture coordinates: rows (a, b, t) of u′ = a·u + b·v + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureTransform {
    /// The row of u′, then that of v′; finite.
    pub rows: [[f32; 3]; 2],
}

impl TextureTransform {
    /// Leaves coordinates as they are.
    pub const IDENTITY: Self = Self { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };

    /// Scales, then rotates counter-clockwise as seen on the image (v points down), then moves: KHR_texture_transform.
    pub fn new(offset: [f64; 2], rotation_radians: f64, scale: [f64; 2]) -> Self {
        let (sin, cos) = rotation_radians.sin_cos();
        let rows = [[cos * scale[0], sin * scale[1], offset[0]], [-sin * scale[0], cos * scale[1], offset[1]]];
        Self { rows: rows.map(|row| row.map(|x| x as f32)) }
    }

    /// The coordinates at which the texture is looked up.
    pub fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        self.rows.map(|[a, b, t]| f64::from(a) * u + f64::from(b) * v + f64::from(t))
    }
}
