//! Small glTF documents for the tests of the scene room.
#![allow(dead_code, reason = "every test file uses a part of it")]

use std::fs;
use std::path::PathBuf;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};
use sunfleck::scene::load::load_scene;
use sunfleck::scene::{Scene, SceneError, SceneResult};
use tempfile::TempDir;

/// A data URI of bytes.
pub(crate) fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(bytes))
}

/// Little-endian bytes of floats.
pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Bytes of the triangle (0,0,0), (1,0,0), (0,1,0), then its 16-bit indices: 36 + 6 bytes.
pub(crate) fn triangle_bytes() -> Vec<u8> {
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend([0, 0, 1, 0, 2, 0]);
    bytes
}

/// A document of one triangle: accessor 0 is its positions, accessor 1 its indices, all in one buffer.
pub(crate) fn triangle() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "the node"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "the material"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6}
        ],
        "buffers": [{"byteLength": 42, "uri": data_uri(&triangle_bytes())}]
    })
}

/// Replaces, or adds, the value at a JSON pointer; a last `-` appends to an array.
pub(crate) fn set(document: &mut Value, pointer: &str, value: Value) {
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer begins with /");
    match document.pointer_mut(parent).expect("the parent exists") {
        Value::Object(members) => {
            members.insert(key.to_owned(), value);
        }
        Value::Array(elements) if key == "-" => elements.push(value),
        Value::Array(elements) => elements[key.parse::<usize>().expect("an index")] = value,
        other => panic!("{parent} is {other}"),
    }
}

/// The triangle with a few values replaced.
pub(crate) fn triangle_with(changes: &[(&str, Value)]) -> Value {
    let mut document = triangle();
    for (pointer, value) in changes {
        set(&mut document, pointer, value.clone());
    }
    document
}

/// The triangle with other bytes in its buffer.
pub(crate) fn triangle_of(bytes: &[u8]) -> Value {
    triangle_with(&[("/buffers/0", json!({"byteLength": bytes.len(), "uri": data_uri(bytes)}))])
}

/// A folder with files in it, removed when dropped.
pub(crate) struct Folder(TempDir);

impl Folder {
    /// An empty folder.
    pub(crate) fn new() -> Self {
        Self(TempDir::new().expect("a temporary folder"))
    }

    /// Writes a file and returns its path.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(&path, bytes).expect("the file can be written");
        path
    }
}

/// Loads a document as a .gltf file; what loads must also be valid.
pub(crate) fn load(document: &Value) -> SceneResult<Scene> {
    let folder = Folder::new();
    let scene = load_scene(&folder.write("test.gltf", document.to_string()))?;
    scene.validate().expect("a scene that loads is valid");
    Ok(scene)
}

/// Loads a document that must load.
pub(crate) fn load_ok(document: &Value) -> Scene {
    load(document).unwrap_or_else(|error| panic!("{error}"))
}

/// The error of a document that must not load.
pub(crate) fn load_error(document: &Value) -> SceneError {
    load(document).err().unwrap_or_else(|| panic!("this should not load: {document}"))
}

/// A .glb of a JSON text and a binary chunk.
pub(crate) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let chunk = |kind: &[u8; 4], bytes: &[u8], padding: u8| {
        let padded = bytes.len().next_multiple_of(4);
        let mut chunk = (padded as u32).to_le_bytes().to_vec();
        chunk.extend(kind);
        chunk.extend(bytes);
        chunk.resize(8 + padded, padding);
        chunk
    };
    let body = [chunk(b"JSON", json.as_bytes(), b' '), chunk(b"BIN\0", binary, 0)].concat();
    let mut file = b"glTF".to_vec();
    file.extend(2_u32.to_le_bytes());
    file.extend((body.len() as u32 + 12).to_le_bytes());
    file.extend(body);
    file
}

/// A PNG of one colour.
pub(crate) fn png(width: u32, height: u32, color: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(width, height, image::Rgba(color))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("a PNG can be written");
    bytes.into_inner()
}
