//! Textures, samplers and images. Images are collected while materials are read and decoded at the end, in parallel.

use std::sync::Arc;

use rayon::prelude::*;

use super::Loader;
use super::buffer::{View, file_of_uri, read_uri};
use super::json::Json;
use crate::scene::load::Decoded;
use crate::scene::{Filter, Image, SceneError, SceneResult, Texture, Wrap};

/// An image that some material needs, still encoded.
pub(super) struct PendingImage {
    name: String,
    encoded: Encoded,
    pointer: String,
    path: std::path::PathBuf,
}

enum Encoded {
    File(std::path::PathBuf),
    Bytes(Vec<u8>),
    View(View),
}

impl Loader<'_> {
    /// The index in `Scene::textures` of a glTF texture.
    pub(super) fn load_texture(&mut self, index: usize, place: &Json<'_>) -> SceneResult<usize> {
        if let Some(&known) = self.textures.get(&index) {
            return Ok(known);
        }
        for name in place.extension_names()?.into_iter().filter(|name| *name != "EXT_texture_webp") {
            let subject = format!("{name} is not supported yet: the texture's plain image is used");
            self.warnings.add(subject, &place.pointer);
        }
        let webp = match place.extension("EXT_texture_webp")? {
            Some(extension) => extension.refer_by("source", "images")?,
            None => None,
        };
        let source = webp.map_or_else(|| place.refer_by("source", "images"), |image| Ok(Some(image)))?;
        let Some((image_index, image)) = source else {
            return Err(place.fail("the texture has no image that can be read").hint("use PNG, JPEG or WebP images"));
        };
        let image = self.image(image_index, &image)?;
        let sampler = place.refer_by("sampler", "samplers")?.map(|(_, sampler)| sampler);
        self.scene.textures.push(read_sampler(sampler, image)?);
        self.textures.insert(index, self.scene.textures.len() - 1);
        Ok(self.scene.textures.len() - 1)
    }

    fn image(&mut self, index: usize, place: &Json<'_>) -> SceneResult<usize> {
        if let Some(&known) = self.images.get(&index) {
            return Ok(known);
        }
        let (name, encoded) = match (place.get("uri")?, place.refer_by("bufferView", "bufferViews")?) {
            (Some(uri), _) => match file_of_uri(&uri)? {
                Some(file) => (file.display().to_string(), Encoded::File(file)),
                None => (place.name(), Encoded::Bytes(read_uri(&uri)?)),
            },
            (None, Some((_, view))) => (place.name(), Encoded::View(self.buffers.view(&view)?)),
            (None, None) => return Err(place.fail("the image has neither \"uri\" nor \"bufferView\"")),
        };
        let path = place.document.path.clone();
        self.pending_images.push(PendingImage { name, encoded, pointer: place.pointer.clone(), path });
        self.images.insert(index, self.pending_images.len() - 1);
        Ok(self.pending_images.len() - 1)
    }
}

/// Decodes all images, in order. Of several broken ones the first is reported.
pub(super) fn decode(pending: Vec<PendingImage>, decoded: &Decoded) -> SceneResult<Vec<Arc<Image>>> {
    let images: Vec<_> = pending.into_par_iter().map(|pending| decode_one(pending, decoded)).collect();
    images.into_iter().collect()
}

fn decode_one(pending: PendingImage, decoded: &Decoded) -> SceneResult<Arc<Image>> {
    let PendingImage { name, encoded, pointer, path } = pending;
    let fail = |message: String| {
        let subject = if name.is_empty() { String::from("the image") } else { format!("the image {name}") };
        SceneError::at(&path, &pointer, format!("{subject}: {message}"))
    };
    let hint = "replace it by a whole PNG, JPEG or WebP file";
    let decode = |bytes: &[u8]| decoded.texture(&name, bytes).map_err(|message| fail(message).hint(hint));
    match encoded {
        Encoded::Bytes(bytes) => decode(&bytes),
        Encoded::View(view) => decode(view.bytes()),
        Encoded::File(file) => {
            let bytes = super::file::read(&file)
                .map_err(|error| fail(error.message).hint(format!("put it there, beside {}", path.display())))?;
            decode(&bytes)
        }
    }
}

/// A texture of `image` with its sampler; without one it repeats and is filtered linearly. Minification filters do not
/// matter: every pixel takes many samples.
fn read_sampler(sampler: Option<Json<'_>>, image: usize) -> SceneResult<Texture> {
    let Some(sampler) = sampler else {
        return Ok(Texture { image, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, filter: Filter::Linear });
    };
    let wrap = |key: &str| match sampler.unsigned_or(key, 10497)? {
        10497 => Ok(Wrap::Repeat),
        33071 => Ok(Wrap::ClampToEdge),
        33648 => Ok(Wrap::MirroredRepeat),
        other => Err(sampler.fail(format!("{key} {other} is no wrap mode of glTF 2.0"))),
    };
    let filter = match sampler.unsigned_or("magFilter", 9729)? {
        9728 => Filter::Nearest,
        9729 => Filter::Linear,
        other => return Err(sampler.fail(format!("magFilter {other} is no magnification filter of glTF 2.0"))),
    };
    Ok(Texture { image, wrap_u: wrap("wrapS")?, wrap_v: wrap("wrapT")?, filter })
}
