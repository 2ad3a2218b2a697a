//! A file to a [`Scene`], or an error with file and place.

mod file;
mod gltf;
mod image;
mod obj;
mod warnings;

use std::path::Path;

use super::{Scene, SceneError, SceneResult, builtin};

pub use self::image::load_environment;

/// A built-in scene by its name (see [`builtin::names`]), else the scene in the file of that path.
pub fn resolve(name_or_path: &str) -> SceneResult<Scene> {
    match builtin::builtin(name_or_path) {
        Some(scene) => Ok(scene),
        None => load_scene(Path::new(name_or_path)),
    }
}

/// Reads a scene file: `.gltf`, `.glb` or `.obj`, whatever the case of the extension.
///
/// # Errors
/// The file is missing or broken, it needs something that is not supported, or a file that it names is missing or broken.
pub fn load_scene(path: &Path) -> SceneResult<Scene> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !path.exists() {
        let names = builtin::names().join(", ");
        return Err(SceneError::file(path, "no such file")
            .hint(format!("give the path of a .gltf, .glb or .obj file, or a built-in scene: {names}")));
    }
    let scene = match extension.as_str() {
        "gltf" | "glb" => gltf::load(path),
        "obj" => obj::load(path),
        "" => Err(SceneError::file(path, "the file's kind cannot be told without an extension")
            .hint("name it .gltf, .glb or .obj")),
        _ => Err(SceneError::file(path, format!("scene files of the kind \"{extension}\" are not supported"))
            .hint("convert it to one of .gltf, .glb, .obj")),
    }?;
    debug_assert!(scene.validate().is_ok(), "{:?}", scene.validate());
    Ok(scene)
}
