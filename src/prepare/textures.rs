//! Textures as the shader reads them: headers in the tables, texels in one array, each image once.

use std::collections::HashMap;
use std::sync::Arc;

use super::PrepareError;
use super::kept::Kept;
use crate::layout::{
    NONE, TEXTURE_16_BIT, TEXTURE_MIPS, TEXTURE_NEAREST, TEXTURE_SET_1, TEXTURE_SRGB, TEXTURE_TRANSFORMED,
    TEXTURE_WRAP_U_SHIFT, TEXTURE_WRAP_V_SHIFT, Texel, TextureHeader,
};
use crate::scene::{Filter, Image, Scene, Texels, Texture, TextureBinding, TextureTransform, Wrap};

/// How a texture's numbers are to be read, which follows from what it is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum ColorSpace {
    /// sRGB-encoded colour.
    Srgb,
    /// Plain numbers.
    Linear,
}

/// How a texture is looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lookup {
    /// In the level of its mip chain that fits the ray's cone.
    Filtered,
    /// As it is in the file.
    Exact,
}

/// The textures in use.
#[derive(Debug)]
pub(super) struct TextureTable<'a> {
    /// Headers by the index that materials hold.
    pub headers: Vec<TextureHeader>,
    /// The texel array, packed words.
    pub texels: Vec<Texel>,
    /// Mip chains are made; without, all lookups are exact.
    mip: bool,
    images: HashMap<usize, u32>,
    /// First word of the list of levels, by image and whether its numbers are sRGB.
    chains: HashMap<(usize, bool), u32>,
    /// Textures that read the same words in the same way are one.
    known: HashMap<Key, u32>,
    kept: &'a Kept,
}

/// Image, sampling bits, and the bits of the transform.
type Key = (usize, u32, [[u32; 3]; 2]);

impl<'a> TextureTable<'a> {
    /// None yet.
    pub(super) fn new(mip: bool, kept: &'a Kept) -> Self {
        let (images, chains, known) = (HashMap::new(), HashMap::new(), HashMap::new());
        Self { headers: Vec::new(), texels: Vec::new(), mip, images, chains, known, kept }
    }

    /// Index of the header for a texture of the scene in the given use; its image is stored at the first use.
    ///
    /// # Errors
    /// If the texels of all images are more words than 32 bits can address.
    pub(super) fn add(
        &mut self,
        scene: &Scene,
        binding: TextureBinding,
        space: ColorSpace,
        lookup: Lookup,
    ) -> Result<u32, PrepareError> {
        let texture = &scene.textures[binding.texture];
        let image = &scene.images[texture.image];
        let mut sampling = sampling_bits(texture, image, space);
        if binding.set == 1 {
            sampling |= TEXTURE_SET_1;
        }
        if binding.transform != TextureTransform::IDENTITY {
            sampling |= TEXTURE_TRANSFORMED;
        }
        // Who asks for the nearest texel wants to see it.
        let one_texel = image.width == 1 && image.height == 1;
        if self.mip && lookup == Lookup::Filtered && texture.filter == Filter::Linear && !one_texel {
            sampling |= TEXTURE_MIPS;
        }
        let [u_row, v_row] = binding.transform.rows;
        let key = (texture.image, sampling, [u_row, v_row].map(|row| row.map(f32::to_bits)));
        if let Some(&index) = self.known.get(&key) {
            return Ok(index);
        }
        let first_word = self.store(texture.image, image)?;
        let mips = if sampling & TEXTURE_MIPS != 0 { self.store_chain(texture.image, image, space)? } else { NONE };
        let index = self.headers.len() as u32;
        let (width, height) = (image.width, image.height);
        let header =
            TextureHeader { first_word, width, height, sampling, u_row, mips, v_row, ..TextureHeader::default() };
        self.headers.push(header);
        self.known.insert(key, index);
        Ok(index)
    }

    fn store(&mut self, index: usize, image: &Image) -> Result<u32, PrepareError> {
        if let Some(&word) = self.images.get(&index) {
            return Ok(word);
        }
        let first_word = self.append(match &image.texels {
            Texels::Rgba8(texels) => {
                super::pack(texels.chunks(4), |texels, k| texels.get(k).map_or(0, |t| u32::from_le_bytes(*t)))
            }
            Texels::Rgba16(texels) => pack_16_bit(texels),
        })?;
        self.images.insert(index, first_word);
        Ok(first_word)
    }

    fn store_chain(&mut self, index: usize, image: &Arc<Image>, space: ColorSpace) -> Result<u32, PrepareError> {
        let key = (index, space == ColorSpace::Srgb);
        if let Some(&word) = self.chains.get(&key) {
            return Ok(word);
        }
        let levels = self.kept.chain(image, space);
        let first_words = levels.iter().map(|level| self.append(pack_16_bit(level))).collect::<Result<Vec<_>, _>>()?;
        let list = self.append(super::pack_words(&first_words))?;
        self.chains.insert(key, list);
        Ok(list)
    }

    /// The first word of what is appended.
    fn append(&mut self, texels: Vec<Texel>) -> Result<u32, PrepareError> {
        let first_word = u32::try_from(4 * self.texels.len()).map_err(|_| PrepareError::TooManyTexels)?;
        if 4 * (self.texels.len() + texels.len()) as u64 > u64::from(u32::MAX) {
            return Err(PrepareError::TooManyTexels);
        }
        self.texels.extend(texels);
        Ok(first_word)
    }
}

fn pack_16_bit(texels: &[[u16; 4]]) -> Vec<Texel> {
    super::pack(texels.chunks(2), |texels, k| {
        texels.get(k / 2).map_or(0, |t| {
            let half = 2 * (k % 2);
            u32::from(t[half]) | u32::from(t[half + 1]) << 16
        })
    })
}

fn sampling_bits(texture: &Texture, image: &Image, space: ColorSpace) -> u32 {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::MirroredRepeat => 1,
        Wrap::ClampToEdge => 2,
    };
    let mut bits = wrap(texture.wrap_u) << TEXTURE_WRAP_U_SHIFT | wrap(texture.wrap_v) << TEXTURE_WRAP_V_SHIFT;
    if space == ColorSpace::Srgb {
        bits |= TEXTURE_SRGB;
    }
    if matches!(image.texels, Texels::Rgba16(_)) {
        bits |= TEXTURE_16_BIT;
    }
    if texture.filter == Filter::Nearest {
        bits |= TEXTURE_NEAREST;
    }
    bits
}

/// The sRGB transfer function of IEC 61966-2-1, encoded value to linear.
pub fn srgb_to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
