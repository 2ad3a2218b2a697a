//! Textures of MTL materials: which images they need, and how several maps become one image. MTL has a file for each
//! quantity; ours pack alpha beside colour, and roughness (G) with metalness (B).

use std::collections::HashMap;
use std::sync::Arc;

use super::material::MtlTexture;
use super::{at_line, file};
use crate::scene::load::Decoded;
use crate::scene::load::warnings::Warnings;
use crate::scene::{Filter, Image, Scene, SceneResult, Texels, Texture, TextureBinding};

/// What an image is made of.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Source {
    /// A file as it is.
    File(MtlTexture),
    /// A bump map: normals or heights, as its image shows.
    Bump(MtlTexture),
    /// Colour, or white, with the alpha of another file.
    ColorAlpha { color: Option<MtlTexture>, alpha: MtlTexture },
    /// Roughness in G and metalness in B, 1 where there is no file.
    RoughnessMetallic { roughness: Option<MtlTexture>, metallic: Option<MtlTexture> },
}

impl Source {
    /// The map that decides how the image is wrapped.
    fn first(&self) -> Option<&MtlTexture> {
        match self {
            Self::File(texture) | Self::Bump(texture) => Some(texture),
            Self::ColorAlpha { color, alpha } => color.as_ref().or(Some(alpha)),
            Self::RoughnessMetallic { roughness, metallic } => roughness.as_ref().or(metallic.as_ref()),
        }
    }
}

/// The textures that the materials converted so far need; their images are not decoded yet.
#[derive(Default)]
pub(super) struct Textures {
    textures: Vec<Texture>,
    known: HashMap<Source, usize>,
    pending: Vec<Source>,
}

impl Textures {
    /// The texture of an image.
    pub(super) fn bind(&mut self, source: Source) -> TextureBinding {
        if let Some(&texture) = self.known.get(&source) {
            return TextureBinding::new(texture);
        }
        let wrap = source.first().map(|texture| texture.wrap).unwrap_or_default();
        let same_image =
            |other: &Source| matches!((other, &source), (Source::File(a), Source::File(b)) if a.file == b.file);
        let image = self.pending.iter().position(same_image).unwrap_or_else(|| {
            self.pending.push(source.clone());
            self.pending.len() - 1
        });
        self.textures.push(Texture { image, wrap_u: wrap, wrap_v: wrap, filter: Filter::Linear });
        self.known.insert(source, self.textures.len() - 1);
        TextureBinding::new(self.textures.len() - 1)
    }

    /// The textures, and what the images they index are made of, to be decoded in this order.
    pub(super) fn into_parts(self) -> (Vec<Texture>, Vec<Source>) {
        (self.textures, self.pending)
    }
}

/// Takes away the bump maps that hold heights, which nothing here can use, and says so. MTL means heights by `map_Bump`, but
/// Blender and others write tangent-space normals there. Those are bluish: the mean of z, stored as (z + 1)/2 in blue, is
/// well above that of x and y, which is near 0.
pub(super) fn drop_heights(scene: &mut Scene, sources: &[Source], warnings: &mut Warnings) {
    let heights: Vec<bool> =
        sources.iter().zip(&scene.images).map(|(s, image)| matches!(s, Source::Bump(_)) && !is_bluish(image)).collect();
    for material in &mut scene.materials {
        if material.normal_texture.is_some_and(|binding| heights[scene.textures[binding.texture].image]) {
            material.normal_texture = None;
            let subject = "bump maps of heights (map_Bump) are not supported yet: the surface is smooth";
            warnings.add(subject, format!("\"{}\"", material.name));
        }
    }
}

/// Whether blue is above red and green by an eighth of the range in the mean.
fn is_bluish(image: &Image) -> bool {
    fn sums<T: Copy + Into<u64>>(texels: &[[T; 4]]) -> [u64; 3] {
        texels.iter().fold([0; 3], |sums, texel| [0, 1, 2].map(|k| sums[k] + texel[k].into()))
    }
    let ([red, green, blue], white) = match &image.texels {
        Texels::Rgba8(texels) => (sums(texels), 255 * texels.len() as u64),
        Texels::Rgba16(texels) => (sums(texels), 65535 * texels.len() as u64),
    };
    8 * blue > 8 * red.max(green) + white
}

/// Reads or makes an image.
pub(super) fn decode(source: &Source, decoded: &Decoded) -> SceneResult<Arc<Image>> {
    let read = |texture: &MtlTexture| read(texture, decoded);
    let map = |texture: &Option<MtlTexture>| texture.as_ref().map(&read).transpose();
    match source {
        Source::File(texture) | Source::Bump(texture) => read(texture),
        Source::ColorAlpha { color, alpha } => {
            let (color, alpha) = (map(color)?, read(alpha)?);
            // An image with an alpha channel has it there, any other is grey.
            let channel = if is_translucent(&alpha) { 3 } else { 0 };
            let of_color = |channel| color.as_deref().map(|image| Channel { image, channel });
            Ok(combine([of_color(0), of_color(1), of_color(2), Some(Channel { image: &alpha, channel })]).into())
        }
        Source::RoughnessMetallic { roughness, metallic } => {
            let (roughness, metallic) = (map(roughness)?, map(metallic)?);
            let red = |image| Channel { image, channel: 0 };
            Ok(combine([None, roughness.as_deref().map(red), metallic.as_deref().map(red), None]).into())
        }
    }
}

fn read(texture: &MtlTexture, decoded: &Decoded) -> SceneResult<Arc<Image>> {
    let name = texture.file.display().to_string();
    let fail = |message: String| at_line(&texture.mtl_file, texture.line, format!("the image {name}: {message}"));
    let bytes = file::read(&texture.file)
        .map_err(|error| fail(error.message).hint("put the file there, or remove the line"))?;
    decoded.texture(&name, &bytes).map_err(|message| fail(message).hint("replace it by a whole PNG, JPEG or WebP file"))
}

fn is_translucent(image: &Image) -> bool {
    match &image.texels {
        Texels::Rgba8(texels) => texels.iter().any(|texel| texel[3] < u8::MAX),
        Texels::Rgba16(texels) => texels.iter().any(|texel| texel[3] < u16::MAX),
    }
}

/// One channel of an image.
#[derive(Clone, Copy)]
struct Channel<'a> {
    image: &'a Image,
    channel: usize,
}

impl Channel<'_> {
    /// The value at a texel of an image of another size, in 16 bits: that of the texel there (8 bits become 16 exactly).
    fn at(self, x: u32, y: u32, width: u32, height: u32) -> u16 {
        let place =
            |i: u32, from: u32, to: u32| (u64::from(2 * i + 1) * u64::from(to) / (2 * u64::from(from))) as usize;
        let column = place(x, width, self.image.width);
        let index = place(y, height, self.image.height) * self.image.width as usize + column;
        match &self.image.texels {
            Texels::Rgba8(texels) => u16::from(texels[index][self.channel]) * 257,
            Texels::Rgba16(texels) => texels[index][self.channel],
        }
    }
}

/// An image of the given channels, as large as the largest and as deep as the deepest of them; where there is none it is 1.
fn combine(channels: [Option<Channel<'_>>; 4]) -> Image {
    let images = || channels.iter().flatten().map(|channel| channel.image);
    let width = images().map(|image| image.width).max().unwrap_or(1);
    let height = images().map(|image| image.height).max().unwrap_or(1);
    let mut names: Vec<&str> = images().map(|image| image.name.as_str()).collect();
    names.dedup();
    let texel = |x, y| channels.map(|c| c.map_or(u16::MAX, |channel| channel.at(x, y, width, height)));
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y));
    let texels = if images().any(|image| matches!(image.texels, Texels::Rgba16(_))) {
        Texels::Rgba16(texels.collect())
    } else {
        Texels::Rgba8(texels.map(|texel| texel.map(|value| (value / 257) as u8)).collect())
    };
    Image { name: names.join(" and "), width, height, texels }
}
