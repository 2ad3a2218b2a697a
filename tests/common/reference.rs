//! The reference images of `tests/reference/`, as estimates with their variance.

use std::path::{Path, PathBuf};

use exr::prelude::{ReadChannels, ReadLayers, Text, read};

use super::statistics::Estimate;

/// The edge in pixels of the square tiles whose means the references hold.
pub const TILE: usize = 8;

/// The edge in pixels of the images that the references were made from.
pub const RESOLUTION: usize = 256;

/// One reference: a mean for every tile of a rendering.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Three estimates (R, G, B) a tile, row by row from the top.
    pub tiles: Vec<Estimate>,
}

impl Reference {
    /// Everything that the camera sees with at most `bounces` scattering events; `None` is unlimited.
    pub fn everything(bounces: Option<u32>) -> Self {
        Self::read(&format!("cornell_bounces_{}.exr", label(bounces)))
    }

    /// The same without emission that reaches the camera unscattered; `bounces` is 1 or more.
    pub fn reflected(bounces: Option<u32>) -> Self {
        Self::read(&format!("cornell_reflected_{}.exr", label(bounces)))
    }

    /// The means of the whole image. The references' pixels are independent, so the tiles' variances add up.
    pub fn image(&self) -> [Estimate; 3] {
        [0, 1, 2].map(|channel| Estimate::mean_of_independent(self.tiles.iter().skip(channel).step_by(3).copied()))
    }

    /// A file of tests/reference/.
    pub fn read(name: &str) -> Self {
        let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference").join(name);
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(&path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let layer = &image.layer_data;
        let channel = |name: &str| -> Vec<f64> {
            let found = layer.channel_data.list.iter().find(|channel| channel.name.eq(name));
            let channel = found.unwrap_or_else(|| panic!("{}: no channel {name}", path.display()));
            channel.sample_data.values_as_f32().map(f64::from).collect()
        };
        let seeds = layer.attributes.other.get(&Text::from("seeds")).and_then(|value| value.to_text().ok());
        let count = seeds
            .and_then(|text| text.to_string().parse().ok())
            .unwrap_or_else(|| panic!("{}: no attribute seeds", path.display()));
        let means = ["R", "G", "B"].map(channel);
        let variances = ["varR", "varG", "varB"].map(channel);
        let tiles = (0..means[0].len())
            .flat_map(|tile| [0, 1, 2].map(|c| Estimate { mean: means[c][tile], variance: variances[c][tile], count }))
            .collect();
        Self { tiles }
    }
}

fn label(bounces: Option<u32>) -> String {
    bounces.map_or_else(|| "unlimited".to_string(), |bounces| bounces.to_string())
}
