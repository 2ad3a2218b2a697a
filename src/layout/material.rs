//! Materials, and the sizes of the albedo tables that their BSDFs read.

use bytemuck::{Pod, Zeroable};

/// [`Material`] `kind`: Lambertian.
pub const BSDF_LAMBERTIAN: u32 = 0;
/// [`Material`] `kind`: mirror.
pub const BSDF_MIRROR: u32 = 1;
/// [`Material`] `kind`: refract.
pub const BSDF_REFRACT: u32 = 2;
/// [`Material`] `kind`: glass.
pub const BSDF_GLASS: u32 = 3;
/// [`Material`] `kind`: metallic-roughness.
pub const BSDF_METALLIC_ROUGHNESS: u32 = 4;
/// [`Material`] `kind`: unlit.
pub const BSDF_UNLIT: u32 = 5;
/// Bits of `kind_flags` that hold the BSDF.
pub const MATERIAL_KIND_MASK: u32 = 0xff;
/// `kind_flags`: emits from both sides.
pub const MATERIAL_DOUBLE_SIDED: u32 = 1 << 8;
/// `kind_flags`: the back neither scatters nor emits.
pub const MATERIAL_BLACK_BACK: u32 = 1 << 9;
/// `kind_flags`: glass with Schlick's Fresnel term.
pub const MATERIAL_SCHLICK: u32 = 1 << 10;

/// `kind_flags`: KHR_materials_volume: transmission refracts into what the surface encloses.
pub const MATERIAL_VOLUME: u32 = 1 << 11;
/// `kind_flags`: alpha says whether the surface is there.
pub const MATERIAL_ALPHA_MASK: u32 = 1 << 12;
/// `kind_flags`: alpha is the probability that the surface is there.
pub const MATERIAL_ALPHA_BLEND: u32 = 1 << 13;

/// Whether a material with these `kind_flags` emits from its back too.
pub fn emits_from_both_sides(kind_flags: u32) -> bool {
    kind_flags & (MATERIAL_DOUBLE_SIDED | MATERIAL_BLACK_BACK) == MATERIAL_DOUBLE_SIDED
}

/// A material's parameters; see `scene::Material`. Textures are indices of [`TextureHeader`](super::TextureHeader)s or
/// [`NONE`](super::NONE). A shader reads the texels of what its scene needs alone.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Material {
    /// Linear colour.
    pub base_color: [f32; 3],
    /// One of `BSDF_*` and `MATERIAL_*` flags.
    pub kind_flags: u32,
    /// Radiance.
    pub emission: [f32; 3],
    /// Perceptual roughness.
    pub roughness: f32,
    /// Metalness.
    pub metallic: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Share of the diffuse base that transmits.
    pub transmission: f32,
    /// Factor on the base colour's alpha.
    pub alpha: f32,
    /// Base colour and alpha.
    pub base_color_texture: u32,
    /// Roughness in G, metalness in B.
    pub metallic_roughness_texture: u32,
    /// Emission.
    pub emission_texture: u32,
    /// Tangent-space normals.
    pub normal_texture: u32,
    /// Colour of the dielectric's reflectance at normal incidence.
    pub specular_color: [f32; 3],
    /// Strength of the dielectric's reflection.
    pub specular: f32,
    /// Absorption coefficient of the volume in 1/m.
    pub absorption: [f32; 3],
    /// With [`MATERIAL_ALPHA_MASK`]: the surface is there where alpha is at least this.
    pub alpha_cutoff: f32,
    /// Strength of the anisotropy.
    pub anisotropy: f32,
    /// Angle of the anisotropy from the tangent, in turns.
    pub anisotropy_turns: f32,
    /// Scales the x and y of normals from the texture.
    pub normal_scale: f32,
    /// Unused, zero.
    pub unused: u32,
    /// Transmission in R.
    pub transmission_texture: u32,
    /// Strength of the specular reflection in A.
    pub specular_texture: u32,
    /// Colour of the specular reflection.
    pub specular_color_texture: u32,
    /// Anisotropy: direction in R and G, strength in B.
    pub anisotropy_texture: u32,
}

/// Nodes of the albedo table of GGX along each of its coordinates. A texel holds a node and the one after it.
pub const GGX_ALBEDO_SIZE: u32 = 48;

/// Nodes of the albedo table of rough dielectrics along its coordinates, for each side. It stands before that of GGX. A texel
/// holds a node and the three next to it along the first two coordinates, 16 bits a number.
pub const DIELECTRIC_ALBEDO_SIZE: [u32; 3] = [40, 20, 40];

/// Nodes of the table of anisotropic albedos along each of its coordinates: direction (polar angle), azimuth, ratio of the
/// two roughnesses, larger roughness.
pub const GGX_ANISOTROPIC_SIZES: [u32; 4] = [24, 12, 12, 20];

/// Texels a material takes.
pub const MATERIAL_TEXELS: u32 = 8;
