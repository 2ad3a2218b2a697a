//! MTL materials to ours.
//!
//! | `illum` | condition | becomes |
//! |---|---|---|
//! | 3, 5, 8 | `Ks` is not black | mirror of colour `Ks`; a diffuse part is dropped, with a warning |
//! | 6 | transparent | refraction without Fresnel reflection, colour `Tf` or white, index `Ni` or 1.5 |
//! | 4, 7, 9 | transparent | glass, colour `Tf` or white, index `Ni` or 1.5 |
//! | else | | Lambertian of `Kd` × `map_Kd`; a glossy highlight (`illum` 2 and more, `Ks`) is dropped, with a warning |
//!
//! *Transparent* means `Ni` other than 1, or `Tf` other than black, or `d` below 1. `Ke` × `map_Ke` is emitted, from the
//! front. `Kd` defaults to 0.8, `Ke` to black, or to white where there is `map_Ke`. `Ka` and `Ns` are ignored.

use std::collections::HashMap;
use std::path::PathBuf;

use super::material::{MtlMaterial, MtlTexture};
use super::{at_line, file};
use crate::scene::load::image::decode_texture;
use crate::scene::load::warnings::Warnings;
use crate::scene::{Bsdf, Filter, Image, Material, SceneResult, Texture, TextureBinding, Wrap};

/// The textures that the materials converted so far need; their images are still encoded.
#[derive(Default)]
pub(super) struct Textures {
    textures: Vec<Texture>,
    known: HashMap<(PathBuf, bool), usize>,
    images: HashMap<PathBuf, usize>,
    pending: Vec<MtlTexture>,
}

impl Textures {
    fn bind(&mut self, texture: &MtlTexture) -> TextureBinding {
        let key = (texture.file.clone(), texture.wrap == Wrap::Repeat);
        if let Some(&texture) = self.known.get(&key) {
            return TextureBinding::new(texture);
        }
        let image = *self.images.entry(texture.file.clone()).or_insert_with(|| {
            self.pending.push(texture.clone());
            self.pending.len() - 1
        });
        self.textures.push(Texture { image, wrap_u: texture.wrap, wrap_v: texture.wrap, filter: Filter::Linear });
        self.known.insert(key, self.textures.len() - 1);
        TextureBinding::new(self.textures.len() - 1)
    }

    /// The textures, and the images they index, to be decoded in this order.
    pub(super) fn into_parts(self) -> (Vec<Texture>, Vec<MtlTexture>) {
        (self.textures, self.pending)
    }
}

/// Reads the image of a texture.
pub(super) fn decode(texture: MtlTexture) -> SceneResult<Image> {
    let name = texture.file.display().to_string();
    let fail = |message: String| at_line(&texture.library, texture.line, format!("the image {name}: {message}"));
    let bytes = file::read(&texture.file)
        .map_err(|error| fail(error.message).hint("put the file there, or remove the line"))?;
    decode_texture(&name, &bytes).map_err(|message| fail(message).hint("replace it by a whole PNG, JPEG or WebP file"))
}

/// Converts a material that some face uses.
pub(super) fn convert(
    name: &str,
    mtl: &MtlMaterial,
    textures: &mut Textures,
    warnings: &mut Warnings,
) -> SceneResult<Material> {
    let mut warn = |subject: &str| warnings.add(subject, format!("\"{name}\" in {}", mtl.place));
    let illum = mtl.illum.unwrap_or(1);
    let diffuse = mtl.diffuse.unwrap_or([0.8; 3]);
    let specular = mtl.specular.unwrap_or([0.0; 3]);
    let filter = mtl.transmission_filter.filter(|filter| *filter != [0.0; 3]);
    let ior = mtl.ior.filter(|&ior| ior != 1.0 && ior > 0.0);
    let dissolves = mtl.dissolve.is_some_and(|dissolve| dissolve < 1.0);
    let transparent = filter.is_some() || ior.is_some() || dissolves;

    let (bsdf, color) = match illum {
        3 | 5 | 8 if specular != [0.0; 3] => (Bsdf::Mirror, specular),
        6 if transparent => (Bsdf::Refract, filter.unwrap_or([1.0; 3])),
        4 | 7 | 9 if transparent => (Bsdf::Glass, filter.unwrap_or([1.0; 3])),
        _ => (Bsdf::Lambertian, diffuse),
    };
    let mut material =
        Material { bsdf, ior: ior.unwrap_or(1.5), ..Material::lambertian(name, color.map(|c| c.min(1.0))) };
    if color.iter().any(|&c| c > 1.0) {
        warn("colours above 1 would create light: they are limited to 1");
    }
    match bsdf {
        Bsdf::Lambertian => {
            if illum >= 2 && specular != [0.0; 3] {
                warn("glossy highlights (Ks, Ns) are not supported yet: the surface is diffuse");
            }
            if dissolves {
                warn("opacity (d, Tr) is not supported yet: the surface is opaque");
            }
            material.base_color_texture = mtl.diffuse_texture.as_ref().map(|texture| textures.bind(texture));
        }
        Bsdf::Mirror if mtl.diffuse.is_some_and(|diffuse| diffuse != [0.0; 3]) || mtl.diffuse_texture.is_some() => {
            warn("mirrors (illum 3, 5, 8) have no diffuse part: Kd is ignored");
        }
        _ => {}
    }
    let default_emission = if mtl.emission_texture.is_some() { [1.0; 3] } else { [0.0; 3] };
    material.emission = mtl.emission.unwrap_or(default_emission);
    if material.is_emissive() {
        material.emission_texture = mtl.emission_texture.as_ref().map(|texture| textures.bind(texture));
    }
    for map in &mtl.ignored_maps {
        warn(&format!("{map} is not supported yet and ignored"));
    }
    Ok(material)
}
