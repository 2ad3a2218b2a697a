//! What the worker says of its picture and its scene.

use super::loaded::camera_of;
use super::{Worker, aovs_of, pick, say};
use crate::Result;
use crate::watch::messages::{FromWorker, Ready};

impl Worker {
    pub(super) fn announce(&self) -> Result<()> {
        let scene = &self.front.loaded.scene;
        let key = self.front.tracer.key();
        say(
            &FromWorker::Ready(Ready {
                scene: scene.name.clone(),
                device: self.builder.device(),
                variant: [key.trace as u32, key.array_form as u32],
                cameras: self.front.loaded.cameras(),
                warnings: scene.warnings.iter().chain(&scene.notes).cloned().collect(),
                resolution: [self.settings.width, self.settings.height],
                aovs: aovs_of(key.trace).iter().map(ToString::to_string).collect(),
                kernel: key.to_string(),
            }),
            &[],
        )
    }

    pub(super) fn send_frame(&mut self) -> Result<()> {
        let done = self.is_done();
        self.shown.feed(self.tev.as_ref().filter(|tev| !self.view.moving && (done || tev.is_due())));
        match self.shown.frame(self.edit, self.start, &self.view, done)? {
            Some((frame, png)) => say(&FromWorker::Frame(frame), &png),
            None => Ok(()),
        }
    }

    /// Says what the kernel prints for the pixel of the view. Not while the camera moves.
    pub(super) fn print(&mut self) -> Result<()> {
        if !self.front.prints || self.view.moving {
            return Ok(());
        }
        let size = [self.settings.width, self.settings.height];
        let wanted = self.view.pixel.unwrap_or(size.map(|n| n / 2));
        let pixel = [0, 1].map(|i| wanted[i].min(size[i] - 1));
        let values = self.front.tracer.prints(self.settings.seed, pixel.into(), 0)?;
        let values = values.into_iter().map(|printed| (printed.place, printed.value)).collect();
        say(&FromWorker::Prints { edit: self.edit, pixel, values }, &[])
    }

    pub(super) fn inspect(&self, client: u64, x: u32, y: u32) -> Result<()> {
        let Some(film) = self.shown.film.as_ref().filter(|f| x < f.width() && y < f.height()) else { return Ok(()) };
        let pixel = &film.pixels()[(y * film.width() + x) as usize];
        let scene = &self.front.loaded.scene;
        let camera = camera_of(scene, &self.front_view())?;
        say(
            &FromWorker::Pixel {
                client,
                x,
                y,
                radiance: pixel.mean(),
                samples: pixel.count,
                variance: pixel.variance_of_mean().filter(|v| v.is_finite()),
                seen: pick::seen_at(scene, &camera, [film.width(), film.height()], (x, y)),
                aovs: self.shown.aovs_at((y * film.width() + x) as usize),
            },
            &[],
        )
    }

    pub(super) fn save(&self, client: u64, format: String) -> Result<()> {
        let key = self.front.tracer.key().to_string();
        let scene = self.front.loaded.scene.name.clone();
        let metadata = self.shown.metadata(&self.front.settings, key, scene);
        match self.shown.file(&format, &self.view, metadata) {
            Some(Ok(bytes)) => say(&FromWorker::Saved { client, format }, &bytes),
            Some(Err(message)) => say(&FromWorker::Failed { edit: self.edit, message }, &[]),
            None => Ok(()),
        }
    }
}
