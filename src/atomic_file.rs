//! Writing a file whole or not at all, and finding out beforehand whether that will be possible.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Checks before the work that [`write_atomically`] will be able to write `path` after it: the folder exists and a
/// file can be created in it, and what stands at `path` may be replaced. Nothing is left behind.
///
/// # Errors
/// [`Error::Io`] or [`Error::Input`] that says what is in the way.
pub fn check_writable(path: &Path) -> Result<()> {
    let path = &resolve_link(path)?;
    temporary_beside(path).map(drop)
}

/// Writes `path` by writing a file beside it and renaming that over it, so that at no time a half-written file has
/// the name. If `write` fails, `path` is as it was. A symbolic link is followed, not replaced.
///
/// # Errors
/// [`Error::Io`] if the file system refuses; what `write` returns, if that fails.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut fs::File) -> io::Result<()>) -> Result<()> {
    let path = &resolve_link(path)?;
    let mut temporary = temporary_beside(path)?;
    write(temporary.as_file_mut()).map_err(|e| Error::io(path, "write", e))?;
    temporary.persist(path).map_err(|e| Error::io(path, "put the finished file in place", e.error))?;
    Ok(())
}

/// The file that a path stands for. Refuses what a rename must not replace: folders, devices, pipes.
fn resolve_link(path: &Path) -> Result<PathBuf> {
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(Error::input(path, "cannot be written: it is a folder; name a file in it")),
        Ok(found) if !found.is_file() => Err(Error::input(path, "cannot be written: it is not a regular file")),
        Ok(_) => fs::canonicalize(path).map_err(|e| Error::io(path, "write", e)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(path.to_owned()),
        Err(e) => Err(Error::io(path, "write", e)),
    }
}

fn temporary_beside(path: &Path) -> Result<tempfile::NamedTempFile> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(Error::input(
            path,
            format!("cannot be written: there is no folder '{}'; create it", folder.display()),
        ));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".sunfleck-").suffix(".part");
    // Temporary files are private by default; an image gets the permissions that any new file would (0666 & !umask).
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    // The library's error names the temporary file, which means nothing to the user: only its kind is kept.
    builder.tempfile_in(folder).map_err(|e| Error::io(path, "write in its folder", e.kind().into()))
}
