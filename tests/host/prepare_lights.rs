//! Lights: which there are, where they are, and how often each is picked.

use std::f64::consts::PI;

use crate::prepare_support::*;
use glam::{DAffine3, DVec3};
use proptest::prelude::*;
use sunfleck::layout::*;
use sunfleck::prepare::{LightChoice, PrepareOptions, Prepared, cdf, prepare, spot_falloff, spot_solid_angle};
use sunfleck::scene::{
    Bsdf, Environment, Filter, Image, Instance, Material, PunctualKind, PunctualLight, Scene, Texels, Texture,
    TextureBinding, Wrap,
};

#[test]
fn a_guide_bounds_the_search_for_every_count() {
    let random = |seed: u64, n: usize| {
        (0..n as u64).map(|i| ((i * 2_654_435_761 + seed * 40_503) % 1009) as f64 / 1009.0).collect::<Vec<_>>()
    };
    let sun = |n: usize| (0..n).map(|i| if i == n / 3 { 1e9 } else { f64::from(u8::from(i % 2 == 0)) }).collect();
    for weights in
        [vec![1.0], vec![1.0, 2.0], vec![0.0, 0.0, 1.0], random(1, 5), random(2, 64), random(3, 1000), sun(500)]
    {
        let table = cdf::build(&weights);
        let guide = cdf::guide(&table);
        assert_eq!(guide.len(), cdf::guide_words(weights.len()));
        let buckets = guide.len() as u64 - 1;
        assert!(buckets.is_power_of_two());
        let shift = CDF_TOTAL.ilog2() - buckets.ilog2();
        // The first and the last count of each bin and of each bucket.
        let starts = table.iter().map(|&start| u64::from(start)).chain((0..=buckets).map(|b| b << shift));
        for x in starts.flat_map(|x| [x, x.saturating_sub(1)]).filter(|&x| x < u64::from(CDF_TOTAL)) {
            let bin = table[..weights.len()].iter().rposition(|&start| u64::from(start) <= x).unwrap() as u32;
            let bucket = (x >> shift) as usize;
            assert!((guide[bucket]..=guide[bucket + 1]).contains(&bin), "{weights:?}: count {x}");
        }
    }
}

proptest! {
    #[test]
    fn a_cdf_is_exact(weights in prop::collection::vec(
        prop_oneof![Just(0.0), 0.0..1.0f64, (-300.0..300.0f64).prop_map(|e| 10f64.powf(e)), Just(5e-324)], 0..200)) {
        let table = cdf::build(&weights);
        prop_assert_eq!(table.len(), weights.len() + 1);
        prop_assert_eq!(table[0], 0);
        let positive = weights.iter().filter(|&&w| w > 0.0).count();
        prop_assert_eq!(*table.last().unwrap(), if positive > 0 { CDF_TOTAL } else { 0 });
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let total: f64 = weights.iter().map(|w| w / largest).sum();
        for (bin, &weight) in weights.iter().enumerate() {
            prop_assert!(table[bin] <= table[bin + 1]);
            let count = cdf::count(&table, bin);
            prop_assert_eq!(count > 0, weight > 0.0);
            if weight > 0.0 {
                let share = weight / largest / total * f64::from(CDF_TOTAL);
                prop_assert!((f64::from(count) - share).abs() <= positive as f64 + 2.0);
            }
        }
    }
}

fn lights(prepared: &Prepared) -> Vec<Light> {
    let tables = &prepared.arrays[SceneArray::Tables as usize];
    let first = prepared.constants.lights as usize;
    let texels = &tables[first..][..prepared.constants.light_count as usize * LIGHT_TEXELS as usize];
    bytemuck::cast_slice(texels).to_vec()
}

fn light_cdf(prepared: &Prepared) -> Vec<u32> {
    let words = prepared.arrays[SceneArray::Tables as usize].as_flattened();
    words[prepared.constants.light_cdf_word as usize..][..=prepared.constants.light_count as usize].to_vec()
}

fn by_power(scene: &Scene) -> Prepared {
    prepare(scene, &PrepareOptions { light_choice: LightChoice::Power, ..PrepareOptions::default() }).unwrap()
}

fn light_of(prepared: &Prepared, number: u32) -> Option<u32> {
    prepared.triangle(number).light
}

const UNIT: TriangleVertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn emitter(emission: [f32; 3]) -> Material {
    Material { emission, ..Material::lambertian("lamp", [0.0; 3]) }
}

/// One mesh with a grey and an emissive triangle.
fn lamp_scene(transforms: &[DAffine3], material: Material) -> Scene {
    let mut scene = scene_of(&[UNIT.map(|[x, y, z]| [x, y, z - 1.0])], transforms);
    scene.materials.push(material);
    scene.meshes[0].primitives.push(soup(&[UNIT, UNIT.map(|[x, y, z]| [2.0 * x, 2.0 * y, z + 1.0])], 1));
    scene
}

#[test]
fn baked_triangles_know_their_light_and_lights_their_slot() {
    let prepared = prepared(&lamp_scene(&[DAffine3::IDENTITY], emitter([2.0; 3])));
    let lights = lights(&prepared);
    assert_eq!(lights.len(), 2);
    for (index, light) in lights.iter().enumerate() {
        assert_eq!((light.kind, light.instance), (LIGHT_TRIANGLE, NONE));
        assert_eq!(light_of(&prepared, light.slot), Some(index as u32));
    }
    let table = light_cdf(&prepared);
    let ratio = cdf::probability(&table, 1) / cdf::probability(&table, 0);
    assert!((ratio - 4.0).abs() < 1e-6, "powers are as areas: {ratio}");
    assert_eq!(prepared.features.lights, 1 << LIGHT_TRIANGLE);
    let dark = prepared.triangle_slots(&prepared.meshes[0]).filter(|&slot| light_of(&prepared, slot).is_none()).count();
    assert_eq!(dark, 1);
}

#[test]
fn instances_have_lights_of_their_own() {
    let transforms = [1.0, 2.0, 3.0].map(|s| {
        DAffine3::from_scale_rotation_translation(
            DVec3::splat(s),
            glam::DQuat::from_rotation_x(s),
            DVec3::splat(10.0 * s),
        )
    });
    let prepared = by_power(&lamp_scene(&transforms, emitter([1.0; 3])));
    let lights = lights(&prepared);
    assert_eq!(lights.len(), 6);
    let table = light_cdf(&prepared);
    for (index, instance) in prepared.instances.iter().enumerate() {
        for ordinal in 0..2 {
            let number = (instance.record.first_light + ordinal) as usize;
            assert_eq!(lights[number].instance, index as u32);
            assert_eq!(light_of(&prepared, lights[number].slot), Some(ordinal));
            let scale = [1.0, 2.0, 3.0][instance.source];
            let area = 0.5 * scale * scale * [1.0, 4.0][ordinal as usize];
            let expected = area / (0.5 * 5.0 * 14.0);
            assert!((cdf::probability(&table, number) - expected).abs() < 1e-6);
        }
    }
}

#[test]
fn what_cannot_emit_is_no_light() {
    let black = lamp_scene(&[DAffine3::IDENTITY], emitter([0.0; 3]));
    assert_eq!(lights(&prepared(&black)).len(), 0);
    let unlit = Material { bsdf: Bsdf::Unlit, ..emitter([1.0; 3]) };
    assert_eq!(lights(&prepared(&lamp_scene(&[DAffine3::IDENTITY], unlit))).len(), 0);
    let mut flat = scene_of(&[[[0.0; 3], [1.0; 3], [2.0; 3]], [[1.0; 3]; 3]], &[DAffine3::IDENTITY]);
    flat.materials[0] = emitter([1.0; 3]);
    let flat = prepared(&flat);
    assert_eq!((lights(&flat).len(), flat.statistics.triangles), (0, 0));
    assert_eq!(light_cdf(&flat), [0]);
}

#[test]
fn two_sided_emitters_have_twice_the_power() {
    let mut scene = lamp_scene(&[DAffine3::IDENTITY], emitter([1.0; 3]));
    scene.materials.push(Material { double_sided: true, ..emitter([1.0; 3]) });
    scene.materials.push(Material { double_sided: true, black_back: true, ..emitter([1.0; 3]) });
    scene.meshes[0].primitives = vec![soup(&[UNIT], 1), soup(&[UNIT], 2), soup(&[UNIT], 3)];
    let table = light_cdf(&by_power(&scene));
    for (bin, expected) in [0.25, 0.5, 0.25].into_iter().enumerate() {
        assert!((cdf::probability(&table, bin) - expected).abs() < 1e-6);
    }
}

/// A 64×64 image, black but for one texel.
fn textured_lamp(texcoords: Vec<[f32; 2]>, wrap: Wrap) -> Scene {
    let mut texels = vec![[0, 0, 0, 255]; 64 * 64];
    texels[10 * 64 + 20] = [255; 4];
    let mut scene = scene_of(&[UNIT, UNIT], &[DAffine3::IDENTITY]);
    scene.images.push(Image { name: "glow".into(), width: 64, height: 64, texels: Texels::Rgba8(texels) }.into());
    scene.textures.push(Texture { image: 0, wrap_u: wrap, wrap_v: wrap, filter: Filter::Linear });
    scene.materials[0] = Material { emission_texture: Some(TextureBinding::new(0)), ..emitter([1.0; 3]) };
    scene.meshes[0].primitives[0].texcoords = Some(texcoords);
    scene
}

#[test]
fn a_textured_triangle_is_a_light_where_its_texels_are_bright() {
    let dark = [[0.7, 0.7], [0.9, 0.7], [0.7, 0.9]];
    let bright = [[0.2, 0.1], [0.4, 0.1], [0.2, 0.3]];
    // The bright texel is at (20, 10)/64 = (0.31, 0.16); shifted by whole periods it is the same for Repeat.
    let shifted = bright.map(|[u, v]| [u + 3.0, v - 2.0]);
    let mirrored = bright.map(|[u, v]| [2.0 - u, -v]);
    for (second, wrap) in [(bright, Wrap::ClampToEdge), (shifted, Wrap::Repeat), (mirrored, Wrap::MirroredRepeat)] {
        let texcoords = dark.iter().chain(&second).copied().collect();
        let prepared = prepared(&textured_lamp(texcoords, wrap));
        let lights = lights(&prepared);
        assert_eq!(lights.len(), 1, "{wrap:?}");
        assert_eq!(prepared.triangle(lights[0].slot).record.vertices, [3, 4, 5], "the second");
        assert!(prepared.features.emission_textures);
    }
    let all_dark = prepared(&textured_lamp(dark.iter().chain(&dark).copied().collect(), Wrap::Repeat));
    assert_eq!(lights(&all_dark).len(), 0);
}

#[test]
fn a_black_emission_texture_is_not_stored() {
    let mut scene = textured_lamp(vec![[0.0; 2]; 6], Wrap::Repeat);
    let black = Texels::Rgba8(vec![[0, 0, 0, 255]; 64 * 64]);
    scene.images[0] = Image { texels: black, ..(*scene.images[0]).clone() }.into();
    let prepared = prepared(&scene);
    assert!(!prepared.features.emission && !prepared.features.textures);
    assert_eq!(prepared.statistics.array_bytes[SceneArray::Texels as usize], 16);
}

fn punctual(kind: PunctualKind) -> PunctualLight {
    PunctualLight {
        name: "light".into(),
        kind,
        intensity: [1.0; 3],
        position: DVec3::new(1.0, 2.0, 3.0),
        direction: DVec3::NEG_Y,
    }
}

#[test]
fn punctual_lights_and_the_environment_follow() {
    let mut scene = lamp_scene(&[DAffine3::IDENTITY], emitter([1.0; 3]));
    let spot = PunctualKind::Spot { inner_cone_radians: 0.3, outer_cone_radians: 0.6 };
    scene.lights = [PunctualKind::Point, spot, PunctualKind::Directional].map(punctual).to_vec();
    scene.lights.push(PunctualLight { intensity: [0.0; 3], ..punctual(PunctualKind::Point) });
    scene.environment = Environment::Constant([1.0; 3]);
    let with = prepared(&scene);
    let lights_with = lights(&with);
    let kinds: Vec<u32> = lights_with.iter().map(|light| light.kind).collect();
    assert_eq!(kinds, [LIGHT_TRIANGLE, LIGHT_TRIANGLE, LIGHT_POINT, LIGHT_SPOT, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT]);
    assert_eq!(with.constants.environment_light, 5);
    assert_eq!(DVec3::from(lights_with[2].position.map(f64::from)) + with.origin, DVec3::new(1.0, 2.0, 3.0));
    let options = PrepareOptions { sample_environment: false, ..PrepareOptions::default() };
    let without = prepare(&scene, &options).unwrap();
    assert_eq!((without.constants.light_count, without.constants.environment_light), (5, NONE));
    assert_eq!(without.constants.environment_radiance, [1.0; 3], "seen, not sampled");
}

#[test]
fn spot_solid_angle_is_the_integral_of_the_falloff() {
    for (inner, outer) in [(0.0, 0.5), (0.3, 0.6), (0.2, PI / 2.0), (0.0, 1e-3), (0.499_999, 0.5), (0.02, 0.021)] {
        let (scale, offset) = spot_falloff(inner, outer);
        let steps = 200_000;
        let sum: f64 = (0..steps)
            .map(|i| {
                let cos_theta = 1.0 - (1.0 - outer.cos()) * (f64::from(i) + 0.5) / f64::from(steps);
                (cos_theta * scale + offset).clamp(0.0, 1.0).powi(2)
            })
            .sum();
        let integral = 2.0 * PI * sum * (1.0 - outer.cos()) / f64::from(steps);
        let closed = spot_solid_angle(inner, outer);
        assert!((closed / integral - 1.0).abs() < 1e-4, "{inner} {outer}: {closed} {integral}");
    }
}

#[test]
fn an_instance_without_lights_keeps_the_next_ones_base() {
    let mut scene = lamp_scene(&[DAffine3::IDENTITY, DAffine3::from_translation(DVec3::X * 5.0)], emitter([1.0; 3]));
    scene.meshes.push(scene.meshes[0].clone());
    scene.meshes[1].primitives.truncate(1);
    for i in 0..2 {
        let object_to_world = DAffine3::from_translation(DVec3::Y * (7.0 + f64::from(i)));
        scene.instances.push(Instance { mesh: 1, object_to_world, name: String::new() });
    }
    let prepared = prepared(&scene);
    assert_eq!(prepared.instances.len(), 4);
    let bases: Vec<u32> = prepared.instances.iter().map(|i| i.record.first_light).collect();
    assert_eq!(bases, [0, 2, 4, 4]);
}
