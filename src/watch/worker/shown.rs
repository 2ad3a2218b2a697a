//! The picture so far: its film, the images that are sent of it, and the files that are saved.

use std::time::{Duration, Instant};

use crate::film::Film;
use crate::film::exr::ExrImage;
use crate::film::metadata::{Metadata, REC709_CHROMATICITIES, software};
use crate::film::png::{encode_png, tone_map_srgb8};
use crate::film::tonemap::ToneMap;
use crate::render::{Run, Settings};
use crate::watch::messages::{Frame, View};
use crate::{Error, Result};

/// Images are sent this often while samples come in.
const FRAME_INTERVAL: Duration = Duration::from_millis(120);
/// A round of samples between two images should take about this long.
const ROUND: Duration = Duration::from_millis(100);

/// What has been rendered since rendering started anew.
#[derive(Default)]
pub(super) struct Shown {
    pub(super) film: Option<Film>,
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
        let fits = (ROUND.as_secs_f64() / each.max(1e-9)) as u32;
        // Up to a power of two first: there the Sobol' points are at their best.
        fits.clamp(1, self.spp)
    }

    /// The image as a PNG with its figures; `None` if there is none yet.
    pub(super) fn frame(&mut self, edit: u32, start: u32, view: &View, done: bool) -> Result<Option<(Frame, Vec<u8>)>> {
        let Some(film) = &self.film else { return Ok(None) };
        let png = png_of(film, view).map_err(Error::Usage)?;
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
        };
        Ok(Some((frame, png)))
    }

    /// The image as a file, `png` or `exr`; `None` if there is none yet.
    pub(super) fn file(
        &self,
        format: &str,
        view: &View,
        metadata: Metadata,
    ) -> Option<std::result::Result<Vec<u8>, String>> {
        let film = self.film.as_ref()?;
        Some(if format == "exr" { exr_bytes(film, metadata).map_err(|e| e.to_string()) } else { png_of(film, view) })
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
fn exr_bytes(film: &Film, metadata: Metadata) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir().map_err(|e| Error::io(&std::env::temp_dir(), "make a folder in it", e))?;
    let path = folder.path().join("image.exr");
    ExrImage::from_film(film, metadata).write(&path)?;
    std::fs::read(&path).map_err(|e| Error::io(&path, "read", e))
}
