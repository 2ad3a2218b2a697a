//! Broken input: every error names the file, the place and what is wrong, and nothing panics, hangs or takes memory that
//! the file does not justify.

use std::path::Path;

use crate::scene_support::*;
use proptest::prelude::*;
use serde_json::{Value, json};
use sunfleck::scene::load::{load_environment, load_scene, resolve};

/// The error's place, and words of its message.
fn expect(document: &Value, place: &str, words: &str) {
    let error = load_error(document);
    assert!(error.path.ends_with("test.gltf"), "{error}");
    assert_eq!(error.place, place, "{error}");
    assert!(error.message.contains(words), "\"{words}\" is not in: {error}");
}

fn expect_change(pointer: &str, value: Value, place: &str, words: &str) {
    expect(&triangle_with(&[(pointer, value)]), place, words);
}

#[test]
fn files_that_are_missing_or_of_another_kind() {
    for name in ["no such file.gltf", "nothing", "cornel"] {
        let error = resolve(name).expect_err("there is no such file").to_string();
        assert!(error.contains(name) && error.contains("no such file") && error.contains("cornell"), "{error}");
    }
    let folder = Folder::new();
    let error = load_scene(&folder.write("scene.fbx", "")).expect_err("not supported").to_string();
    assert!(error.contains("fbx") && error.contains(".gltf") && error.contains(".obj"), "{error}");
    for name in ["folder.gltf", "folder.obj"] {
        folder.write(&format!("{name}/inside"), "");
        let path = folder.write("other", "").with_file_name(name);
        assert!(load_scene(&path).expect_err("a folder").to_string().contains("not a regular file"));
    }
}

#[test]
fn json_and_versions() {
    let folder = Folder::new();
    for text in ["", "{", "[]", "nonsense", "{\"asset\": 1}", "{}", "{\"asset\":{\"version\":\"2.0\"},}"] {
        let error = load_scene(&folder.write("test.gltf", text)).expect_err(text);
        assert!(!error.place.is_empty(), "{error}");
    }
    let nested = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(load_scene(&folder.write("nested.gltf", nested)).is_err());
    expect_change("/asset/version", json!("1.0"), "/asset/version", "glTF 1.0 is not supported");
    expect_change("/asset/version", json!("two"), "/asset/version", "no version");
    expect_change("/asset/minVersion", json!("2.1"), "/asset/minVersion", "needs glTF 2.1");
    let required = json!(["KHR_materials_ior", "KHR_draco_mesh_compression", "EXT_unknown"]);
    expect_change("/extensionsRequired", required, "/extensionsRequired", "KHR_draco_mesh_compression, EXT_unknown");
}

#[test]
fn truncated_binaries() {
    let folder = Folder::new();
    let document = triangle_with(&[("/buffers/0", json!({"byteLength": 42}))]);
    let whole = glb(&document.to_string(), &triangle_bytes());
    for length in 0..whole.len() {
        let error = load_scene(&folder.write("cut.glb", &whole[..length])).expect_err("it is truncated");
        assert!(error.path.ends_with("cut.glb") && !error.hint.is_empty(), "{error}");
    }
    let lies = |offset: usize, value: u32| {
        let mut bytes = whole.clone();
        bytes[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        load_scene(&folder.write("lies.glb", bytes)).expect_err("the header lies")
    };
    assert!(lies(4, 1).message.contains("version 1"));
    assert!(lies(8, u32::MAX).message.contains("truncated"));
    assert!(lies(8, 3).message.contains("no JSON"));
    assert!(lies(12, u32::MAX).message.contains("beyond the end"));
}

#[test]
fn accessors_views_and_buffers() {
    let huge = json!(u64::MAX);
    expect_change("/accessors/0/count", json!(4), "/accessors/0", "do not fit");
    expect_change("/accessors/0/count", huge.clone(), "/accessors/0", "do not fit");
    expect_change("/accessors/0/byteOffset", huge.clone(), "/accessors/0", "do not fit");
    expect_change("/accessors/0/count", json!(-1), "/accessors/0/count", "integer of at least 0");
    expect_change("/accessors/0/type", json!("VEC2"), "/accessors/0/type", "used as VEC3");
    expect_change("/accessors/0/componentType", json!(5130), "/accessors/0/componentType", "no component type");
    expect_change("/accessors/0/componentType", json!(5125), "/accessors/0", "not allowed");
    expect_change("/accessors/1/componentType", json!(5126), "/accessors/1/componentType", "unsigned");
    expect_change("/accessors/0/bufferView", json!(7), "/accessors/0/bufferView", "the file has 2 bufferViews");
    expect_change("/bufferViews/0/byteStride", json!(4), "/accessors/0", "byteStride");
    expect_change("/bufferViews/0/byteLength", json!(43), "/bufferViews/0", "outside of buffer 0");
    expect_change("/bufferViews/0/byteOffset", huge, "/bufferViews/0", "outside of buffer 0");
    expect_change("/buffers/0/byteLength", json!(43), "/buffers/0", "only 42 are there");
    expect_change("/buffers/0/uri", json!("gone.bin"), "/buffers/0/uri", "no such file");
    expect_change("/buffers/0/uri", json!("data:;base64,???"), "/buffers/0/uri", "base64");
    expect_change("/buffers/0/uri", json!("https://example.org/a.bin"), "/buffers/0/uri", "https");
    expect_change("/buffers/0/uri", json!("/dev/zero"), "/buffers/0/uri", "relative");
    expect_change("/buffers/0", json!({"byteLength": 42}), "/buffers/0", "no \"uri\"");
    let zeros = json!({"componentType": 5126, "type": "VEC3", "count": 4_000_000_000_u64});
    expect_change("/accessors/0", zeros, "/accessors/0/count", "limit");
    let sparse = |count: u64, index_view: u64| json!({"count": count, "indices": {"bufferView": index_view, "componentType": 5123}, "values": {"bufferView": 0}});
    expect_change("/accessors/0/sparse", sparse(4, 1), "/accessors/0/sparse/count", "only 3");
    expect_change("/accessors/0/sparse", sparse(1, 9), "/accessors/0/sparse/indices/bufferView", "out of range");
}

#[test]
fn vertices_and_indices() {
    let mut bytes = triangle_bytes();
    bytes[40] = 3;
    expect(&triangle_of(&bytes), "/accessors/1", "vertex index 3 (element 2) is out of range");
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut bytes = triangle_bytes();
        bytes[16..20].copy_from_slice(&bad.to_le_bytes());
        expect(&triangle_of(&bytes), "/accessors/0", "position of vertex 1");
    }
    expect_change("/meshes/0/primitives/0/mode", json!(7), "/meshes/0/primitives/0", "mode 7");
    expect_change("/meshes/0/primitives/0/material", json!(1), "/meshes/0/primitives/0/material", "1 materials");
    let shorter = json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 2});
    let mut document = triangle_with(&[("/accessors/-", shorter)]);
    set(&mut document, "/meshes/0/primitives/0/attributes/NORMAL", json!(2));
    expect(&document, "/accessors/2", "2 elements, but POSITION has 3");
}

#[test]
fn hierarchies() {
    let nodes = |nodes: Value| triangle_with(&[("/nodes", nodes)]);
    expect(&nodes(json!([{"children": [0]}])), "/nodes/0", "cycle");
    expect(&nodes(json!([{"children": [1]}, {"children": [2]}, {"children": [1]}])), "/nodes/1", "cycle");
    expect(&nodes(json!([{"children": [9]}])), "/nodes/0/children/0", "out of range");
    expect(&nodes(json!([{"mesh": 9}])), "/nodes/0/mesh", "out of range");
    expect(&nodes(json!([{"matrix": [1, 2, 3]}])), "/nodes/0/matrix", "expected 16 numbers");
    let projective = json!([{"matrix": [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]);
    expect(&nodes(projective), "/nodes/0/matrix", "not affine");
    expect(&nodes(json!([{"rotation": [0, 0, 0, 0]}])), "/nodes/0/rotation", "quaternion");
    let overflowing = json!([{"scale": [1e300, 1, 1], "children": [1]}, {"scale": [1e300, 1, 1]}]);
    expect(&nodes(overflowing), "/nodes/1", "not finite");
    // Each node twice below the one before: 2⁶⁰ instances.
    let mut doubling: Vec<Value> = (1..60).map(|child| json!({"children": [child, child]})).collect();
    doubling.push(json!({"mesh": 0}));
    assert!(load_error(&nodes(json!(doubling))).message.contains("unfold"));
    let both = triangle_with(&[("/nodes", json!([{"children": [1]}, {}])), ("/scenes/0/nodes", json!([0, 1]))]);
    expect(&both, "/nodes/0/children/0", "also a child");
}

#[test]
fn cameras_lights_and_materials() {
    let camera = |camera: Value| triangle_with(&[("/nodes/0/camera", json!(0)), ("/cameras", json!([camera]))]);
    let yfov = |yfov: f64| camera(json!({"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.1}}));
    expect(&yfov(0.0), "/cameras/0/perspective/yfov", "field of view");
    expect(&yfov(4.0), "/cameras/0/perspective/yfov", "field of view");
    expect(&camera(json!({"type": "fisheye"})), "/cameras/0/type", "fisheye");
    expect(&camera(json!({"type": "perspective"})), "/cameras/0", "\"perspective\" is missing");
    let lens = json!({"type": "perspective", "perspective": {"yfov": 1}, "extras": {"sunfleck": {"lens_radius": -1}}});
    expect(&camera(lens), "/cameras/0/extras/sunfleck/lens_radius", "at least 0");

    let light = |light: Value| {
        triangle_with(&[
            ("/nodes/0/extensions", json!({"KHR_lights_punctual": {"light": 0}})),
            ("/extensions", json!({"KHR_lights_punctual": {"lights": [light]}})),
        ])
    };
    let place = "/extensions/KHR_lights_punctual/lights/0";
    expect(&light(json!({"type": "neon"})), &format!("{place}/type"), "neon");
    expect(&light(json!({"type": "point", "intensity": -1})), &format!("{place}/intensity"), "out of range");
    let cone = json!({"type": "spot", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.5}});
    expect(&light(cone), &format!("{place}/spot"), "inner cone");

    let ours = |extras: Value| triangle_with(&[("/materials/0/extras", json!({"sunfleck": extras}))]);
    expect(&ours(json!({"bsdf": "glas"})), "/materials/0/extras/sunfleck/bsdf", "glas");
    expect(&ours(json!({"bsdf": 1})), "/materials/0/extras/sunfleck/bsdf", "expected a string");
    expect(&ours(json!({"fresnel": "none"})), "/materials/0/extras/sunfleck/fresnel", "none");
    expect(&ours(json!({"black_back": 1})), "/materials/0/extras/sunfleck/black_back", "true or false");
    expect(&ours(json!({"bdsf": "glass"})), "/materials/0/extras/sunfleck/bdsf", "not known");
    let factor = json!({"baseColorFactor": [0, 0, 2, 1]});
    let place = "/materials/0/pbrMetallicRoughness/baseColorFactor/2";
    expect_change("/materials/0/pbrMetallicRoughness", factor, place, "out of range");
    expect_change("/materials/0/emissiveFactor", json!([-1, 0, 0]), "/materials/0/emissiveFactor/0", "out of range");
}

#[test]
fn textures_that_are_missing_or_broken() {
    let mut bytes = triangle_bytes();
    bytes.extend([0; 26]);
    let textured = |image: Value| {
        let mut document = triangle_of(&bytes);
        set(&mut document, "/bufferViews/-", json!({"buffer": 0, "byteOffset": 44, "byteLength": 24}));
        set(&mut document, "/accessors/-", json!({"bufferView": 2, "componentType": 5126, "type": "VEC2", "count": 3}));
        set(&mut document, "/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(2));
        set(&mut document, "/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": {"index": 0}}));
        set(&mut document, "/textures", json!([{"source": 0}]));
        set(&mut document, "/images", json!([image]));
        document
    };
    expect(&textured(json!({"uri": "gone.png"})), "/images/0", "gone.png: no such file");
    expect(&textured(json!({"uri": "data:,abc"})), "/images/0", "no known format");
    let cut = png(8, 8, [1, 2, 3, 4]);
    expect(&textured(json!({"uri": data_uri(&cut[..cut.len() / 2])})), "/images/0", "cannot be decoded");
    expect(&textured(json!({"bufferView": 0, "mimeType": "image/png"})), "/images/0", "no known format");
    expect(&textured(json!({})), "/images/0", "neither");
    // A header alone that claims 2³¹ × 2³¹ texels takes no memory.
    let mut giant = cut;
    giant[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    assert_eq!(load_error(&textured(json!({"uri": data_uri(&giant)}))).place, "/images/0");
}

#[test]
fn environments() {
    let folder = Folder::new();
    let error = |name: &str, bytes: &[u8]| {
        load_environment(&folder.write(name, bytes), 1.0, 0.0).expect_err("it is broken").to_string()
    };
    assert!(error("empty.hdr", b"").contains("empty.hdr"));
    assert!(error("text.hdr", b"some text").contains("no known format"));
    assert!(error("cut.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 4\n").contains("cannot be decoded"));
    let giant = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000000000 +X 2000000000\n";
    assert!(error("giant.hdr", giant).contains("giant.hdr"));
    assert!(error("cut.exr", b"\x76\x2f\x31\x01\x02\0\0\0").contains("EXR"));
    assert!(load_environment(Path::new("gone.exr"), 1.0, 0.0).expect_err("gone").message.contains("no such file"));
    let good = folder.write("good.png", png(1, 1, [0; 4]));
    assert!(load_environment(&good, -1.0, 0.0).is_err() && load_environment(&good, f32::NAN, 0.0).is_err());
    assert!(load_environment(&good, 1.0, f64::INFINITY).is_err() && load_environment(&good, 0.0, 1e9).is_ok());
}

#[test]
fn an_exr_with_nan_names_its_texel() {
    let folder = Folder::new();
    let path = folder.write("nan.exr", "");
    let pixel = |x: usize, y: usize| if (x, y) == (2, 1) { (0.0, f32::NAN, 0.0) } else { (1.0_f32, 2.0_f32, 3.0_f32) };
    exr::prelude::write_rgb_file(&path, 4, 3, pixel).expect("an EXR can be written");
    let error = load_environment(&path, 1.0, 0.0).expect_err("NaN is refused");
    assert_eq!(error.place, "texel (2, 1)");
    assert!(error.message.contains("1 texel"), "{error}");
}

#[test]
fn obj_errors_have_lines() {
    let folder = Folder::new();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let cases = [
        ("v 0 0\n", 1, "needs 3"),
        ("v 0 nan 0\n", 1, "no finite number"),
        ("# comment\nv 0 1e99 0\n", 2, "no finite number"),
        (&format!("{triangle}f 1 2 4\n"), 4, "vertex index 4 is out of range"),
        (&format!("{triangle}f 0 1 2\n"), 4, "vertex index 0"),
        (&format!("{triangle}f -4 1 2\n"), 4, "vertex index -4"),
        (&format!("{triangle}f -9223372036854775808 1 2\n"), 4, "out of range"),
        (&format!("{triangle}f 1 2 99999999999\n"), 4, "out of range"),
        (&format!("{triangle}vn 0 0 1\nf 1//1 2//1 3//2\n"), 5, "normal index 2"),
        (&format!("{triangle}f 1/1/1/1 2 3\n"), 4, "no vertex"),
        (&format!("{triangle}f one two three\n"), 4, "no vertex index"),
    ];
    for (text, line, words) in cases {
        let error = load_scene(&folder.write("bad.obj", text)).expect_err(text);
        assert_eq!(error.place, format!("line {line}"), "{error}");
        assert!(error.message.contains(words), "{error}");
    }
    let used = format!("mtllib m.mtl\n{triangle}usemtl m\nf 1 2 3\n");
    let path = folder.write("used.obj", used);
    for (mtl, words) in [
        ("Kd 1", ""),
        ("Kd 0.5 0.5", "needs three"),
        ("Kd x y z", "finite"),
        ("Ni nan", "finite"),
        ("Ke -1 0 0", "at least 0"),
        ("map_Kd gone.png", "gone.png"),
    ] {
        folder.write("m.mtl", format!("newmtl m\n{mtl}\n"));
        match load_scene(&path) {
            Ok(_) => assert!(words.is_empty(), "{mtl}"),
            Err(error) => assert!(
                error.path.ends_with("m.mtl") && error.place == "line 2" && error.message.contains(words),
                "{error}"
            ),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever bytes are changed in a .glb: an error or a valid scene, never a panic.
    #[test]
    fn damaged_binaries_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let document = triangle_with(&[("/buffers/0", json!({"byteLength": 42}))]);
        let mut bytes = glb(&document.to_string(), &triangle_bytes());
        for (index, value) in changes {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        let folder = Folder::new();
        if let Ok(scene) = load_scene(&folder.write("damaged.glb", bytes)) {
            scene.validate().expect("what loads is valid");
        }
    }

    /// Whatever stands in an OBJ file.
    #[test]
    fn odd_obj_files_never_panic(lines in prop::collection::vec("(v|vn|vt|f|usemtl|g|l|mtllib)( -?[0-9/.e]{1,6}){0,5}", 0..30)) {
        let folder = Folder::new();
        if let Ok(scene) = load_scene(&folder.write("odd.obj", lines.join("\n"))) {
            scene.validate().expect("what loads is valid");
        }
    }
}
