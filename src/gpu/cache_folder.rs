//! Where what was compiled and measured is kept between runs.

use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::atomic_file::write_atomically;

/// `$XDG_CACHE_HOME/sunfleck`, or `~/.cache/sunfleck`; `None` where there is no home. It need not exist.
pub(super) fn cache_folder() -> Option<PathBuf> {
    let variable = |name| env::var_os(name).filter(|value| !value.is_empty());
    let home = || variable("HOME").map(|home| Path::new(&home).join(".cache"));
    variable("XDG_CACHE_HOME").map(PathBuf::from).or_else(home).map(|folder| folder.join("sunfleck"))
}

/// Writes the parts to a file of the cache, which another process then reads whole: the old one or the new one. The folder
/// is made if it is not there.
pub(super) fn write_parts(path: &Path, parts: &[&[u8]]) -> io::Result<()> {
    fs::create_dir_all(path.parent().unwrap_or(Path::new(".")))?;
    write_atomically(path, |file| parts.iter().try_for_each(|part| file.write_all(part))).map_err(io::Error::other)
}
