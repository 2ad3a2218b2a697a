//! Materials at the ends of their ranges: indices of refraction of 1, nearly 1, below 1 and 100, roughness and albedo from 0
//! to 1, ten thousand bounces, glass in glass, colours next to black.

use glam::DVec3;
use sunfleck::render::{LightSampling, Settings};
use sunfleck::scene::{Bsdf, Camera, Environment, Material, Primitive, Scene, Volume};

use crate::common::builder::{camera, mean, placed, rectangle, scene};
use crate::common::scenes::{full_form, seeds};
use crate::common::statistics::{Comparison, Estimate};
use crate::common::{ggx_albedo, gpu, trace};

/// Level of each test here.
const ALPHA: f64 = 0.01;
const SEEDS: u32 = 8;

fn settings(size: u32) -> Settings {
    gpu::settings(size, size)
}

fn material(bsdf: Bsdf, color: f32, ior: f32) -> Material {
    Material { bsdf, ior, ..Material::lambertian("stressed", [color; 3]) }
}

fn front() -> Camera {
    camera(DVec3::Z * 4.0, DVec3::ZERO, 0.6)
}

/// Objects before a white environment, with one white triangle of each kind far behind the camera: none of them loses
/// light, and all scenes here need the same kernel.
fn furnace(mut objects: Vec<Primitive>, mut materials: Vec<Material>) -> Scene {
    let white = |bsdf| Material { roughness: 0.0, ..material(bsdf, 1.0, 1.5) };
    for bsdf in [Bsdf::Lambertian, Bsdf::Mirror, Bsdf::Refract, Bsdf::Glass, Bsdf::MetallicRoughness] {
        let corner = DVec3::new(materials.len() as f64, 0.0, 30.0);
        objects.push(rectangle(corner, DVec3::X * 0.5, DVec3::Y * 0.5, materials.len()));
        materials.push(white(bsdf));
    }
    Scene { environment: Environment::Constant([1.0; 3]), ..scene(objects, materials, front()) }
}

fn assert_white(name: &str, scene: &Scene, spp: u32) {
    let settings = settings(16);
    let mut tracer = gpu::path_tracer(scene, &settings);
    let statistics = seeds(&mut tracer, &settings, SEEDS, spp);
    let means = statistics.image();
    println!("{name}: {:.6} ± {:.1e}", means[1].mean, means[1].standard_error());
    assert!(means[1].standard_error() < 5e-3, "{name}: {:?}", means[1]);
    let tiles = statistics.tiles();
    let comparison = Comparison::new(&tiles, &vec![Estimate::exact(1.0); tiles.len()], ALPHA);
    assert!(comparison.passed(), "{name}: {comparison}");
}

fn ball(scale: f64, centre: DVec3, material: usize) -> Primitive {
    placed(trace::icosphere(2), scale, centre, material)
}

#[test]
fn white_glass_of_any_index_loses_nothing() {
    for ior in [1.0, 1.0 + 1e-7, 0.5] {
        let kinds: &[Bsdf] = if full_form() { &[Bsdf::Glass, Bsdf::Refract] } else { &[Bsdf::Glass] };
        for bsdf in kinds.iter().copied() {
            let scene = furnace(vec![ball(1.0, DVec3::ZERO, 0)], vec![material(bsdf, 1.0, ior)]);
            assert_white(&format!("{bsdf:?} of index {ior}"), &scene, 64);
        }
    }
}

/// A known fault. What enters glass of index 100 finds its way out once in some 10^4 reflections, but roulette ends a path with
/// 1/256 at each from the 65th on: nearly all of the 4 % of light that enters is left to a few paths of enormous weight,
/// which no run of this length meets.
#[test]
#[should_panic(expected = "index 100")]
fn white_glass_of_index_100_loses_nothing() {
    let scene = furnace(vec![ball(1.0, DVec3::ZERO, 0)], vec![material(Bsdf::Glass, 1.0, 100.0)]);
    assert_white("Glass of index 100", &scene, 64);
}

#[test]
fn nested_glass_loses_nothing() {
    let balls = [1.0, 0.7, 0.4, 0.1].iter().enumerate().map(|(i, s)| ball(*s, DVec3::ZERO, i)).collect();
    let indices = [1.5, 1.33, 0.8, 2.4];
    let scene = furnace(balls, indices.map(|ior| material(Bsdf::Glass, 1.0, ior)).to_vec());
    assert_white("glass in glass in glass in glass", &scene, 64);
}

/// A floor under an area lamp and an environment; with spheres of glass and of refraction of index 1 in the way of both.
#[test]
fn index_one_is_invisible() {
    let room = |objects: Vec<Primitive>| {
        let mut all = vec![
            rectangle(DVec3::new(-2.0, -1.0, 2.0), DVec3::X * 4.0, DVec3::Z * -4.0, 2),
            rectangle(DVec3::new(-1.5, 2.0, -1.5), DVec3::X * 3.0, DVec3::Z * 3.0, 3),
        ];
        all.extend(objects);
        let lamp = Material { emission: [2.0, 1.0, 0.5], ..Material::lambertian("lamp", [0.0; 3]) };
        let clear = [Bsdf::Glass, Bsdf::Refract].map(|bsdf| material(bsdf, 1.0, 1.0));
        let [glass, refract] = clear;
        let materials = vec![glass, refract, Material::lambertian("floor", [0.7; 3]), lamp];
        let camera = camera(DVec3::new(0.0, 1.0, 6.0), DVec3::ZERO, 0.7);
        Scene { environment: Environment::Constant([0.3, 0.4, 0.5]), ..scene(all, materials, camera) }
    };
    let balls = vec![ball(0.8, DVec3::new(-0.9, 0.0, 0.0), 0), ball(0.8, DVec3::new(0.9, 0.0, 0.0), 1)];
    let (count, spp) = if full_form() { (32, 256) } else { (16, 32) };
    let settings = settings(32);
    let render = |scene: &Scene| seeds(&mut gpu::path_tracer(scene, &settings), &settings, count, spp);
    let (with, without) = (render(&room(balls)), render(&room(Vec::new())));
    let comparison = Comparison::new(&with.tiles(), &without.tiles(), ALPHA);
    println!("index 1 against nothing: {comparison}");
    assert!(comparison.passed(), "{comparison}");
    for (a, b) in with.image().iter().zip(without.image()) {
        assert!(a.relative_error() < 0.01 && a.deviation(&b) < 4.0, "{a:?} and {b:?}");
    }
}

/// A plane seen at a cosine: its mean radiance before the white environment is its directional albedo.
fn albedo(material: Material, cosine: f64) -> Estimate {
    let plane = rectangle(DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 0);
    let mut scene = furnace(vec![plane], vec![material]);
    let sine = (1.0 - cosine * cosine).sqrt();
    scene.cameras = vec![camera(DVec3::new(0.0, cosine, sine), DVec3::ZERO, 1e-4 * cosine)];
    mean(&scene, &settings(8), 4 * SEEDS, 64)[1]
}

/// Energy: a white metal and a white dielectric give back what they get, to the accuracy of the albedo table.
#[test]
fn roughness_from_zero_to_one_is_finite_and_bounded() {
    let roughnesses: &[f32] =
        if full_form() { &[0.0, 0.0156, 0.015625, 0.03, 0.1, 0.3, 0.7, 1.0] } else { &[0.0, 0.015625, 1.0] };
    let cosines: &[f64] = if full_form() { &[1.0, 0.3, 0.03, 0.003] } else { &[0.03] };
    for roughness in roughnesses.iter().copied() {
        for metallic in [1.0, 0.0] {
            for cosine in cosines.iter().copied() {
                let mean =
                    albedo(Material { roughness, metallic, ..material(Bsdf::MetallicRoughness, 1.0, 1.5) }, cosine);
                println!(
                    "roughness {roughness}, metallic {metallic}, cosine {cosine}: {:.5} ± {:.1e}",
                    mean.mean,
                    mean.standard_error()
                );
                // Of 64 t-tests with 31 degrees of freedom one fails by chance with probability 1e-3.
                let slack = 5.0 * mean.standard_error();
                assert!(mean.mean >= 0.99 - slack && mean.mean <= 1.001 + slack, "{mean:?}");
            }
        }
    }
}

/// The narrowest lobe that is not a delta, seen ever more from the side: light sampling and BSDF sampling share it by the
/// pdf, so what rounding does to the pdf would show as a loss or gain of light. The albedo is that of the model in f64 (the
/// same distribution of visible normals, weight G2/G1, 150,000 samples), times what the shader gives back of its loss.
#[test]
fn narrowest_lobe_at_grazing_angles() {
    let exact =
        [(0.01, 0.999_670, 3.4e-5), (0.1, 0.999_999, 1e-6), (0.003, 0.996_190, 1.1e-4), (0.001, 0.966_271, 3.1e-4)];
    for (cosine, model, model_error) in exact.into_iter().take(if full_form() { 4 } else { 1 }) {
        let metal = Material { roughness: 0.015625, metallic: 1.0, ..material(Bsdf::MetallicRoughness, 1.0, 1.5) };
        let mean = albedo(metal, cosine);
        let wo = DVec3::new(0.0, cosine, ((1.0 - cosine) * (1.0 + cosine)).sqrt());
        let kept = ggx_albedo::stored(wo, [2.0_f64.powi(-12); 2]).white;
        let (model, model_error) = (model / kept, model_error / kept);
        let error = mean.standard_error();
        println!("alpha 2^-12, cosine {cosine}: {:.6} ± {error:.1e}, the model {model} ± {model_error:.1e}", mean.mean);
        // Eight seeds: Student's t at level 0.01/4 with seven degrees of freedom is 4.5; and f32's rounding of a weight.
        assert!((mean.mean - model).abs() <= 4.5 * error.hypot(model_error) + 2e-5, "{mean:?} and {model}");
    }
}

#[test]
fn black_is_black() {
    let kinds = [Bsdf::Lambertian, Bsdf::Mirror, Bsdf::Refract, Bsdf::Glass];
    for bsdf in kinds.into_iter().skip(if full_form() { 0 } else { 3 }) {
        let mut black = furnace(vec![ball(1.0, DVec3::ZERO, 0)], vec![material(bsdf, 0.0, 1.5)]);
        black.cameras = vec![camera(DVec3::Z * 4.0, DVec3::ZERO, 0.2)];
        let film = gpu::run(&mut gpu::path_tracer(&black, &settings(8)), 0, 64).film;
        assert!(film.radiance().iter().all(|p| *p == [0.0; 3]), "{bsdf:?} of colour 0 shines");
    }
}

/// Colours of 1e-6, twice through a slab: 1e-12 exactly, for the path is too short for roulette. 1e6 is refused.
#[test]
fn colours_next_to_black_and_beyond_white() {
    let near = rectangle(DVec3::new(-1.0, -1.0, 0.5), DVec3::X * 2.0, DVec3::Y * 2.0, 0);
    let far = rectangle(DVec3::new(-1.0, -1.0, -0.5), DVec3::Y * 2.0, DVec3::X * 2.0, 0);
    let mut slab = furnace(vec![near, far], vec![material(Bsdf::Refract, 1e-6, 1.5)]);
    slab.cameras = vec![camera(DVec3::Z * 4.0, DVec3::ZERO, 0.1)];
    let film = gpu::run(&mut gpu::path_tracer(&slab, &settings(8)), 0, 64).film;
    for pixel in film.radiance() {
        // Six rounded operations, and those of 1.5 and 1/1.5.
        assert!((f64::from(pixel[1]) / 1e-12 - 1.0).abs() < 16.0 * 0.5_f64.powi(24), "{pixel:?}");
    }
    slab.materials[0].base_color = [1e6; 3];
    let error = slab.validate().expect_err("a colour of 1e6 makes light").to_string();
    assert!(error.contains("materials[0]"), "{error}");
}

/// Absorption of 1e-6 to 1e6 a metre, of slabs a micrometre, a metre and a kilometre thick: Beer and Lambert's law, with an
/// index of 1, so that nothing is reflected. What is absorbed to below the least f32 is 0.
#[test]
fn absorption_over_twelve_decades() {
    for (absorption, thickness) in [(1e-6_f64, 1.0_f64), (1e-6, 1e3), (1.0, 1.0), (1e6, 1e-6), (1e6, 1e-5), (1e6, 1.0)]
    {
        // A colour of 1/e at the distance 1/absorption.
        let volume =
            Volume { attenuation_color: [(-1.0f32).exp(); 3], attenuation_distance: (1.0 / absorption) as f32 };
        let clear = Material {
            metallic: 0.0,
            transmission: 1.0,
            volume: Some(volume),
            ..material(Bsdf::MetallicRoughness, 1.0, 1.0)
        };
        let half = 0.5 * thickness;
        let side = DVec3::X * 2.0 * thickness.max(1.0);
        let up = DVec3::Y * side.x;
        let corner = -0.5 * (side + up);
        let faces =
            [rectangle(corner + DVec3::Z * half, side, up, 0), rectangle(corner - DVec3::Z * half, up, side, 0)];
        let eye = DVec3::new(0.1, 0.2, 4.0 + half);
        let sky = Environment::Constant([1.0; 3]);
        let view = camera(eye, DVec3::new(0.1, 0.2, -10.0 - half), 1e-4);
        let slab =
            Scene { environment: sky, ..scene(faces.to_vec(), vec![Material { roughness: 0.0, ..clear }], view) };
        let film = gpu::run(&mut gpu::path_tracer(&slab, &settings(4)), 0, 16).film;
        let expected = (-absorption * thickness).exp();
        println!("absorption {absorption:e}, {thickness:e} m: {} for {expected}", film.radiance()[0][1]);
        for pixel in film.radiance() {
            // The exponent is known to a few roundings of the absorption, the way and their product, and e^x turns that into
            // its own relative error.
            let bound =
                (8.0 * absorption * thickness + 8.0) * 0.5_f64.powi(24) * expected + f64::from(f32::MIN_POSITIVE);
            let error = (f64::from(pixel[1]) - expected).abs();
            assert!(error <= bound, "absorption {absorption:e}, {thickness:e} m: {} for {expected}", pixel[1]);
        }
    }
}

/// A closed white room with one small black lamp of radiance 1: however long its paths, each ends at the lamp, and every
/// pixel is 1. The lamp is a 96th of the walls, so a path has a hundred bounces in the mean and some have a thousand.
#[test]
fn ten_thousand_bounces_lose_nothing() {
    let white = Material::lambertian("white", [1.0; 3]);
    let lamp = Material { emission: [1.0; 3], double_sided: true, ..Material::lambertian("lamp", [0.0; 3]) };
    // One square of 4 × 4 on one of six faces shines.
    let mut walls = trace::cube(4);
    let shining =
        Primitive { triangles: walls.triangles.split_off(walls.triangles.len() - 2), material: 1, ..walls.clone() };
    let camera = camera(DVec3::ZERO, DVec3::new(-1.0, 0.2, 0.1), 1.0);
    let scene = scene(vec![walls, shining], vec![white, lamp], camera);
    let settings = Settings { max_bounces: Some(10_000), light_sampling: LightSampling::Bsdf, ..gpu::settings(16, 16) };
    let spp = if full_form() { 64 } else { 8 };
    let mut tracer = gpu::path_tracer(&scene, &settings);
    let rays = gpu::run(&mut tracer, 99, 1).rays;
    let estimate = seeds(&mut tracer, &settings, SEEDS, spp).image()[1];
    println!("white room: {:.5} ± {:.1e}, {} rays a path", estimate.mean, estimate.standard_error(), rays / 256);
    assert!(rays / 256 > 64, "the paths are long");
    assert!(estimate.standard_error() < 0.02, "{estimate:?}");
    assert!(estimate.deviation(&Estimate::exact(1.0)) < 4.0, "{estimate:?}");
}

/// A closed white mirror room without any light: nothing ever ends its paths but roulette, and they end.
#[test]
fn mirrors_without_end_end() {
    let room = scene(vec![trace::cube(1)], vec![material(Bsdf::Mirror, 1.0, 1.5)], camera(DVec3::ZERO, DVec3::X, 1.0));
    let settings = Settings { max_bounces: Some(10_000), ..settings(8) };
    let run = gpu::run(&mut gpu::path_tracer(&room, &settings), 0, 16);
    assert_eq!(run.capped_samples, 0);
    assert!(run.film.radiance().iter().all(|p| *p == [0.0; 3]));
    println!("mirror room: {} rays a path", run.rays / run.paths);
}
