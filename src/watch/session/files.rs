//! Files that have changed: shaders are compiled, the scene is loaded again.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::{CompiledKernel, Event, KERNEL, LISTED_EDITS, Session};
use crate::Result;
use crate::gpu::shader_compiler::{compile, read_sources};
use crate::watch::diagnostic::{Diagnostic, diagnose};
use crate::watch::includes::reached_from;
use crate::watch::messages::ToWorker;
use crate::watch::report::Report;
use crate::watch::scene_files::files_of;
use crate::watch::tracked::absolute;

/// What came of a compilation.
pub(super) struct Compiled {
    number: u32,
    edit: u32,
    saved: Instant,
    /// The files that changed; `None` if none did, and the kernel is compiled for another device.
    what: Option<String>,
    compile_ms: f64,
    result: std::result::Result<Vec<u32>, Vec<Diagnostic>>,
}

impl Session {
    pub(super) fn files_changed(&mut self, paths: &BTreeSet<PathBuf>) -> Result<()> {
        let saved = Instant::now();
        let folder = self.options.shaders.as_deref().map(absolute);
        if folder.is_some_and(|folder| paths.iter().any(|path| path.starts_with(&folder))) {
            self.read_shaders(saved);
        }
        let of_scene: Vec<_> = paths.iter().filter(|path| self.scene_files.contains(path)).collect();
        if let Some(first) = of_scene.first() {
            let name = first.file_name().unwrap_or_default().to_string_lossy().into_owned();
            self.edit += 1;
            self.list(Report::new(self.edit, name, saved));
            self.notice = None;
            self.worker.tell(ToWorker::Scene { edit: self.edit }, Vec::new());
            self.track_scene()?;
            self.show_status();
        }
        Ok(())
    }

    /// Takes the files of the scene anew: it may name others now.
    pub(super) fn track_scene(&mut self) -> Result<()> {
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
    pub(super) fn read_shaders(&mut self, saved: Instant) {
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
        self.sources = Arc::new(sources);
        if !used.is_empty() {
            self.edit += 1;
            self.compile(self.edit, saved, Some(used.join(", ")));
        } else if !unused.is_empty() && self.good.is_some() {
            self.say(&format!("{}: {KERNEL} does not include it", unused.join(", ")));
        }
    }

    /// Compiles in a thread of its own: the page goes on meanwhile, and so does a picture that moves.
    pub(super) fn compile(&mut self, edit: u32, saved: Instant, what: Option<String>) {
        let Some(ready) = &self.ready else { return };
        let [trace, form] = ready.variant;
        self.worker.tell(ToWorker::Hold, Vec::new());
        self.compilation += 1;
        let (number, sources, events) = (self.compilation, Arc::clone(&self.sources), self.events.clone());
        std::thread::spawn(move || {
            let start = Instant::now();
            let defines = [("TRACE_BACKEND", trace.to_string()), ("ARRAY_FORM", form.to_string())];
            let result = compile(&sources, KERNEL, &defines).map_err(|error| diagnose(&error, &sources));
            let compile_ms = 1e3 * start.elapsed().as_secs_f64();
            let _ = events.send(Event::Compiled(Compiled { number, edit, saved, what, compile_ms, result }));
        });
    }

    pub(super) fn compiled(&mut self, compiled: Compiled) {
        let Compiled { number, edit, saved, what, compile_ms, result } = compiled;
        // There is a newer one.
        if number != self.compilation {
            return;
        }
        match result {
            Ok(spirv) => {
                self.errors.clear();
                self.notice = None;
                let spirv: Arc<[u8]> = spirv.iter().flat_map(|word| word.to_le_bytes()).collect();
                if let Some(what) = what {
                    let mut report = Report::new(edit, what, saved);
                    report.compile_ms = Some(compile_ms);
                    self.list(report);
                }
                self.worker.tell(ToWorker::Kernel { edit }, spirv.to_vec());
                self.current = Some(CompiledKernel { edit, spirv });
            }
            Err(errors) => {
                self.worker.tell(ToWorker::Resume, Vec::new());
                let lines: Vec<_> = errors.iter().map(ToString::to_string).collect();
                self.say(&format!("error: {}", lines.join("\nerror: ")));
                self.errors = errors;
            }
        }
        self.show_status();
    }

    fn list(&mut self, report: Report) {
        self.reports.push(report);
        if self.reports.len() > LISTED_EDITS {
            self.reports.remove(0);
        }
    }
}
