//! The files on disk that the picture depends on, and when they change.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use notify::{EventKind, RecommendedWatcher, RecursiveMode, Watcher};

use crate::{Error, Result};

/// An editor writes in several steps; this long after the last one a file is taken to be whole.
const QUIET: Duration = Duration::from_millis(15);
/// Something that is written to all the time is looked at nevertheless.
const LONGEST_WAIT: Duration = Duration::from_millis(150);

/// Watches folders. Files that are renamed over others, as most editors do, change their folder, not themselves.
pub(super) struct Tracker {
    watcher: RecommendedWatcher,
    folders: BTreeSet<PathBuf>,
}

impl Tracker {
    /// `changed` is called with the paths that a burst of changes touched, from a thread of its own.
    pub(super) fn new(changed: impl Fn(BTreeSet<PathBuf>) + Send + 'static) -> Result<Self> {
        let (send, events) = channel();
        let watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
            let Ok(event) = event else { return };
            if !matches!(event.kind, EventKind::Access(_)) {
                let _ = send.send(event.paths);
            }
        });
        let watcher = watcher.map_err(|e| Error::Usage(format!("files cannot be watched: {e}")))?;
        std::thread::spawn(move || {
            while let Some(paths) = burst(&events) {
                changed(paths)
            }
        });
        Ok(Self { watcher, folders: BTreeSet::new() })
    }

    /// Watches a folder, with those in it if `deep`.
    pub(super) fn add(&mut self, folder: &Path, deep: bool) -> Result<()> {
        let folder = absolute(folder);
        if self.folders.contains(&folder) {
            return Ok(());
        }
        let mode = if deep { RecursiveMode::Recursive } else { RecursiveMode::NonRecursive };
        self.watcher.watch(&folder, mode).map_err(|e| Error::input(&folder, format!("cannot be watched: {e}")))?;
        self.folders.insert(folder);
        Ok(())
    }
}

/// The path as events name it: symbolic links in the folder are followed.
pub(super) fn absolute(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    match (std::fs::canonicalize(path), path.parent(), path.file_name()) {
        (Ok(path), _, _) => path,
        (Err(_), Some(parent), Some(name)) if parent != path => absolute(parent).join(name),
        _ => path.to_owned(),
    }
}

fn burst(events: &Receiver<Vec<PathBuf>>) -> Option<BTreeSet<PathBuf>> {
    let mut paths: BTreeSet<PathBuf> = events.recv().ok()?.into_iter().collect();
    let start = Instant::now();
    while start.elapsed() < LONGEST_WAIT {
        match events.recv_timeout(QUIET) {
            Ok(more) => paths.extend(more),
            Err(RecvTimeoutError::Timeout) => break,
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
    Some(paths)
}
