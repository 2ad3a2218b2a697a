//! Vertex attributes and texture bindings of glTF files: texture transforms, sets of coordinates, colours, tangents.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::scene_support::*;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use sunfleck::scene::{Primitive, Scene, TextureBinding, TextureTransform};

/// A quadrilateral in the plane z = 0 seen from +Z, upright as glTF's images are: (u, v) = (x, 1 − y).
const QUAD: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
const QUAD_UV: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];

/// A glTF accessor: component type, whether it is normalised, type, bytes.
type Accessor = (u32, bool, &'static str, Vec<u8>);

/// The quadrilateral with some attributes, and with one texture that the material may bind.
fn quad(attributes: &[(&str, Accessor)], material: Value) -> Value {
    let mut bytes = floats(QUAD.as_flattened());
    bytes.extend([0, 0, 1, 0, 2, 0, 0, 0, 2, 0, 3, 0]);
    let mut document = triangle_of(&bytes);
    set(&mut document, "/accessors/0/count", json!(4));
    set(&mut document, "/accessors/1/count", json!(6));
    set(&mut document, "/bufferViews/0/byteLength", json!(48));
    set(&mut document, "/bufferViews/1", json!({"buffer": 0, "byteOffset": 48, "byteLength": 12}));
    for (index, (name, (component, normalized, kind, bytes))) in attributes.iter().enumerate() {
        set(&mut document, "/buffers/-", json!({"byteLength": bytes.len(), "uri": data_uri(bytes)}));
        set(&mut document, "/bufferViews/-", json!({"buffer": index + 1, "byteLength": bytes.len()}));
        set(
            &mut document,
            "/accessors/-",
            json!({"bufferView": index + 2, "componentType": component, "normalized": normalized, "type": kind, "count": 4}),
        );
        set(&mut document, &format!("/meshes/0/primitives/0/attributes/{name}"), json!(index + 2));
    }
    set(&mut document, "/materials/0", material);
    set(&mut document, "/textures", json!([{"source": 0}]));
    set(&mut document, "/images", json!([{"uri": data_uri(&png(1, 1, [128, 128, 255, 255]))}]));
    document
}

fn vec2(values: [[f32; 2]; 4]) -> Accessor {
    (5126, false, "VEC2", floats(values.as_flattened()))
}

fn vec3(value: [f32; 3]) -> Accessor {
    (5126, false, "VEC3", floats([value; 4].as_flattened()))
}

fn primitive(scene: &Scene) -> &Primitive {
    &scene.meshes[0].primitives[0]
}

fn base_color(scene: &Scene) -> TextureBinding {
    scene.materials[0].base_color_texture.expect("a texture")
}

fn textured(info: Value) -> Value {
    json!({"pbrMetallicRoughness": {"baseColorTexture": info}})
}

/// KHR_texture_transform by the words of its specification: scaled, turned counter-clockwise on the image, moved.
#[test]
fn texture_transforms() {
    let extension = json!({"offset": [0.25, -0.5], "rotation": FRAC_PI_2 / 3.0, "scale": [2.0, 3.0]});
    let info = json!({"index": 0, "extensions": {"KHR_texture_transform": extension}});
    let mut document = quad(&[("TEXCOORD_0", vec2(QUAD_UV))], textured(info));
    set(&mut document, "/extensionsRequired", json!(["KHR_texture_transform"]));
    let scene = load_ok(&document);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let binding = base_color(&scene);
    let (sin, cos) = (PI / 6.0).sin_cos();
    for [u, v] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.3, -0.7]] {
        let (x, y) = (2.0 * u, 3.0 * v);
        let expected = [cos * x + sin * y + 0.25, -sin * x + cos * y - 0.5];
        let got = binding.transform.apply([u, v]);
        assert!((0..2).all(|k| (got[k] - expected[k]).abs() < 1e-6), "{got:?} instead of {expected:?}");
    }
    // A quarter turn takes what is to the right to the top of the image, where v is negative.
    let quarter = TextureTransform::new([0.0; 2], FRAC_PI_2, [1.0; 2]).apply([1.0, 0.0]);
    assert!(quarter[0].abs() < 1e-7 && (quarter[1] + 1.0).abs() < 1e-7, "{quarter:?}");
    let plain = load_ok(&quad(&[("TEXCOORD_0", vec2(QUAD_UV))], textured(json!({"index": 0}))));
    assert_eq!(base_color(&plain), TextureBinding::new(0));
}

#[test]
fn a_texture_transform_that_overflows_is_refused() {
    for extension in [json!({"scale": [1e39, 1.0]}), json!({"offset": [0.0, -1e300]})] {
        let info = json!({"index": 0, "extensions": {"KHR_texture_transform": extension}});
        let error = load_error(&quad(&[("TEXCOORD_0", vec2(QUAD_UV))], textured(info)));
        assert!(error.to_string().contains("KHR_texture_transform: the texture transform is too large"), "{error}");
    }
    let info = json!({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [1]}}});
    let error = load_error(&quad(&[("TEXCOORD_0", vec2(QUAD_UV))], textured(info)));
    assert!(error.to_string().contains("expected 2 numbers, found 1"), "{error}");
}

/// Only the sets that the material looks up are loaded; the transform's `texCoord` overrides the texture's.
#[test]
fn two_sets_of_coordinates() {
    let other = [[0.5, 0.25]; 4];
    let sets = [("TEXCOORD_0", vec2(QUAD_UV)), ("TEXCOORD_1", vec2(other))];
    let overridden = json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}});
    for info in [json!({"index": 0, "texCoord": 1}), overridden] {
        let scene = load_ok(&quad(&sets, textured(info)));
        assert_eq!(base_color(&scene).set, 1);
        assert_eq!(primitive(&scene).texcoords_1.as_deref(), Some(&other[..]));
        assert!(primitive(&scene).texcoords.is_none());
    }
    let both = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "texCoord": 1}});
    let scene = load_ok(&quad(&sets, both));
    assert_eq!(primitive(&scene).texcoords.as_deref(), Some(&QUAD_UV[..]));
    assert_eq!(primitive(&scene).texcoords_1.as_deref(), Some(&other[..]));
    assert_eq!((base_color(&scene).set, scene.materials[0].emission_texture.expect("a texture").set), (0, 1));
}

/// Every component type that glTF allows, with and without alpha, means the same colours.
#[test]
fn vertex_colors_of_all_types() {
    let codes: [[u16; 4]; 4] = [[0, 51, 102, 255], [255, 0, 255, 0], [1, 2, 3, 4], [128, 64, 32, 16]];
    for channels in [3, 4] {
        let kind = if channels == 3 { "VEC3" } else { "VEC4" };
        let numbers = || codes.iter().flat_map(|code| &code[..channels]).copied();
        let padded = |unit: usize, bytes: Vec<u8>| -> Vec<u8> {
            // Vertex attributes are aligned to four bytes: three narrow channels leave a gap, which the stride bridges.
            let stride = (channels * unit).next_multiple_of(4);
            bytes.chunks(channels * unit).flat_map(|chunk| [chunk, &vec![0; stride - chunk.len()]].concat()).collect()
        };
        let bytes: Vec<u8> = numbers().map(|code| code as u8).collect();
        let words: Vec<u8> = numbers().flat_map(|code| (code * 257).to_le_bytes()).collect();
        let reals = floats(&numbers().map(|code| f32::from(code) / 255.0).collect::<Vec<_>>());
        for (component, unit, bytes) in [(5121, 1, bytes), (5123, 2, words), (5126, 4, reals)] {
            let accessor = (component, component != 5126, kind, padded(unit, bytes));
            let mut document = quad(&[("COLOR_0", accessor)], json!({}));
            set(&mut document, "/bufferViews/2/byteStride", json!((channels * unit).next_multiple_of(4)));
            let scene = load_ok(&document);
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            let colors = primitive(&scene).colors.as_ref().expect("colours");
            for (color, code) in colors.iter().zip(codes) {
                let mut expected = code.map(|c| f32::from(c) / 255.0);
                if channels == 3 {
                    expected[3] = 1.0;
                }
                assert!((0..4).all(|k| (color[k] - expected[k]).abs() < 1e-6), "{kind} of {component}: {color:?}");
            }
        }
    }
}

#[test]
fn odd_vertex_colors() {
    let white = (5126, false, "VEC3", floats(&[1.0; 12]));
    assert!(primitive(&load_ok(&quad(&[("COLOR_0", white)], json!({})))).colors.is_none(), "white changes nothing");
    let wild = floats(&[2.0, -1.0, f32::NAN, f32::INFINITY, 0.5, 0.25, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let scene = load_ok(&quad(&[("COLOR_0", (5126, false, "VEC3", wild))], json!({})));
    let colors = primitive(&scene).colors.as_ref().expect("colours");
    assert_eq!(colors[..2], [[1.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.25, 1.0]]);
    assert!(scene.warnings[0].contains("vertex colours outside [0, 1]"), "{:?}", scene.warnings);
    let short = (5126, false, "VEC2", floats(&[1.0; 8]));
    let error = load_error(&quad(&[("COLOR_0", short)], json!({})));
    assert!(error.to_string().contains("used as VEC4, but its type is VEC2"), "{error}");
}

fn bumpy(info: Value) -> Value {
    json!({"normalTexture": info})
}

/// The tangents of a file are taken as they are; without normals, or where one is none, they are made.
#[test]
fn tangents_of_the_file() {
    let tangents = |t: [f32; 4]| (5126, false, "VEC4", floats([t; 4].as_flattened()));
    let uv = ("TEXCOORD_0", vec2(QUAD_UV));
    let normal = ("NORMAL", vec3([0.0, 0.0, 1.0]));
    let material = bumpy(json!({"index": 0, "scale": 0.5}));
    let given = ("TANGENT", tangents([0.0, 2.0, 0.0, -1.0]));
    let scene = load_ok(&quad(&[uv.clone(), normal.clone(), given.clone()], material.clone()));
    assert_eq!(primitive(&scene).tangents.as_deref(), Some(&[[0.0, 1.0, 0.0, -1.0]; 4][..]));
    assert_eq!(
        (scene.materials[0].normal_scale, scene.materials[0].normal_texture),
        (0.5, Some(TextureBinding::new(0)))
    );
    let made = Some(&[[1.0, 0.0, 0.0, 1.0]; 4][..]);
    assert_eq!(primitive(&load_ok(&quad(&[uv.clone(), given.clone()], material.clone()))).tangents.as_deref(), made);
    let scene = load_ok(&quad(&[uv.clone(), normal, ("TANGENT", tangents([0.0; 4]))], material));
    assert_eq!(primitive(&scene).tangents.as_deref(), made);
    assert!(scene.warnings[0].contains("tangents of zero length"), "{:?}", scene.warnings);
    // What needs none has none.
    assert!(primitive(&load_ok(&quad(&[uv, given], json!({})))).tangents.is_none());
}

/// On a plane the tangent is where u grows, and the bitangent points up the image; a texture transform turns both, and so
/// does another set of coordinates.
#[test]
fn generated_tangents_of_a_plane() {
    let turned = QUAD_UV.map(|[u, v]| [v, -u]);
    let mirrored = QUAD_UV.map(|[u, v]| [1.0 - u, v]);
    let turn = json!({"index": 0, "extensions": {"KHR_texture_transform": {"rotation": FRAC_PI_2}}});
    let plain = json!({"index": 0});
    let cases = [
        (QUAD_UV, plain.clone(), [1.0, 0.0, 0.0, 1.0]),
        // u = v_plain grows downwards.
        (turned, plain.clone(), [0.0, -1.0, 0.0, 1.0]),
        (mirrored, plain, [-1.0, 0.0, 0.0, -1.0]),
        // u′ = v, v′ = −u.
        (QUAD_UV, turn, [0.0, -1.0, 0.0, 1.0]),
    ];
    for (uv, info, expected) in cases {
        let scene = load_ok(&quad(&[("TEXCOORD_0", vec2(uv))], bumpy(info)));
        let tangents = primitive(&scene).tangents.as_ref().expect("tangents");
        assert_eq!(tangents.len(), 4, "no vertex had to be split");
        for tangent in tangents {
            assert!((0..4).all(|k| (tangent[k] - expected[k]).abs() < 1e-6), "{tangent:?} instead of {expected:?}");
        }
    }
    let second = json!({"index": 0, "texCoord": 1});
    let scene = load_ok(&quad(&[("TEXCOORD_0", vec2(QUAD_UV)), ("TEXCOORD_1", vec2(turned))], bumpy(second)));
    assert_eq!(primitive(&scene).tangents.as_ref().expect("tangents")[0], [0.0, -1.0, 0.0, 1.0]);
    assert!(primitive(&scene).texcoords.is_none());
}

/// Two triangles share an edge but look the image up mirrored: their vertices there are split, once for each side.
#[test]
fn mirrored_neighbours_are_split() {
    let mut strip = Primitive {
        positions: vec![[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
        normals: Some(vec![[0.0, 0.0, 1.0]; 4]),
        texcoords: Some(vec![[1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 1.0]]),
        colors: Some((0..4).map(|i| [i as f32 / 4.0, 0.0, 0.0, 1.0]).collect()),
        triangles: vec![[0, 1, 2], [1, 3, 2]],
        ..Primitive::default()
    };
    strip.generate_tangents(0, &TextureTransform::IDENTITY);
    assert_eq!((strip.positions.len(), strip.triangles[0]), (6, [0, 1, 2]));
    let tangents = strip.tangents.as_ref().expect("tangents");
    for (triangle, expected) in strip.triangles.iter().zip([[-1.0, 0.0, 0.0, -1.0], [1.0, 0.0, 0.0, 1.0]]) {
        assert!(triangle.iter().all(|&vertex| tangents[vertex as usize] == expected), "{tangents:?}");
    }
    let [a, _, c] = strip.triangles[1].map(|vertex| vertex as usize);
    assert_eq!((strip.positions[a], strip.positions[c]), ([0.0, 0.0, 0.0], [0.0, 1.0, 0.0]));
    let colors = strip.colors.as_ref().expect("colours");
    assert_eq!((colors[a][0], colors[c][0], strip.normals.as_ref().map(Vec::len)), (0.25, 0.5, Some(6)));
}

/// A sphere by longitude and latitude: the tangent runs along the parallels, the bitangent to the north.
#[test]
fn generated_tangents_of_a_sphere() {
    let (across, down) = (64_u32, 32_u32);
    let point = |i: u32, j: u32| {
        let (theta, phi) = (PI * f64::from(j) / f64::from(down), TAU * f64::from(i) / f64::from(across));
        DVec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin())
    };
    let grid: Vec<(u32, u32)> = (0..=down).flat_map(|j| (0..=across).map(move |i| (i, j))).collect();
    let normals: Vec<[f32; 3]> = grid.iter().map(|&(i, j)| point(i, j).as_vec3().into()).collect();
    let index = |i: u32, j: u32| j * (across + 1) + i;
    let cell = |(i, j): (u32, u32)| {
        let [a, b, c, d] = [index(i, j), index(i, j + 1), index(i + 1, j + 1), index(i + 1, j)];
        [[a, b, c], [a, c, d]]
    };
    // Away from the poles, where cells are quadrilaterals.
    let cells = (1..down - 1).flat_map(|j| (0..across).map(move |i| (i, j)));
    let mut sphere = Primitive {
        positions: normals.clone(),
        normals: Some(normals),
        texcoords: Some(grid.iter().map(|&(i, j)| [i as f32 / across as f32, j as f32 / down as f32]).collect()),
        triangles: cells.flat_map(cell).collect(),
        ..Primitive::default()
    };
    sphere.generate_tangents(0, &TextureTransform::IDENTITY);
    assert_eq!(sphere.positions.len(), grid.len(), "a sphere with a seam of its own needs no splitting");
    let tangents = sphere.tangents.as_ref().expect("tangents");
    let mut worst = 1.0_f64;
    for vertex in sphere.triangles.iter().flatten().map(|&vertex| vertex as usize) {
        let [x, y, z, sign] = tangents[vertex];
        let normal = Vec3::from(sphere.positions[vertex]).as_dvec3();
        let tangent = DVec3::new(x.into(), y.into(), z.into());
        let east = DVec3::Y.cross(normal).normalize();
        worst = worst.min(tangent.dot(east));
        assert!(normal.cross(tangent).y * f64::from(sign) > 0.0, "the bitangent of {normal} points south");
    }
    println!("tangents are at most {:.2}° off", worst.acos().to_degrees());
    // Within the angle of a cell, half of which an average over neighbours can be off at the seam.
    assert!(worst > (PI / f64::from(across)).cos(), "{worst}");
    // The comparison sees coordinates that are read upside down.
    for texcoord in sphere.texcoords.iter_mut().flatten() {
        texcoord[1] = -texcoord[1];
    }
    sphere.generate_tangents(0, &TextureTransform::IDENTITY);
    assert!(sphere.tangents.as_ref().is_some_and(|t| t.iter().all(|t| t[..3] == [0.0; 3] || t[3] < 0.0)));
}

#[test]
fn a_primitive_without_coordinates_stays_without_tangents() {
    let mut triangle = Primitive { positions: QUAD[..3].to_vec(), triangles: vec![[0, 1, 2]], ..Primitive::default() };
    triangle.generate_tangents(0, &TextureTransform::IDENTITY);
    assert!(triangle.tangents.is_none());
}

fn anisotropic(extension: Value) -> Value {
    json!({"extensions": {"KHR_materials_anisotropy": extension}})
}

/// KHR_materials_anisotropy is read and gets tangents, along the coordinates of its texture, without a normal map.
#[test]
fn anisotropy_and_its_tangents() {
    let coordinates = [("TEXCOORD_0", vec2(QUAD_UV))];
    let info = json!({"index": 0, "extensions": {"KHR_texture_transform": {"rotation": FRAC_PI_2}}});
    let full = json!({"anisotropyStrength": 0.6, "anisotropyRotation": -FRAC_PI_2, "anisotropyTexture": info});
    let scene = load_ok(&quad(&coordinates, anisotropic(full)));
    let material = &scene.materials[0];
    assert_eq!(material.anisotropy, 0.6);
    assert!((f64::from(material.anisotropy_rotation_radians) - 1.5 * PI).abs() < 1e-6);
    assert!(material.anisotropy_texture.is_some());
    let tangent = primitive(&scene).tangents.as_ref().expect("tangents")[0];
    assert!((0..4).all(|k| (tangent[k] - [0.0, -1.0, 0.0, 1.0][k]).abs() < 1e-6), "{tangent:?}");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    // Without a texture they run along the first set.
    let scene = load_ok(&quad(&coordinates, anisotropic(json!({"anisotropyStrength": 1}))));
    assert_eq!(primitive(&scene).tangents.as_ref().expect("tangents")[0], [1.0, 0.0, 0.0, 1.0]);
    // The default strength is 0: nothing is needed.
    let scene = load_ok(&quad(&coordinates, anisotropic(json!({"anisotropyRotation": 1}))));
    assert!(primitive(&scene).tangents.is_none() && scene.materials[0].anisotropy == 0.0);
}

#[test]
fn anisotropy_without_a_direction_is_named() {
    let scene = load_ok(&quad(&[], anisotropic(json!({"anisotropyStrength": 1}))));
    assert!(primitive(&scene).tangents.is_none());
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("has no direction"), "{:?}", scene.warnings);
    for (key, value) in [("anisotropyStrength", 1.5), ("anisotropyStrength", -0.1)] {
        let error = load_error(&quad(&[], anisotropic(json!({key: value})))).to_string();
        assert!(error.contains(key), "{error}");
    }
}
