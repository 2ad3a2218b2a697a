//! Materials.
//!
//! glTF's metallic-roughness model, or one of the classic BSDFs by the extras
//! `{"sunfleck": {"bsdf": "lambertian" | "mirror" | "refract" | "glass", "fresnel": "exact" | "schlick",
//! "black_back": true | false}}`; their colour is the base colour, their index of refraction KHR_materials_ior's.

use std::f64::consts::TAU;

use super::Loader;
use super::json::Json;
use crate::scene::{AlphaMode, Bsdf, Fresnel, Material, SceneResult, TextureBinding, TextureTransform, Volume};

impl Loader<'_> {
    /// The index in `Scene::materials` of a glTF material, or of the default one. Where a primitive lacks a set of
    /// texture coordinates, textures on it cannot be used and their factors stand alone.
    pub(super) fn material(
        &mut self,
        place: Option<(usize, Json<'_>)>,
        has_texcoords: [bool; 2],
    ) -> SceneResult<usize> {
        let key = (place.as_ref().map(|(index, _)| *index), if place.is_none() { [true; 2] } else { has_texcoords });
        if let Some(&known) = self.materials.get(&key) {
            return Ok(known);
        }
        let material = match &place {
            Some((_, place)) => self.read_material(place, has_texcoords)?,
            None => Material { name: String::from("default"), ..Material::default() },
        };
        self.scene.materials.push(material);
        let index = self.scene.materials.len() - 1;
        self.materials.insert(key, index);
        Ok(index)
    }

    fn read_material(&mut self, place: &Json<'_>, has_texcoords: [bool; 2]) -> SceneResult<Material> {
        let mut material = Material {
            name: place.name(),
            double_sided: place.flag("doubleSided")?,
            ior: self.index_of_refraction(place)?,
            ..Material::default()
        };
        if let Some(unlit) = place.extension("KHR_materials_unlit")? {
            let _ = unlit.keys()?;
            material.bsdf = Bsdf::Unlit;
        }
        read_extras(place, &mut material)?;
        material.alpha_mode = self.alpha_mode(place)?;
        if let Some(pbr) = place.get("pbrMetallicRoughness")? {
            self.read_metallic_roughness(&pbr, &mut material, has_texcoords)?;
        }
        if material.bsdf != Bsdf::Unlit {
            self.read_emission(place, &mut material, has_texcoords)?;
            self.read_normal_map(place, &mut material, has_texcoords)?;
        }
        if material.bsdf == Bsdf::MetallicRoughness {
            self.read_specular(place, &mut material, has_texcoords)?;
            self.read_transmission(place, &mut material, has_texcoords)?;
            self.read_anisotropy(place, &mut material, has_texcoords)?;
        }
        material.volume = read_volume(place, &material)?;
        self.warn_of_material(place)?;
        Ok(material)
    }

    /// What the base colour's alpha means. A cutoff above 1 leaves nothing.
    fn alpha_mode(&mut self, place: &Json<'_>) -> SceneResult<AlphaMode> {
        let Some(mode) = place.get("alphaMode")? else { return Ok(AlphaMode::Opaque) };
        match mode.string()? {
            "OPAQUE" => Ok(AlphaMode::Opaque),
            "BLEND" => Ok(AlphaMode::Blend),
            "MASK" => {
                let cutoff = place.number_in("alphaCutoff", 0.5, 0.0, f64::from(f32::MAX))?;
                Ok(AlphaMode::Mask { cutoff: cutoff as f32 })
            }
            other => {
                let subject = format!("alphaMode {other} is none of OPAQUE, MASK and BLEND: the surface is opaque");
                self.warnings.add(subject, &mode.pointer);
                Ok(AlphaMode::Opaque)
            }
        }
    }

    fn read_metallic_roughness(
        &mut self,
        pbr: &Json<'_>,
        material: &mut Material,
        has_texcoords: [bool; 2],
    ) -> SceneResult<()> {
        if let Some(place) = pbr.get("baseColorFactor")? {
            for component in place.elements()? {
                component.number_within(0.0, 1.0)?;
            }
            let [r, g, b, alpha] = place.numbers::<4>()?;
            material.base_color = [r, g, b].map(|c| c as f32);
            material.alpha = alpha as f32;
        }
        if material.base_color != [0.0; 3] || material.alpha_mode != AlphaMode::Opaque {
            material.base_color_texture = self.texture(pbr.get("baseColorTexture")?, has_texcoords)?;
        }
        // Lambertian reflection has no roughness, but a lobe that somebody's own shaders put in its place has.
        if matches!(material.bsdf, Bsdf::Lambertian | Bsdf::MetallicRoughness) {
            material.roughness = pbr.number_in("roughnessFactor", 1.0, 0.0, 1.0)? as f32;
        }
        if material.bsdf == Bsdf::MetallicRoughness {
            material.metallic = pbr.number_in("metallicFactor", 1.0, 0.0, 1.0)? as f32;
            if material.metallic > 0.0 || material.roughness > 0.0 {
                material.metallic_roughness_texture =
                    self.texture(pbr.get("metallicRoughnessTexture")?, has_texcoords)?;
            }
        }
        Ok(())
    }

    fn read_emission(
        &mut self,
        place: &Json<'_>,
        material: &mut Material,
        has_texcoords: [bool; 2],
    ) -> SceneResult<()> {
        let factor = place.color("emissiveFactor", [0.0; 3], f64::MAX)?;
        let strength = match place.extension("KHR_materials_emissive_strength")? {
            Some(extension) => extension.number_in("emissiveStrength", 1.0, 0.0, f64::MAX)?,
            None => 1.0,
        };
        material.emission = factor.map(|f| (f * strength) as f32);
        if !material.emission.iter().all(|e| e.is_finite()) {
            return Err(place.fail("the emission (emissiveFactor times strength) is too large for a 32-bit float"));
        }
        if material.is_emissive() {
            material.emission_texture = self.texture(place.get("emissiveTexture")?, has_texcoords)?;
        }
        Ok(())
    }

    fn read_normal_map(
        &mut self,
        place: &Json<'_>,
        material: &mut Material,
        has_texcoords: [bool; 2],
    ) -> SceneResult<()> {
        let Some(info) = place.get("normalTexture")? else { return Ok(()) };
        material.normal_scale = info.number_or("scale", 1.0)? as f32;
        if !material.normal_scale.is_finite() {
            return Err(info.fail("the scale is too large for a 32-bit float"));
        }
        if material.normal_scale != 0.0 {
            material.normal_texture = self.texture(Some(info), has_texcoords)?;
        }
        Ok(())
    }

    fn index_of_refraction(&mut self, place: &Json<'_>) -> SceneResult<f32> {
        let Some(extension) = place.extension("KHR_materials_ior")? else { return Ok(1.5) };
        let ior = extension.number_in("ior", 1.5, 0.0, f64::from(f32::MAX))? as f32;
        if ior > 0.0 {
            return Ok(ior);
        }
        // KHR_materials_ior gives 0 a meaning of its own: full reflection, for converted specular-glossiness materials.
        self.warnings.add("an index of refraction of 0 is not supported yet: 1.5 is used", &extension.pointer);
        Ok(1.5)
    }

    fn read_specular(
        &mut self,
        place: &Json<'_>,
        material: &mut Material,
        has_texcoords: [bool; 2],
    ) -> SceneResult<()> {
        let Some(extension) = place.extension("KHR_materials_specular")? else { return Ok(()) };
        material.specular = extension.number_in("specularFactor", 1.0, 0.0, 1.0)? as f32;
        material.specular_color =
            extension.color("specularColorFactor", [1.0; 3], f64::from(f32::MAX))?.map(|c| c as f32);
        if material.specular > 0.0 {
            material.specular_texture = self.texture(extension.get("specularTexture")?, has_texcoords)?;
            material.specular_color_texture = self.texture(extension.get("specularColorTexture")?, has_texcoords)?;
        }
        Ok(())
    }

    fn read_anisotropy(
        &mut self,
        place: &Json<'_>,
        material: &mut Material,
        has_texcoords: [bool; 2],
    ) -> SceneResult<()> {
        let Some(extension) = place.extension("KHR_materials_anisotropy")? else { return Ok(()) };
        material.anisotropy = extension.number_in("anisotropyStrength", 0.0, 0.0, 1.0)? as f32;
        if material.anisotropy > 0.0 {
            let rotation = extension.number_or("anisotropyRotation", 0.0)?;
            material.anisotropy_rotation_radians = rotation.rem_euclid(TAU) as f32;
            material.anisotropy_texture = self.texture(extension.get("anisotropyTexture")?, has_texcoords)?;
        }
        Ok(())
    }

    /// KHR_materials_transmission: thin-walled, or into a volume.
    fn read_transmission(
        &mut self,
        place: &Json<'_>,
        material: &mut Material,
        has_texcoords: [bool; 2],
    ) -> SceneResult<()> {
        let Some(extension) = place.extension("KHR_materials_transmission")? else { return Ok(()) };
        material.transmission = extension.number_in("transmissionFactor", 0.0, 0.0, 1.0)? as f32;
        if material.transmission > 0.0 {
            material.transmission_texture = self.texture(extension.get("transmissionTexture")?, has_texcoords)?;
        }
        Ok(())
    }

    /// Names the features of a material that are not covered. Occlusion textures are no part of a path tracer.
    fn warn_of_material(&mut self, place: &Json<'_>) -> SceneResult<()> {
        for name in place.extension_names()? {
            let known = super::SUPPORTED.contains(&name.as_str()) || super::INVISIBLE.contains(&name.as_str());
            if !known {
                let subject = format!("{name} is not supported yet: what it describes is ignored");
                self.warnings.add(subject, &place.pointer);
            }
        }
        Ok(())
    }

    /// The binding of a texture info object; `None` if there is none or it cannot be honoured.
    fn texture(&mut self, info: Option<Json<'_>>, has_texcoords: [bool; 2]) -> SceneResult<Option<TextureBinding>> {
        let Some(info) = info else { return Ok(None) };
        let extension = info.extension("KHR_texture_transform")?;
        let (index, place) = info.require("index")?.refer("textures")?;
        let own_set = info.unsigned_or("texCoord", 0)?;
        let set = extension.as_ref().map_or(Ok(own_set), |extension| extension.unsigned_or("texCoord", own_set))?;
        match has_texcoords.get(set) {
            Some(true) => {}
            Some(false) => {
                let subject =
                    format!("textures on meshes without TEXCOORD_{set} cannot be shown: their factor alone is used");
                self.warnings.add(subject, &info.pointer);
                return Ok(None);
            }
            None => {
                let subject = "textures on TEXCOORD_2 and higher are not supported yet: their factor alone is used";
                self.warnings.add(subject, &info.pointer);
                return Ok(None);
            }
        }
        let transform = extension.map_or(Ok(TextureTransform::IDENTITY), |extension| read_transform(&extension))?;
        let texture = self.load_texture(index, &place)?;
        Ok(Some(TextureBinding { texture, set, transform }))
    }
}

/// KHR_materials_volume: what a surface that transmits encloses, unless its thickness of 0 says that it is a thin wall.
/// How thick it is, geometry says.
fn read_volume(place: &Json<'_>, material: &Material) -> SceneResult<Option<Volume>> {
    let Some(extension) = place.extension("KHR_materials_volume")? else { return Ok(None) };
    let thickness = extension.number_in("thicknessFactor", 0.0, 0.0, f64::MAX)?;
    let attenuation_color = extension.color("attenuationColor", [1.0; 3], 1.0)?.map(|c| c as f32);
    let distance = match extension.get("attenuationDistance")? {
        Some(place) => place.number_within(f64::from(f32::MIN_POSITIVE), f64::MAX)?,
        None => f64::INFINITY,
    };
    let transmits = match material.bsdf {
        Bsdf::MetallicRoughness => material.transmission > 0.0,
        Bsdf::Refract | Bsdf::Glass => true,
        Bsdf::Lambertian | Bsdf::Mirror | Bsdf::Unlit => false,
    };
    Ok((transmits && thickness > 0.0).then_some(Volume { attenuation_color, attenuation_distance: distance as f32 }))
}

/// KHR_texture_transform.
fn read_transform(extension: &Json<'_>) -> SceneResult<TextureTransform> {
    let pair = |key: &str, default: [f64; 2]| extension.get(key)?.map_or(Ok(default), |place| place.numbers::<2>());
    let transform = TextureTransform::new(
        pair("offset", [0.0; 2])?,
        extension.number_or("rotation", 0.0)?,
        pair("scale", [1.0; 2])?,
    );
    if transform.rows.iter().flatten().all(|x| x.is_finite()) {
        Ok(transform)
    } else {
        Err(extension.fail("the texture transform is too large for a 32-bit float"))
    }
}

/// The material's `sunfleck` extras.
fn read_extras(place: &Json<'_>, material: &mut Material) -> SceneResult<()> {
    let Some(extras) = place.sunfleck_extras(&["bsdf", "fresnel", "black_back"])? else { return Ok(()) };
    if let Some(bsdf) = extras.get("bsdf")? {
        material.bsdf = match bsdf.string()? {
            "lambertian" => Bsdf::Lambertian,
            "mirror" => Bsdf::Mirror,
            "refract" => Bsdf::Refract,
            "glass" => Bsdf::Glass,
            other => {
                let error = bsdf.fail(format!("\"{other}\" is no BSDF"));
                return Err(error.hint("use lambertian, mirror, refract or glass"));
            }
        };
    }
    if let Some(fresnel) = extras.get("fresnel")? {
        material.fresnel = match fresnel.string()? {
            "exact" => Fresnel::Exact,
            "schlick" => Fresnel::Schlick,
            other => {
                return Err(fresnel.fail(format!("\"{other}\" is no Fresnel term")).hint("use exact or schlick"));
            }
        };
    }
    material.black_back = extras.flag("black_back")?;
    Ok(())
}
