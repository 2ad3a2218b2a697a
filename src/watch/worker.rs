//! The worker: it has the device, renders the view that it is told, and sends images until all samples are done.

use std::io::{self, BufWriter, Write};
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use super::messages::{CameraEntry, Frame, FromWorker, Pose, Ready, Stage, ToWorker, View};
use super::wire::{read_message, write_message};
use crate::film::Film;
use crate::film::exr::ExrImage;
use crate::film::metadata::{Metadata, REC709_CHROMATICITIES, software};
use crate::film::png::{encode_png, tone_map_srgb8};
use crate::film::tonemap::ToneMap;
use crate::prepare::Prepared;
use crate::render::{BindingOverride, OpenDevice, PathTracer, Settings, open_device, prepare_scene};
use crate::scene::{Camera, Scene};
use crate::{Error, Result};

/// Images are sent this often while samples come in.
const FRAME_INTERVAL: Duration = Duration::from_millis(120);
/// A round of samples between two looks at what is there should take about this long.
const ROUND: Duration = Duration::from_millis(100);
/// While the camera moves, each side of the image has this share of its pixels.
const MOVING_SHARE: u32 = 3;

/// Reads the scene; called anew for each reload.
pub type LoadScene<'a> = &'a dyn Fn() -> std::result::Result<Scene, String>;

/// Renders until standard input ends.
///
/// # Errors
/// No device, a scene that is bad at the start, a lost device.
pub fn run(settings: Settings, load: LoadScene<'_>) -> Result<()> {
    let (send, inbox) = channel();
    std::thread::spawn(move || {
        let mut stdin = io::stdin().lock();
        while let Ok(message) = read_message::<ToWorker>(&mut stdin) {
            if send.send(message).is_err() {
                return;
            }
        }
        // The server is gone: the closed channel ends the worker, unless it hangs.
        drop(send);
        std::thread::sleep(Duration::from_secs(2));
        std::process::exit(0);
    });
    say(&FromWorker::Stage(Stage::Load), &[])?;
    let device = open_device(&settings)?;
    let scene = load().map_err(Error::Usage)?;
    let view = View { integrator: settings.integrator.name().to_owned(), ..View::default() };
    let loaded = Loaded::new(&device, scene, &settings, &view)?;
    let mut worker = Worker { device, settings, view, loaded, shown: Shown::default(), edit: 0, start: 0 };
    worker.announce()?;
    worker.serve(&inbox, load)
}

fn say(message: &FromWorker, bytes: &[u8]) -> Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    // A server that is gone needs no worker.
    write_message(&mut out, message, bytes).and_then(|()| out.flush()).map_err(|_| Error::Interrupted)
}

/// A scene on the device.
struct Loaded {
    scene: Scene,
    prepared: Prepared,
    tracer: PathTracer,
}

impl Loaded {
    fn new(device: &OpenDevice, scene: Scene, settings: &Settings, view: &View) -> Result<Self> {
        let camera = camera_of(&scene, view)?;
        let prepared = prepare_scene(&scene, &camera, settings)?;
        let tracer =
            PathTracer::new(&device.gpu, device.trace, &prepared, &camera, settings, BindingOverride::default())?;
        Ok(Self { scene, prepared, tracer })
    }
}

/// What has been rendered since the last start.
#[derive(Default)]
struct Shown {
    film: Option<Film>,
    spp: u32,
    seconds: f64,
    rays: u64,
    non_finite: u64,
    sent: Option<Instant>,
}

struct Worker {
    device: OpenDevice,
    settings: Settings,
    view: View,
    loaded: Loaded,
    shown: Shown,
    edit: u32,
    start: u32,
}

impl Worker {
    fn announce(&self) -> Result<()> {
        let scene = &self.loaded.scene;
        let centre = scene.bounds().map(|(low, high)| (low + high) / 2.0);
        let cameras = scene.cameras.iter().map(|c| CameraEntry { name: c.name.clone(), pose: pose_of(c, centre) });
        let key = self.loaded.tracer.key();
        say(
            &FromWorker::Ready(Ready {
                scene: scene.name.clone(),
                device: format!("{}, {}", self.device.reason, self.device.gpu.info.driver),
                variant: [key.trace as u32, key.array_form as u32],
                cameras: cameras.collect(),
                warnings: scene.warnings.iter().chain(&scene.notes).cloned().collect(),
                resolution: [self.settings.width, self.settings.height],
            }),
            &[],
        )
    }

    fn serve(&mut self, inbox: &Receiver<(ToWorker, Vec<u8>)>, load: LoadScene<'_>) -> Result<()> {
        loop {
            let message = if self.is_done() {
                say(&FromWorker::Stage(Stage::Idle), &[])?;
                inbox.recv().map_err(|_| TryRecvError::Disconnected)
            } else {
                inbox.try_recv()
            };
            match message {
                Ok((message, bytes)) => self.obey(message, &bytes, load)?,
                Err(TryRecvError::Disconnected) => return Ok(()),
                Err(TryRecvError::Empty) => self.render_round(inbox, load)?,
            }
        }
    }

    fn is_done(&self) -> bool {
        self.shown.spp >= self.settings.spp
    }

    fn obey(&mut self, message: ToWorker, bytes: &[u8], load: LoadScene<'_>) -> Result<()> {
        match message {
            ToWorker::View(view) => self.change_view(view),
            ToWorker::Kernel { edit } => self.change_kernel(edit, bytes),
            ToWorker::Scene { edit } => self.change_scene(edit, load),
            ToWorker::Inspect { client, x, y } => self.inspect(client, x, y),
            ToWorker::Save { client, format } => self.save(client, &format),
        }
    }

    fn restart(&mut self) {
        self.shown = Shown::default();
        self.start += 1;
    }

    fn change_view(&mut self, view: View) -> Result<()> {
        let old = std::mem::replace(&mut self.view, view);
        if old.integrator != self.view.integrator {
            if let Ok(integrator) = self.view.integrator.parse() {
                self.settings.integrator = integrator;
                self.rebuild(self.edit)?;
            }
            self.restart();
        } else if old.camera != self.view.camera {
            // Another camera may have a lens or another projection, which are other kernels.
            self.rebuild(self.edit)?;
            self.restart();
        } else if (old.pose, old.moving) != (self.view.pose, self.view.moving) {
            self.restart();
        } else if (old.exposure, &old.tonemap) != (self.view.exposure, &self.view.tonemap) {
            return self.send_frame();
        }
        Ok(())
    }

    fn change_kernel(&mut self, edit: u32, bytes: &[u8]) -> Result<()> {
        let words = bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
        let before = self.settings.kernel_spirv.replace(words.collect::<Vec<_>>().into());
        if self.rebuild(edit)? {
            self.edit = edit;
            self.restart();
        } else {
            self.settings.kernel_spirv = before;
        }
        Ok(())
    }

    /// Whether the kernel could be built.
    fn rebuild(&mut self, edit: u32) -> Result<bool> {
        say(&FromWorker::Stage(Stage::Build), &[])?;
        let loaded = &mut self.loaded;
        let camera = camera_of(&loaded.scene, &self.view)?;
        match loaded.tracer.rebuild(&self.device.gpu, &loaded.prepared, &camera, &self.settings) {
            Ok(()) => say(&FromWorker::Built { edit, seconds: loaded.tracer.compile_seconds }, &[]).map(|()| true),
            Err(error @ Error::DeviceLost(_)) => Err(error),
            Err(error) => say(&FromWorker::Failed { edit, message: error.to_string() }, &[]).map(|()| false),
        }
    }

    fn change_scene(&mut self, edit: u32, load: LoadScene<'_>) -> Result<()> {
        say(&FromWorker::Stage(Stage::Load), &[])?;
        let loaded = load().and_then(|scene| {
            self.view.camera = self.view.camera.min(scene.cameras.len().saturating_sub(1));
            Loaded::new(&self.device, scene, &self.settings, &self.view).map_err(|e| e.to_string())
        });
        match loaded {
            Ok(loaded) => {
                let seconds = loaded.tracer.compile_seconds;
                self.loaded = loaded;
                self.edit = edit;
                self.restart();
                self.announce()?;
                say(&FromWorker::Built { edit, seconds }, &[])
            }
            Err(message) => say(&FromWorker::Failed { edit, message }, &[]),
        }
    }

    /// Some more samples of every pixel, fewer than would keep a message waiting.
    fn render_round(&mut self, inbox: &Receiver<(ToWorker, Vec<u8>)>, load: LoadScene<'_>) -> Result<()> {
        say(&FromWorker::Stage(Stage::Render), &[])?;
        let camera = camera_of(&self.loaded.scene, &self.view)?;
        let share = if self.view.moving { MOVING_SHARE } else { 1 };
        let (width, height) = ((self.settings.width / share).max(1), (self.settings.height / share).max(1));
        self.loaded.tracer.look_through(&camera, self.loaded.prepared.origin, width, height);
        let first = self.shown.spp;
        let end = first.saturating_add(self.round_samples()).min(self.settings.spp);
        let mut waiting = None;
        let mut beat = Instant::now();
        let run = self.loaded.tracer.run(self.settings.seed, first..end, None, &mut |_| {
            if beat.elapsed() > FRAME_INTERVAL {
                beat = Instant::now();
                if say(&FromWorker::Stage(Stage::Render), &[]).is_err() {
                    return ControlFlow::Break(());
                }
            }
            // A moving camera would otherwise never come to an image.
            if self.view.moving && first == 0 {
                return ControlFlow::Continue(());
            }
            // The slices in flight still come in; a second message must not take the place of the first.
            if waiting.is_some() {
                return ControlFlow::Break(());
            }
            match inbox.try_recv() {
                Ok(message) => {
                    waiting = Some(message);
                    ControlFlow::Break(())
                }
                Err(TryRecvError::Empty) => ControlFlow::Continue(()),
                Err(TryRecvError::Disconnected) => ControlFlow::Break(()),
            }
        })?;
        // A round that was broken off leaves pixels with different counts: it is thrown away.
        if waiting.is_none() {
            self.shown.spp = end;
            self.shown.seconds += run.seconds;
            self.shown.rays += run.rays;
            self.shown.non_finite += run.non_finite_samples;
            match &mut self.shown.film {
                Some(film) => film.merge(&run.film),
                None => self.shown.film = Some(run.film),
            }
            if self.is_done() || self.shown.sent.is_none_or(|sent| sent.elapsed() >= FRAME_INTERVAL) {
                self.send_frame()?;
            }
        }
        match waiting {
            Some((message, bytes)) => self.obey(message, &bytes, load),
            None => Ok(()),
        }
    }

    fn round_samples(&self) -> u32 {
        if self.shown.spp == 0 {
            return 1;
        }
        let each = self.shown.seconds / f64::from(self.shown.spp);
        let fits = (ROUND.as_secs_f64() / each.max(1e-9)) as u32;
        // Up to a power of two first: there the Sobol' points are at their best.
        fits.clamp(1, self.shown.spp)
    }

    fn send_frame(&mut self) -> Result<()> {
        let Some(film) = &self.shown.film else { return Ok(()) };
        let tone_map: ToneMap = self.view.tonemap.parse().unwrap_or_default();
        let (pixels, _) = tone_map_srgb8(&film.radiance(), self.view.exposure, tone_map);
        let png = encode_png(film.width(), film.height(), &pixels).map_err(Error::Usage)?;
        self.shown.sent = Some(Instant::now());
        let frame = Frame {
            edit: self.edit,
            start: self.start,
            width: film.width(),
            height: film.height(),
            spp: self.shown.spp,
            seconds: self.shown.seconds,
            rays: self.shown.rays,
            error: film.estimated_error().filter(|error| error.is_finite()),
            non_finite: self.shown.non_finite,
            done: self.is_done(),
            moving: self.view.moving,
        };
        say(&FromWorker::Frame(frame), &png)
    }

    fn inspect(&self, client: u64, x: u32, y: u32) -> Result<()> {
        let Some(film) = self.shown.film.as_ref().filter(|f| x < f.width() && y < f.height()) else { return Ok(()) };
        let pixel = &film.pixels()[(y * film.width() + x) as usize];
        say(
            &FromWorker::Pixel {
                client,
                x,
                y,
                radiance: pixel.mean(),
                samples: pixel.count,
                variance: pixel.variance_of_mean().filter(|v| v.is_finite()),
            },
            &[],
        )
    }

    fn save(&self, client: u64, format: &str) -> Result<()> {
        let Some(film) = &self.shown.film else { return Ok(()) };
        let file = if format == "exr" {
            exr_bytes(film, self.metadata()).map_err(|e| e.to_string())
        } else {
            let tone_map: ToneMap = self.view.tonemap.parse().unwrap_or_default();
            let (pixels, _) = tone_map_srgb8(&film.radiance(), self.view.exposure, tone_map);
            encode_png(film.width(), film.height(), &pixels)
        };
        match file {
            Ok(bytes) => say(&FromWorker::Saved { client, format: format.to_owned() }, &bytes),
            Err(message) => say(&FromWorker::Failed { edit: self.edit, message }, &[]),
        }
    }

    fn metadata(&self) -> Metadata {
        Metadata {
            seed: Some(self.settings.seed),
            sample_ranges: std::iter::once(0..self.shown.spp).collect(),
            render_time_seconds: Some(self.shown.seconds as f32),
            chromaticities: Some(REC709_CHROMATICITIES),
            software: Some(software()),
            kernel_key: Some(self.loaded.tracer.key().to_string()),
            scene: Some(self.loaded.scene.name.clone()),
            integrator: Some(self.settings.integrator.to_string()),
            clamp_indirect: self.settings.clamp_indirect,
            ..Metadata::default()
        }
    }
}

/// An EXR file's bytes: its library writes to a file.
fn exr_bytes(film: &Film, metadata: Metadata) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir().map_err(|e| Error::io(&std::env::temp_dir(), "make a folder in it", e))?;
    let path = folder.path().join("image.exr");
    ExrImage::from_film(film, metadata).write(&path)?;
    std::fs::read(&path).map_err(|e| Error::io(&path, "read", e))
}

fn camera_of(scene: &Scene, view: &View) -> Result<Camera> {
    let camera = scene.cameras.get(view.camera).or(scene.cameras.first());
    let mut camera = camera.ok_or_else(|| Error::Usage(format!("{} has no camera", scene.name)))?.clone();
    if let Some(to_world) = view.pose.and_then(|pose| pose.camera_to_world()) {
        camera.camera_to_world = to_world;
    }
    Ok(camera)
}

/// A scene's camera turns around the point on its axis that is nearest to the middle of the scene.
fn pose_of(camera: &Camera, centre: Option<glam::DVec3>) -> Pose {
    let eye = camera.camera_to_world.translation;
    let forward = -camera.camera_to_world.matrix3.z_axis.normalize_or(glam::DVec3::Z);
    let distance = centre.map(|centre| (centre - eye).dot(forward)).filter(|d| *d > 0.0).unwrap_or(1.0);
    Pose {
        eye: eye.to_array(),
        target: (eye + forward * distance).to_array(),
        up: camera.camera_to_world.matrix3.y_axis.to_array(),
    }
}
