//! The loop: files change, kernels are compiled, the worker is told, and what it says goes to the terminal and the page.

mod compile;
mod files;
mod worker;

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::json;

use self::compile::Compiler;
use self::worker::start_worker;
use super::compiler::CompileAnswer;
use super::debug_calls::{DebugCalls, PrintPlace};
use super::diagnostic::Diagnostic;
use super::guard::Guard;
use super::hub::Hub;
use super::messages::{FromPage, FromWorker, Ready, Stage, ToWorker, View};
use super::options::choices;
use super::report::Report;
use super::server::{Server, serve};
use super::supervisor::{Heard, Helper};
use super::tracked::Tracker;
use crate::Result;
use crate::gpu::embedded;
use crate::gpu::shader_compiler::Sources;

/// The kernel that is watched.
const KERNEL: &str = "path_trace.comp";
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
    Worker(u32, Heard<FromWorker>),
    Files(BTreeSet<PathBuf>),
    Compiler(u32, Heard<CompileAnswer>),
    Page(u64, FromPage),
}

#[derive(Clone)]
struct CompiledKernel {
    edit: u32,
    spirv: Arc<[u8]>,
    calls: DebugCalls,
}

/// What the kernel printed for a pixel.
#[derive(Serialize)]
struct Prints {
    #[serde(skip)]
    edit: u32,
    pixel: [u32; 2],
    values: Vec<(PrintPlace, String)>,
}

struct Session {
    options: Options,
    events: Sender<Event>,
    hub: Arc<Hub>,
    tracker: Tracker,
    scene_files: Vec<PathBuf>,
    sources: Sources,
    compiler: Compiler,
    worker: Helper<ToWorker>,
    worker_number: u32,
    /// The worker that has announced its scene.
    ready_worker: u32,
    ready: Option<Ready>,
    stage: Stage,
    heard: Instant,
    /// The edit whose kernel the worker builds, and since when.
    building: Option<(u32, Instant)>,
    ends: u32,
    /// There is no worker until a file of the scene is saved.
    waits_for_scene: bool,
    /// The kernel that the worker was told to use, and the last of which an image has come.
    current: Option<CompiledKernel>,
    good: Option<CompiledKernel>,
    edit: u32,
    view: View,
    errors: Vec<Diagnostic>,
    notice: Option<String>,
    reports: Vec<Report>,
    prints: Option<Prints>,
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
            compiler: Compiler::new(),
            worker,
            worker_number: 1,
            ready_worker: 0,
            ready: None,
            stage: Stage::Load,
            heard: now,
            building: None,
            ends: 0,
            waits_for_scene: false,
            current: None,
            good: None,
            edit: 0,
            errors: Vec::new(),
            notice: None,
            prints: None,
            reports: vec![Report::new(0, "start".to_owned(), now)],
        };
        session.track_scene()?;
        if let Some(folder) = session.options.shaders.clone() {
            session.tracker.add(&folder, true)?;
            session.start_compiler()?;
        }
        Ok(session)
    }

    fn serve(&mut self, inbox: &Receiver<Event>) -> Result<()> {
        loop {
            let event = match self.overdue_at() {
                Some(at) => inbox.recv_timeout(at.saturating_duration_since(Instant::now())).ok(),
                None => inbox.recv().ok(),
            };
            match event {
                Some(Event::Worker(number, heard)) if number == self.worker_number => self.hear(heard)?,
                // The last words of a worker that was replaced.
                Some(Event::Worker(..)) => {}
                Some(Event::Files(paths)) => self.files_changed(&paths)?,
                Some(Event::Compiler(number, heard)) => self.hear_compiler(number, heard),
                Some(Event::Page(client, message)) => self.page_said(client, message)?,
                None => self.overdue()?,
            }
        }
    }

    fn page_said(&mut self, client: u64, message: FromPage) -> Result<()> {
        match message {
            FromPage::View(view) => {
                // Beyond, exposures are infinite or nothing.
                let exposure = if view.exposure.is_finite() { view.exposure.clamp(-100.0, 100.0) } else { 0.0 };
                let before = std::mem::replace(&mut self.view, View { exposure, ..*view });
                self.worker.tell(ToWorker::View(Box::new(self.view.clone())), Vec::new());
                match &self.current {
                    Some(kernel) if kernel.calls.has_pixel && before.debug != self.view.debug => {
                        return self.compile(kernel.edit, Instant::now(), None);
                    }
                    _ => {}
                }
            }
            FromPage::Inspect { x, y } => self.worker.tell(ToWorker::Inspect { client, x, y }, Vec::new()),
            FromPage::Save { format } if ["png", "exr"].contains(&format.as_str()) => {
                self.worker.tell(ToWorker::Save { client, format }, Vec::new());
            }
            FromPage::Save { .. } => {}
        }
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
            "building": self.building.map(|(edit, _)| edit),
            "view": self.view,
            "errors": self.errors,
            "notice": self.notice,
            "reports": self.reports,
            "prints": self.prints,
            "has_debug_pixel": self.current.as_ref().is_some_and(|kernel| kernel.calls.has_pixel),
            "choices": choices(),
            "command": self.options.command,
            "shaders": self.options.shaders,
        });
        self.hub.set_status(status.to_string());
    }
}
