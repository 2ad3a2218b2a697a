//! The picture so far: its film, the images that are sent of it, and the files that are saved.

use std::time::{Duration, Instant};

use crate::film::Film;
use crate::film::aov::{Aov, AovFilm};
use crate::film::aov_picture::{AovPicture, aov_picture};
use crate::film::exr::ExrImage;
use crate::film::metadata::{Metadata, REC709_CHROMATICITIES, software};
use crate::film::png::{encode_png, tone_map_srgb8};
use crate::film::tev_feed::TevFeed;
use crate::film::tonemap::ToneMap;
use crate::render::{Run, Settings, Statistics};
use crate::watch::messages::{Frame, View};
use crate::{Error, Result};

/// Images are sent this often while samples come in.
const FRAME_INTERVAL: Duration = Duration::from_millis(120);
/// A round of samples between two images should take about this long at first,
const ROUND: Duration = Duration::from_millis(100);
/// and later this share of the time that the picture has taken: one sample a pixel is rendered more slowly than several, and
/// more of them change less. What interrupts a round does not wait for its end.
const ROUND_SHARE: f64 = 0.25;
/// But never longer than this.
const LONGEST_ROUND: Duration = Duration::from_secs(1);

/// What has been rendered since rendering started anew.
#[derive(Default)]
pub(super) struct Shown {
    pub(super) film: Option<Film>,
    aovs: Option<AovFilm>,
    statistics: Option<Statistics>,
    pub(super) spp: u32,
    seconds: f64,
    rays: u64,
    non_finite: u64,
    sent: Option<Instant>,
}

impl Shown {
    /// Takes in a round that went up to `end` samples.
    pub(super) fn add(&mut self, run: Run, end: u32) {
        self.spp = end;
        self.seconds += run.seconds;
        self.rays += run.rays;
        self.non_finite += run.non_finite_samples;
        match &mut self.film {
            Some(film) => film.merge(&run.film),
            None => self.film = Some(run.film),
        }
        match (&mut self.aovs, run.aovs) {
            (Some(mine), Some(theirs)) => mine.merge(&theirs),
            (_, aovs) => self.aovs = aovs,
        }
        match (&mut self.statistics, run.statistics) {
            (Some(mine), Some(theirs)) => mine.merge(&theirs),
            (_, statistics) => self.statistics = statistics,
        }
    }

    /// Whether it is time for an image.
    pub(super) fn is_due(&self) -> bool {
        self.sent.is_none_or(|sent| sent.elapsed() >= FRAME_INTERVAL)
    }

    /// Samples of the next round.
    pub(super) fn round_samples(&self) -> u32 {
        if self.spp == 0 {
            return 1;
        }
        let each = self.seconds / f64::from(self.spp);
        let round = (ROUND_SHARE * self.seconds).clamp(ROUND.as_secs_f64(), LONGEST_ROUND.as_secs_f64());
        let fits = (round / each.max(1e-9)) as u32;
        // Up to a power of two first: there the Sobol' points are at their best.
        fits.clamp(1, self.spp)
    }

    /// The image as a PNG with its figures; `None` if there is none yet.
    pub(super) fn frame(&mut self, edit: u32, start: u32, view: &View, done: bool) -> Result<Option<(Frame, Vec<u8>)>> {
        let Some(film) = &self.film else { return Ok(None) };
        let drawn = self.drawn(view);
        let png = match &drawn {
            Some((_, picture)) => encode_png(film.width(), film.height(), &picture.pixels),
            None => png_of(film, view),
        };
        let png = png.map_err(Error::Usage)?;
        self.sent = Some(Instant::now());
        let frame = Frame {
            edit,
            start,
            width: film.width(),
            height: film.height(),
            spp: self.spp,
            seconds: self.seconds,
            rays: self.rays,
            error: film.estimated_error().filter(|error| error.is_finite()),
            non_finite: self.non_finite,
            done,
            moving: view.moving,
            shown: drawn.as_ref().map(|(aov, _)| aov.to_string()),
            scale: drawn.and_then(|(_, picture)| picture.scale),
            statistics: self.statistics.as_ref().and_then(|counted| serde_json::to_value(counted.report()).ok()),
        };
        Ok(Some((frame, png)))
    }

    /// The AOV that the view shows, if it is summed.
    fn drawn(&self, view: &View) -> Option<(Aov, AovPicture)> {
        let aov = view.shown.parse().ok()?;
        Some((aov, aov_picture(self.aovs.as_ref()?, self.film.as_ref()?, aov)?))
    }

    /// Hands the image and its AOVs to a viewer.
    pub(super) fn feed(&self, viewer: Option<&TevFeed>) {
        if let (Some(viewer), Some(film)) = (viewer, &self.film) {
            viewer.show(film, self.aovs.as_ref());
        }
    }

    /// Names and means of the AOVs of a pixel.
    pub(super) fn aovs_at(&self, pixel: usize) -> Vec<(String, Vec<f64>)> {
        let (Some(film), Some(aovs)) = (&self.film, &self.aovs) else { return Vec::new() };
        aovs.pixel_means(pixel, film).into_iter().map(|(aov, means)| (aov.to_string(), means)).collect()
    }

    /// The image as a file, `png` or `exr`; `None` if there is none yet.
    pub(super) fn file(
        &self,
        format: &str,
        view: &View,
        metadata: Metadata,
    ) -> Option<std::result::Result<Vec<u8>, String>> {
        let film = self.film.as_ref()?;
        Some(match (format, self.drawn(view)) {
            ("exr", _) => exr_bytes(film, self.aovs.as_ref(), metadata).map_err(|e| e.to_string()),
            (_, Some((_, picture))) => encode_png(film.width(), film.height(), &picture.pixels),
            (_, None) => png_of(film, view),
        })
    }

    /// What an EXR says of itself.
    pub(super) fn metadata(&self, settings: &Settings, key: String, scene: String) -> Metadata {
        Metadata {
            seed: Some(settings.seed),
            sample_ranges: std::iter::once(0..self.spp).collect(),
            render_time_seconds: Some(self.seconds as f32),
            chromaticities: Some(REC709_CHROMATICITIES),
            software: Some(software()),
            kernel_key: Some(key),
            scene: Some(scene),
            integrator: Some(settings.integrator.to_string()),
            sampler: Some(settings.sampler.to_string()),
            clamp_indirect: settings.clamp_indirect,
            ..Metadata::default()
        }
    }
}

fn png_of(film: &Film, view: &View) -> std::result::Result<Vec<u8>, String> {
    let tone_map: ToneMap = view.tonemap.parse().unwrap_or_default();
    let (pixels, _) = tone_map_srgb8(&film.radiance(), view.exposure, tone_map);
    encode_png(film.width(), film.height(), &pixels)
}

/// An EXR file's bytes: its library writes to a file.
fn exr_bytes(film: &Film, aovs: Option<&AovFilm>, metadata: Metadata) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir().map_err(|e| Error::io(&std::env::temp_dir(), "make a folder in it", e))?;
    let path = folder.path().join("image.exr");
    let mut image = ExrImage::from_film(film, metadata);
    if let Some(aovs) = aovs {
        aovs.push_layers(film, &mut image);
    }
    image.write(&path)?;
    std::fs::read(&path).map_err(|e| Error::io(&path, "read", e))
}
