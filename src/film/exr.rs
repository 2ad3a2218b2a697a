//! OpenEXR images: named channels of 32-bit floats or counts, with the attributes of [`Metadata`].
//!
//! A rendered image has the channels `R`, `G`, `B` (mean radiance, linear Rec.709, f32), `samples` (u32, how many
//! samples the pixel is the mean of) and `variance` (f32, estimated variance of the pixel's mean luminance; 0 below
//! two samples; of a low-discrepancy sequence an upper bound). An AOV is a named layer in the way of all renderers:
//! channels with a prefix, `albedo.R`.
//!
//! Means in f32 with their counts are enough for [`merge`](super::merge) to equal the single run to 1 ulp. Radiance
//! is not negative, so rounding each part's mean moves the weighted mean by at most a share of 2⁻²⁴, less than one
//! ulp of it; two numbers less than an ulp apart round to floats at most one ulp apart.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;

use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatImage, FlatSamples, Image, Layer};
use exr::meta::attribute::{LineOrder, Text};
use exr::prelude::{Compression, ImageAttributes, IntegerBounds, LayerAttributes, ReadChannels, ReadLayers, Vec2};
use exr::prelude::{WritableImage, read};

use super::metadata::Metadata;
use super::{Film, PixelSums};
use crate::atomic_file::write_atomically;
use crate::{Error, Result};

/// Name of the channel of sample counts.
pub const SAMPLES_CHANNEL: &str = "samples";
/// Name of the channel of the variance of the mean luminance.
pub const VARIANCE_CHANNEL: &str = "variance";

/// An image as named channels, in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Channels; each has width × height values, row by row from the top left.
    pub channels: Vec<Channel>,
    /// The attributes.
    pub metadata: Metadata,
}

/// One channel of an [`ExrImage`].
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// `R`, or `layer.R`.
    pub name: String,
    /// Its values.
    pub values: ChannelValues,
}

/// Values of a channel. Half floats are read as f32, which is exact.
#[derive(Clone, Debug, PartialEq)]
pub enum ChannelValues {
    /// 32-bit float.
    F32(Vec<f32>),
    /// 32-bit unsigned integer.
    U32(Vec<u32>),
}

impl ExrImage {
    /// The image of a film: radiance, sample counts and variance.
    pub fn from_film(film: &Film, mut metadata: Metadata) -> Self {
        metadata.samples_per_pixel = Some(film.mean_samples_per_pixel() as f32);
        let radiance = film.radiance();
        let mut image = Self { width: film.width(), height: film.height(), channels: Vec::new(), metadata };
        for (index, name) in ["R", "G", "B"].into_iter().enumerate() {
            image.push(name, ChannelValues::F32(radiance.iter().map(|rgb| rgb[index]).collect()));
        }
        image.push(SAMPLES_CHANNEL, ChannelValues::U32(film.pixels().iter().map(|p| p.count).collect()));
        let variance = film.pixels().iter().map(|p| p.variance_of_mean().unwrap_or(0.0) as f32).collect();
        image.push(VARIANCE_CHANNEL, ChannelValues::F32(variance));
        image
    }

    /// The film that this image was made from, up to the rounding of its means. Without a `samples` channel every
    /// pixel counts as the `samplesPerPixel` attribute says; `None` if there is neither, or no RGB.
    pub fn to_film(&self) -> Option<Film> {
        let rgb = self.rgb()?;
        let uniform = self.metadata.samples_per_pixel.filter(|s| *s >= 1.0).map(|s| s.round() as u32);
        let counts = match self.values(SAMPLES_CHANNEL) {
            Some(ChannelValues::U32(counts)) => counts.clone(),
            _ => vec![uniform?; rgb.len()],
        };
        let variance = match self.values(VARIANCE_CHANNEL) {
            Some(ChannelValues::F32(variance)) => variance.clone(),
            _ => vec![0.0; rgb.len()],
        };
        let pixels =
            rgb.iter().zip(&counts).zip(&variance).map(|((mean, &count), &variance)| {
                PixelSums::from_mean(mean.map(f64::from), f64::from(variance), count)
            });
        Some(Film::from_pixels(self.width, self.height, pixels.collect()))
    }

    /// Adds a channel.
    ///
    /// # Panics
    /// If it has not width × height values.
    pub fn push(&mut self, name: &str, values: ChannelValues) {
        assert_eq!(values.len(), self.width as usize * self.height as usize, "a channel has width × height values");
        self.channels.push(Channel { name: name.to_owned(), values });
    }

    /// The values of the channel of this name.
    pub fn values(&self, name: &str) -> Option<&ChannelValues> {
        self.channels.iter().find(|c| c.name == name).map(|c| &c.values)
    }

    /// The channels `R`, `G`, `B` together; without them those of the first layer that has some (`Combined.R`), or `Y`
    /// three times in an image of luminance alone.
    pub fn rgb(&self) -> Option<Vec<[f32; 3]>> {
        let prefixes = self.channels.iter().filter_map(|c| c.name.strip_suffix('R'));
        let layers = std::iter::once("").chain(prefixes.filter(|p| p.is_empty() || p.ends_with('.')));
        let colours = layers.map(|prefix| ["R", "G", "B"].map(|c| self.values(&format!("{prefix}{c}"))));
        let grey = std::iter::once([self.values("Y"); 3]);
        colours.chain(grey).find_map(|[r, g, b]| {
            let (r, g, b) = (r?.to_f32(), g?.to_f32(), b?.to_f32());
            Some(r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect())
        })
    }

    /// Writes the image, whole or not at all: ZIP-compressed scan lines.
    ///
    /// # Errors
    /// [`Error::Io`] if the file system refuses.
    pub fn write(&self, path: &Path) -> Result<()> {
        let size = Vec2(self.width as usize, self.height as usize);
        let mut image_attributes = ImageAttributes::new(IntegerBounds::from_dimensions(size));
        let mut layer_attributes = LayerAttributes::default();
        self.metadata.store(&mut image_attributes, &mut layer_attributes);
        let channels = self.channels.iter().map(|channel| {
            let values = match &channel.values {
                ChannelValues::F32(v) => FlatSamples::F32(v.clone()),
                ChannelValues::U32(v) => FlatSamples::U32(v.clone()),
            };
            AnyChannel::new(Text::from_slice_unchecked(channel.name.as_bytes()), values)
        });
        let encoding =
            Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let layer = Layer::new(size, layer_attributes, encoding, AnyChannels::sort(channels.collect()));
        let image = Image::new(image_attributes, layer);
        write_atomically(path, |file| {
            let mut writer = BufWriter::new(file);
            image.write().to_buffered(&mut writer).map_err(io_error)?;
            writer.flush()
        })
    }
}

impl ChannelValues {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::U32(v) => v.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values as floats.
    pub fn to_f32(&self) -> Vec<f32> {
        match self {
            Self::F32(v) => v.clone(),
            Self::U32(v) => v.iter().map(|&u| u as f32).collect(),
        }
    }
}

/// Reads any flat OpenEXR image. The channels of a named part get its name as a prefix (`part.R`), unless the part is
/// the only one with colours.
///
/// # Errors
/// [`Error::Io`] if the file cannot be opened, [`Error::Input`] if it is not an EXR image of equal-sized parts.
pub fn read_exr(path: &Path) -> Result<ExrImage> {
    let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
    if file.metadata().is_ok_and(|m| m.is_dir()) {
        return Err(Error::input(path, "is a folder, not an OpenEXR image"));
    }
    let image: FlatImage = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(BufReader::new(file))
        .map_err(|e| Error::input(path, format!("is not a readable OpenEXR image: {e}")))?;
    from_parts(image).map_err(|message| Error::input(path, message))
}

/// Joins the parts of a file to one list of channels.
fn from_parts(image: FlatImage) -> std::result::Result<ExrImage, String> {
    let first = image.layer_data.first().ok_or("holds no image")?;
    let size = first.size;
    let metadata = Metadata::load(&image.attributes, &first.attributes);
    let single = image.layer_data.len() == 1;
    let side = |n: usize| u32::try_from(n).map_err(|_| "is too large".to_owned());
    let mut result = ExrImage { width: side(size.0)?, height: side(size.1)?, channels: Vec::new(), metadata };
    for layer in image.layer_data {
        if layer.size != size {
            return Err("has parts of different sizes, which are not supported; split it into files".to_owned());
        }
        let prefix = layer.attributes.layer_name.filter(|name| !single && !name.as_slice().is_empty());
        for channel in layer.channel_data.list {
            if channel.sampling != Vec2(1, 1) {
                return Err(format!("channel {} is subsampled, which is not supported", channel.name));
            }
            let name = prefix.as_ref().map_or(channel.name.to_string(), |p| format!("{p}.{}", channel.name));
            let values = match channel.sample_data {
                FlatSamples::F16(v) => ChannelValues::F32(v.into_iter().map(|h| h.to_f32()).collect()),
                FlatSamples::F32(v) => ChannelValues::F32(v),
                FlatSamples::U32(v) => ChannelValues::U32(v),
            };
            result.push(&name, values);
        }
    }
    Ok(result)
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(e) => e,
        other => io::Error::other(other.to_string()),
    }
}
