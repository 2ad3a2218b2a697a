//! Valid glTF: what is read, and what is warned of.

use crate::scene_support::*;
use glam::DVec3;
use serde_json::{Value, json};
use sunfleck::scene::load::{load_scene, resolve};
use sunfleck::scene::{
    AlphaMode, Bsdf, Environment, Filter, Fresnel, Primitive, Projection, PunctualKind, Scene, Texels, Volume, Wrap,
    builtin,
};

fn primitive(scene: &Scene) -> &Primitive {
    &scene.meshes[0].primitives[0]
}

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn a_triangle_by_data_uri_file_and_glb_is_the_same() {
    let folder = Folder::new();
    folder.write("a folder/the bytes é.bin", triangle_bytes());
    let beside = json!({"byteLength": 42, "uri": "a%20folder/the%20bytes%20%C3%A9.bin"});
    let unencoded = json!({"byteLength": 42, "uri": "a folder/the bytes é.bin"});
    let binary = triangle_with(&[("/buffers/0", json!({"byteLength": 42}))]);
    let paths = [
        folder.write("data.gltf", triangle().to_string()),
        folder.write("file.gltf", triangle_with(&[("/buffers/0", beside)]).to_string()),
        folder.write("unencoded.GLTF", triangle_with(&[("/buffers/0", unencoded)]).to_string()),
        folder.write("binary.glb", glb(&binary.to_string(), &triangle_bytes())),
    ];
    for path in paths {
        let scene = load_scene(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(primitive(&scene).positions, CORNERS);
        assert_eq!(primitive(&scene).triangles, [[0, 1, 2]]);
        assert!(primitive(&scene).normals.is_none() && scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!(scene.instances[0].name, "the node");
        assert_eq!(scene.materials[0].name, "the material");
    }
}

#[test]
fn indices_of_every_width_or_none() {
    for (component, size) in [(5121, 1), (5123, 2), (5125, 4)] {
        let mut bytes = triangle_bytes()[..36].to_vec();
        for index in [2_u32, 0, 1] {
            bytes.extend(&index.to_le_bytes()[..size]);
        }
        let mut document = triangle_of(&bytes);
        set(&mut document, "/bufferViews/1/byteLength", json!(3 * size));
        set(&mut document, "/accessors/1/componentType", json!(component));
        assert_eq!(primitive(&load_ok(&document)).triangles, [[2, 0, 1]]);
    }
    let mut document = triangle();
    document["meshes"][0]["primitives"][0].as_object_mut().expect("an object").remove("indices");
    assert_eq!(primitive(&load_ok(&document)).triangles, [[0, 1, 2]]);
}

#[test]
fn interleaved_and_normalized_attributes() {
    // Position (12 bytes), normal (4 signed bytes), texture coordinate (2 × u16), with a stride of 20.
    let mut bytes = Vec::new();
    for (corner, uv) in CORNERS.iter().zip([[0_u16, 0], [65535, 0], [0, 32768]]) {
        bytes.extend(floats(corner));
        bytes.extend([0, 0, 127, 0]);
        bytes.extend(uv.iter().flat_map(|x| x.to_le_bytes()));
    }
    let texture = json!({"baseColorTexture": {"index": 0}});
    let mut document = triangle_of(&bytes);
    set(&mut document, "/bufferViews", json!([{"buffer": 0, "byteLength": 60, "byteStride": 20}]));
    set(
        &mut document,
        "/accessors",
        json!([
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 0, "componentType": 5120, "type": "VEC3", "count": 3, "byteOffset": 12, "normalized": true},
            {"bufferView": 0, "componentType": 5123, "type": "VEC2", "count": 3, "byteOffset": 16, "normalized": true}
        ]),
    );
    set(
        &mut document,
        "/meshes/0/primitives/0",
        json!({"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "material": 0}),
    );
    set(&mut document, "/materials/0/pbrMetallicRoughness", texture);
    set(&mut document, "/textures", json!([{"source": 0}]));
    set(&mut document, "/images", json!([{"uri": data_uri(&png(1, 1, [1, 2, 3, 4]))}]));
    let scene = load_ok(&document);
    assert_eq!(primitive(&scene).positions, CORNERS);
    assert_eq!(primitive(&scene).normals.as_deref(), Some(&[[0.0, 0.0, 1.0]; 3][..]));
    let expected = [[0.0, 0.0], [1.0, 0.0], [0.0, 32768.0 / 65535.0]];
    assert_eq!(primitive(&scene).texcoords.as_deref(), Some(&expected[..]));
}

#[test]
fn sparse_accessors_with_and_without_a_view() {
    let mut bytes = triangle_bytes();
    bytes.extend([0, 0]);
    bytes.extend(floats(&[5.0, 6.0, 7.0]));
    bytes.push(2);
    let mut document = triangle_of(&bytes);
    set(&mut document, "/bufferViews/-", json!({"buffer": 0, "byteOffset": 44, "byteLength": 12}));
    set(&mut document, "/bufferViews/-", json!({"buffer": 0, "byteOffset": 56, "byteLength": 1}));
    let sparse = json!({"count": 1, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 2}});
    set(&mut document, "/accessors/0/sparse", sparse);
    assert_eq!(primitive(&load_ok(&document)).positions[2], [5.0, 6.0, 7.0]);
    document["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    assert_eq!(primitive(&load_ok(&document)).positions, [[0.0; 3], [0.0; 3], [5.0, 6.0, 7.0]]);
}

#[test]
fn strips_fans_points_and_lines() {
    let bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let with_mode = |mode: u32| {
        let mut document = triangle_of(&bytes);
        set(&mut document, "/accessors/0/count", json!(4));
        set(&mut document, "/bufferViews", json!([{"buffer": 0, "byteLength": 48}]));
        set(&mut document, "/meshes/0/primitives", json!([{"attributes": {"POSITION": 0}, "mode": mode}]));
        load_ok(&document)
    };
    assert_eq!(primitive(&with_mode(5)).triangles, [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(primitive(&with_mode(6)).triangles, [[1, 2, 0], [2, 3, 0]]);
    for mode in 0..4 {
        let scene = with_mode(mode);
        assert!(scene.instances.is_empty() && scene.meshes.is_empty());
        assert_eq!(scene.warnings.iter().filter(|warning| warning.contains("points and lines")).count(), 1);
    }
}

#[test]
fn only_vertices_in_use_are_loaded() {
    let mut bytes = floats(&[f32::NAN; 3]);
    bytes.extend(floats(CORNERS.as_flattened()));
    bytes.extend([1, 0, 2, 0, 3, 0]);
    let mut document = triangle_of(&bytes);
    set(&mut document, "/accessors/0/count", json!(4));
    set(&mut document, "/bufferViews/0/byteLength", json!(48));
    set(&mut document, "/bufferViews/1/byteOffset", json!(48));
    let scene = load_ok(&document);
    assert_eq!(primitive(&scene).positions, CORNERS);
    assert_eq!(primitive(&scene).triangles, [[0, 1, 2]]);
}

#[test]
fn node_transforms_multiply_in_f64() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let nodes = json!([
        {"children": [1], "translation": [1e9, 0, 0], "rotation": [0, half, 0, half]},
        {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 3, 0, 0, 0, 0, -4, 0, 0.125, 0, 0, 1]}
    ]);
    let scene = load_ok(&triangle_with(&[("/nodes", nodes)]));
    let to_world = scene.instances[0].object_to_world;
    // The rotation of 90° about +Y takes +X to −Z and −Z to −X.
    let near = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-6, "{a} {b}");
    near(to_world.transform_point3(DVec3::ZERO), DVec3::new(1e9, 0.0, -0.125));
    near(to_world.transform_vector3(DVec3::X), DVec3::new(0.0, 0.0, -2.0));
    near(to_world.transform_vector3(DVec3::Z), DVec3::new(-4.0, 0.0, 0.0));
    assert!(to_world.matrix3.determinant() < 0.0);
}

#[test]
fn scenes_are_chosen_as_the_specification_says() {
    let nodes = json!([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}, {"children": [0]}]);
    let names = |document: &Value| -> Vec<String> {
        load_ok(document).instances.iter().map(|instance| instance.name.clone()).collect()
    };
    let scenes = json!([{"nodes": [2]}, {"nodes": [1]}]);
    let mut document = triangle_with(&[("/nodes", nodes), ("/scenes", scenes), ("/scene", json!(1))]);
    assert_eq!(names(&document), ["b"]);
    document.as_object_mut().expect("an object").remove("scene");
    assert_eq!(names(&document), ["a"]);
    document.as_object_mut().expect("an object").remove("scenes");
    assert_eq!(names(&document), ["b", "a"]);
}

#[test]
fn a_mesh_below_several_parents_is_one_mesh() {
    let nodes = json!([{"children": [2]}, {"children": [2], "translation": [1, 0, 0]}, {"mesh": 0}]);
    let scene = load_ok(&triangle_with(&[("/nodes", nodes), ("/scenes", json!([{"nodes": [0, 1]}]))]));
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    assert_eq!(scene.warnings.len(), 1);
}

#[test]
fn very_deep_hierarchies_do_not_overflow_the_stack() {
    let count = 50_000;
    let mut nodes: Vec<Value> = (1..count).map(|child| json!({"children": [child]})).collect();
    nodes.push(json!({"mesh": 0}));
    assert_eq!(load_ok(&triangle_with(&[("/nodes", json!(nodes))])).instances.len(), 1);
}

#[test]
fn cameras_and_lenses() {
    let cameras = json!([
        {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1},
         "extras": {"sunfleck": {"lens_radius": 0.02, "focus_distance": 3}}},
        {"type": "orthographic", "name": "plan", "orthographic": {"xmag": 1, "ymag": 2.5, "znear": 0, "zfar": 9}}
    ]);
    let nodes = json!([{"mesh": 0}, {"camera": 0, "name": "eye", "scale": [-2, 3, 4], "translation": [0, 0, 5]}, {"camera": 1}]);
    let changes = [("/cameras", cameras), ("/nodes", nodes), ("/scenes/0/nodes", json!([0, 1, 2]))];
    let scene = load_ok(&triangle_with(&changes));
    let [eye, plan] = &scene.cameras[..] else { panic!("{:?}", scene.cameras) };
    assert_eq!((eye.name.as_str(), plan.name.as_str()), ("eye", "plan"));
    assert_eq!(eye.projection, Projection::Perspective { yfov_radians: 0.8 });
    assert_eq!((eye.lens_radius, eye.focus_distance), (0.02, 3.0));
    assert_eq!(plan.projection, Projection::Orthographic { ymag: 2.5 });
    // Scale and mirroring of the node do not reach the camera.
    assert!((eye.camera_to_world.matrix3.determinant() - 1.0).abs() < 1e-12);
    assert_eq!(eye.camera_to_world.translation, DVec3::new(0.0, 0.0, 5.0));
}

#[test]
fn punctual_lights() {
    let lights = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.5, 0.25], "intensity": 8, "range": 3},
        {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}},
        {"type": "directional"},
        {"type": "point", "intensity": 0}
    ]}});
    let node =
        |light: u32| json!({"extensions": {"KHR_lights_punctual": {"light": light}}, "translation": [0, light, 0]});
    let mut document = triangle_with(&[
        ("/extensions", lights),
        ("/nodes", json!([node(0), node(1), node(2), node(3)])),
        ("/scenes/0/nodes", json!([0, 1, 2, 3])),
        ("/extensionsUsed", json!(["KHR_lights_punctual"])),
        ("/extensionsRequired", json!(["KHR_lights_punctual"])),
    ]);
    set(&mut document, "/nodes/2/rotation", json!([1, 0, 0, 0]));
    let scene = load_ok(&document);
    let [point, spot, sun] = &scene.lights[..] else { panic!("{:?}", scene.lights) };
    assert_eq!((point.kind, point.intensity), (PunctualKind::Point, [8.0, 4.0, 2.0]));
    assert_eq!(spot.kind, PunctualKind::Spot { inner_cone_radians: 0.1, outer_cone_radians: 0.4 });
    assert_eq!((spot.position, spot.direction), (DVec3::Y, DVec3::NEG_Z));
    assert_eq!((sun.kind, sun.direction), (PunctualKind::Directional, DVec3::Z));
}

#[test]
fn materials_and_their_extensions() {
    let materials = json!([
        {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 0.25, "roughnessFactor": 0.5},
         "emissiveFactor": [1, 0.5, 0], "doubleSided": true, "extensions": {
             "KHR_materials_emissive_strength": {"emissiveStrength": 12},
             "KHR_materials_ior": {"ior": 1.25},
             "KHR_materials_transmission": {"transmissionFactor": 0.75}}},
        {"extensions": {"KHR_materials_unlit": {}}, "emissiveFactor": [1, 1, 1]},
        {"extras": {"sunfleck": {"bsdf": "glass", "fresnel": "schlick", "black_back": true}}},
        {"pbrMetallicRoughness": {"roughnessFactor": 0.5},
         "extras": {"sunfleck": {"bsdf": "lambertian"}, "of another program": 1}},
        {"extras": {"sunfleck": {"bsdf": "mirror"}}},
        {"extras": {"sunfleck": {"bsdf": "refract"}}},
        {"name": "never used", "emissiveFactor": "nonsense"}
    ]);
    let primitives: Vec<Value> =
        (0..6).map(|material| json!({"attributes": {"POSITION": 0}, "indices": 1, "material": material})).collect();
    let scene = load_ok(&triangle_with(&[("/materials", materials), ("/meshes/0/primitives", json!(primitives))]));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let bsdfs: Vec<Bsdf> = scene.materials.iter().map(|material| material.bsdf).collect();
    let classic = [Bsdf::Glass, Bsdf::Lambertian, Bsdf::Mirror, Bsdf::Refract];
    assert_eq!(bsdfs, [[Bsdf::MetallicRoughness, Bsdf::Unlit].as_slice(), &classic].concat());
    let first = &scene.materials[0];
    assert_eq!((first.base_color, first.metallic, first.roughness), ([0.1, 0.2, 0.3], 0.25, 0.5));
    assert_eq!((first.emission, first.ior, first.transmission), ([12.0, 6.0, 0.0], 1.25, 0.75));
    assert!(first.double_sided && !scene.materials[1].is_emissive());
    assert!(scene.materials[2].fresnel == Fresnel::Schlick && scene.materials[2].black_back);
    // For a lobe of the user's own in place of the Lambertian one.
    assert_eq!(scene.materials[3].roughness, 0.5);
}

/// KHR_materials_volume makes a surface that transmits the boundary of a solid; without thickness it is a thin wall, and
/// without transmission nothing is seen of it.
#[test]
fn volumes_of_surfaces_that_transmit() {
    let material = |transmission: f64, volume: Value| json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission}, "KHR_materials_volume": volume}});
    let absorbing = json!({"thicknessFactor": 0.1, "attenuationColor": [0.5, 0, 1], "attenuationDistance": 2});
    let materials = json!([
        material(1.0, json!({"thicknessFactor": 1})),
        material(0.5, absorbing.clone()),
        material(1.0, json!({"attenuationDistance": 2})),
        material(0.0, absorbing),
        {"extras": {"sunfleck": {"bsdf": "glass"}}, "extensions": {"KHR_materials_volume": {"thicknessFactor": 1}}}
    ]);
    let primitives: Vec<Value> =
        (0..5).map(|material| json!({"attributes": {"POSITION": 0}, "indices": 1, "material": material})).collect();
    let scene = load_ok(&triangle_with(&[("/materials", materials), ("/meshes/0/primitives", json!(primitives))]));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let clear = Volume { attenuation_color: [1.0; 3], attenuation_distance: f32::INFINITY };
    let tinted = Volume { attenuation_color: [0.5, 0.0, 1.0], attenuation_distance: 2.0 };
    let volumes: Vec<Option<Volume>> = scene.materials.iter().map(|material| material.volume).collect();
    assert_eq!(volumes, [Some(clear), Some(tinted), None, None, Some(clear)]);
    scene.validate().expect("valid");
    for (key, bad) in
        [("attenuationDistance", json!(0)), ("attenuationColor", json!([2, 0, 0])), ("thicknessFactor", json!(-1))]
    {
        let mut volume = json!({"thicknessFactor": 1});
        volume[key] = bad;
        let error = load_error(&triangle_with(&[("/materials", json!([material(1.0, volume)]))])).to_string();
        assert!(error.contains(key), "{error}");
    }
}

#[test]
fn a_primitive_without_a_material_has_the_default() {
    let mut document = triangle();
    document["meshes"][0]["primitives"][0].as_object_mut().expect("an object").remove("material");
    let scene = load_ok(&document);
    let material = &scene.materials[0];
    assert_eq!((material.bsdf, material.metallic, material.roughness), (Bsdf::MetallicRoughness, 1.0, 1.0));
}

fn textured(info: Value, extra: &[(&str, Value)]) -> Value {
    let mut bytes = triangle_bytes();
    bytes.extend([0, 0]);
    bytes.extend(floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]));
    let mut document = triangle_of(&bytes);
    set(&mut document, "/bufferViews/-", json!({"buffer": 0, "byteOffset": 44, "byteLength": 24}));
    set(&mut document, "/accessors/-", json!({"bufferView": 2, "componentType": 5126, "type": "VEC2", "count": 3}));
    set(&mut document, "/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(2));
    set(&mut document, "/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": info}));
    set(&mut document, "/textures", json!([{"source": 0, "sampler": 0}]));
    set(&mut document, "/samplers", json!([{"magFilter": 9728, "minFilter": 9987, "wrapS": 33071, "wrapT": 33648}]));
    set(&mut document, "/images", json!([{"uri": data_uri(&png(2, 1, [10, 20, 30, 255]))}]));
    for (pointer, value) in extra {
        set(&mut document, pointer, value.clone());
    }
    document
}

#[test]
fn textures_and_samplers() {
    let scene = load_ok(&textured(json!({"index": 0}), &[]));
    let texture = scene.textures[scene.materials[0].base_color_texture.expect("a texture").texture];
    assert_eq!(
        (texture.wrap_u, texture.wrap_v, texture.filter),
        (Wrap::ClampToEdge, Wrap::MirroredRepeat, Filter::Nearest)
    );
    let image = &scene.images[texture.image];
    assert_eq!((image.width, image.height), (2, 1));
    assert!(matches!(&image.texels, Texels::Rgba8(texels) if texels[..] == [[10, 20, 30, 255]; 2]));
    assert!(primitive(&scene).texcoords.is_some());
}

#[test]
fn textures_that_cannot_be_honoured_leave_their_factor() {
    for (set, message) in [(1, "without TEXCOORD_1"), (2, "TEXCOORD_2 and higher")] {
        let scene = load_ok(&textured(json!({"index": 0, "texCoord": set}), &[]));
        assert!(scene.images.is_empty() && scene.materials[0].base_color_texture.is_none());
        assert!(scene.warnings.iter().any(|warning| warning.contains(message)), "{:?}", scene.warnings);
        assert!(primitive(&scene).texcoords.is_none(), "coordinates that no texture uses are not loaded");
    }
}

/// Nothing is loaded that no ray can need: a broken image or mesh that nothing shows is not even looked at.
#[test]
fn what_is_not_used_is_not_read() {
    let broken_mesh = json!({"primitives": [{"attributes": {"POSITION": 99}}]});
    let document = textured(
        json!({"index": 0}),
        &[
            ("/images/-", json!({"uri": "missing.png"})),
            ("/meshes/-", broken_mesh),
            ("/buffers/-", json!({"byteLength": 9, "uri": "missing.bin"})),
        ],
    );
    assert_eq!(load_ok(&document).images.len(), 1);
}

#[test]
fn each_missing_feature_is_one_warning() {
    let material = json!({"occlusionTexture": {"index": 0}, "alphaMode": "DITHER",
        "extensions": {"KHR_materials_clearcoat": {}, "KHR_materials_transmission": {"transmissionFactor": 1},
                       "KHR_materials_sheen": {}}});
    let part =
        |material: u32| json!({"attributes": {"POSITION": 0}, "indices": 1, "material": material, "targets": [{}]});
    let scene = load_ok(&triangle_with(&[
        ("/materials", json!([material, material])),
        ("/meshes/0/primitives", json!([part(0), part(1)])),
        ("/nodes/0/skin", json!(0)),
        ("/animations", json!([{}])),
        ("/extensionsUsed", json!(["KHR_materials_clearcoat", "KHR_materials_sheen", "EXT_of_the_future"])),
    ]));
    let subjects = [
        "alphaMode DITHER",
        "KHR_materials_clearcoat",
        "KHR_materials_sheen",
        "morph",
        "skins",
        "animations",
        "EXT_of_the_future",
    ];
    for subject in subjects {
        let lines: Vec<&String> = scene.warnings.iter().filter(|warning| warning.contains(subject)).collect();
        assert_eq!(lines.len(), 1, "{subject}: {:?}", scene.warnings);
    }
    assert_eq!(scene.warnings.len(), subjects.len(), "{:?}", scene.warnings);
    let alpha = scene.warnings.iter().find(|warning| warning.contains("alphaMode")).expect("it is there");
    assert!(alpha.contains("2 times"), "{alpha}");
    assert_eq!((scene.materials[0].bsdf, scene.materials[0].transmission), (Bsdf::MetallicRoughness, 1.0));
}

#[test]
fn alpha_modes_with_their_cutoffs() {
    let alpha = |material: Value| {
        let scene = load_ok(&triangle_with(&[
            ("/materials", json!([material])),
            ("/meshes/0/primitives/0/material", json!(0)),
        ]));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        (scene.materials[0].alpha_mode, scene.materials[0].alpha)
    };
    let faded = json!({"baseColorFactor": [0, 0, 0, 0.25]});
    let mask = |cutoff| AlphaMode::Mask { cutoff };
    assert_eq!(alpha(json!({})), (AlphaMode::Opaque, 1.0));
    assert_eq!(alpha(json!({"pbrMetallicRoughness": faded})), (AlphaMode::Opaque, 0.25));
    assert_eq!(alpha(json!({"pbrMetallicRoughness": faded, "alphaMode": "BLEND"})), (AlphaMode::Blend, 0.25));
    assert_eq!(alpha(json!({"alphaMode": "MASK"})), (mask(0.5), 1.0));
    assert_eq!(alpha(json!({"alphaMode": "MASK", "alphaCutoff": 1.5})), (mask(1.5), 1.0));
    // The cutoff of another mode means nothing.
    assert_eq!(alpha(json!({"alphaMode": "BLEND", "alphaCutoff": 0.1})), (AlphaMode::Blend, 1.0));
    let negative = json!([{"alphaMode": "MASK", "alphaCutoff": -0.5}]);
    let document = triangle_with(&[("/materials", negative), ("/meshes/0/primitives/0/material", json!(0))]);
    assert!(load_error(&document).to_string().contains("/materials/0/alphaCutoff"));
}

#[test]
fn normals_that_are_none_make_the_mesh_flat() {
    let mut bytes = triangle_bytes();
    bytes.extend([0, 0]);
    bytes.extend(floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
    let mut document = triangle_of(&bytes);
    set(&mut document, "/bufferViews/-", json!({"buffer": 0, "byteOffset": 44, "byteLength": 36}));
    set(&mut document, "/accessors/-", json!({"bufferView": 2, "componentType": 5126, "type": "VEC3", "count": 3}));
    set(&mut document, "/meshes/0/primitives/0/attributes/NORMAL", json!(2));
    let scene = load_ok(&document);
    assert!(primitive(&scene).normals.is_none());
    assert_eq!(scene.warnings.len(), 1);
}

#[test]
fn environments_of_scene_extras() {
    let extras = |environment: Value| ("/scenes/0/extras", json!({"sunfleck": {"environment": environment}}));
    let scene = load_ok(&triangle_with(&[extras(json!({"color": [1, 2, 3], "strength": 2}))]));
    assert!(matches!(scene.environment, Environment::Constant([2.0, 4.0, 6.0])));
    let folder = Folder::new();
    folder.write("sky.png", png(4, 2, [255, 255, 255, 255]));
    let document = triangle_with(&[extras(json!({"file": "sky.png", "rotation_degrees": 180}))]);
    let scene = load_scene(&folder.write("test.gltf", document.to_string())).unwrap_or_else(|error| panic!("{error}"));
    let Environment::Image { width: 4, height: 2, texels, rotation_radians, .. } = scene.environment else {
        panic!("{:?}", scene.environment)
    };
    assert!(texels.iter().all(|texel| *texel == [1.0; 3]));
    assert_eq!(rotation_radians, std::f64::consts::PI);
}

#[test]
fn a_scene_without_camera_and_light_is_completed() {
    let mut scene = load_ok(&triangle());
    scene.frame_if_no_camera();
    scene.light_if_dark();
    assert_eq!((scene.cameras.len(), scene.notes.len()), (1, 2));
    assert!(matches!(scene.environment, Environment::Constant([1.0, 1.0, 1.0])));
    scene.validate().expect("a completed scene is valid");
    // Every corner lies within the square in the middle of the film.
    let camera = &scene.cameras[0];
    let Projection::Perspective { yfov_radians } = camera.projection else { panic!("{camera:?}") };
    for corner in CORNERS {
        let seen = camera.camera_to_world.inverse().transform_point3(DVec3::from(corner.map(f64::from)));
        let limit = -seen.z * (0.5 * yfov_radians).tan();
        assert!(seen.z < 0.0 && seen.x.abs() <= limit && seen.y.abs() <= limit, "{seen}");
    }
    let mut cornell = resolve("cornell").expect("the built-in scene");
    cornell.frame_if_no_camera();
    cornell.light_if_dark();
    assert!(cornell.notes.is_empty());
}

/// The scenes of the project itself load without a warning, with a camera and light.
#[test]
fn our_own_scenes() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("the folder of scenes").flatten() {
        if entry.path().extension().is_none_or(|extension| extension != "gltf") {
            continue;
        }
        let mut scene = load_scene(&entry.path()).unwrap_or_else(|error| panic!("{error}"));
        scene.validate().expect("valid");
        scene.frame_if_no_camera();
        scene.light_if_dark();
        assert!(scene.warnings.is_empty() && scene.notes.is_empty(), "{:?} {:?}", scene.warnings, scene.notes);
        count += 1;
    }
    assert!(count >= 14, "{count} scenes");
    assert_eq!(builtin::names(), ["cornell", "bumpy"]);
}
