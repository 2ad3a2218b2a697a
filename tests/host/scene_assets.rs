//! Every scene and environment file of a shared collection of real input: nothing panics or hangs, what loads is valid,
//! valid glTF loads, and every error names a file. The collection is no part of the repository; without it (set
//! SUNFLECK_ASSETS to its folder) these tests say so and pass.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::common::assets::{collection, files};
use sunfleck::scene::SceneError;
use sunfleck::scene::load::{load_environment, load_scene};

/// No file of the collection may take longer than this, in a barely optimised build on a busy machine.
const LONGEST: Duration = Duration::from_secs(20);

/// Loads every file; returns those that do not load.
fn load_all<T>(
    paths: Vec<PathBuf>,
    load: impl Fn(&Path) -> Result<T, SceneError>,
    check: impl Fn(T),
) -> Vec<(PathBuf, SceneError)> {
    let count = paths.len();
    let mut errors = Vec::new();
    for path in paths {
        let start = Instant::now();
        match load(&path) {
            Ok(loaded) => check(loaded),
            Err(error) => {
                assert!(!error.message.is_empty() && !error.path.as_os_str().is_empty());
                println!("{error}");
                errors.push((path.clone(), error));
            }
        }
        assert!(start.elapsed() < LONGEST, "{} took {:?}", path.display(), start.elapsed());
    }
    println!("{count} files, {} with an error", errors.len());
    errors
}

/// Whether an error is one that a valid file can meet: it wants more than we have, or the collection lacks a part of it.
fn is_excused(error: &SceneError) -> bool {
    let reasons = ["requires what is not supported", "the file needs glTF", "has no \"uri\"", "KTX images"];
    reasons.iter().any(|reason| error.message.contains(reason))
}

/// The Khronos validator's verdict on a file, where its report lies beside it: whether it found no error.
fn validator_accepts(path: &Path) -> bool {
    let report = path.with_file_name(format!("{}.report.json", path.file_name().unwrap_or_default().display()));
    let Ok(text) = fs::read_to_string(report) else { return false };
    let report: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    report["issues"]["numErrors"] == 0
}

#[test]
fn scene_files() {
    let Some(folder) = collection() else { return };
    let paths = files(&folder, &["gltf", "glb", "obj"]);
    let errors = load_all(paths, load_scene, |scene| scene.validate().expect("what loads is valid"));
    // Collections whose files are all meant to be valid glTF 2.0.
    let valid = ["gltf-khronos-samples-2018/2.0", "gltf-qmuntal", "gltf-blender-io-tests", "gltf-bevy"]
        .map(|name| folder.join(name));
    for (path, error) in errors {
        let is_valid = valid.iter().any(|folder| path.starts_with(folder)) || validator_accepts(&path);
        assert!(!is_valid || is_excused(&error), "a valid file does not load: {error}");
    }
}

#[test]
fn environment_files() {
    let Some(folder) = collection() else { return };
    let load = |path: &Path| load_environment(path, 1.0, 0.0);
    load_all(files(&folder, &["hdr", "exr"]), load, drop);
}
