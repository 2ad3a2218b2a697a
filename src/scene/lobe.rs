//! Which lobes a material has: what of the BSDFs' code it can need, whatever its textures say.

use super::{Bsdf, Material};

/// A part of a material's scattering, or its emission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Lobe {
    /// Lambertian reflection: of [`Bsdf::Lambertian`], or the base of metallic-roughness.
    Diffuse,
    /// Reflection of metallic-roughness' dielectric.
    DielectricReflection,
    /// Reflection of metallic-roughness' metal.
    MetalReflection,
    /// Transmission through a thin wall, without refraction.
    ThinTransmission,
    /// The boundary of a solid dielectric: reflection and refraction, and absorption inside.
    DielectricBoundary,
    /// [`Bsdf::Mirror`].
    Mirror,
    /// [`Bsdf::Refract`].
    Refraction,
    /// [`Bsdf::Glass`].
    Glass,
    /// Shows its colour without scattering.
    Unlit,
    /// Emission that is sampled as a light.
    Emission,
}

impl Lobe {
    /// Name for people and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse",
            Self::DielectricReflection => "dielectric-reflection",
            Self::MetalReflection => "metal-reflection",
            Self::ThinTransmission => "thin-transmission",
            Self::DielectricBoundary => "dielectric-boundary",
            Self::Mirror => "mirror",
            Self::Refraction => "refraction",
            Self::Glass => "glass",
            Self::Unlit => "unlit",
            Self::Emission => "emission",
        }
    }
}

impl Material {
    /// The lobes that some point of the surface may have: a texture may take any value up to its factor.
    pub fn lobes(&self) -> Vec<Lobe> {
        let mut lobes = match self.bsdf {
            Bsdf::Lambertian if self.base_color == [0.0; 3] => Vec::new(),
            Bsdf::Lambertian => vec![Lobe::Diffuse],
            Bsdf::Mirror => vec![Lobe::Mirror],
            Bsdf::Refract => vec![Lobe::Refraction],
            Bsdf::Glass => vec![Lobe::Glass],
            Bsdf::Unlit => return vec![Lobe::Unlit],
            Bsdf::MetallicRoughness => self.metallic_roughness_lobes(),
        };
        if self.is_emissive() {
            lobes.push(Lobe::Emission);
        }
        lobes
    }

    fn metallic_roughness_lobes(&self) -> Vec<Lobe> {
        let dielectric = self.metallic < 1.0 || self.metallic_roughness_texture.is_some();
        let opaque_base = self.transmission < 1.0 || self.transmission_texture.is_some();
        let transmits = dielectric && self.transmission > 0.0;
        let colored = self.base_color != [0.0; 3];
        [
            (Lobe::Diffuse, dielectric && opaque_base && colored),
            // All of a solid that transmits everything is its boundary.
            (Lobe::DielectricReflection, dielectric && self.specular > 0.0 && (self.volume.is_none() || opaque_base)),
            (Lobe::MetalReflection, self.metallic > 0.0),
            (Lobe::ThinTransmission, transmits && colored && self.volume.is_none()),
            (Lobe::DielectricBoundary, transmits && self.volume.is_some()),
        ]
        .into_iter()
        .filter_map(|(lobe, present)| present.then_some(lobe))
        .collect()
    }

    /// What each texture is for, in words.
    pub fn texture_uses(&self) -> Vec<&'static str> {
        [
            ("base colour", self.base_color_texture),
            ("metallic-roughness", self.metallic_roughness_texture),
            ("emission", self.emission_texture),
            ("normal", self.normal_texture),
            ("transmission", self.transmission_texture),
            ("specular", self.specular_texture),
            ("specular colour", self.specular_color_texture),
            ("anisotropy", self.anisotropy_texture),
        ]
        .into_iter()
        .filter_map(|(name, binding)| binding.map(|_| name))
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{TextureBinding, Volume};

    fn names(material: &Material) -> Vec<&'static str> {
        material.lobes().into_iter().map(Lobe::name).collect()
    }

    #[test]
    fn a_material_has_the_lobes_that_its_factors_allow() {
        let metal = Material::default();
        assert_eq!(names(&metal), ["metal-reflection"]);
        let plastic = Material { metallic: 0.0, ..Material::default() };
        assert_eq!(names(&plastic), ["diffuse", "dielectric-reflection"]);
        let painted = Material { metallic_roughness_texture: Some(TextureBinding::new(0)), ..Material::default() };
        assert_eq!(names(&painted), ["diffuse", "dielectric-reflection", "metal-reflection"]);
        let window = Material { transmission: 1.0, ..plastic.clone() };
        assert_eq!(names(&window), ["dielectric-reflection", "thin-transmission"]);
        let volume = Some(Volume { attenuation_color: [1.0; 3], attenuation_distance: f32::INFINITY });
        let solid = Material { volume, ..window };
        assert_eq!(names(&solid), ["dielectric-boundary"]);
        assert_eq!(names(&Material { volume, ..plastic }), ["diffuse", "dielectric-reflection"]);
    }

    #[test]
    fn emission_counts_unless_it_is_unlit() {
        let lamp = Material { emission: [1.0; 3], ..Material::lambertian("lamp", [0.0; 3]) };
        assert_eq!(names(&lamp), ["emission"]);
        assert_eq!(names(&Material { bsdf: Bsdf::Unlit, ..lamp }), ["unlit"]);
    }
}
