//! MTL materials to ours. The first row that fits counts.
//!
//! | condition | becomes |
//! |---|---|
//! | a statement of the PBR extension: `Pr`, `Pm`, `Ps`, `Pc`, `aniso`, `map_Pr`, `map_Pm`, … | metallic-roughness: base colour `Kd`, roughness `Pr` × `map_Pr` (without either that of `Ns`), metalness `Pm` × `map_Pm`, index `Ni`; `illum` 4, 6, 7, 9: thin-walled transmission by the largest of `Tf` |
//! | `illum` 3, 5, 8, `Ks` not black | mirror of colour `Ks`; a diffuse part is dropped, with a warning |
//! | `illum` 6, transparent | refraction without Fresnel reflection, colour `Tf` or white, index `Ni` or 1.5 |
//! | `illum` 4, 7, 9, transparent | glass, colour `Tf` or white, index `Ni` or 1.5 |
//! | `illum` 2 and more, or none; `Ks` not black, `Kd` black | a metal of colour `Ks`, roughness from `Ns` |
//! | `illum` 2 and more, or none; `Ks` not black | a dielectric over `Kd` that reflects 0.08·`Ks` at normal incidence, roughness from `Ns` |
//! | else | Lambertian of `Kd` |
//!
//! *Transparent* means `Ni` other than 1, or `Tf` other than black, or `d` below 1. Where that makes no glass, `d` × `map_d`
//! is alpha. `norm` is a map of normals, and so is `map_Bump` where its image looks like one. `Ke` × `map_Ke` is emitted, from the front. `Kd` defaults to 0.8, or to white where there is `map_Kd`; `Ke` to
//! black, or to white where there is `map_Ke`. `Ka` is ignored.

use super::material::{MtlMaterial, MtlTexture};
use super::textures::{Source, Textures};
use crate::scene::load::warnings::Warnings;
use crate::scene::{AlphaMode, Bsdf, Material, TextureBinding};

/// Reflectance at normal incidence of a highlight of `Ks` 1. Blender writes its principled shader's specular level as
/// `Ks`, and reads it back as such: 0.5 is the 4 % of an index of refraction of 1.5.
const REFLECTANCE_OF_WHITE_KS: f32 = 0.08;
/// Reflectance at normal incidence of the default index of refraction.
const REFLECTANCE_OF_DEFAULT_IOR: f32 = 0.04;

/// Converts a material that some face uses.
pub(super) fn convert(name: &str, mtl: &MtlMaterial, textures: &mut Textures, warnings: &mut Warnings) -> Material {
    let mut warn = |subject: &str| warnings.add(subject, format!("\"{name}\" in {}", mtl.place));
    let mut material = Material { name: name.to_owned(), ..base(mtl, &mut warn) };
    let has_color_maps = matches!(material.bsdf, Bsdf::Lambertian | Bsdf::MetallicRoughness);
    if has_color_maps {
        set_alpha(&mut material, mtl);
    }
    limit(&mut material, &mut warn);
    bind_textures(&mut material, mtl, has_color_maps, textures);
    if material.bsdf == Bsdf::Mirror && (mtl.diffuse.is_some_and(|kd| kd != [0.0; 3]) || mtl.diffuse_texture.is_some())
    {
        warn("mirrors (illum 3, 5, 8) have no diffuse part: Kd is ignored");
    }
    if let Some(bump) = mtl.bump_texture.as_ref().filter(|bump| mtl.normal_texture.is_none() && !bump.file.exists()) {
        warn(&format!("the bump map {} does not exist: it is ignored", bump.file.display()));
    }
    for statement in &mtl.ignored {
        warn(&format!("{statement} is not supported yet and ignored{}", why_ignored(statement)));
    }
    material
}

fn why_ignored(statement: &str) -> &'static str {
    match statement {
        "Ps" => " (sheen)",
        "Pc" => " (clearcoat)",
        _ => "",
    }
}

/// The scattering model with its numbers, as they stand in the file.
fn base(mtl: &MtlMaterial, warn: &mut impl FnMut(&str)) -> Material {
    let diffuse = mtl.diffuse.unwrap_or(if mtl.diffuse_texture.is_some() { [1.0; 3] } else { [0.8; 3] });
    let specular = mtl.specular.unwrap_or([0.0; 3]);
    let filter = mtl.transmission_filter.filter(|filter| *filter != [0.0; 3]);
    let ior = mtl.ior.filter(|&ior| ior != 1.0 && ior > 0.0);
    let transparent = filter.is_some() || ior.is_some() || mtl.dissolve.is_some_and(|dissolve| dissolve < 1.0);
    let illum = mtl.illum.unwrap_or(2);
    let of = |bsdf, base_color| Material {
        bsdf,
        base_color,
        ior: ior.unwrap_or(1.5),
        ..Material::lambertian("", base_color)
    };
    if mtl.is_pbr {
        return pbr(mtl, of(Bsdf::MetallicRoughness, diffuse), illum, filter);
    }
    let has_black_kd = diffuse == [0.0; 3] && mtl.diffuse_texture.is_none();
    match illum {
        3 | 5 | 8 if specular != [0.0; 3] => of(Bsdf::Mirror, specular),
        6 if transparent => of(Bsdf::Refract, filter.unwrap_or([1.0; 3])),
        4 | 7 | 9 if transparent => of(Bsdf::Glass, filter.unwrap_or([1.0; 3])),
        2.. if specular != [0.0; 3] && has_black_kd => Material {
            metallic: 1.0,
            roughness: roughness_of_exponent(mtl.exponent),
            ..of(Bsdf::MetallicRoughness, specular)
        },
        2.. if specular != [0.0; 3] => {
            if specular.iter().any(|&c| c > 1.0) {
                warn("highlights (Ks) above 1 are limited to 1");
            }
            let scale = REFLECTANCE_OF_WHITE_KS / REFLECTANCE_OF_DEFAULT_IOR;
            Material {
                metallic: 0.0,
                roughness: roughness_of_exponent(mtl.exponent),
                // The index would make a reflectance of its own.
                ior: 1.5,
                specular_color: specular.map(|c| c.min(1.0) * scale),
                ..of(Bsdf::MetallicRoughness, diffuse)
            }
        }
        _ => of(Bsdf::Lambertian, diffuse),
    }
}

/// The PBR extension (Clara.io, "Extending Wavefront MTL for physically-based rendering").
fn pbr(mtl: &MtlMaterial, material: Material, illum: u32, filter: Option<[f32; 3]>) -> Material {
    let of_map = |map: &Option<MtlTexture>| map.as_ref().map(|_| 1.0);
    let roughness = mtl.roughness.or(of_map(&mtl.roughness_texture));
    let transmission = filter.filter(|_| matches!(illum, 4 | 6 | 7 | 9));
    Material {
        roughness: roughness.unwrap_or_else(|| roughness_of_exponent(mtl.exponent)),
        metallic: mtl.metallic.or(of_map(&mtl.metallic_texture)).unwrap_or(0.0),
        transmission: transmission.map_or(0.0, |[r, g, b]| r.max(g).max(b)),
        anisotropy: mtl.anisotropy.unwrap_or(0.0),
        anisotropy_rotation_radians: mtl.anisotropy_rotation.unwrap_or(0.0) * std::f32::consts::TAU,
        ..material
    }
}

/// The roughness whose lobe is as wide as Phong's of exponent n: α² = 2/(n + 2) (Walter et al., "Microfacet Models for
/// Refraction through Rough Surfaces", EGSR 2007, §5.2), and α = roughness². Without an exponent it is 0, and roughness 1.
fn roughness_of_exponent(exponent: Option<f32>) -> f32 {
    (2.0 / (exponent.unwrap_or(0.0) + 2.0)).powf(0.25)
}

fn set_alpha(material: &mut Material, mtl: &MtlMaterial) {
    material.alpha = mtl.dissolve.unwrap_or(1.0);
    if material.alpha < 1.0 || mtl.alpha_texture.is_some() {
        material.alpha_mode = AlphaMode::Blend;
    }
}

/// Brings every factor into its range.
fn limit(material: &mut Material, warn: &mut impl FnMut(&str)) {
    let factors = [
        &mut material.roughness,
        &mut material.metallic,
        &mut material.transmission,
        &mut material.anisotropy,
        &mut material.alpha,
    ];
    if material.base_color.iter().any(|&c| c > 1.0) {
        material.base_color = material.base_color.map(|c| c.min(1.0));
        warn("colours above 1 would create light: they are limited to 1");
    }
    for factor in factors {
        if !(0.0..=1.0).contains(factor) {
            *factor = factor.clamp(0.0, 1.0);
            warn("numbers outside of [0, 1] (Pr, Pm, Tf, aniso, d) are limited");
        }
    }
}

fn bind_textures(material: &mut Material, mtl: &MtlMaterial, has_color_maps: bool, textures: &mut Textures) {
    let mut bind = |source: Option<Source>| -> Option<TextureBinding> { source.map(|source| textures.bind(source)) };
    let file = |map: &Option<MtlTexture>| map.clone().map(Source::File);
    let default_emission = if mtl.emission_texture.is_some() { [1.0; 3] } else { [0.0; 3] };
    material.emission = mtl.emission.unwrap_or(default_emission);
    if material.is_emissive() {
        material.emission_texture = bind(file(&mtl.emission_texture));
    }
    if !has_color_maps {
        return;
    }
    material.base_color_texture = bind(match mtl.alpha_texture.clone() {
        Some(alpha) => Some(Source::ColorAlpha { color: mtl.diffuse_texture.clone(), alpha }),
        None => file(&mtl.diffuse_texture),
    });
    // Which of the two a bump map is can only be seen in its image: see `drop_heights`.
    let bump = mtl.bump_texture.clone().filter(|bump| bump.file.exists()).map(Source::Bump);
    material.normal_scale = mtl.normal_texture.as_ref().or(mtl.bump_texture.as_ref()).map_or(1.0, |map| map.scale);
    material.normal_texture = bind(file(&mtl.normal_texture).or(bump));
    if material.bsdf != Bsdf::MetallicRoughness {
        return;
    }
    if mtl.is_pbr {
        let (roughness, metallic) = (mtl.roughness_texture.clone(), mtl.metallic_texture.clone());
        let any = roughness.is_some() || metallic.is_some();
        material.metallic_roughness_texture = bind(any.then_some(Source::RoughnessMetallic { roughness, metallic }));
    } else if material.metallic > 0.0 && mtl.alpha_texture.is_none() {
        // A metal by Ks: its colour is the highlight's.
        material.base_color_texture = bind(file(&mtl.specular_texture));
    } else if material.metallic == 0.0 {
        material.specular_color_texture = bind(file(&mtl.specular_texture));
    }
}
