//! A file to a [`Scene`], or an error with file and place.

mod decoded;
mod file;
mod gltf;
mod image;
mod obj;
mod warnings;

use std::path::Path;

use super::{Scene, SceneError, SceneResult, builtin};

pub use self::decoded::Decoded;
pub use self::image::load_environment;

/// A built-in scene by its name (see [`builtin::names`]), else the scene in the file of that path.
///
/// # Errors
/// Those of [`load_scene`].
pub fn resolve(name_or_path: &str) -> SceneResult<Scene> {
    resolve_again(name_or_path, &Decoded::default())
}

/// The same with the images of earlier calls: what has not changed is not decoded again.
///
/// # Errors
/// Those of [`load_scene`].
pub fn resolve_again(name_or_path: &str, decoded: &Decoded) -> SceneResult<Scene> {
    match builtin::builtin(name_or_path) {
        Some(scene) => Ok(scene),
        None => load(Path::new(name_or_path), decoded),
    }
}

/// Reads a scene file: `.gltf`, `.glb` or `.obj`, whatever the case of the extension.
///
/// # Errors
/// The file is missing or broken, it needs something that is not supported, or a file that it names is missing or broken.
pub fn load_scene(path: &Path) -> SceneResult<Scene> {
    load(path, &Decoded::default())
}

fn load(path: &Path, decoded: &Decoded) -> SceneResult<Scene> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !path.exists() {
        let names = builtin::names().join(", ");
        return Err(SceneError::file(path, "no such file")
            .hint(format!("give the path of a .gltf, .glb or .obj file, or a built-in scene: {names}")));
    }
    let scene = match extension.as_str() {
        "gltf" | "glb" => gltf::load(path, decoded),
        "obj" => obj::load(path, decoded),
        "" => Err(SceneError::file(path, "the file's kind cannot be told without an extension")
            .hint("name it .gltf, .glb or .obj")),
        _ => Err(SceneError::file(path, format!("scene files of the kind \"{extension}\" are not supported"))
            .hint("convert it to one of .gltf, .glb, .obj")),
    }?;
    debug_assert!(scene.validate().is_ok(), "{:?}", scene.validate());
    Ok(scene)
}
