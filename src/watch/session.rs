//! The loop: files change, kernels are compiled, the worker is told, and what it says goes to the terminal and the page.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use serde_json::json;

use super::diagnostic::{Diagnostic, diagnose};
use super::guard::Guard;
use super::hub::{Hub, ToPage, packed};
use super::includes::reached_from;
use super::messages::{Frame, FromPage, FromWorker, Ready, Stage, ToWorker, View};
use super::report::Report;
use super::scene_files::files_of;
use super::server::{Server, serve};
use super::supervisor::{Heard, WorkerProcess};
use super::tracked::{Tracker, absolute};
use crate::gpu::embedded;
use crate::gpu::shader_compiler::{Sources, compile, read_sources};
use crate::{Error, Result};

/// The kernel that is watched.
const KERNEL: &str = "path_trace.comp";
/// Workers that may end with a kernel that was good before, in a row.
const MOST_ENDS: u32 = 3;
/// Edits that the page lists.
const LISTED_EDITS: usize = 50;

/// What `sunfleck watch` is asked for.
#[derive(Clone, Debug)]
pub struct Options {
    /// A file or the name of a built-in scene.
    pub scene: String,
    /// The image of the environment.
    pub environment: Option<PathBuf>,
    /// The folder of shader sources; without one, the embedded ones are used and none are watched.
    pub shaders: Option<PathBuf>,
    /// Arguments of this program that make it the worker.
    pub worker_arguments: Vec<OsString>,
    /// What is shown first.
    pub view: View,
    /// The command that renders this scene with these settings, without what the page changes.
    pub command: String,
    /// The worker hangs if it is at work and silent for so long.
    pub hang: Duration,
}

/// Where the page is served.
#[derive(Debug)]
pub struct Serving {
    /// Listens already.
    pub listener: TcpListener,
    /// Its address.
    pub address: SocketAddr,
    /// What a request must know.
    pub token: Option<String>,
}

enum Event {
    Worker(u32, Heard),
    Files(BTreeSet<PathBuf>),
    Page(u64, FromPage),
}

#[derive(Clone)]
struct CompiledKernel {
    edit: u32,
    spirv: Arc<[u8]>,
}

struct Session {
    options: Options,
    events: Sender<Event>,
    hub: Arc<Hub>,
    tracker: Tracker,
    scene_files: Vec<PathBuf>,
    sources: Sources,
    worker: WorkerProcess,
    worker_number: u32,
    ready: Option<Ready>,
    stage: Stage,
    heard: Instant,
    ends: u32,
    /// The kernel that the worker was told to use, and the last of which an image has come.
    current: Option<CompiledKernel>,
    good: Option<CompiledKernel>,
    edit: u32,
    view: View,
    errors: Vec<Diagnostic>,
    notice: Option<String>,
    reports: Vec<Report>,
}

/// Runs until the process is ended.
///
/// # Errors
/// A worker that cannot start, or that ends again and again with a kernel that was good.
pub fn run(options: Options, serving: Option<Serving>) -> Result<()> {
    let (events, inbox) = channel();
    let hub = Arc::new(Hub::default());
    let mut session = Session::new(options, events.clone(), Arc::clone(&hub))?;
    if let Some(serving) = serving {
        let said = move |client, message| {
            let _ = events.send(Event::Page(client, message));
        };
        let guard = Guard { address: serving.address, token: serving.token };
        serve(serving.listener, Arc::new(Server { guard, hub, said: Box::new(said) }));
    }
    session.serve(&inbox)
}

impl Session {
    fn new(options: Options, events: Sender<Event>, hub: Arc<Hub>) -> Result<Self> {
        let changed = events.clone();
        let tracker = Tracker::new(move |paths| {
            let _ = changed.send(Event::Files(paths));
        })?;
        let sources = embedded::SOURCES.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
        let worker = start_worker(&options, 1, &events)?;
        let now = Instant::now();
        let mut session = Self {
            view: options.view.clone(),
            options,
            events,
            hub,
            tracker,
            scene_files: Vec::new(),
            sources,
            worker,
            worker_number: 1,
            ready: None,
            stage: Stage::Load,
            heard: now,
            ends: 0,
            current: None,
            good: None,
            edit: 0,
            errors: Vec::new(),
            notice: None,
            reports: vec![Report::new(0, "start".to_owned(), now)],
        };
        session.track_scene()?;
        if let Some(folder) = session.options.shaders.clone() {
            session.tracker.add(&folder, true)?;
        }
        Ok(session)
    }

    fn serve(&mut self, inbox: &Receiver<Event>) -> Result<()> {
        loop {
            let event = if matches!(self.stage, Stage::Build | Stage::Render) {
                let left = self.options.hang.saturating_sub(self.heard.elapsed());
                inbox.recv_timeout(left).ok()
            } else {
                inbox.recv().ok()
            };
            match event {
                Some(Event::Worker(number, heard)) if number == self.worker_number => self.hear(heard)?,
                // The last words of a worker that was replaced.
                Some(Event::Worker(..)) => {}
                Some(Event::Files(paths)) => self.files_changed(&paths)?,
                Some(Event::Page(client, message)) => self.page_said(client, message),
                None => {
                    let seconds = self.options.hang.as_secs();
                    self.replace_worker(&format!("has been silent for {seconds} s"))?;
                }
            }
        }
    }

    fn hear(&mut self, heard: Heard) -> Result<()> {
        self.heard = Instant::now();
        let Heard::Message(message, bytes) = heard else {
            let status = self.worker.end();
            if self.ready.is_none() && self.worker_number == 1 {
                return Err(start_error(status.and_then(|s| s.code())));
            }
            let status = status.map_or_else(|| "without a status".to_owned(), |status| status.to_string());
            return self.replace_worker(&format!("has ended ({status})"));
        };
        match message {
            FromWorker::Ready(ready) => self.worker_ready(ready),
            FromWorker::Built { edit, seconds } => {
                if let Some(report) = self.report(edit) {
                    report.build_ms = Some(1e3 * seconds);
                }
            }
            FromWorker::Failed { edit, message } => {
                self.say(&format!("edit {edit} cannot be shown: {message}"));
                self.notice = Some(message);
                self.show_status();
            }
            FromWorker::Frame(frame) => self.frame(&frame, &bytes),
            FromWorker::Stage(stage) => {
                let changed = self.stage != stage;
                self.stage = stage;
                if changed {
                    self.show_status();
                }
            }
            FromWorker::Pixel { client, x, y, radiance, samples, variance } => {
                let pixel = json!({"type": "pixel", "x": x, "y": y, "radiance": radiance, "samples": samples,
                    "variance": variance});
                self.hub.reply(client, ToPage::Text(Arc::new(pixel.to_string())));
            }
            FromWorker::Saved { client, format } => {
                let name = Path::new(&self.options.scene).file_stem().map(|s| s.to_string_lossy().into_owned());
                let name = format!("{}.{format}", name.unwrap_or_else(|| "image".to_owned()));
                let json = json!({"type": "file", "name": name}).to_string();
                self.hub.reply(client, ToPage::Binary(Arc::new(packed(&json, &bytes))));
            }
        }
        Ok(())
    }

    fn worker_ready(&mut self, ready: Ready) {
        let variant_changed = self.ready.as_ref().is_none_or(|before| before.variant != ready.variant);
        if self.ready.is_none() {
            self.say(&format!("{} on {}", ready.scene, ready.device));
        }
        self.ready = Some(ready);
        self.worker.tell(ToWorker::View(self.view.clone()), Vec::new());
        match &self.current {
            Some(kernel) if !variant_changed => {
                self.worker.tell(ToWorker::Kernel { edit: kernel.edit }, kernel.spirv.to_vec());
            }
            Some(_) => self.compile(self.edit, Instant::now(), None),
            None => self.read_shaders(Instant::now()),
        }
        self.show_status();
    }

    fn frame(&mut self, frame: &Frame, png: &[u8]) {
        if self.current.as_ref().is_some_and(|kernel| kernel.edit <= frame.edit) {
            self.good = self.current.clone();
            self.ends = 0;
        }
        let mut json = serde_json::to_value(frame).unwrap_or_default();
        json["type"] = json!("frame");
        self.hub.set_frame(&json.to_string(), png);
        let Some(index) = self.reports.iter().rposition(|report| report.edit == frame.edit) else { return };
        let before = self.reports[..index].iter().rev().find(|report| report.is_measured).cloned();
        let view = format!("{} {:?} {}", self.view.camera, self.view.pose, self.view.integrator);
        let is_first = self.reports[index].first_image_ms.is_none();
        if self.reports[index].observe(frame, &view, before.as_ref()) {
            let line = self.reports[index].to_string();
            self.say(&line);
            self.show_status();
        } else if is_first {
            self.show_status();
        }
    }

    fn report(&mut self, edit: u32) -> Option<&mut Report> {
        self.reports.iter_mut().rev().find(|report| report.edit == edit)
    }

    fn page_said(&mut self, client: u64, message: FromPage) {
        match message {
            FromPage::View(view) => {
                // Beyond, exposures are infinite or nothing.
                let exposure = if view.exposure.is_finite() { view.exposure.clamp(-100.0, 100.0) } else { 0.0 };
                self.view = View { exposure, ..view };
                self.worker.tell(ToWorker::View(self.view.clone()), Vec::new());
            }
            FromPage::Inspect { x, y } => self.worker.tell(ToWorker::Inspect { client, x, y }, Vec::new()),
            FromPage::Save { format } if ["png", "exr"].contains(&format.as_str()) => {
                self.worker.tell(ToWorker::Save { client, format }, Vec::new());
            }
            FromPage::Save { .. } => {}
        }
    }

    fn files_changed(&mut self, paths: &BTreeSet<PathBuf>) -> Result<()> {
        let saved = Instant::now();
        let folder = self.options.shaders.as_deref().map(absolute);
        if folder.is_some_and(|folder| paths.iter().any(|path| path.starts_with(&folder))) {
            self.read_shaders(saved);
        }
        let of_scene: Vec<_> = paths.iter().filter(|path| self.scene_files.contains(path)).collect();
        if let Some(first) = of_scene.first() {
            let name = first.file_name().unwrap_or_default().to_string_lossy().into_owned();
            self.edit += 1;
            self.reports.push(Report::new(self.edit, name, saved));
            self.notice = None;
            self.worker.tell(ToWorker::Scene { edit: self.edit }, Vec::new());
            self.track_scene()?;
            self.show_status();
        }
        Ok(())
    }

    /// Takes the files of the scene anew: it may name others now.
    fn track_scene(&mut self) -> Result<()> {
        let scene = Path::new(&self.options.scene);
        let mut files = if scene.is_file() { files_of(scene) } else { Vec::new() };
        files.extend(self.options.environment.clone());
        self.scene_files = files.iter().map(|file| absolute(file)).collect();
        for file in &self.scene_files {
            if let Some(folder) = file.parent().filter(|folder| folder.is_dir()) {
                self.tracker.add(folder, false)?;
            }
        }
        Ok(())
    }

    /// Reads the shaders and compiles the kernel if one of its files has changed.
    fn read_shaders(&mut self, saved: Instant) {
        let Some(folder) = &self.options.shaders else { return };
        let sources = match read_sources(folder) {
            Ok(sources) => sources,
            // An editor may be about to put a file in place: its next step is another event.
            Err(error) => return self.say(&format!("{}: cannot be read: {error}", folder.display())),
        };
        let names: BTreeSet<_> = sources.keys().chain(self.sources.keys()).cloned().collect();
        let changed: Vec<_> = names.into_iter().filter(|name| sources.get(name) != self.sources.get(name)).collect();
        let before = reached_from(&self.sources, KERNEL);
        let after = reached_from(&sources, KERNEL);
        let (used, unused): (Vec<_>, Vec<_>) =
            changed.into_iter().partition(|name| before.contains_key(name) || after.contains_key(name));
        self.sources = sources;
        if !used.is_empty() {
            self.edit += 1;
            self.compile(self.edit, saved, Some(used.join(", ")));
        } else if !unused.is_empty() && self.good.is_some() {
            self.say(&format!("{}: {KERNEL} does not include it", unused.join(", ")));
        }
    }

    fn compile(&mut self, edit: u32, saved: Instant, what: Option<String>) {
        let Some(ready) = &self.ready else { return };
        let [trace, form] = ready.variant;
        let start = Instant::now();
        let defines = [("TRACE_BACKEND", trace.to_string()), ("ARRAY_FORM", form.to_string())];
        match compile(&self.sources, KERNEL, &defines) {
            Ok(spirv) => {
                self.errors.clear();
                self.notice = None;
                let spirv: Arc<[u8]> = spirv.iter().flat_map(|word| word.to_le_bytes()).collect();
                if let Some(what) = what {
                    let mut report = Report::new(edit, what, saved);
                    report.compile_ms = Some(1e3 * start.elapsed().as_secs_f64());
                    self.reports.push(report);
                    if self.reports.len() > LISTED_EDITS {
                        self.reports.remove(0);
                    }
                }
                self.worker.tell(ToWorker::Kernel { edit }, spirv.to_vec());
                self.current = Some(CompiledKernel { edit, spirv });
            }
            Err(error) => {
                self.errors = diagnose(&error, &self.sources);
                let errors: Vec<_> = self.errors.iter().map(ToString::to_string).collect();
                self.say(&format!("error: {}", errors.join("\nerror: ")));
            }
        }
        self.show_status();
    }

    /// Kills what is left of the worker and starts another, with the last good kernel.
    fn replace_worker(&mut self, why: &str) -> Result<()> {
        let edit = |kernel: &Option<CompiledKernel>| kernel.as_ref().map_or(0, |kernel| kernel.edit);
        let (current, good) = (edit(&self.current), edit(&self.good));
        let mut message = format!("the worker {why} while it ran {KERNEL} of edit {current}");
        if current == good {
            self.ends += 1;
            if self.ends >= MOST_ENDS {
                return Err(Error::DeviceLost(format!("{message}, {MOST_ENDS} times in a row")));
            }
            message += "; it is started again";
        } else {
            message += &format!("; it is started again with that of edit {good}");
            self.current = self.good.clone();
        }
        self.say(&message);
        self.notice = Some(message);
        self.worker_number += 1;
        self.worker = start_worker(&self.options, self.worker_number, &self.events)?;
        self.stage = Stage::Load;
        self.heard = Instant::now();
        self.show_status();
        Ok(())
    }

    fn say(&self, text: &str) {
        eprintln!("{text}");
    }

    fn show_status(&self) {
        let status = json!({
            "type": "status",
            "ready": self.ready,
            "stage": self.stage,
            "view": self.view,
            "errors": self.errors,
            "notice": self.notice,
            "reports": self.reports,
            "command": self.options.command,
            "shaders": self.options.shaders,
        });
        self.hub.set_status(status.to_string());
    }
}

fn start_worker(options: &Options, number: u32, events: &Sender<Event>) -> Result<WorkerProcess> {
    let events = events.clone();
    WorkerProcess::start(&options.worker_arguments, move |heard| {
        let _ = events.send(Event::Worker(number, heard));
    })
}

/// The worker has said why on standard error; its exit code stays.
fn start_error(code: Option<i32>) -> Error {
    let message = "the worker could not start".to_owned();
    match code {
        Some(2) => Error::Usage(message),
        Some(3) => Error::input(Path::new("watch"), message),
        Some(4) => Error::Device(message),
        _ => Error::DeviceLost(message),
    }
}
