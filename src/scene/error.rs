//! Errors of scene files: which file, where in it, what is wrong and what to do. They end the program with exit code 3.

use std::path::{Path, PathBuf};

/// What went wrong in a scene file or another input.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {message}{}", path.display(), place_suffix(place), hint_suffix(hint))]
pub struct SceneError {
    /// The file.
    pub path: PathBuf,
    /// The place in it: a JSON pointer, a line, a node or an accessor. Empty if it is the file as a whole.
    pub place: String,
    /// What is wrong.
    pub message: String,
    /// What to do about it; may be empty.
    pub hint: String,
}

/// Result of reading a scene.
pub type SceneResult<T> = Result<T, SceneError>;

fn place_suffix(place: &str) -> String {
    if place.is_empty() { String::new() } else { format!(" at {place}") }
}

fn hint_suffix(hint: &str) -> String {
    if hint.is_empty() { String::new() } else { format!("; {hint}") }
}

impl SceneError {
    /// An error about the file as a whole.
    pub fn file(path: &Path, message: impl Into<String>) -> Self {
        Self { path: path.to_owned(), place: String::new(), message: message.into(), hint: String::new() }
    }

    /// An error at a place in the file.
    pub fn at(path: &Path, place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.to_owned(), place: place.into(), message: message.into(), hint: String::new() }
    }

    /// Adds what to do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = hint.into();
        self
    }
}
