//! PNG images: 8-bit sRGB through an exposure and a tone curve.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::tonemap::{ToneMap, to_srgb8};
use crate::Result;
use crate::atomic_file::write_atomically;

/// What a pixel with a NaN or an infinity looks like, so that it is seen: magenta.
pub const NON_FINITE_SRGB8: [u8; 3] = [255, 0, 255];

/// Tone-maps radiance to 8-bit sRGB. The second value is the number of pixels that are NaN or infinite; they are
/// [`NON_FINITE_SRGB8`].
pub fn tone_map_srgb8(radiance: &[[f32; 3]], exposure_ev: f32, tone_map: ToneMap) -> (Vec<[u8; 3]>, usize) {
    let pixels: Vec<_> = radiance.par_iter().map(|&pixel| to_srgb8(pixel, exposure_ev, tone_map)).collect();
    let non_finite = pixels.iter().filter(|pixel| pixel.is_none()).count();
    (pixels.into_iter().map(|pixel| pixel.unwrap_or(NON_FINITE_SRGB8)).collect(), non_finite)
}

/// Writes 8-bit sRGB pixels, row by row from the top left, as a PNG: whole or not at all.
///
/// # Errors
/// [`crate::Error::Io`] if the file system refuses.
///
/// # Panics
/// If the number of pixels is not `width` × `height`.
pub fn write_png(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<()> {
    assert_eq!(pixels.len(), width as usize * height as usize, "an image has width × height pixels");
    write_atomically(path, |file| {
        let mut writer = BufWriter::new(file);
        let encoder = PngEncoder::new(&mut writer);
        encoder
            .write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
            .map_err(|e| io::Error::other(e.to_string()))?;
        writer.flush()
    })
}

/// A PNG file's bytes, made fast rather than small.
///
/// # Errors
/// What the encoder says, as of an image without pixels.
///
/// # Panics
/// If the number of pixels is not `width` × `height`.
pub fn encode_png(width: u32, height: u32, pixels: &[[u8; 3]]) -> std::result::Result<Vec<u8>, String> {
    assert_eq!(pixels.len(), width as usize * height as usize, "an image has width × height pixels");
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub)
        .write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}
