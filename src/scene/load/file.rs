//! Reading files that a scene file names, relative to it.

use std::fs;
use std::path::{Path, PathBuf};

use percent_encoding::percent_decode_str;

use crate::scene::{SceneError, SceneResult};

/// Reads a whole regular file. A device or a pipe is refused: it might have no end.
pub(super) fn read(path: &Path) -> SceneResult<Vec<u8>> {
    let metadata = fs::metadata(path).map_err(|error| unreadable(path, &error))?;
    if !metadata.is_file() {
        return Err(SceneError::file(path, "this is not a regular file"));
    }
    fs::read(path).map_err(|error| unreadable(path, &error))
}

fn unreadable(path: &Path, error: &std::io::Error) -> SceneError {
    match error.kind() {
        std::io::ErrorKind::NotFound => SceneError::file(path, "no such file"),
        _ => SceneError::file(path, format!("cannot be read: {error}")),
    }
}

/// The file that a URI in `scene_path` names: a relative path, percent-encoded as RFC 3986 asks or, as some exporters
/// write it, not. The error's message says what is wrong with the URI.
pub(super) fn resolve_uri(scene_path: &Path, uri: &str) -> Result<PathBuf, String> {
    if uri.is_empty() {
        return Err(String::from("the URI is empty"));
    }
    if let Some((scheme, _)) = uri.split_once("://") {
        return Err(format!("URIs of the scheme {scheme}: are not read"));
    }
    let folder = scene_path.parent().unwrap_or(Path::new(""));
    let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| String::from("the URI is not UTF-8"))?;
    if Path::new(decoded.as_ref()).is_absolute() || decoded.starts_with('/') || decoded.contains('\0') {
        return Err(String::from("the URI must be a path relative to the scene file"));
    }
    let literal = folder.join(uri);
    if literal.exists() {
        return Ok(literal);
    }
    Ok(folder.join(decoded.as_ref()))
}
