//! Every scene and environment file of the shared collection of real input: nothing panics or hangs, valid files load,
//! and every error has a file and a message. The collection is no part of the repository; without it the test says so.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use sunfleck::scene::load::{load_environment, load_scene};

/// No file of the collection may take longer than this, in an unoptimised build on a busy machine.
const LONGEST: Duration = Duration::from_secs(20);

fn collection() -> Option<PathBuf> {
    let folder = std::env::var_os("SUNFLECK_ASSETS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets"), PathBuf::from);
    if !folder.is_dir() {
        eprintln!("{} is absent: real input is not tested (set SUNFLECK_ASSETS)", folder.display());
        return None;
    }
    Some(folder)
}

fn files(folder: &Path, extensions: &[&str], found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).expect("the folder is readable").flatten().map(|e| e.path()).collect();
    entries.sort();
    for path in entries {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if path.is_dir() {
            files(&path, extensions, found);
        } else if extensions.contains(&extension.as_str()) {
            found.push(path);
        }
    }
}

#[test]
fn scene_files() {
    let Some(folder) = collection() else { return };
    let mut paths = Vec::new();
    files(&folder, &["gltf", "glb", "obj"], &mut paths);
    for path in paths {
        let start = Instant::now();
        let result = load_scene(&path);
        let took = start.elapsed();
        let shown = path.strip_prefix(&folder).unwrap_or(&path).display();
        match result {
            Ok(scene) => {
                let t: usize = scene.meshes.iter().flat_map(|m| &m.primitives).map(|p| p.triangles.len()).sum();
                println!(
                    "ok {shown} {took:?} tris {t} inst {} cams {} lights {} mats {} imgs {}",
                    scene.instances.len(),
                    scene.cameras.len(),
                    scene.lights.len(),
                    scene.materials.len(),
                    scene.images.len()
                );
                for w in &scene.warnings {
                    println!("      W {w}");
                }
                scene.validate().expect("valid");
            }
            Err(error) => println!("ERR {shown}: {error}"),
        }
        assert!(took < LONGEST, "{shown} took {took:?}");
    }
}

#[test]
fn environment_files() {
    let Some(folder) = collection() else { return };
    let mut paths = Vec::new();
    files(&folder, &["hdr", "exr"], &mut paths);
    for path in paths {
        let start = Instant::now();
        let shown = path.strip_prefix(&folder).unwrap_or(&path).display();
        match load_environment(&path, 1.0, 0.0) {
            Ok(sunfleck::scene::Environment::Image { width, height, .. }) => {
                println!("ok {shown} {width}x{height} {:?}", start.elapsed())
            }
            Ok(_) => unreachable!(),
            Err(error) => println!("ERR {shown}: {error}"),
        }
        assert!(start.elapsed() < LONGEST, "{shown}");
    }
}
