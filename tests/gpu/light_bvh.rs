//! The light BVH as the shader walks it: probabilities add up, picks follow them, no light that arrives is left out, and
//! images are those that other choices of light give.

use crate::common::builder::mean;
use crate::common::gpu;
use crate::common::kernel::{Random, TestKernel, empty_scene, vector_texel};
use crate::common::scenes::{scene, short_form};
use crate::common::statistics::{Estimate, assert_agree, chi_square_test, sidak};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use sunfleck::layout::{self, NONE, SceneArray};
use sunfleck::render::{LightChoice, LightSampling, Settings};
use sunfleck::scene::{Bsdf, Environment, Instance, Material, Mesh, Primitive, PunctualKind, PunctualLight, Scene};

/// Level of each test here.
const ALPHA: f64 = 0.01;

/// Triangles whose sizes are spread over so many decades below 1.
fn lamps(random: &mut Random, count: usize, spread: f64, decades: f64) -> Primitive {
    let mut primitive = Primitive::default();
    for i in 0..count as u32 {
        let center = random.point(spread);
        let size = 10.0_f64.powf(random.between(-decades, 0.0));
        let corners: [[f32; 3]; 3] = [(); 3].map(|()| (center + size * random.direction()).as_vec3().into());
        primitive.positions.extend(corners);
        primitive.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    primitive
}

/// Lamps of both kinds, baked, instanced, stretched and mirrored; points and spots; a directional light and a constant
/// environment unless `near` is set. Powers over `decades`.
fn everything(seed: u64, decades: f64, near: bool) -> Scene {
    let mut random = Random(seed);
    let mut material = |double_sided: bool| {
        let strength = 10.0_f64.powf(random.between(-decades, 0.0)) as f32;
        Material { emission: [strength; 3], double_sided, ..Material::lambertian("lamp", [0.5; 3]) }
    };
    let mut scene = empty_scene();
    scene.materials = (0..6).map(|i| material(i % 2 == 1)).collect();
    for mesh in 0..3 {
        let mut primitives = vec![lamps(&mut random, 12, 1.5, 3.0), lamps(&mut random, 3, 0.1, 3.0)];
        primitives.iter_mut().enumerate().for_each(|(i, primitive)| primitive.material = 2 * mesh + i);
        scene.meshes.push(Mesh { name: format!("lamps {mesh}"), primitives });
        // One placement is baked, several are instances.
        for place in 0..=mesh {
            let mirror = if place == 1 { -1.0 } else { 1.0 };
            let stretch = DMat3::from_diagonal(DVec3::new(mirror, random.between(0.3, 2.0), 1.0));
            let turn = DMat3::from_quat(DQuat::from_axis_angle(random.direction(), 2.0));
            let object_to_world = DAffine3::from_mat3_translation(turn * stretch, random.point(4.0));
            scene.instances.push(Instance { mesh, object_to_world, name: String::new() });
        }
    }
    for i in 0..12 {
        let outer = random.between(0.1, 1.5);
        let spot = PunctualKind::Spot { inner_cone_radians: outer * random.unit(), outer_cone_radians: outer };
        scene.lights.push(PunctualLight {
            name: String::new(),
            kind: if i % 3 == 0 { PunctualKind::Point } else { spot },
            intensity: [10.0_f64.powf(random.between(-decades, 0.0)) as f32; 3],
            position: random.point(4.0),
            direction: random.direction(),
        });
    }
    if !near {
        let sun = PunctualLight {
            name: String::new(),
            kind: PunctualKind::Directional,
            intensity: [0.3; 3],
            position: DVec3::ZERO,
            direction: random.direction(),
        };
        scene.lights.insert(0, sun);
        scene.environment = Environment::Constant([0.05; 3]);
    }
    scene
}

/// A point and a normal; without the latter light arrives from everywhere.
type Receiver = (DVec3, DVec3);

fn receivers(random: &mut Random, count: usize, spread: f64) -> Vec<Receiver> {
    let normal = |random: &mut Random, i: usize| if i % 5 == 4 { DVec3::ZERO } else { random.direction() };
    let rounded = |v: DVec3| v.as_vec3().as_dvec3();
    (0..count).map(|i| (rounded(random.point(spread)), rounded(normal(random, i)))).collect()
}

/// What the kernel gives a lane.
struct Answer {
    /// Of the light asked for.
    probability: f64,
    /// The light picked, or [`NONE`].
    picked: u32,
    picked_probability: f64,
    rest: f64,
}

/// Asks for (receiver, light) with random numbers for the picks.
fn ask(kernel: &TestKernel, questions: &[(Receiver, usize)], random: &mut Random) -> Vec<Answer> {
    let mut word = || (random.bits() >> 32) as u32;
    let mut inputs = Vec::new();
    for ((point, normal), light) in questions {
        let slack = if *normal == DVec3::ZERO { 1.0_f32 } else { 0.0 };
        inputs.push(vector_texel(*point, *light as u32));
        inputs.push(vector_texel(*normal, slack.to_bits()));
        inputs.push([word(), word(), word(), 0]);
        inputs.push([word(), word(), word(), word()]);
    }
    let outputs = kernel.run(&inputs, questions.len(), 2);
    let float = |bits: u32| f64::from(f32::from_bits(bits));
    let answer = |t: &[[u32; 4]]| Answer {
        probability: float(t[0][0]),
        picked: t[0][1],
        picked_probability: float(t[0][2]),
        rest: float(t[0][3]),
    };
    outputs.chunks_exact(2).map(answer).collect()
}

fn kernel(scene: &Scene) -> TestKernel {
    let kernel = TestKernel::with_choice("light_bvh.comp", scene, LightChoice::Bvh).specialize(4, !16);
    assert_eq!(kernel.prepared.features.light_choice, LightChoice::Bvh);
    kernel
}

fn light_count(kernel: &TestKernel) -> usize {
    kernel.constants.light_count as usize
}

/// Probability of each light for a receiver.
fn probabilities(kernel: &TestKernel, receiver: Receiver) -> Vec<f64> {
    let questions: Vec<_> = (0..light_count(kernel)).map(|light| (receiver, light)).collect();
    ask(kernel, &questions, &mut Random(1)).iter().map(|answer| answer.probability).collect()
}

#[test]
fn picks_follow_their_probabilities() {
    const SAMPLES: usize = 1 << 15;
    let mut random = Random(11);
    for near in [false, true] {
        let kernel = kernel(&everything(3, 3.0, near));
        let receivers = receivers(&mut random, 10, 3.0);
        for (case, receiver) in receivers.iter().enumerate() {
            let probabilities = probabilities(&kernel, *receiver);
            let sum: f64 = probabilities.iter().sum();
            assert!(sum <= 1.0 + 1e-6 && probabilities.iter().all(|p| *p > 0.0), "{receiver:?}: {sum}");
            let samples = ask(&kernel, &vec![(*receiver, 0); SAMPLES], &mut random);
            // The last bin is for what picks nothing.
            let mut observed = vec![0; probabilities.len() + 1];
            let mut rests = [0; 16];
            for s in &samples {
                let bin = if s.picked == NONE { probabilities.len() } else { s.picked as usize };
                observed[bin] += 1;
                if s.picked != NONE {
                    assert!((s.picked_probability - probabilities[bin]).abs() == 0.0, "light {bin}: two probabilities");
                    rests[(s.rest * 16.0) as usize] += 1;
                }
            }
            let mut expected: Vec<f64> = probabilities.iter().map(|p| p * SAMPLES as f64).collect();
            expected.push((1.0 - sum).max(0.0) * SAMPLES as f64);
            let level = sidak(ALPHA, 40);
            let result = chi_square_test(&observed, &expected, SAMPLES as u64);
            assert!(result.p_value > level, "near {near}, case {case}: {result:?}");
            let picked: u64 = rests.iter().sum();
            let result = chi_square_test(&rests, &[picked as f64 / 16.0; 16], picked);
            assert!(result.p_value > level, "near {near}, case {case}: what is left is not uniform: {result:?}");
        }
    }
}

/// A light as brute force sees it.
struct BruteLight {
    corners: [DVec3; 3],
    normal: DVec3,
    two_sided: bool,
    record: layout::Light,
    intensity: f64,
}

fn brute_lights(kernel: &TestKernel) -> Vec<BruteLight> {
    let tables: &[[u32; 4]] = &kernel.prepared.arrays[SceneArray::Tables as usize];
    let first = kernel.constants.lights as usize;
    let texels = &tables[first..first + light_count(kernel) * layout::LIGHT_TEXELS as usize];
    let records: Vec<layout::Light> = bytemuck::pod_collect_to_vec(texels);
    records.iter().map(|record| brute_light(kernel, tables, *record)).collect()
}

fn brute_light(kernel: &TestKernel, tables: &[[u32; 4]], record: layout::Light) -> BruteLight {
    let position = Vec3::from(record.position).as_dvec3();
    let intensity = f64::from(record.intensity[0]);
    let mut light = BruteLight { corners: [position; 3], normal: DVec3::ZERO, two_sided: false, record, intensity };
    if record.kind == layout::LIGHT_TRIANGLE {
        let mut side = 1.0;
        light.corners = kernel.prepared.triangle(record.slot).vertices.map(|v| Vec3::from(v).as_dvec3());
        if record.instance != NONE {
            let instance = kernel.prepared.instances[record.instance as usize].record;
            let [x, y, z] = instance.object_to_world.map(|row| row.map(f64::from));
            let row = |r: [f64; 4], v: DVec3| r[0] * v.x + r[1] * v.y + r[2] * v.z + r[3];
            light.corners = light.corners.map(|v| DVec3::new(row(x, v), row(y, v), row(z, v)));
            side = if instance.mirrored == 0 { 1.0 } else { -1.0 };
        }
        let [a, b, c] = light.corners;
        let normal = (b - a).cross(c - a);
        light.normal = normal.normalize() * side;
        let material = (kernel.constants.materials + record.material * layout::MATERIAL_TEXELS) as usize;
        let material: layout::Material =
            bytemuck::pod_collect_to_vec(&tables[material..material + layout::MATERIAL_TEXELS as usize])[0];
        light.two_sided = material.kind_flags & layout::MATERIAL_DOUBLE_SIDED != 0;
        light.intensity = f64::from(material.emission[0]) * 0.5 * normal.length();
    }
    light
}

/// Irradiance from one point of a light; nothing from lights without a place.
fn irradiance(light: &BruteLight, (point, normal): Receiver, weights: DVec3) -> f64 {
    let [a, b, c] = light.corners;
    let offset = a * weights.x + b * weights.y + c * weights.z - point;
    let direction = offset.normalize();
    let arriving = if normal == DVec3::ZERO { 1.0 } else { direction.dot(normal).max(0.0) };
    let leaving = match light.record.kind {
        layout::LIGHT_TRIANGLE if light.two_sided => direction.dot(light.normal).abs(),
        layout::LIGHT_TRIANGLE => (-direction.dot(light.normal)).max(0.0),
        layout::LIGHT_POINT => 1.0,
        layout::LIGHT_SPOT => {
            let cosine = -direction.dot(Vec3::from(light.record.direction).as_dvec3());
            let ramp = cosine * f64::from(light.record.cone_scale) + f64::from(light.record.cone_offset);
            ramp.clamp(0.0, 1.0).powi(2)
        }
        _ => 0.0,
    };
    light.intensity * arriving * leaving / offset.length_squared()
}

/// A light that only keeps the one count that all have sends next to nothing, less than a share that 10⁵ counts would be,
/// wherever the receiver is: among the lights, far from them, or beside a corner of one.
#[test]
fn no_light_that_arrives_is_left_out() {
    let mut random = Random(17);
    for (seed, decades) in [(21, 1.0), (22, 12.0)] {
        let kernel = kernel(&everything(seed, decades, true));
        let lights = brute_lights(&kernel);
        let mut all = receivers(&mut random, 40, 4.0);
        all.extend(receivers(&mut random, 10, 1e3));
        let beside = receivers(&mut random, 30, 1e-3);
        all.extend(
            beside.iter().zip(&lights).map(|((p, n), light)| ((*p + light.corners[0]).as_vec3().as_dvec3(), *n)),
        );
        let questions: Vec<_> = all.iter().flat_map(|&r| (0..lights.len()).map(move |light| (r, light))).collect();
        let answers = ask(&kernel, &questions, &mut random);
        for (receiver, answers) in all.iter().zip(answers.chunks_exact(lights.len())) {
            let mut weights = || {
                let (u, v) = (random.unit().sqrt(), random.unit());
                DVec3::new(1.0 - u, u * (1.0 - v), u * v)
            };
            let weights: Vec<DVec3> = (0..12).map(|_| weights()).collect();
            let from =
                |light: &BruteLight| weights.iter().map(|w| irradiance(light, *receiver, *w)).collect::<Vec<_>>();
            let total: f64 = lights.iter().map(|light| from(light).iter().sum::<f64>() / 12.0).sum();
            for (light, answer) in lights.iter().zip(answers) {
                let counts = answer.probability * f64::from(layout::CDF_TOTAL);
                let most = from(light).into_iter().fold(0.0, f64::max);
                assert!(counts >= 1.0, "a light without a count");
                let left_out = counts <= 1.5 && most * f64::from(layout::CDF_TOTAL) > 1e5 * total;
                assert!(!left_out, "{receiver:?}: {most} of {total}: {:?} {:?}", light.corners, light.record);
            }
        }
    }
}

/// Among many lamps, the variance that the choice leaves, had nothing else any, is far below that of power.
#[test]
fn the_tree_knows_what_arrives() {
    let mut random = Random(5);
    let mut scene = empty_scene();
    scene.materials = vec![Material { emission: [1.0; 3], ..Material::lambertian("lamp", [0.5; 3]) }];
    scene.meshes = vec![Mesh { name: String::from("lamps"), primitives: vec![lamps(&mut random, 500, 40.0, 1.0)] }];
    scene.instances = vec![Instance { mesh: 0, object_to_world: DAffine3::IDENTITY, name: String::new() }];
    let (tree, table) = (kernel(&scene), TestKernel::with_choice("light_bvh.comp", &scene, LightChoice::Power));
    let lights = brute_lights(&tree);
    let (mut by_tree, mut by_power) = (0.0, 0.0);
    for receiver in receivers(&mut random, 16, 30.0) {
        let center = DVec3::splat(1.0 / 3.0);
        let arriving: Vec<f64> = lights.iter().map(|light| irradiance(light, receiver, center)).collect();
        let total: f64 = arriving.iter().sum();
        if total == 0.0 {
            continue;
        }
        let variance = |p: Vec<f64>| arriving.iter().zip(p).map(|(f, p)| f * f / p).sum::<f64>() / total.powi(2) - 1.0;
        by_tree += variance(probabilities(&tree, receiver)).ln_1p();
        by_power += variance(probabilities(&table, receiver)).ln_1p();
    }
    println!("mean ln(1 + variance): {} by tree, {} by power", by_tree / 16.0, by_power / 16.0);
    assert!(by_tree < 0.5 * by_power, "{by_tree} and {by_power}");
}

/// A floor and a sheet that lets light through, among lights of all kinds.
fn lit_floor() -> Scene {
    let mut scene = everything(41, 2.0, false);
    let square = |y: f32, material: usize| Primitive {
        positions: vec![[-3.0, y, -3.0], [-3.0, y, 3.0], [3.0, y, 3.0], [3.0, y, -3.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material,
        ..Primitive::default()
    };
    scene.materials.push(Material::lambertian("floor", [0.7; 3]));
    let sheet = Bsdf::MetallicRoughness;
    let sheet = Material { bsdf: sheet, roughness: 0.7, transmission: 0.6, ..Material::lambertian("sheet", [0.8; 3]) };
    scene.materials.push(sheet);
    let primitives = vec![square(-1.5, 6), square(0.4, 7)];
    scene.meshes.push(Mesh { name: String::from("floor"), primitives });
    scene.instances.push(Instance { mesh: 3, object_to_world: DAffine3::IDENTITY, name: String::new() });
    let back = DAffine3::from_translation(DVec3::new(0.0, 0.5, 7.0));
    scene.cameras[0].camera_to_world = back;
    scene
}

#[test]
fn images_do_not_depend_on_the_choice() {
    let own = ("lit floor", lit_floor());
    let names: &[&'static str] = if short_form() { &[] } else { &["many_lights"] };
    for (name, scene) in names.iter().map(|&name| (name, scene(name))).chain([own]) {
        let base = Settings { max_bounces: Some(3), ..gpu::settings(32, 32) };
        let bvh = mean(&scene, &base, 16, 32);
        for light_choice in [LightChoice::Power, LightChoice::Uniform] {
            let other = Settings { light_choice, ..base.clone() };
            assert_agree(&format!("{name}, bvh and {light_choice}"), bvh, mean(&scene, &other, 16, 32));
        }
        let mixture = Settings { light_sampling: LightSampling::Mixture, ..base.clone() };
        assert_agree(&format!("{name}, mis and mixture"), bvh, mean(&scene, &mixture, 16, 32));
    }
}

/// 2²⁰ samples a pixel.
#[test]
fn pixels_agree_at_a_million_samples() {
    if short_form() {
        return;
    }
    let scene = lit_floor();
    let base = Settings { max_bounces: Some(2), ..gpu::settings(2, 2) };
    let images = |light_choice| {
        let mut tracer = gpu::path_tracer(&scene, &Settings { light_choice, ..base.clone() });
        let films: Vec<_> = (0..16).map(|seed| gpu::run(&mut tracer, seed, 1 << 16).film.radiance()).collect();
        (0..4).map(|i| Estimate::from_values(&films.iter().map(|f| f64::from(f[i][1])).collect::<Vec<_>>())).collect()
    };
    let (bvh, power): (Vec<Estimate>, Vec<Estimate>) = (images(LightChoice::Bvh), images(LightChoice::Power));
    for (pixel, (a, b)) in bvh.iter().zip(&power).enumerate() {
        println!(
            "pixel {pixel}: {:.5} ± {:.1e}, {:.5} ± {:.1e}",
            a.mean,
            a.standard_error(),
            b.mean,
            b.standard_error()
        );
        assert!(a.deviation(b) < 4.0, "pixel {pixel}: {a:?} {b:?}");
    }
}
