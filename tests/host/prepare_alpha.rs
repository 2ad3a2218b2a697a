//! What preparation makes of alpha: a flag on the triangles that traversal must ask, and nothing where the answer is known.

use crate::prepare_support::*;
use glam::DAffine3;
use sunfleck::layout::*;
use sunfleck::prepare::Prepared;
use sunfleck::scene::{AlphaMode, Filter, Image, Material, Primitive, Scene, Texels, Texture, TextureBinding, Wrap};

const UNIT: TriangleVertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// An opaque triangle, and one of `material` behind it whose texture, if any, has the given texels.
fn prepared_with(mut material: Material, texels: Option<Texels>) -> Prepared {
    let mut scene = scene_of(&[UNIT], &[DAffine3::IDENTITY]);
    if let Some(texels) = texels {
        let width = match &texels {
            Texels::Rgba8(texels) => texels.len(),
            Texels::Rgba16(texels) => texels.len(),
        };
        scene.images.push(Image { name: String::new(), width: width as u32, height: 1, texels }.into());
        let (wrap_u, wrap_v) = (Wrap::Repeat, Wrap::Repeat);
        scene.textures.push(Texture { image: 0, wrap_u, wrap_v, filter: Filter::Linear });
        material.base_color_texture = Some(TextureBinding::new(0));
    }
    scene.materials.push(material);
    let behind: Primitive = soup(&[UNIT.map(|[x, y, _]| [x, y, -1.0])], 1);
    scene.meshes[0].primitives.push(behind);
    prepared(&scene)
}

/// Whether the triangles of the second material are marked, and the flags of its record.
fn flags(prepared: &Prepared) -> Vec<(bool, u32)> {
    let triangles = prepared.triangle_slots(&prepared.meshes[0]).map(|number| prepared.triangle(number));
    let record = |kind: u32| {
        let first = prepared.constants.materials + MATERIAL_TEXELS * (kind & TRIANGLE_INDEX_MASK);
        let texels = &prepared.arrays[SceneArray::Tables as usize][first as usize..][..MATERIAL_TEXELS as usize];
        *bytemuck::from_bytes::<sunfleck::layout::Material>(bytemuck::cast_slice(texels))
    };
    let modes = MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND;
    let second = triangles.filter(|triangle| triangle.vertices[0][2] != leaf_plane(prepared)).map(|t| t.record.kind);
    second.map(|kind| (kind & TRIANGLE_ALPHA != 0, record(kind).kind_flags & modes)).collect()
}

/// z of the opaque triangle in rebased space.
fn leaf_plane(prepared: &Prepared) -> f32 {
    -prepared.origin.z as f32
}

fn material(alpha_mode: AlphaMode, alpha: f32) -> Material {
    Material { alpha_mode, alpha, ..Material::lambertian("sheet", [0.0; 3]) }
}

/// By the order of its vertices traversal tells a leaf that it must ask about, without a look at the triangles' records.
#[test]
fn leaves_with_alpha_begin_with_the_larger_vertex() {
    let mut scene = scene_of(&[UNIT], &[DAffine3::IDENTITY]);
    scene.materials.push(material(AlphaMode::Blend, 0.5));
    let mut random = crate::common::random::Random(5);
    for index in 0..40 {
        let [a, b, c, d] = [0; 4].map(|_| [0; 3].map(|_| (random.unit() as f32 * 4.0).floor() - 2.0));
        let pair = [[0, 1, 2], [0, 2, 3]][..1 + index / 2 % 2].to_vec();
        scene.meshes[0].primitives.push(Primitive { triangles: pair, ..soup(&[[a, b, c], [d, d, d]], index % 2) });
        let positions = &mut scene.meshes[0].primitives.last_mut().expect("it was added").positions;
        positions.truncate(4);
    }
    let prepared = prepared(&scene);
    let words = |vertex: [f32; 3]| vertex.map(f32::to_bits);
    let mut seen = [0; 4];
    for number in prepared.triangle_slots(&prepared.meshes[0]) {
        let (first, alpha) =
            (prepared.triangle(number & !1), prepared.triangle(number).record.kind & TRIANGLE_ALPHA != 0);
        assert_eq!(words(first.vertices[0]) > words(first.vertices[2]), alpha, "{first:?}");
        seen[usize::from(alpha) + 2 * (number & 1) as usize] += 1;
    }
    assert!(seen.iter().all(|&count| count > 3), "one or two triangles, with alpha and without: {seen:?}");
}

const MASK: AlphaMode = AlphaMode::Mask { cutoff: 0.5 };

#[test]
fn constant_alpha_is_decided_beforehand_where_it_can_be() {
    let opaque = vec![(false, 0)];
    let cases = [
        (AlphaMode::Opaque, 0.0, opaque.clone()),
        (AlphaMode::Blend, 1.0, opaque.clone()),
        (AlphaMode::Blend, 0.0, vec![]),
        (AlphaMode::Blend, 0.5, vec![(true, MATERIAL_ALPHA_BLEND)]),
        (MASK, 0.5, opaque.clone()),
        (MASK, 0.49, vec![]),
        (AlphaMode::Mask { cutoff: 0.0 }, 0.0, opaque),
        (AlphaMode::Mask { cutoff: 1.01 }, 1.0, vec![]),
    ];
    for (mode, alpha, expected) in cases {
        let prepared = prepared_with(material(mode, alpha), None);
        assert_eq!(flags(&prepared), expected, "{mode:?} of {alpha}");
        assert_eq!(prepared.features.alpha, expected.iter().any(|(asks, _)| *asks));
        assert_eq!(prepared.statistics.triangles as usize, 1 + expected.len());
    }
}

#[test]
fn the_texels_say_whether_a_texture_is_asked() {
    let rgba8 = |alphas: &[u8]| Texels::Rgba8(alphas.iter().map(|a| [255, 255, 255, *a]).collect());
    let rgba16 = |alphas: &[u16]| Texels::Rgba16(alphas.iter().map(|a| [0, 0, 0, *a]).collect());
    let opaque = vec![(false, 0)];
    let (blend, mask) = (vec![(true, MATERIAL_ALPHA_BLEND)], vec![(true, MATERIAL_ALPHA_MASK)]);
    let cases = [
        (AlphaMode::Blend, 1.0, rgba8(&[255, 255, 255]), opaque.clone()),
        (AlphaMode::Blend, 1.0, rgba8(&[255, 254, 255]), blend.clone()),
        (AlphaMode::Blend, 0.9, rgba8(&[255]), blend.clone()),
        (AlphaMode::Blend, 1.0, rgba16(&[65535, 65535]), opaque.clone()),
        (AlphaMode::Blend, 1.0, rgba16(&[65535, 65534]), blend),
        (AlphaMode::Blend, 1.0, rgba8(&[0, 0]), vec![]),
        (MASK, 1.0, rgba8(&[128, 255]), opaque),
        (MASK, 1.0, rgba8(&[127, 128]), mask.clone()),
        (MASK, 0.9, rgba8(&[128, 255]), mask),
        (MASK, 1.0, rgba8(&[0, 127]), vec![]),
    ];
    for (mode, alpha, texels, expected) in cases {
        let prepared = prepared_with(material(mode, alpha), Some(texels.clone()));
        assert_eq!(flags(&prepared), expected, "{mode:?} of {alpha} × {texels:?}");
        // The base colour is black: the texture is there for its alpha, or not at all.
        assert_eq!(prepared.features.textures, prepared.features.alpha, "{mode:?} of {alpha} × {texels:?}");
    }
}

/// What is nowhere there is no light, and brings none of its features; a mesh of nothing else is no instance.
#[test]
fn what_is_nowhere_leaves_nothing() {
    let lamp = Material { emission: [1.0; 3], ..material(AlphaMode::Blend, 0.0) };
    let scene = Scene { materials: vec![lamp], ..scene_of(&[UNIT], &[DAffine3::IDENTITY; 2]) };
    let prepared = prepared(&scene);
    assert_eq!((prepared.statistics.triangles, prepared.constants.light_count), (0, 0));
    assert!(prepared.instances.is_empty() && prepared.features.kept().is_empty(), "{:?}", prepared.features.kept());
}

/// Lights are weighed by what is there of them.
#[test]
fn a_faint_lamp_is_picked_seldom() {
    let lamp = Material { emission: [1.0; 3], ..material(AlphaMode::Blend, 0.25) };
    let other = Material { emission: [1.0; 3], ..material(AlphaMode::Opaque, 0.25) };
    let mut scene = scene_of(&[UNIT], &[DAffine3::IDENTITY]);
    scene.materials = vec![lamp, other];
    scene.meshes[0].primitives.push(soup(&[UNIT.map(|[x, y, _]| [x, y, -1.0])], 1));
    let prepared = prepared(&scene);
    let word = |i: u32| prepared.arrays[SceneArray::Tables as usize].as_flattened()[i as usize];
    let first = word(prepared.constants.light_cdf_word + 1);
    let share = f64::from(first) / f64::from(CDF_TOTAL);
    assert!((share - 0.2).abs() < 1e-6, "{share}");
}
