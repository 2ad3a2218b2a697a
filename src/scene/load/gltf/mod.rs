//! glTF 2.0: `.gltf` with files or data URIs, and `.glb`.
//!
//! The document is read as JSON values that know their place (`json.rs`), and only what a ray can meet is read at all:
//! the nodes of one scene, the meshes, materials and textures they use, and of the buffers what those need.
//!
//! - The default scene, else the first, else all root nodes. A node with several parents is shown below each;
//!   cycles are refused.
//! - Triangles, strips and fans; points and lines have no surface and are skipped with a warning.
//! - Extensions: KHR_lights_punctual (a light's `range` is ignored: light falls off by the square of the distance, to
//!   infinity), KHR_materials_anisotropy, _emissive_strength, _ior, _specular, _unlit, _transmission, _volume,
//!   KHR_mesh_quantization, KHR_texture_transform, EXT_texture_webp; KHR_materials_variants shows its default.
//! - Extras: `sunfleck` on a material (`material.rs`), a camera (`camera.rs`) and a scene (`extras.rs`).
//! - Everything else that changes the picture is named in [`Scene::warnings`]; if the file requires it, it is an error.

mod accessor;
mod attributes;
mod buffer;
mod camera;
mod extras;
mod glb;
mod json;
mod light;
mod material;
mod mesh;
mod node;
mod texture;

use std::collections::HashMap;
use std::path::Path;

use self::buffer::Buffers;
use self::json::{Document, Json};
use self::texture::PendingImage;
use super::warnings::Warnings;
use super::{Decoded, file};
use crate::scene::{Scene, SceneResult};

/// What a file may require. KHR_materials_variants only adds alternatives to a valid default.
const SUPPORTED: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
];

/// What may be ignored without a word: it does not change the picture, or it is a compressed copy of what is read plainly
/// (a file that has nothing else must require it).
const INVISIBLE: &[&str] = &[
    "EXT_mesh_features",
    "EXT_meshopt_compression",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "KHR_draco_mesh_compression",
    "KHR_meshopt_compression",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// The state of one load.
struct Loader<'a> {
    document: &'a Document,
    buffers: Buffers,
    warnings: Warnings,
    scene: Scene,
    /// glTF mesh to `Scene::meshes`, for meshes that have triangles.
    meshes: HashMap<usize, Option<usize>>,
    /// glTF material, and which sets of texture coordinates its textures can use, to `Scene::materials`.
    materials: HashMap<(Option<usize>, [bool; 2]), usize>,
    /// glTF texture to `Scene::textures`.
    textures: HashMap<usize, usize>,
    /// glTF image to its place among the pending ones.
    images: HashMap<usize, usize>,
    pending_images: Vec<PendingImage>,
    /// Images of earlier loads.
    decoded: &'a Decoded,
}

/// Reads a glTF file.
pub(super) fn load(path: &Path, decoded: &Decoded) -> SceneResult<Scene> {
    let bytes = file::read(path)?;
    let (json, binary) = if bytes.starts_with(glb::MAGIC) { glb::split(path, &bytes)? } else { (&bytes[..], None) };
    let document = Document::parse(path, json)?;
    let binary = binary.map(<[u8]>::to_vec);
    drop(bytes);
    check_version(&document.root())?;
    check_required_extensions(&document.root())?;
    let mut loader = Loader {
        document: &document,
        buffers: Buffers::new(binary),
        warnings: Warnings::default(),
        scene: Scene { name: path.display().to_string(), ..Scene::default() },
        meshes: HashMap::new(),
        materials: HashMap::new(),
        textures: HashMap::new(),
        images: HashMap::new(),
        pending_images: Vec::new(),
        decoded,
    };
    loader.load_nodes()?;
    loader.finish()
}

impl Loader<'_> {
    /// Decodes the images that are needed and closes the list of warnings.
    fn finish(mut self) -> SceneResult<Scene> {
        self.scene.images = texture::decode(std::mem::take(&mut self.pending_images), self.decoded)?;
        self.warn_of_the_whole()?;
        self.scene.warnings = self.warnings.into_lines();
        Ok(self.scene)
    }

    fn warn_of_the_whole(&mut self) -> SceneResult<()> {
        let root = self.document.root();
        if !root.list("animations")?.is_empty() {
            self.warnings.add("animations are not supported yet: the scene is shown at rest", "/animations");
        }
        for name in root.list("extensionsUsed")? {
            let extension = name.string()?;
            let known = SUPPORTED.contains(&extension) || INVISIBLE.contains(&extension);
            if !known && !self.warnings.has(&format!("{extension} ")) {
                self.warnings
                    .add(format!("{extension} is not supported yet: what it describes is ignored"), &name.pointer);
            }
        }
        if self.scene.instances.is_empty() {
            self.warnings.add("the scene has no triangles", "");
        }
        Ok(())
    }

    /// Names the extensions of an object that are not among the supported and invisible ones.
    fn warn_of_extensions(&mut self, place: &Json<'_>) -> SceneResult<()> {
        for name in place.extension_names()? {
            if !SUPPORTED.contains(&name.as_str()) && !INVISIBLE.contains(&name.as_str()) {
                self.warnings.add(format!("{name} is not supported yet: what it describes is ignored"), &place.pointer);
            }
        }
        Ok(())
    }
}

fn check_version(root: &Json<'_>) -> SceneResult<()> {
    const HINT: &str = "convert it to glTF 2.0, for instance by an import into Blender and an export";
    let asset = root.require("asset").map_err(|error| error.hint("is this a glTF 2.0 file?"))?;
    let version = asset.require("version").map_err(|error| error.hint(HINT))?;
    let text = version.string()?;
    let numbers = |text: &str| {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?))
    };
    match numbers(text) {
        Some((2, _)) => {}
        Some(_) => return Err(version.fail(format!("glTF {text} is not supported")).hint(HINT)),
        None => return Err(version.fail(format!("\"{text}\" is no version of glTF")).hint(HINT)),
    }
    if let Some(least) = asset.get("minVersion")? {
        let text = least.string()?;
        if numbers(text).is_none_or(|least| least > (2, 0)) {
            return Err(least.fail(format!("the file needs glTF {text}; 2.0 is supported")).hint(HINT));
        }
    }
    Ok(())
}

fn check_required_extensions(root: &Json<'_>) -> SceneResult<()> {
    let Some(required) = root.get("extensionsRequired")? else { return Ok(()) };
    let names = required.elements()?.iter().map(Json::string).collect::<SceneResult<Vec<_>>>()?;
    let missing: Vec<&str> = names.into_iter().filter(|name| !SUPPORTED.contains(name)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let message = format!("the file requires what is not supported: {}", missing.join(", "));
    Err(required.fail(message).hint("export it without, or with a fallback that does not require it"))
}
