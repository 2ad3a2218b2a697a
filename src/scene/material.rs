//! Materials: which BSDF, its parameters, and what the surface emits.

use super::{TextureBinding, TextureTransform};

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

impl Bsdf {
    /// Its name for people, as scene files and reports have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lambertian => "lambertian",
            Self::Mirror => "mirror",
            Self::Refract => "refract",
            Self::Glass => "glass",
            Self::MetallicRoughness => "metallic-roughness",
            Self::Unlit => "unlit",
        }
    }
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

/// What the alpha of the base colour means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: the surface is opaque.
    #[default]
    Opaque,
    /// The surface is there where alpha is at least the cutoff.
    Mask {
        /// In [0, 1], or above 1 where nothing is there.
        cutoff: f32,
    },
    /// The share of light that meets the surface; the rest passes straight through.
    Blend,
}

/// What fills a closed surface (KHR_materials_volume): it refracts, and absorbs by the Beer-Lambert law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Transmittance over `attenuation_distance`, in [0, 1].
    pub attenuation_color: [f32; 3],
    /// In metres, > 0; infinite where nothing is absorbed.
    pub attenuation_distance: f32,
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
    /// Share of the diffuse base replaced by transmission, in [0, 1]: thin-walled, or into the `volume`.
    pub transmission: f32,
    /// Multiplies `transmission` by its R (linear image).
    pub transmission_texture: Option<TextureBinding>,
    /// What the surface encloses; `None` for a thin wall.
    pub volume: Option<Volume>,
    /// Strength of the dielectric's specular reflection, in [0, 1] (KHR_materials_specular).
    pub specular: f32,
    /// Multiplies `specular` by its A (linear image).
    pub specular_texture: Option<TextureBinding>,
    /// Colour of the dielectric's reflectance at normal incidence, ≥ 0; may exceed 1.
    pub specular_color: [f32; 3],
    /// Multiplies `specular_color` (sRGB-encoded image, RGB used).
    pub specular_color_texture: Option<TextureBinding>,
    /// Strength of the anisotropy, in [0, 1] (KHR_materials_anisotropy).
    pub anisotropy: f32,
    /// Direction in which the surface is rougher: counter-clockwise from the tangent, on top of the texture's, in radians.
    pub anisotropy_rotation_radians: f32,
    /// Direction in its R and G, as x and y of the tangent space in [-1, 1]; multiplies `anisotropy` by its B (linear image).
    pub anisotropy_texture: Option<TextureBinding>,
    /// Tangent-space normals (linear image, RGB).
    pub normal_texture: Option<TextureBinding>,
    /// Scales the x and y of `normal_texture`.
    pub normal_scale: f32,
    /// Alpha, in [0, 1]; multiplied by that of `base_color_texture`.
    pub alpha: f32,
    /// What alpha means.
    pub alpha_mode: AlphaMode,
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
            transmission_texture: None,
            volume: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: [1.0; 3],
            specular_color_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation_radians: 0.0,
            anisotropy_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            alpha: 1.0,
            alpha_mode: AlphaMode::Opaque,
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

    /// The textures that are bound, whatever for.
    pub fn textures(&self) -> impl Iterator<Item = TextureBinding> {
        [
            self.base_color_texture,
            self.metallic_roughness_texture,
            self.emission_texture,
            self.normal_texture,
            self.transmission_texture,
            self.specular_texture,
            self.specular_color_texture,
            self.anisotropy_texture,
        ]
        .into_iter()
        .flatten()
    }

    /// Which sets of texture coordinates its textures look up.
    pub fn texcoord_sets(&self) -> [bool; 2] {
        self.textures().fold([false; 2], |mut sets, binding| {
            sets[binding.set] = true;
            sets
        })
    }

    /// Where shading needs a tangent: the set and the transform of the texture coordinates along which it runs, those of
    /// the normal texture if there is one, else those of the anisotropy texture, else set 0.
    pub fn tangent_coordinates(&self) -> Option<(usize, TextureTransform)> {
        let needed = match self.bsdf {
            Bsdf::Unlit => false,
            Bsdf::MetallicRoughness => self.normal_texture.is_some() || self.anisotropy > 0.0,
            _ => self.normal_texture.is_some(),
        };
        let binding = self.normal_texture.or(self.anisotropy_texture);
        needed.then(|| binding.map_or((0, TextureTransform::IDENTITY), |b| (b.set, b.transform)))
    }

    /// Whether any point of the surface can emit light that is sampled (unlit surfaces are seen, not sampled).
    pub fn is_emissive(&self) -> bool {
        self.emission.iter().any(|&e| e > 0.0)
    }
}
