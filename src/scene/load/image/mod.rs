//! Images: 8 and 16 bit ones for textures, and any kind as an environment.

mod exr;

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use ::image::{DynamicImage, ImageFormat, ImageReader, Limits};

use super::{Decoded, file};
use crate::scene::{Environment, Image, SceneError, SceneResult, Texels};

/// More texels than this are refused: 2²⁹ are a 32768×16384 map, and 6 GiB as radiance.
const MAX_TEXELS: u64 = 1 << 29;

/// Decodes a texture (PNG, JPEG or WebP; 8 or 16 bits a channel; grey, RGB, with or without alpha). Its encoding is kept:
/// what it means depends on the use. The error is a message without a file name, since textures lie in buffers too.
pub(super) fn decode_texture(name: &str, bytes: &[u8]) -> Result<Image, String> {
    let format = ::image::guess_format(bytes).map_err(|_| unknown_format(bytes))?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP) {
        return Err(format!("{} images are not supported as textures; use PNG, JPEG or WebP", format.to_mime_type()));
    }
    let decoded = decode(bytes, format)?;
    let (width, height) = (decoded.width(), decoded.height());
    let sixteen_bits = matches!(
        decoded,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    let texels = if sixteen_bits {
        Texels::Rgba16(decoded.into_rgba16().pixels().map(|pixel| pixel.0).collect())
    } else {
        Texels::Rgba8(decoded.into_rgba8().pixels().map(|pixel| pixel.0).collect())
    };
    Ok(Image { name: name.to_owned(), width, height, texels })
}

fn unknown_format(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return String::from("the image is empty");
    }
    if bytes.starts_with(b"\xabKTX") {
        return String::from("KTX images are not supported; use PNG, JPEG or WebP");
    }
    String::from("the image is of no known format; use PNG, JPEG or WebP")
}

fn decode(bytes: &[u8], format: ImageFormat) -> Result<DynamicImage, String> {
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_TEXELS * 12);
    let (width, height) = ImageReader::with_format(Cursor::new(bytes), format)
        .into_dimensions()
        .map_err(|error| format!("the image cannot be decoded: {error}"))?;
    check_size(u64::from(width), u64::from(height))?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    reader.decode().map_err(|error| format!("the image cannot be decoded: {error}"))
}

fn check_size(width: u64, height: u64) -> Result<(), String> {
    match width.checked_mul(height) {
        Some(0) => Err(format!("the image has {width}×{height} texels, none at all")),
        Some(texels) if texels <= MAX_TEXELS => Ok(()),
        _ => Err(format!("the image has {width}×{height} texels; {MAX_TEXELS} is the limit")),
    }
}

/// Linear radiance, row by row from the top.
#[derive(Debug)]
pub(super) struct Radiance {
    width: u32,
    height: u32,
    texels: Arc<Vec<[f32; 3]>>,
}

/// Reads a latitude/longitude environment map.
///
/// `.hdr` (Radiance RGBE) and `.exr` hold linear radiance (taken as Rec.709; an EXR's display window is the map, and what
/// its data window leaves open is black; a luminance-only EXR is grey). PNG, JPEG and WebP are decoded as sRGB.
/// `strength` multiplies all texels; `rotation_degrees` turns the map about +Y, counter-clockwise seen from above.
///
/// # Errors
/// The file is missing or broken, is of another kind (a cube map, deep data), or holds a texel that is negative, NaN or
/// infinite; `strength` is negative or either number is not finite.
pub fn load_environment(path: &Path, strength: f32, rotation_degrees: f64) -> SceneResult<Environment> {
    Decoded::default().environment(path, strength, rotation_degrees)
}

pub(super) fn read_environment(
    path: &Path,
    strength: f32,
    rotation_degrees: f64,
    decode: impl FnOnce(Vec<u8>) -> Result<Arc<Radiance>, String>,
) -> SceneResult<Environment> {
    if !(strength >= 0.0 && strength.is_finite()) {
        let message = format!("an environment's strength must be a finite number of at least 0, not {strength}");
        return Err(SceneError::file(path, message));
    }
    if !rotation_degrees.is_finite() {
        return Err(SceneError::file(path, "an environment's rotation must be a finite number of degrees"));
    }
    let bytes = file::read(path)?;
    let fail =
        |message: String| SceneError::file(path, message).hint("give a whole .hdr or .exr file, or a PNG or JPEG");
    let radiance = decode(bytes).map_err(fail)?;
    check_texels(path, &radiance, strength)?;
    Ok(Environment::Image {
        name: path.display().to_string(),
        width: radiance.width,
        height: radiance.height,
        texels: Arc::clone(&radiance.texels),
        strength,
        rotation_radians: rotation_degrees.to_radians(),
    })
}

pub(super) fn decode_radiance(bytes: &[u8]) -> Result<Radiance, String> {
    const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
    if bytes.starts_with(&EXR_MAGIC) {
        return exr::decode(bytes);
    }
    let format = ::image::guess_format(bytes).map_err(|_| String::from("the image is of no known format"))?;
    let decoded = decode(bytes, format)?;
    let (width, height) = (decoded.width(), decoded.height());
    let texels = match decoded {
        DynamicImage::ImageRgb32F(image) => image.pixels().map(|pixel| pixel.0).collect(),
        encoded => encoded.into_rgb16().pixels().map(|p| p.0.map(|c| srgb_to_linear(f64::from(c) / 65535.0))).collect(),
    };
    Ok(Radiance { width, height, texels: Arc::new(texels) })
}

/// IEC 61966-2-1: an encoded value in [0, 1] to a linear one.
fn srgb_to_linear(encoded: f64) -> f32 {
    let linear = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
    linear as f32
}

/// Radiance is finite and not negative, also times the strength; anything else would poison the sampling of the whole map.
fn check_texels(path: &Path, radiance: &Radiance, strength: f32) -> SceneResult<()> {
    let bad = |texel: &[f32; 3]| !texel.iter().all(|&c| c >= 0.0 && (c * strength).is_finite() && c.is_finite());
    let Some(first) = radiance.texels.iter().position(bad) else { return Ok(()) };
    let count = radiance.texels.iter().filter(|texel| bad(texel)).count();
    let (x, y) = (first % radiance.width as usize, first / radiance.width as usize);
    let [r, g, b] = radiance.texels[first];
    if [r, g, b].iter().all(|&c| c >= 0.0 && c.is_finite()) {
        let message = format!("{count} texels times the strength {strength} overflow; the first is ({r}, {g}, {b})");
        return Err(SceneError::at(path, format!("texel ({x}, {y})"), message).hint("give a smaller strength"));
    }
    let message = format!("{count} texels are negative, NaN or infinite; the first is ({r}, {g}, {b})");
    Err(SceneError::at(path, format!("texel ({x}, {y})"), message).hint("repair them in an image editor"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bit_textures_keep_their_bits() {
        let image = ::image::ImageBuffer::from_pixel(2, 1, ::image::Luma([0x1234_u16]));
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::ImageLuma16(image).write_to(&mut bytes, ImageFormat::Png).expect("a PNG can be written");
        let texture = decode_texture("grey", bytes.get_ref()).expect("a 16 bit PNG is decoded");
        let Texels::Rgba16(texels) = texture.texels else { panic!("the image was reduced to 8 bits") };
        assert_eq!(texels, [[0x1234, 0x1234, 0x1234, 0xffff]; 2]);
    }

    #[test]
    fn broken_images_are_errors() {
        for bytes in [&b""[..], b"not an image", b"\x89PNG\r\n\x1a\n", b"\x76\x2f\x31\x01", b"#?RADIANCE\n"] {
            assert!(decode_texture("broken", bytes).is_err());
            assert!(decode_radiance(bytes).is_err());
        }
    }

    #[test]
    fn the_first_bad_texel_is_named() {
        let check = |texels: &[[f32; 3]]| {
            let radiance = Radiance { width: 3, height: 2, texels: Arc::new(texels.to_vec()) };
            check_texels(Path::new("map.exr"), &radiance, 1.0)
        };
        let mut texels = [[1.0; 3]; 6];
        assert!(check(&texels).is_ok());
        texels[4] = [0.0, f32::NAN, 0.0];
        texels[5] = [-1.0, 0.0, 0.0];
        let error = check(&texels).expect_err("NaN is refused").to_string();
        assert!(error.contains("texel (1, 1)") && error.contains("2 texels"), "{error}");
    }
}
