//! Where what was compiled is kept between runs.

use std::env;
use std::path::{Path, PathBuf};

/// `$XDG_CACHE_HOME/sunfleck`, or `~/.cache/sunfleck`; `None` where there is no home. It need not exist.
pub(crate) fn cache_folder() -> Option<PathBuf> {
    let variable = |name| env::var_os(name).filter(|value| !value.is_empty());
    let home = || variable("HOME").map(|home| Path::new(&home).join(".cache"));
    variable("XDG_CACHE_HOME").map(PathBuf::from).or_else(home).map(|folder| folder.join("sunfleck"))
}
