//! Files that have changed: shaders are compiled, the scene is loaded again.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::{KERNEL, Session};
use crate::Result;
use crate::gpu::shader_compiler::read_sources;
use crate::watch::includes::reached_from;
use crate::watch::messages::ToWorker;
use crate::watch::report::Report;
use crate::watch::scene_files::files_of;
use crate::watch::tracked::absolute;

impl Session {
    pub(super) fn files_changed(&mut self, paths: &BTreeSet<PathBuf>) -> Result<()> {
        let saved = Instant::now();
        let folder = self.options.shaders.as_deref().map(absolute);
        if folder.is_some_and(|folder| paths.iter().any(|path| path.starts_with(&folder))) {
            self.read_shaders(saved)?;
        }
        let of_scene: Vec<_> = paths.iter().filter(|path| self.scene_files.contains(path)).collect();
        if let Some(first) = of_scene.first() {
            let name = first.file_name().unwrap_or_default().to_string_lossy().into_owned();
            self.edit += 1;
            self.list(Report::new(self.edit, name, saved));
            self.notice = None;
            if self.waits_for_scene {
                self.restart_worker()?;
            }
            self.worker.tell(ToWorker::Scene { edit: self.edit }, Vec::new());
            self.track_scene()?;
            self.show_status();
        }
        Ok(())
    }

    /// Takes the files of the scene anew: it may name others now. One that is gone (moved away, or never a file but a built-in
    /// scene) keeps those that it had: it may come back.
    pub(super) fn track_scene(&mut self) -> Result<()> {
        let scene = Path::new(&self.options.scene);
        if scene.is_file() {
            self.scene_files = files_of(scene).iter().map(|file| absolute(file)).collect();
        }
        let environment = self.options.environment.as_deref().map(absolute);
        self.scene_files.extend(environment.filter(|file| !self.scene_files.contains(file)));
        for file in &self.scene_files {
            if let Some(folder) = file.parent().filter(|folder| folder.is_dir()) {
                self.tracker.add(folder, false)?;
            }
        }
        Ok(())
    }

    /// Reads the shaders and compiles the kernel if one of its files has changed.
    pub(super) fn read_shaders(&mut self, saved: Instant) -> Result<()> {
        let Some(folder) = &self.options.shaders else { return Ok(()) };
        let sources = match read_sources(folder) {
            Ok(sources) => sources,
            // An editor may be about to put a file in place: its next step is another event.
            Err(error) => {
                self.say(&format!("{}: cannot be read: {error}", folder.display()));
                return Ok(());
            }
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
            self.compile(self.edit, saved, Some(used.join(", ")))?;
        } else if !unused.is_empty() && self.good.is_some() {
            self.say(&format!("{}: {KERNEL} does not include it", unused.join(", ")));
        }
        Ok(())
    }
}
