//! The files on disk that the picture depends on, and when they change.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use notify::event::{AccessKind, AccessMode, EventKind, ModifyKind, RenameMode};
use notify::{RecommendedWatcher, RecursiveMode, Watcher};

use crate::{Error, Result};

/// An editor writes in several steps; this long after the last one a file is taken to be whole,
const QUIET: Duration = Duration::from_millis(15);
/// and this long if that was to close it or to give it its name (Linux tells). Other files may have been saved with it.
const QUIET_WHOLE: Duration = Duration::from_millis(3);
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
            let is_whole = is_whole(event.kind);
            if is_whole || !matches!(event.kind, EventKind::Access(_)) {
                let _ = send.send((event.paths, is_whole));
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

/// Whether the writing of a file ended with this.
fn is_whole(kind: EventKind) -> bool {
    let closed = EventKind::Access(AccessKind::Close(AccessMode::Write));
    let renamed = |mode| EventKind::Modify(ModifyKind::Name(mode));
    kind == closed || kind == renamed(RenameMode::To) || kind == renamed(RenameMode::Both)
}

fn burst(events: &Receiver<(Vec<PathBuf>, bool)>) -> Option<BTreeSet<PathBuf>> {
    let (first, mut is_whole) = events.recv().ok()?;
    let mut paths: BTreeSet<PathBuf> = first.into_iter().collect();
    let start = Instant::now();
    while start.elapsed() < LONGEST_WAIT {
        match events.recv_timeout(if is_whole { QUIET_WHOLE } else { QUIET }) {
            Ok((more, whole)) => {
                paths.extend(more);
                is_whole = whole;
            }
            Err(RecvTimeoutError::Timeout) => break,
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
    Some(paths)
}
