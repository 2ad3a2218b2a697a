//! The shared collection of real input: scene and environment files of many projects. It is no part of the repository;
//! SUNFLECK_ASSETS names its folder.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the collection; says so where it is absent.
pub fn collection() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets");
    let folder = std::env::var_os("SUNFLECK_ASSETS").map_or_else(beside, PathBuf::from);
    if !folder.is_dir() {
        eprintln!("{} is absent: real input is not tested (set SUNFLECK_ASSETS)", folder.display());
        return None;
    }
    Some(folder)
}

/// The files below a folder that have one of the extensions, sorted.
pub fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).expect("the folder is readable").flatten().map(|entry| entry.path()) {
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
            if path.is_dir() {
                folders.push(path);
            } else if extensions.contains(&extension.as_str()) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}
