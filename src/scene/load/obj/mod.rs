//! Wavefront OBJ with MTL.
//!
//! Parsed here and not by the `tobj` crate, because that gives no line numbers, panics on a `Kd` of fewer than three
//! numbers, fans concave polygons, and fills missing normals with those of other vertices.
//!
//! - Faces of any size, concave ones too, with negative indices; points, lines and free-form geometry are skipped.
//! - One mesh, one primitive a material. Faces without normals are flat, whatever smoothing groups say.
//! - Without a material: a Lambertian surface of albedo 0.8.
//! - UTF-8 and UTF-16; texture coordinates are turned so that v runs downwards, as in glTF.
//!
//! What an MTL material becomes stands in `convert.rs`.

mod convert;
mod material;
mod parse;
mod polygon;
mod textures;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DAffine3;
use rayon::prelude::*;

use self::material::MtlMaterial;
use self::parse::{Corner, Face, Geometry};
use self::textures::Textures;
use super::warnings::{NO_DIRECTION, Warnings};
use super::{Decoded, file};
use crate::scene::{Instance, Material, Mesh, Primitive, Scene, SceneError, SceneResult};

/// Reads an OBJ file and the material libraries it names.
pub(super) fn load(path: &Path, decoded: &Decoded) -> SceneResult<Scene> {
    let text = decode_text(&file::read(path)?);
    let mut warnings = Warnings::default();
    let geometry = parse::parse(path, &text, &mut warnings)?;
    let library = read_libraries(path, &geometry.libraries, &mut warnings)?;

    let mut scene = Scene { name: path.display().to_string(), ..Scene::default() };
    let mut textures = Textures::default();
    let mut materials: HashMap<Option<u32>, usize> = HashMap::new();
    let mut mesh = Mesh { name: scene.name.clone(), primitives: Vec::new() };
    for part in split(&geometry.faces) {
        let material = match materials.get(&part.material) {
            Some(&known) => known,
            None => {
                let name = part.material.map(|index| geometry.material_names[index as usize].as_str());
                scene.materials.push(convert_material(name, &library, path, &mut textures, &mut warnings));
                materials.insert(part.material, scene.materials.len() - 1);
                scene.materials.len() - 1
            }
        };
        let primitive = build(&part, &geometry, material, &mut warnings);
        if !primitive.triangles.is_empty() {
            mesh.primitives.push(primitive);
        }
    }
    if mesh.primitives.is_empty() {
        warnings.add("the scene has no triangles", "");
    } else {
        scene.instances.push(Instance { mesh: 0, object_to_world: DAffine3::IDENTITY, name: scene.name.clone() });
        scene.meshes.push(mesh);
    }
    let (textures, pending) = textures.into_parts();
    scene.textures = textures;
    let images: Vec<SceneResult<_>> = pending.par_iter().map(|source| textures::decode(source, decoded)).collect();
    scene.images = images.into_iter().collect::<SceneResult<_>>()?;
    textures::drop_heights(&mut scene, &pending, &mut warnings);
    generate_tangents(&mut scene, &mut warnings);
    scene.warnings = warnings.into_lines();
    Ok(scene)
}

/// Tangents for the materials that need them, once it is known which maps are of normals.
fn generate_tangents(scene: &mut Scene, warnings: &mut Warnings) {
    for primitive in scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        let material = &scene.materials[primitive.material];
        let Some((set, transform)) = material.tangent_coordinates() else { continue };
        primitive.generate_tangents(set, &transform);
        if primitive.tangents.is_none() && material.anisotropy > 0.0 {
            warnings.add(NO_DIRECTION, format!("\"{}\"", material.name));
        }
    }
}

/// UTF-16 by its byte order mark, else UTF-8; what is not valid becomes U+FFFD and is refused where it matters.
fn decode_text(bytes: &[u8]) -> String {
    let utf16 = |bytes: &[u8], word: fn([u8; 2]) -> u16| {
        let words: Vec<u16> = bytes.chunks_exact(2).map(|pair| word([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&words)
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest).into_owned(),
        _ => String::from_utf8_lossy(bytes).into_owned(),
    }
}

/// The materials of all libraries by name; a library that is not there is a warning, its materials are then missing.
fn read_libraries(
    obj: &Path,
    libraries: &[(usize, String)],
    warnings: &mut Warnings,
) -> SceneResult<HashMap<String, MtlMaterial>> {
    let mut materials = HashMap::new();
    for (line, names) in libraries {
        for library in library_files(obj, names) {
            if !library.exists() {
                let subject = format!("the material library {} does not exist", library.display());
                warnings.add(subject, format!("line {line}"));
                continue;
            }
            material::parse(&library, &decode_text(&file::read(&library)?), &mut materials, warnings)?;
        }
    }
    Ok(materials)
}

/// `mtllib` takes several names, but many exporters write one with spaces: what exists decides.
fn library_files(obj: &Path, names: &str) -> Vec<PathBuf> {
    let whole = beside(obj, names);
    if whole.exists() || !names.contains(char::is_whitespace) {
        return vec![whole];
    }
    let parts: Vec<PathBuf> = names.split_whitespace().map(|name| beside(obj, name)).collect();
    if parts.iter().any(|part| part.exists()) { parts } else { vec![whole] }
}

/// A file named in `from`, relative to it; Windows' separators are understood.
fn beside(from: &Path, name: &str) -> PathBuf {
    let folder = from.parent().unwrap_or(Path::new(""));
    let literal = folder.join(name);
    if literal.exists() { literal } else { folder.join(name.replace('\\', "/")) }
}

fn convert_material(
    name: Option<&str>,
    library: &HashMap<String, MtlMaterial>,
    obj: &Path,
    textures: &mut Textures,
    warnings: &mut Warnings,
) -> Material {
    const DEFAULT_ALBEDO: [f32; 3] = [0.8; 3];
    let Some(name) = name else { return Material::lambertian("default", DEFAULT_ALBEDO) };
    match library.get(name) {
        Some(material) => convert::convert(name, material, textures, warnings),
        None => {
            let subject = format!("material \"{name}\" is in no material library: a Lambertian of 0.8 stands for it");
            warnings.add(subject, obj.display().to_string());
            Material::lambertian(name, DEFAULT_ALBEDO)
        }
    }
}

/// Faces that become one primitive: same material, and all or none with normals and texture coordinates.
struct Part<'a> {
    material: Option<u32>,
    has_normals: bool,
    has_texcoords: bool,
    faces: Vec<&'a Face>,
}

/// Parts in the order of their first face.
fn split(faces: &[Face]) -> Vec<Part<'_>> {
    let mut parts: Vec<Part<'_>> = Vec::new();
    let mut places = HashMap::new();
    for face in faces {
        let has_normals = face.corners.iter().all(|corner| corner.normal.is_some());
        let has_texcoords = face.corners.iter().all(|corner| corner.texcoord.is_some());
        let place = *places.entry((face.material, has_normals, has_texcoords)).or_insert_with(|| {
            parts.push(Part { material: face.material, has_normals, has_texcoords, faces: Vec::new() });
            parts.len() - 1
        });
        parts[place].faces.push(face);
    }
    parts
}

/// One vertex for each different corner.
fn build(part: &Part<'_>, geometry: &Geometry, material: usize, warnings: &mut Warnings) -> Primitive {
    let mut vertices: HashMap<Corner, u32> = HashMap::new();
    let mut primitive = Primitive { material, ..Primitive::default() };
    let mut normals = Vec::new();
    let mut texcoords = Vec::new();
    for face in &part.faces {
        let points: Vec<[f32; 3]> =
            face.corners.iter().map(|corner| geometry.positions[corner.position as usize]).collect();
        let mut number = |corner: &Corner| {
            let key = Corner {
                position: corner.position,
                normal: corner.normal.filter(|_| part.has_normals),
                texcoord: corner.texcoord.filter(|_| part.has_texcoords),
            };
            *vertices.entry(key).or_insert_with(|| {
                primitive.positions.push(geometry.positions[key.position as usize]);
                normals.extend(key.normal.map(|normal| geometry.normals[normal as usize]));
                texcoords.extend(key.texcoord.map(|texcoord| geometry.texcoords[texcoord as usize]));
                primitive.positions.len() as u32 - 1
            })
        };
        for triangle in polygon::triangulate(&points) {
            let triangle = triangle.map(|i| number(&face.corners[i]));
            let [a, b, c] = triangle.map(|vertex| vertex);
            if a != b && b != c && c != a {
                primitive.triangles.push(triangle);
            }
        }
    }
    primitive.normals = part.has_normals.then(|| normals.into_iter().map(unit).collect::<Option<Vec<_>>>()).flatten();
    if part.has_normals && primitive.normals.is_none() {
        warnings.add("normals of zero length: those meshes are shaded flat", "");
    }
    primitive.texcoords = part.has_texcoords.then_some(texcoords);
    primitive
}

/// The vector at unit length, if it has a direction.
fn unit(vector: [f32; 3]) -> Option<[f32; 3]> {
    let vector = glam::DVec3::from(vector.map(f64::from));
    vector.try_normalize().map(|unit| unit.to_array().map(|x| x as f32))
}

/// An error at a line.
fn at_line(path: &Path, line: usize, message: impl Into<String>) -> SceneError {
    SceneError::at(path, format!("line {line}"), message)
}
