//! Lights at the ends of what floats can hold: extreme radiances beside each other, an environment of one bright texel,
//! black and broken environments, lights that touch surfaces, lights of almost no extent. Everything is held against
//! radiometry's closed formulas.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;
use std::sync::Arc;

use assert_cmd::Command;
use glam::DVec3;
use sunfleck::film::exr::{ChannelValues, ExrImage};
use sunfleck::film::metadata::Metadata;
use sunfleck::render::{LightSampling, Settings};
use sunfleck::scene::load::load_environment;
use sunfleck::scene::{Environment, Material, Primitive, PunctualKind, PunctualLight, Scene};

use crate::common::builder::{camera, mean, placed, rectangle, scene};
use crate::common::scenes::full_form;
use crate::common::statistics::{Comparison, Estimate};
use crate::common::{gpu, trace};

/// Level of each test here.
const ALPHA: f64 = 0.01;
const ALBEDO: f32 = 0.5;
const SEEDS: u32 = 8;

fn settings(light_sampling: LightSampling) -> Settings {
    Settings { light_sampling, ..gpu::settings(16, 16) }
}

fn lamp(radiance: f32) -> Material {
    Material { emission: [radiance; 3], ..Material::lambertian("lamp", [0.0; 3]) }
}

fn grey() -> Material {
    Material::lambertian("grey", [ALBEDO; 3])
}

/// The image's mean is the exact one, and known to 1 % at least; `rounding` is what f32 may do to it, relatively.
fn assert_mean(name: &str, estimate: Estimate, exact: f64, rounding: f64) {
    let error = estimate.standard_error() / exact;
    println!(
        "{name}: {:.6e} ± {:.3} %, exact {exact:.6e}, {:+.1e}",
        estimate.mean,
        100.0 * error,
        estimate.mean / exact - 1.0
    );
    assert!(error < 0.01, "{name}: a standard error of {error:e} shows nothing");
    let beyond = ((estimate.mean / exact - 1.0).abs() - rounding).max(0.0);
    let shifted = Estimate { mean: exact * (1.0 + beyond), ..estimate };
    let comparison = Comparison::new(&[shifted], &[Estimate::exact(exact)], ALPHA);
    assert!(comparison.passed(), "{name}: {comparison}");
}

/// View factor from a point to a parallel rectangle of half sides a and b at distance h straight above it (Howell,
/// *Catalog of Radiation Heat Transfer Configuration Factors*, B-3, four times).
fn parallel_factor(a: f64, b: f64, h: f64) -> f64 {
    let (a, b) = (a / h, b / h);
    let term = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    2.0 / PI * (term(a, b) + term(b, a))
}

/// View factor from a point to a rectangle that stands on its plane at distance d, of height h, reaching w to both sides
/// (Howell, B-4, twice).
fn standing_factor(d: f64, h: f64, w: f64) -> f64 {
    let far = d.hypot(h);
    ((w / d).atan() - d / far * (w / far).atan()) / PI
}

/// Closed black rooms in a row, each with a grey floor under its own lamp.
fn rooms(radiances: &[f32]) -> Scene {
    let mut materials = vec![Material::lambertian("black", [0.0; 3]), grey()];
    let mut primitives = Vec::new();
    for (index, radiance) in radiances.iter().enumerate() {
        let centre = DVec3::X * (3.0 * index as f64);
        primitives.push(placed(trace::cube(1), 1.0, centre, 0));
        primitives.push(rectangle(centre + DVec3::new(-0.9, -0.9, 0.9), DVec3::X * 1.8, DVec3::Z * -1.8, 1));
        // Its front looks down.
        primitives.push(rectangle(centre + DVec3::new(-0.5, 0.6, -0.5), DVec3::X, DVec3::Z, materials.len()));
        materials.push(lamp(*radiance));
    }
    scene(primitives, materials, camera(DVec3::Y, DVec3::ZERO, 1.0))
}

#[test]
fn lamps_of_24_decades_in_one_scene() {
    let step = if full_form() { 1 } else { 12 };
    let radiances: Vec<f32> = (-12..=12).step_by(step).map(|decade| 10.0_f32.powi(decade)).collect();
    let mut rooms = rooms(&radiances);
    let exact = f64::from(ALBEDO) * parallel_factor(0.5, 0.5, 1.5);
    for (index, radiance) in radiances.iter().enumerate() {
        let target = DVec3::new(3.0 * index as f64, -0.9, 0.0);
        rooms.cameras = vec![camera(target + DVec3::Y * 0.5, target, 1e-4)];
        let estimate = mean(&rooms, &settings(LightSampling::Mis), SEEDS, 1024)[1];
        assert_mean(&format!("a lamp of {radiance:e}"), estimate, exact * f64::from(*radiance), 1e-6);
    }
}

/// The room of one lamp is lit by no other: the one of 1e12 leaks into none.
#[test]
fn bright_lamps_do_not_leak() {
    let mut rooms = rooms(&[0.0, 1e12]);
    let target = DVec3::NEG_Y * 0.9;
    rooms.cameras = vec![camera(DVec3::ZERO, target, 2.0)];
    let film = gpu::run(&mut gpu::path_tracer(&rooms, &settings(LightSampling::Mis)), 0, 1024).film;
    assert!(film.radiance().iter().all(|p| *p == [0.0; 3]), "light through a closed wall");
}

/// A floor that faces up, seen from close by.
fn floor() -> Scene {
    let floor = rectangle(DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 0);
    scene(vec![floor], vec![grey()], camera(DVec3::Y * 0.5, DVec3::ZERO, 1e-4))
}

fn map(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Environment {
    let name = String::from("map");
    Environment::Image { name, width, height, texels: Arc::new(texels), strength: 1.0, rotation_radians: 0.0 }
}

/// One texel of 1e9 in a black map, a quarter of the way down from the zenith.
const BRIGHT: (usize, usize, f32) = (9, 8, 1e9);

/// ∫ L cos θ dω over the bilinear tent of the bright texel, by the midpoint rule on each of its four flanks.
fn bright_irradiance(width: usize, height: usize) -> f64 {
    const STEPS: usize = 400;
    let mut sum = 0.0;
    for i in 0..2 * STEPS {
        // Along v the texel's tent has its top in the texel's middle.
        let offset = (i as f64 + 0.5) / STEPS as f64 - 1.0;
        let theta = PI * (BRIGHT.1 as f64 + 0.5 + offset) / height as f64;
        sum += (1.0 - offset.abs()) * theta.cos() * theta.sin() / STEPS as f64;
    }
    // Along u the tent integrates to one texel.
    f64::from(BRIGHT.2) * sum * (PI / height as f64) * (TAU / width as f64)
}

#[test]
fn environment_of_one_texel_of_1e9() {
    let (width, height) = (64_usize, 32_usize);
    let mut texels = vec![[0.0; 3]; width * height];
    texels[BRIGHT.1 * width + BRIGHT.0] = [BRIGHT.2; 3];
    let scene = Scene { environment: map(width as u32, height as u32, texels), ..floor() };
    let exact = f64::from(ALBEDO) / PI * bright_irradiance(width, height);
    let modes: &[LightSampling] =
        if full_form() { &[LightSampling::Mis, LightSampling::Nee] } else { &[LightSampling::Mis] };
    for mode in modes {
        let estimate = mean(&scene, &settings(*mode), SEEDS, 1024)[1];
        // The bilinear weights of f32 texture coordinates, which are known to 2^-24 of the map's width.
        assert_mean(&format!("one texel of 1e9, {mode}"), estimate, exact, 64.0 / (1 << 22) as f64);
    }
}

#[test]
fn empty_environments_are_black() {
    let scene = Scene { environment: map(8, 4, vec![[0.0; 3]; 32]), ..floor() };
    let film = gpu::run(&mut gpu::path_tracer(&scene, &settings(LightSampling::Mis)), 0, 16).film;
    assert!(film.radiance().iter().all(|p| *p == [0.0; 3]), "light from a black map");
    assert_eq!(film.estimated_error(), Some(0.0));
}

fn write_map(path: &Path, texel: f32) {
    let mut image = ExrImage { width: 8, height: 4, channels: Vec::new(), metadata: Metadata::default() };
    for name in ["R", "G", "B"] {
        let mut values = vec![1.0; 32];
        values[2 * 8 + 5] = texel;
        image.push(name, ChannelValues::F32(values));
    }
    image.write(path).expect("written");
}

#[test]
fn broken_texels_are_refused_with_their_place() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let path = folder.path().join("map.exr");
    for texel in [-1.0, -1e-30, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        write_map(&path, texel);
        let error = load_environment(&path, 1.0, 0.0).expect_err("it is refused").to_string();
        assert!(error.contains("texel (5, 2)") && error.contains("map.exr"), "{texel}: {error}");
    }
    let output = Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"))
        .args(["render", "cornell", "--resolution", "8x8", "--spp", "1", "-o"])
        .arg(folder.path().join("a.exr"))
        .arg("--env")
        .arg(&path)
        .output()
        .expect("runs");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.contains("texel (5, 2)"), "{message}");
}

/// A finite texel times a finite strength can be infinite: refused too, not rendered.
#[test]
fn strengths_that_overflow_are_refused() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let path = folder.path().join("map.exr");
    write_map(&path, 1e30);
    assert!(load_environment(&path, 1e8, 0.0).is_ok(), "1e38 fits");
    let error = load_environment(&path, 1e10, 0.0).expect_err("it is refused").to_string();
    assert!(error.contains("texel (5, 2)") && error.contains("strength"), "{error}");
    let mut scene = floor();
    scene.environment = map(1, 1, vec![[1e30; 3]]);
    if let Environment::Image { strength, .. } = &mut scene.environment {
        *strength = 1e10;
    }
    assert!(scene.validate().is_err(), "a program's scene is refused as well");
}

/// A lamp that stands on the floor, seen at a millimetre and at a micrometre from where they touch.
#[test]
fn lamp_that_touches_the_floor() {
    let modes: &[LightSampling] = if full_form() {
        &[LightSampling::Mis, LightSampling::Mixture, LightSampling::Bsdf]
    } else {
        &[LightSampling::Mis]
    };
    let standing = rectangle(DVec3::new(0.0, 0.0, 1.0), DVec3::Y, DVec3::Z * -2.0, 1);
    let distances: &[f64] = if full_form() { &[1e-3, 1e-6] } else { &[1e-6] };
    for distance in distances.iter().copied() {
        let mut touched = floor();
        touched.meshes[0].primitives.push(placed(standing.clone(), 1.0, DVec3::ZERO, 1));
        touched.materials.push(Material { double_sided: true, ..lamp(1.0) });
        // Close to the floor, so that coordinates are fine there; the image is a hundredth of the distance wide.
        let point = DVec3::X * distance;
        touched.cameras = vec![camera(point + DVec3::Y * distance, point, 0.01)];
        let exact = f64::from(ALBEDO) * standing_factor(distance, 1.0, 1.0);
        for mode in modes {
            let estimate = mean(&touched, &settings(*mode), SEEDS, 256)[1];
            assert_mean(&format!("{distance} m from a touching lamp, {mode}"), estimate, exact, 1e-4);
        }
    }
}

/// Point lights next to a corner of three walls and exactly in it: finite, and right on the floor beside it.
#[test]
fn point_light_in_a_corner() {
    let walls = [
        rectangle(DVec3::ZERO, DVec3::Z, DVec3::X, 0),
        rectangle(DVec3::ZERO, DVec3::Y, DVec3::Z, 0),
        rectangle(DVec3::ZERO, DVec3::X, DVec3::Y, 0),
    ];
    let point = DVec3::new(0.01, 0.0, 0.01);
    for height in [1e-3, 1e-6, 0.0] {
        let mut corner = scene(walls.to_vec(), vec![grey()], camera(DVec3::ONE * 0.5, DVec3::ZERO, 1.0));
        let position = DVec3::splat(height);
        let kind = PunctualKind::Point;
        let direction = DVec3::NEG_Y;
        corner.lights = vec![PunctualLight { name: String::new(), kind, intensity: [1.0; 3], position, direction }];
        mean(&corner, &settings(LightSampling::Mis), 2, 64);
        if height == 0.0 {
            continue;
        }
        corner.cameras = vec![camera(point + DVec3::Y * 1e-3, point, 0.01)];
        let direct = Settings { max_bounces: Some(1), ..settings(LightSampling::Mis) };
        let distance = (position - point).length();
        let exact = f64::from(ALBEDO) / PI * height / distance.powi(3);
        // The height above the floor is known to the rounding of coordinates, at most 2^-24 of the scene's 1 m, in light,
        // floor and ray origin; the picture's width of 1e-5 m changes nothing to first order, (1e-5/1e-2)² to second.
        let rounding = 4.0 * (0.5_f64.powi(24) / height).max(1e-6);
        assert_mean(
            &format!("a point light {height} m from a corner"),
            mean(&corner, &direct, 2, 64)[1],
            exact,
            rounding,
        );
    }
}

/// A triangle of 1e-9 m² and 1e9 W/(m² sr), straight above: the floor sees I = 1 W/sr.
#[test]
fn emitter_of_a_square_micrometre() {
    let leg = 2e-9_f64.sqrt();
    let modes: &[LightSampling] =
        if full_form() { &[LightSampling::Mis, LightSampling::Nee] } else { &[LightSampling::Mis] };
    let small = Primitive {
        positions: [DVec3::ZERO, DVec3::X * leg, DVec3::Z * leg].map(|p| p.as_vec3().to_array()).to_vec(),
        triangles: vec![[0, 1, 2]],
        ..Primitive::default()
    };
    let mut tiny = floor();
    tiny.meshes[0].primitives.push(placed(small, 1.0, DVec3::Y, 1));
    tiny.materials.push(lamp(1e9));
    for mode in modes {
        let estimate = mean(&tiny, &settings(*mode), SEEDS, 64)[1];
        // The area from vertices rounded to 2^-24 of a leg; the footprint and the lamp are 5e-5 wide.
        assert_mean(&format!("an emitter of 1e-9, {mode}"), estimate, f64::from(ALBEDO) / PI, 1e-6);
    }
}

/// The formulas above agree with each other: a rectangle so wide that it is half the sky, or all of it.
#[test]
fn view_factors_have_their_limits() {
    assert!((parallel_factor(1e9, 1e9, 1.0) - 1.0).abs() < 1e-8);
    assert!((standing_factor(1e-9, 1.0, 1.0) - FRAC_PI_2 / PI).abs() < 1e-8);
}
