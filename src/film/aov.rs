//! AOVs ("arbitrary output variables"): what an image holds besides radiance, as sums over the same samples.
//!
//! Every AOV is a plain mean over all samples of the pixel, as radiance is, so parts of a farm merge alike. Of a sample
//! whose camera ray meets no surface, the share is 0; over [`Aov::Coverage`] it is the mean of those that meet one.

use super::Film;
use super::exr::{ChannelValues, ExrImage};
use crate::named_enum::named_enum;

named_enum! {
    /// A quantity of the first surface that the camera's ray meets (what alpha lets it pass is not met; a mirror or a pane
    /// of glass is), or of the path.
    Aov, "AOV" {
        /// Base colour, linear Rec.709, in [0, 1]: what the surface's BSDF scatters by, whatever its lobes. Black backs have 0.
        #[default]
        Albedo = "albedo",
        /// Shading normal (normal maps included), world space, on the side that is seen. Unit for each sample; the mean is shorter
        /// where normals differ.
        Normal = "normal",
        /// Distance along the camera's viewing direction, metres: the same for all points of a plane that faces the camera.
        Depth = "depth",
        /// Position, world space, metres.
        Position = "position",
        /// Share of the samples whose camera ray meets a surface.
        Coverage = "coverage",
        /// Nodes visited and triangles tested by all rays of a sample, shadow rays included.
        Cost = "cost",
    }
}

impl Aov {
    /// The channels of its layer in an EXR, as `normal.X`; a layer has the name of its AOV.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo => &["R", "G", "B"],
            Self::Normal | Self::Position => &["X", "Y", "Z"],
            Self::Depth => &["Z"],
            Self::Coverage => &["A"],
            Self::Cost => &["Y"],
        }
    }
}

/// Sums of AOVs over some samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AovSample {
    /// [`Aov::Albedo`].
    pub albedo: [f64; 3],
    /// [`Aov::Normal`].
    pub normal: [f64; 3],
    /// [`Aov::Depth`].
    pub depth: f64,
    /// [`Aov::Position`].
    pub position: [f64; 3],
    /// Samples that met a surface.
    pub hits: f64,
    /// [`Aov::Cost`].
    pub visits: f64,
}

impl AovSample {
    fn of(&self, aov: Aov) -> &[f64] {
        match aov {
            Aov::Albedo => &self.albedo,
            Aov::Normal => &self.normal,
            Aov::Depth => std::slice::from_ref(&self.depth),
            Aov::Position => &self.position,
            Aov::Coverage => std::slice::from_ref(&self.hits),
            Aov::Cost => std::slice::from_ref(&self.visits),
        }
    }
}

/// Sums of AOVs per pixel, row by row from the top left, beside a [`Film`] that counts the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct AovFilm {
    layers: Vec<(Aov, Vec<f64>)>,
    hits: Vec<f64>,
}

impl AovFilm {
    /// The AOVs of an image of so many pixels, without samples.
    pub fn new(aovs: &[Aov], pixels: usize) -> Self {
        let layer = |&aov: &Aov| (aov, vec![0.0; pixels * aov.channels().len()]);
        Self { layers: aovs.iter().map(layer).collect(), hits: vec![0.0; pixels] }
    }

    /// What is kept.
    pub fn aovs(&self) -> impl Iterator<Item = Aov> + '_ {
        self.layers.iter().map(|(aov, _)| *aov)
    }

    /// Adds the samples of another film of the same AOVs, which follow this one's.
    ///
    /// # Panics
    /// If they differ in their AOVs or sizes.
    pub fn merge(&mut self, other: &Self) {
        assert!(self.aovs().eq(other.aovs()) && self.hits.len() == other.hits.len(), "AOVs of different films");
        let add = |mine: &mut [f64], theirs: &[f64]| mine.iter_mut().zip(theirs).for_each(|(a, b)| *a += b);
        add(&mut self.hits, &other.hits);
        for ((_, mine), (_, theirs)) in self.layers.iter_mut().zip(&other.layers) {
            add(mine, theirs);
        }
    }

    /// Adds the sums of a block of samples; blocks of a pixel come in the order of their sample indices, as those of
    /// [`Film::add_block`].
    ///
    /// # Panics
    /// If `pixel` is outside the image.
    pub fn add_block(&mut self, pixel: usize, block: &AovSample) {
        self.hits[pixel] += block.hits;
        for (aov, sums) in &mut self.layers {
            let values = block.of(*aov);
            for (sum, value) in sums[pixel * values.len()..].iter_mut().zip(values) {
                *sum += value;
            }
        }
    }

    /// Means over the samples of each pixel, a vector for each channel; 0 without samples. `None` if the AOV is not kept.
    pub fn means(&self, aov: Aov, film: &Film) -> Option<Vec<Vec<f64>>> {
        self.over(aov, |pixel| f64::from(film.pixels()[pixel].count))
    }

    /// Means over the samples that met a surface; 0 where none did.
    pub fn means_of_hits(&self, aov: Aov) -> Option<Vec<Vec<f64>>> {
        self.over(aov, |pixel| self.hits[pixel])
    }

    /// The means of one pixel over its samples, AOV by AOV; none without samples.
    ///
    /// # Panics
    /// If `pixel` is outside the image.
    pub fn pixel_means(&self, pixel: usize, film: &Film) -> Vec<(Aov, Vec<f64>)> {
        let count = f64::from(film.pixels()[pixel].count);
        let mean = |(aov, sums): &(Aov, Vec<f64>)| {
            let channels = aov.channels().len();
            (*aov, sums[pixel * channels..][..channels].iter().map(|sum| sum / count).collect())
        };
        if count > 0.0 { self.layers.iter().map(mean).collect() } else { Vec::new() }
    }

    /// Whether any sample of the pixel met a surface.
    ///
    /// # Panics
    /// If `pixel` is outside the image.
    pub fn is_hit(&self, pixel: usize) -> bool {
        self.hits[pixel] > 0.0
    }

    fn over(&self, aov: Aov, count: impl Fn(usize) -> f64) -> Option<Vec<Vec<f64>>> {
        let (_, sums) = self.layers.iter().find(|(kept, _)| *kept == aov)?;
        let channels = aov.channels().len();
        let mean = |pixel: usize, channel: usize| match count(pixel) {
            0.0 => 0.0,
            n => sums[pixel * channels + channel] / n,
        };
        Some((0..channels).map(|channel| (0..self.hits.len()).map(|pixel| mean(pixel, channel)).collect()).collect())
    }

    /// Adds a layer for each AOV to the image of `film`.
    pub fn push_layers(&self, film: &Film, image: &mut ExrImage) {
        for (aov, _) in &self.layers {
            let means = self.means(*aov, film).unwrap_or_default();
            for (channel, values) in aov.channels().iter().zip(means) {
                let values = values.into_iter().map(|x| x as f32).collect();
                image.push(&format!("{aov}.{channel}"), ChannelValues::F32(values));
            }
        }
    }
}
