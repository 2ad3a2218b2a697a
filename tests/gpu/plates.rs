//! Four glossy plates under four lamps of equal power (after Veach 1997, figure 9.2): multiple importance sampling is
//! as good as the better of its two strategies in each of the 16 regions, whichever that is there.

use glam::DVec3;

use crate::common::builder::{camera, placed, rectangle, scene};
use crate::common::scenes::{short_form, slow_driver};
use crate::common::{gpu, trace};
use sunfleck::film::REC709_LUMINANCE;
use sunfleck::render::{Integrator, LightSampling, Settings};
use sunfleck::scene::{Bsdf, Material, Scene};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;
const EYE: DVec3 = DVec3::new(0.0, 2.0, 15.0);
const TARGET: DVec3 = DVec3::new(0.0, -2.6, 2.0);
const YFOV: f64 = 0.6;
const RADII: [f64; 4] = [0.03, 0.1, 0.3, 0.9];
const ROUGHNESSES: [f32; 4] = [0.08, 0.15, 0.25, 0.4];
/// How much worse than the better strategy `mis` may be somewhere.
const TOLERANCE: f64 = 1.1;

fn lamp(j: usize) -> DVec3 {
    DVec3::new(-3.75 + 2.5 * j as f64, 5.0, 0.0)
}

/// Centre and normal of plate i: it mirrors the row of lamps to the eye.
fn plate(i: usize) -> (DVec3, DVec3) {
    let centre = DVec3::new(0.0, -2.2 - 0.75 * i as f64, 0.4 + 1.35 * i as f64);
    let to_lamps = (DVec3::new(0.0, 5.0, 0.0) - centre).normalize();
    (centre, ((EYE - centre).normalize() + to_lamps).normalize())
}

const HALF_WIDTH: f64 = 4.0;
const HALF_DEPTH: f64 = 0.6;

fn plates() -> Scene {
    let mut primitives = Vec::new();
    let mut materials = Vec::new();
    for (j, radius) in RADII.into_iter().enumerate() {
        primitives.push(placed(trace::icosphere(3), radius, lamp(j), materials.len()));
        let radiance = (8.0 / radius.powi(2)) as f32;
        materials.push(Material { emission: [radiance; 3], ..Material::lambertian("lamp", [0.0; 3]) });
    }
    for (i, roughness) in ROUGHNESSES.into_iter().enumerate() {
        let (centre, normal) = plate(i);
        let depth = DVec3::X.cross(normal).normalize() * -HALF_DEPTH;
        let width = DVec3::X * HALF_WIDTH;
        primitives.push(rectangle(centre - width - depth, width * 2.0, depth * 2.0, materials.len()));
        let metal = Material::lambertian("plate", [0.7, 0.75, 0.8]);
        materials.push(Material { bsdf: Bsdf::MetallicRoughness, metallic: 1.0, roughness, ..metal });
    }
    scene(primitives, materials, camera(EYE, TARGET, YFOV))
}

/// Plate and lamp of a pixel: the plate that its centre's ray meets, and the lamp nearest in angle to the mirrored ray.
fn region(x: u32, y: u32) -> Option<(usize, usize)> {
    let camera = camera(EYE, TARGET, YFOV);
    let scale = (0.5 * YFOV).tan();
    let [u, v] = [(f64::from(x) + 0.5) / f64::from(WIDTH), (f64::from(y) + 0.5) / f64::from(HEIGHT)];
    let local =
        DVec3::new((2.0 * u - 1.0) * scale * f64::from(WIDTH) / f64::from(HEIGHT), (1.0 - 2.0 * v) * scale, -1.0);
    let direction = camera.camera_to_world.transform_vector3(local).normalize();
    (0..ROUGHNESSES.len()).find_map(|i| {
        let (centre, normal) = plate(i);
        let point = EYE + direction * ((centre - EYE).dot(normal) / direction.dot(normal));
        let inside = point - centre;
        let along = inside.dot(DVec3::X.cross(normal).normalize());
        if inside.x.abs() > HALF_WIDTH || along.abs() > HALF_DEPTH {
            return None;
        }
        let mirrored = direction - normal * (2.0 * direction.dot(normal));
        let cosine = |j: &usize| mirrored.dot((lamp(*j) - point).normalize());
        let nearest = (0..RADII.len()).max_by(|a, b| cosine(a).total_cmp(&cosine(b)))?;
        Some((i, nearest))
    })
}

/// The mean over each region's pixels of the variance of a sample's luminance, over that of the squared luminance.
fn variances(scene: &Scene, light_sampling: LightSampling, spp: u32) -> [[f64; 4]; 4] {
    let settings = Settings { light_sampling, integrator: Integrator::Direct, ..gpu::settings(WIDTH, HEIGHT) };
    let film = gpu::run(&mut gpu::path_tracer(scene, &settings), 5, spp).film;
    let (mut sums, mut squares) = ([[0.0; 4]; 4], [[0.0; 4]; 4]);
    for (index, pixel) in (0_u32..).zip(film.pixels()) {
        let Some((i, j)) = region(index % WIDTH, index / WIDTH) else { continue };
        let n = f64::from(pixel.count);
        let mean = DVec3::from(pixel.rgb).dot(DVec3::from(REC709_LUMINANCE)) / n;
        sums[i][j] += (pixel.luminance_squared / n - mean * mean) * n / (n - 1.0);
        squares[i][j] += mean * mean;
    }
    std::array::from_fn(|i| std::array::from_fn(|j| sums[i][j] / squares[i][j]))
}

#[test]
fn mis_is_as_good_as_the_better_strategy_everywhere() {
    if slow_driver() {
        eprintln!("not run: the weights of samples are no driver's doing, and a slow one needs minutes for these");
        return;
    }
    let spp = if short_form() { 256 } else { 2048 };
    let scene = plates();
    let [mis, nee, bsdf] =
        [LightSampling::Mis, LightSampling::Nee, LightSampling::Bsdf].map(|way| variances(&scene, way, spp));
    let mut worst: f64 = 0.0;
    println!("relative variance of a sample: mis, nee, bsdf, mis over the better");
    for (i, roughness) in ROUGHNESSES.iter().enumerate() {
        for (j, radius) in RADII.iter().enumerate() {
            let ratio = mis[i][j] / nee[i][j].min(bsdf[i][j]);
            worst = worst.max(ratio);
            let figures = [mis[i][j], nee[i][j], bsdf[i][j], ratio].map(|x| format!("{x:9.3}"));
            println!("roughness {roughness:4}, radius {radius:4}: {}", figures.join(" "));
        }
    }
    // Each strategy is the better one somewhere, or the scene would prove nothing.
    let better = |a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]| (0..16).any(|k| a[k / 4][k % 4] < 0.5 * b[k / 4][k % 4]);
    assert!(better(&nee, &bsdf) && better(&bsdf, &nee));
    assert!(worst <= TOLERANCE, "mis has {worst:.3} times the variance of the better strategy");
}
