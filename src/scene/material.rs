//! Materials: which BSDF, its parameters, and what the surface emits.

use super::TextureBinding;

/// The scattering model of a [`Material`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Bsdf {
    /// Ideal diffuse reflection, albedo/π.
    Lambertian,
    /// Ideal specular reflection, weight = colour, no Fresnel.
    Mirror,
    /// Ideal specular refraction by Snell's law; total internal reflection where it must be. No Fresnel reflection.
    Refract,
    /// Smooth dielectric: reflects with probability F, else refracts.
    Glass,
    /// glTF's metallic-roughness model (GGX over a Lambertian base), with thin-walled transmission.
    MetallicRoughness,
    /// KHR_materials_unlit: shows its colour as it is, casts no light and scatters nothing.
    Unlit,
}

/// Which Fresnel term [`Bsdf::Glass`] uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fresnel {
    /// Unpolarised dielectric Fresnel equations.
    #[default]
    Exact,
    /// Schlick's approximation, evaluated on the optically thinner side.
    Schlick,
}

/// A surface material. Colours are linear Rec.709.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name from the file; may be empty.
    pub name: String,
    /// Scattering model.
    pub bsdf: Bsdf,
    /// Albedo, mirror or transmission colour, or base colour; in [0, 1].
    pub base_color: [f32; 3],
    /// Multiplies `base_color` (sRGB-encoded image, RGB used).
    pub base_color_texture: Option<TextureBinding>,
    /// Metalness in [0, 1] ([`Bsdf::MetallicRoughness`]).
    pub metallic: f32,
    /// Perceptual roughness in [0, 1]; α = roughness².
    pub roughness: f32,
    /// Multiplies roughness by its G and metallic by its B (linear image).
    pub metallic_roughness_texture: Option<TextureBinding>,
    /// Index of refraction relative to the outside, > 0.
    pub ior: f32,
    /// Fresnel term of [`Bsdf::Glass`].
    pub fresnel: Fresnel,
    /// Share of the diffuse base replaced by thin-walled straight-through transmission, in [0, 1].
    pub transmission: f32,
    /// Emitted radiance in W·m⁻²·sr⁻¹ (factor × strength), ≥ 0.
    pub emission: [f32; 3],
    /// Multiplies `emission` (sRGB-encoded image, RGB used).
    pub emission_texture: Option<TextureBinding>,
    /// Emits from both sides.
    pub double_sided: bool,
    /// The back neither scatters nor emits (Mitsuba's one-sided surfaces; used by the built-in `cornell`).
    pub black_back: bool,
}

impl Default for Material {
    /// glTF's default material: white, fully metallic and rough.
    fn default() -> Self {
        Self {
            name: String::new(),
            bsdf: Bsdf::MetallicRoughness,
            base_color: [1.0; 3],
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            ior: 1.5,
            fresnel: Fresnel::Exact,
            transmission: 0.0,
            emission: [0.0; 3],
            emission_texture: None,
            double_sided: false,
            black_back: false,
        }
    }
}

impl Material {
    /// A Lambertian material of the given albedo.
    pub fn lambertian(name: &str, albedo: [f32; 3]) -> Self {
        Self { name: name.to_owned(), bsdf: Bsdf::Lambertian, base_color: albedo, ..Self::default() }
    }

    /// Whether any point of the surface can emit light that is sampled (unlit surfaces are seen, not sampled).
    pub fn is_emissive(&self) -> bool {
        self.emission.iter().any(|&e| e > 0.0)
    }
}
