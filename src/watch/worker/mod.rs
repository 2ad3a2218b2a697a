//! The worker: it has the device, renders the view that it is told, and sends images until all samples are done.

mod answers;
mod builder;
mod loaded;
mod pick;
mod shown;

use std::io::{self, BufWriter, Write};
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::time::{Duration, Instant};

use self::builder::{Builder, Built, Front, Outcome, Wanted};
pub use self::loaded::LoadScene;
use self::loaded::camera_of;
use self::shown::Shown;
use super::messages::{Estimator, FromWorker, Stage, ToWorker, View};
use super::wire::{read_message, write_message};
use crate::film::aov::Aov;
use crate::film::tev_feed::{TevFeed, TevNews};
use crate::gpu::TraceBackend;
use crate::render::{Baked, KernelKey, Settings, open_device};
use crate::{Error, Result};

/// While the camera moves, each side of the image has this share of its pixels.
const MOVING_SHARE: u32 = 3;
/// While it renders the worker is heard of this often.
const BEAT: Duration = Duration::from_millis(120);
/// The processor is left to a compilation for so long; then the old kernel goes on.
const LONGEST_HOLD: Duration = Duration::from_secs(2);

/// What the worker's loop takes in.
enum Incoming {
    Told(ToWorker, Vec<u8>),
    Built(Box<Outcome>),
    /// The server is gone.
    Closed,
}

/// Renders until standard input ends, and shows the image in the viewer tev at an address, whenever one is there.
///
/// # Errors
/// No device, a scene that is bad at the start, a lost device.
pub fn run(mut settings: Settings, load: LoadScene, tev: Option<&str>) -> Result<()> {
    // Their pixels would move with the camera.
    settings.emission_rays = Some(0);
    let (send, inbox) = channel();
    let done = send.clone();
    std::thread::spawn(move || listen(&send));
    say(&FromWorker::Stage(Stage::Load), &[])?;
    let device = open_device(&settings)?;
    let view = View { estimator: Estimator::of(&settings), ..View::default() };
    let wanted = Wanted { edit: 0, settings, view: view.clone(), prints: false, reload: false };
    let (builder, front) = Builder::start(device, &wanted, load, done)?;
    let tev = tev.map(|address| feed(address, &front.loaded.scene.name));
    let aim = KernelKey { baked: Baked::default(), ..*front.tracer.key() };
    let mut worker = Worker {
        camera: view.camera,
        kept: wanted.settings.aovs.clone(),
        settings: wanted.settings,
        tev,
        prints: false,
        view,
        builder,
        front,
        shown: Shown::default(),
        edit: 0,
        start: 0,
        hold: None,
        aim,
    };
    worker.announce()?;
    worker.serve(&inbox)
}

fn listen(told: &Sender<Incoming>) {
    let mut stdin = io::stdin().lock();
    while let Ok((message, bytes)) = read_message::<ToWorker>(&mut stdin) {
        if told.send(Incoming::Told(message, bytes)).is_err() {
            return;
        }
    }
    // The worker ends by itself, unless it hangs.
    let _ = told.send(Incoming::Closed);
    std::thread::sleep(Duration::from_secs(2));
    std::process::exit(0);
}

fn say(message: &FromWorker, bytes: &[u8]) -> Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    // A server that is gone needs no worker.
    write_message(&mut out, message, bytes).and_then(|()| out.flush()).map_err(|_| Error::Interrupted)
}

/// A viewer that is slow or away costs nothing but its pictures.
fn feed(address: &str, name: &str) -> TevFeed {
    let at = address.to_owned();
    TevFeed::keep(address, name, move |news| match news {
        TevNews::Connected => eprintln!("tev at {at} shows the image"),
        TevNews::Missing(error) => eprintln!("tev at {at}: {error}; it gets the image as soon as it is there"),
        TevNews::Lost(error) => eprintln!("tev at {at} is gone: {error}"),
    })
}

/// The AOVs that a back end can give: nobody can tell what ray queries visit.
fn aovs_of(trace: TraceBackend) -> Vec<Aov> {
    Aov::ALL.iter().copied().filter(|&aov| aov != Aov::Cost || trace == TraceBackend::Bvh).collect()
}

struct Worker {
    /// What is asked for; what is in front may still have others.
    settings: Settings,
    /// AOVs that are summed whatever is shown.
    kept: Vec<Aov>,
    tev: Option<TevFeed>,
    prints: bool,
    view: View,
    builder: Builder,
    front: Front,
    /// The camera that the kernel in front was built for.
    camera: usize,
    shown: Shown,
    edit: u32,
    start: u32,
    /// Until when a picture that is there is not refined, because something is compiled.
    hold: Option<Instant>,
    /// The key of what was ordered last, or else is in front, but for what is compiled in.
    aim: KernelKey,
}

impl Worker {
    fn serve(&mut self, inbox: &Receiver<Incoming>) -> Result<()> {
        loop {
            let incoming = if self.is_done() {
                say(&FromWorker::Stage(Stage::Idle), &[])?;
                inbox.recv().map_err(|_| TryRecvError::Disconnected)
            } else if let Some(left) = self.held_for() {
                inbox.recv_timeout(left).map_err(|error| match error {
                    RecvTimeoutError::Timeout => TryRecvError::Empty,
                    RecvTimeoutError::Disconnected => TryRecvError::Disconnected,
                })
            } else {
                inbox.try_recv()
            };
            match incoming {
                Ok(Incoming::Closed) | Err(TryRecvError::Disconnected) => return Ok(()),
                Ok(incoming) => self.take(incoming)?,
                Err(TryRecvError::Empty) => self.render_round(inbox)?,
            }
        }
    }

    fn is_done(&self) -> bool {
        self.shown.spp >= self.settings.spp
    }

    /// How long to wait before rendering on. A picture that moves, or of which nothing is there, does not wait.
    fn held_for(&self) -> Option<Duration> {
        let left = self.hold?.checked_duration_since(Instant::now())?;
        (self.shown.spp > 0 && !self.view.moving).then_some(left)
    }

    fn take(&mut self, incoming: Incoming) -> Result<()> {
        match incoming {
            Incoming::Closed => Err(Error::Interrupted),
            Incoming::Built(outcome) => self.built(*outcome),
            Incoming::Told(message, bytes) => match message {
                ToWorker::View(view) => self.change_view(*view),
                ToWorker::Kernel { edit, prints } => self.change_kernel(edit, prints, &bytes),
                ToWorker::Scene { edit } => self.order(edit, true),
                ToWorker::Hold => {
                    self.hold = Some(Instant::now() + LONGEST_HOLD);
                    Ok(())
                }
                ToWorker::Resume => {
                    self.hold = None;
                    Ok(())
                }
                ToWorker::Inspect { client, x, y } => self.inspect(client, x, y),
                ToWorker::Save { client, format } => self.save(client, format),
            },
        }
    }

    fn restart(&mut self) {
        self.shown = Shown::default();
        self.start += 1;
    }

    fn change_view(&mut self, view: View) -> Result<()> {
        let old = std::mem::replace(&mut self.view, view);
        self.view.estimator.apply(&mut self.settings);
        self.settings.statistics = self.view.statistics;
        // All at once: then going from one to another builds no kernel.
        self.settings.aovs = match self.view.shown.parse::<Aov>() {
            Ok(_) => aovs_of(self.front.tracer.key().trace),
            Err(_) => self.kept.clone(),
        };
        if old.estimator != self.view.estimator || self.key_of_view()? != self.aim {
            // What is in front goes on, with its own camera and estimator, until the other kernel is there.
            self.order(self.edit, old.estimator.prepares_otherwise(&self.view.estimator))?;
        }
        let camera = self.fitting_camera()?.unwrap_or(self.camera);
        if self.camera != camera || (old.pose, old.moving) != (self.view.pose, self.view.moving) {
            self.camera = camera;
            self.restart();
        } else if (old.exposure, &old.tonemap, &old.shown) != (self.view.exposure, &self.view.tonemap, &self.view.shown)
        {
            return self.send_frame();
        } else if old.pixel != self.view.pixel && self.shown.spp > 0 {
            return self.print();
        }
        Ok(())
    }

    /// The key of the kernel that the view needs, but for what would be compiled in.
    fn key_of_view(&self) -> Result<KernelKey> {
        let loaded = &self.front.loaded;
        let camera = camera_of(&loaded.scene, &self.view)?;
        Ok(self.front.tracer.key_for(&loaded.prepared, &camera, &self.settings))
    }

    fn key_in_front(&self) -> KernelKey {
        KernelKey { baked: Baked::default(), ..*self.front.tracer.key() }
    }

    /// The view's camera, if the kernel in front can show it.
    fn fitting_camera(&self) -> Result<Option<usize>> {
        Ok((self.key_of_view()? == self.key_in_front()).then_some(self.view.camera))
    }

    fn change_kernel(&mut self, edit: u32, prints: bool, bytes: &[u8]) -> Result<()> {
        self.prints = prints;
        let words = bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
        self.settings.kernel_spirv = Some(words.collect::<Vec<_>>().into());
        self.order(edit, false)
    }

    fn order(&mut self, edit: u32, reload: bool) -> Result<()> {
        self.aim = self.key_of_view()?;
        let before = self.builder.in_work();
        let (settings, view) = (self.settings.clone(), self.view.clone());
        self.builder.order(Wanted { edit, settings, view, prints: self.prints, reload }, &self.front);
        if before.is_none() { self.building() } else { Ok(()) }
    }

    /// Says what is being built, and leaves the processor to it.
    fn building(&mut self) -> Result<()> {
        self.hold = self.builder.in_work().map(|_| Instant::now() + LONGEST_HOLD);
        self.builder.in_work().map_or(Ok(()), |edit| say(&FromWorker::Building { edit }, &[]))
    }

    fn built(&mut self, outcome: Outcome) -> Result<()> {
        let Wanted { edit, reload, view, .. } = outcome.wanted.clone();
        let keeps_kernel = matches!(outcome.built, Ok(Built::Scene(..)));
        let reused = outcome.reused.clone();
        let result = self.builder.take(outcome, &mut self.front);
        match result {
            Ok(()) => {
                self.edit = edit;
                self.camera = self.fitting_camera()?.unwrap_or(view.camera);
                self.restart();
                let seconds = (!keeps_kernel).then_some(self.front.tracer.compile_seconds);
                let kernel = self.front.tracer.key().to_string();
                say(&FromWorker::Built { edit, seconds, kernel, reused }, &[])?;
                self.building()?;
                if reload {
                    self.aim = self.key_in_front();
                    let last = self.front.loaded.scene.cameras.len().saturating_sub(1);
                    self.camera = self.camera.min(last);
                    self.view.camera = self.view.camera.min(last);
                    self.announce()?;
                }
                Ok(())
            }
            Err(error @ Error::DeviceLost(_)) => Err(error),
            Err(error) => {
                // The next order must not fail for what this one brought.
                self.settings.kernel_spirv = self.front.settings.kernel_spirv.clone();
                self.prints = self.front.prints;
                self.aim = self.key_in_front();
                say(&FromWorker::Failed { edit, message: error.to_string() }, &[])?;
                self.building()
            }
        }
    }

    /// The view as the kernel in front can show it.
    fn front_view(&self) -> View {
        View { camera: self.camera, ..self.view.clone() }
    }

    /// Some more samples of every pixel, fewer than would keep a message waiting.
    fn render_round(&mut self, inbox: &Receiver<Incoming>) -> Result<()> {
        say(&FromWorker::Stage(Stage::Render), &[])?;
        let camera = camera_of(&self.front.loaded.scene, &self.front_view())?;
        let share = if self.view.moving { MOVING_SHARE } else { 1 };
        let (width, height) = ((self.settings.width / share).max(1), (self.settings.height / share).max(1));
        self.front.tracer.look_through(&camera, self.front.loaded.prepared.origin, width, height);
        let first = self.shown.spp;
        let end = first.saturating_add(self.shown.round_samples()).min(self.settings.spp);
        let mut waiting = None;
        let mut beat = Instant::now();
        // A moving camera would otherwise never come to an image.
        let goes_on = self.view.moving && first == 0;
        let run = self.front.tracer.run(self.settings.seed, first..end, None, &mut |_| {
            if beat.elapsed() > BEAT {
                beat = Instant::now();
                if say(&FromWorker::Stage(Stage::Render), &[]).is_err() {
                    return ControlFlow::Break(());
                }
            }
            // The slices in flight still come in; a second message must not take the place of the first.
            if waiting.is_none() && !goes_on {
                waiting = match inbox.try_recv() {
                    Ok(incoming) => Some(incoming),
                    Err(TryRecvError::Empty) => None,
                    Err(TryRecvError::Disconnected) => Some(Incoming::Closed),
                };
            }
            if waiting.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        if let Some(incoming) = waiting {
            // A round that was broken off leaves pixels with different counts: it is thrown away.
            return self.take(incoming);
        }
        self.shown.add(run, end);
        if first == 0 {
            self.print()?;
        }
        if self.is_done() || self.shown.is_due() { self.send_frame() } else { Ok(()) }
    }
}
