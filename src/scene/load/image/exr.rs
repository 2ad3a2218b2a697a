//! OpenEXR files as radiance.

use std::io::Cursor;

use exr::image::{AnyChannel, FlatSamples};
use exr::meta::MetaData;
use exr::meta::attribute::EnvironmentMap;
use exr::prelude::{AnyChannels, Layer, ReadChannels, ReadLayers, read};

use super::{Radiance, check_size};

/// Reads the first part's channels R, G, B (of half, float or uint), or Y alone as grey.
pub(super) fn decode(bytes: &[u8]) -> Result<Radiance, String> {
    let broken = |error: exr::error::Error| format!("the EXR file cannot be read: {error}");
    let metadata = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    let header = metadata.headers.first().ok_or("the EXR file has no part")?;
    if header.deep {
        return Err(String::from("the EXR file holds deep data, which is not supported"));
    }
    if header.own_attributes.environment_map == Some(EnvironmentMap::Cube) {
        return Err(String::from("the EXR file is a cube map; convert it to latitude/longitude"));
    }
    let window = header.shared_attributes.display_window;
    check_size(header.layer_size.width() as u64, header.layer_size.height() as u64)?;
    check_size(window.size.width() as u64, window.size.height() as u64)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let layer = image.layer_data;
    let channels = color_channels(&layer)?;
    let offset = layer.attributes.layer_position - window.position;
    let corner = [i64::from(offset.x()), i64::from(offset.y())];
    Ok(place([window.size.width(), window.size.height()], [layer.size.width(), layer.size.height()], corner, channels))
}

/// The samples that stand for red, green and blue.
fn color_channels(layer: &Layer<AnyChannels<FlatSamples>>) -> Result<[&FlatSamples; 3], String> {
    let channels = &layer.channel_data.list;
    let find = |name: &str| channels.iter().find(|channel| channel.name.to_string().eq_ignore_ascii_case(name));
    let whole = |channel: &AnyChannel<FlatSamples>| channel.sample_data.len() == layer.size.area();
    let found = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (None, None, None, Some(y)) if find("RY").is_none() && find("BY").is_none() => [y, y, y],
        _ => {
            let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
            return Err(format!("the EXR file has no channels R, G, B or Y alone, but {}", names.join(", ")));
        }
    };
    if !found.into_iter().all(whole) {
        return Err(String::from("the EXR file's colour channels are subsampled, which is not supported"));
    }
    Ok(found.map(|channel| &channel.sample_data))
}

/// Lays the data window into the display window; what is outside of the latter is cut off, what is open is black.
fn place(size: [usize; 2], data_size: [usize; 2], corner: [i64; 2], channels: [&FlatSamples; 3]) -> Radiance {
    let mut texels = vec![[0.0_f32; 3]; size[0] * size[1]];
    for (component, samples) in channels.into_iter().enumerate() {
        for (index, value) in samples.values_as_f32().enumerate() {
            let x = corner[0] + (index % data_size[0]) as i64;
            let y = corner[1] + (index / data_size[0]) as i64;
            if (0..size[0] as i64).contains(&x) && (0..size[1] as i64).contains(&y) {
                texels[y as usize * size[0] + x as usize][component] = value;
            }
        }
    }
    Radiance { width: size[0] as u32, height: size[1] as u32, texels: texels.into() }
}
