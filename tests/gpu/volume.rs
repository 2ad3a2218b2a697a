//! Volumes (KHR_materials_volume): absorption along known ways, media in media, and what their boundaries do, against
//! analytic values.

use crate::common::builder::{self, camera, placed, rectangle, scene};
use crate::common::gpu;
use crate::common::scenes::short_form;
use crate::common::statistics::Estimate;
use crate::common::trace::icosphere;
use glam::DVec3;
use sunfleck::render::Settings;
use sunfleck::scene::{Environment, Material, Primitive, PunctualKind, PunctualLight, Scene, Volume};

/// A medium of an index of refraction that lets `color` of the light through `distance`.
fn medium(ior: f32, color: [f32; 3], distance: f32) -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        ior,
        volume: Some(Volume { attenuation_color: color, attenuation_distance: distance }),
        ..Material::default()
    }
}

/// A box that reaches from z = `near` to `far` and far to the sides.
fn slab(near: f64, far: f64, material: usize) -> Vec<Primitive> {
    let (low, high) = (DVec3::new(-3.0, -3.0, far), DVec3::new(3.0, 3.0, near));
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * (high - low));
    let faces = [(low, y, x), (low, z, y), (low, x, z), (high, -x, -y), (high, -y, -z), (high, -z, -x)];
    faces.into_iter().map(|(corner, a, b)| rectangle(corner, a, b, material)).collect()
}

/// Seen along −z, before a white environment.
fn seen_straight(objects: Vec<Primitive>, materials: Vec<Material>, eye: f64) -> Scene {
    let camera = camera(DVec3::new(0.1, 0.2, eye), DVec3::new(0.1, 0.2, -10.0), 1e-3);
    Scene { environment: Environment::Constant([1.0; 3]), ..scene(objects, materials, camera) }
}

fn settings() -> Settings {
    gpu::settings(4, 4)
}

fn mean(scene: &Scene, spp: u32) -> [f64; 3] {
    builder::mean(scene, &settings(), 4, spp).map(|e| e.mean)
}

fn transmittance(volume: Volume, distance: f64) -> [f64; 3] {
    volume.attenuation_color.map(|c| f64::from(c).powf(distance / f64::from(volume.attenuation_distance)))
}

fn assert_close(what: &str, mean: [f64; 3], expected: [f64; 3], tolerance: f64) {
    println!("{what}: {mean:?}, expected {expected:?}");
    for (mean, expected) in mean.into_iter().zip(expected) {
        assert!((mean - expected).abs() <= tolerance * expected.max(1e-3), "{what}: {mean} instead of {expected}");
    }
}

fn product(factors: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|k| factors.iter().map(|factor| factor[k]).product())
}

/// With an index of refraction of 1 nothing is reflected: what is left is the Beer–Lambert law, whatever the roughness. A
/// channel of 0 lets nothing through.
#[test]
fn light_is_absorbed_by_the_way_inside() {
    for roughness in [0.0, 0.6] {
        let absorbing = Material { roughness, ..medium(1.0, [0.8, 0.3, 0.0], 0.7) };
        let expected = transmittance(absorbing.volume.unwrap(), 1.2);
        let scene = seen_straight(slab(0.2, -1.0, 0), vec![absorbing], 4.0);
        assert_close(&format!("roughness {roughness}"), mean(&scene, 16), expected, 1e-5);
    }
}

/// The camera may stand in a medium, and a medium may have no end.
#[test]
fn a_camera_can_stand_in_a_volume() {
    let absorbing = medium(1.0, [0.8, 0.3, 0.5], 0.7);
    let expected = transmittance(absorbing.volume.unwrap(), 2.0);
    let scene = seen_straight(slab(5.0, -1.0, 0), vec![absorbing], 1.0);
    assert_close("from inside", mean(&scene, 16), expected, 1e-5);
}

/// In a medium inside of another the inner one alone absorbs; of two that overlap, the one entered last.
#[test]
fn the_medium_entered_last_counts() {
    let materials = vec![medium(1.0, [0.8, 0.3, 0.5], 0.7), medium(1.0, [0.4, 0.9, 0.6], 0.5)];
    let through = |material: usize, way| transmittance(materials[material].volume.unwrap(), way);
    let nested = seen_straight([slab(1.0, -1.0, 0), slab(0.3, -0.1, 1)].concat(), materials.clone(), 4.0);
    let expected = product(&[through(0, 1.6), through(1, 0.4)]);
    // From the third boundary on, paths end by chance.
    let (spp, tolerance) = if short_form() { (1 << 11, 2e-2) } else { (1 << 13, 1e-2) };
    assert_close("nested", mean(&nested, spp), expected, tolerance);
    let overlapping = seen_straight([slab(1.0, -0.2, 1), slab(0.2, -1.0, 0)].concat(), materials.clone(), 4.0);
    let expected = product(&[through(1, 0.8), through(0, 1.2)]);
    assert_close("overlapping", mean(&overlapping, spp), expected, tolerance);
}

/// Reflectance and transmittance of a stack of layers at normal incidence, by adding one after the other: boundaries lie
/// between the indices, absorption within them.
fn layers(indices: &[f64], transmittances: &[f64]) -> [f64; 2] {
    let boundary = |i: usize| ((indices[i + 1] - indices[i]) / (indices[i + 1] + indices[i])).powi(2);
    // From the front: reflectance; to the back: transmittance; from the back: reflectance.
    let mut sum = (boundary(0), 1.0 - boundary(0), boundary(0));
    for i in 1..indices.len() - 1 {
        let (front, through, back) = sum;
        let (tau, r) = (transmittances[i - 1], boundary(i));
        let rest = 1.0 - back * r * tau * tau;
        sum = (
            front + through * through * r * tau * tau / rest,
            through * tau * (1.0 - r) / rest,
            r + (1.0 - r).powi(2) * back * tau * tau / rest,
        );
    }
    [sum.0, sum.1]
}

/// Boundaries reflect by both of their media: a slab of glass, and one that has water in it.
#[test]
fn boundaries_reflect_by_both_of_their_media() {
    let (glass, water) = (medium(1.8, [0.9, 0.6, 0.3], 0.5), medium(1.2, [0.5, 0.8, 0.9], 0.5));
    let through = |m: &Material, way| transmittance(m.volume.unwrap(), way);
    let plain = seen_straight(slab(1.0, -1.0, 0), vec![glass.clone()], 4.0);
    let expected: [f64; 3] = std::array::from_fn(|k| layers(&[1.0, 1.8, 1.0], &[through(&glass, 2.0)[k]]).iter().sum());
    // Standard errors of 1e-3 and less; twice that in the short form.
    let (spp, tolerance) = if short_form() { (1 << 12, 8e-3) } else { (1 << 14, 4e-3) };
    assert_close("a slab", mean(&plain, spp), expected, tolerance);
    let filled =
        seen_straight([slab(1.0, -1.0, 0), slab(0.5, -0.5, 1)].concat(), vec![glass.clone(), water.clone()], 4.0);
    let expected: [f64; 3] = std::array::from_fn(|k| {
        let (wall, inside) = (through(&glass, 0.5)[k], through(&water, 1.0)[k]);
        layers(&[1.0, 1.8, 1.2, 1.8, 1.0], &[wall, inside, wall]).iter().sum()
    });
    assert_close("with water", mean(&filled, 2 * spp), expected, tolerance);
}

/// Light samples are absorbed too: a point light over a diffuse plate, all in one medium.
#[test]
fn shadow_rays_are_absorbed() {
    let absorbing = medium(1.0, [0.8, 0.3, 0.5], 0.7);
    let volume = absorbing.volume.unwrap();
    let plate = rectangle(DVec3::new(-1.0, -1.0, -1.0), DVec3::X * 2.0, DVec3::Y * 2.0, 1);
    let materials = vec![absorbing, Material::lambertian("plate", [0.5; 3])];
    let mut scene = seen_straight([slab(1.0, -2.0, 0), vec![plate]].concat(), materials, 4.0);
    scene.environment = Environment::Constant([0.0; 3]);
    // The boundary lies in no shadow ray's way.
    scene.lights.push(PunctualLight {
        name: String::from("light"),
        kind: PunctualKind::Point,
        intensity: [1.0; 3],
        position: DVec3::new(0.1, 0.2, -0.5),
        direction: DVec3::NEG_Z,
    });
    // The plate is 0.5 below the light and 2 behind the face that the camera sees.
    let irradiance = 1.0 / 0.25;
    let expected = product(&[transmittance(volume, 2.5), [0.5 / std::f64::consts::PI * irradiance; 3]]);
    let direct = Settings { max_bounces: Some(3), ..settings() };
    let mean = builder::mean(&scene, &direct, 4, 256).map(|e| e.mean);
    assert_close("plate", mean, expected, 1e-3);
}

/// A white furnace: rough glass of every kind gives back nearly what it gets, from outside and after many scatterings within.
#[test]
fn white_rough_glass_vanishes_before_a_white_environment() {
    let all = [(1.0, 1.5), (0.4, 1.5), (0.8, 1.3), (0.3, 2.4), (0.1, 1.5)];
    for (roughness, ior) in if short_form() { &all[..1] } else { &all[..] }.iter().copied() {
        let glass = Material { roughness, ..medium(ior, [1.0; 3], 1.0) };
        let ball = placed(icosphere(2), 1.0, DVec3::ZERO, 0);
        let camera = camera(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 0.4);
        let environment = Environment::Constant([1.0; 3]);
        let scene = Scene { environment, ..scene(vec![ball], vec![glass], camera) };
        let settings = gpu::settings(16, 16);
        let mean = builder::mean(&scene, &settings, 8, 256)[1];
        println!("roughness {roughness}, ior {ior}: {:.5} ± {:.1e}", mean.mean, mean.standard_error());
        let exact = Estimate::exact(1.0);
        let error = mean.standard_error();
        assert!(error < 1.5e-3, "a standard error of {error}");
        assert!(mean.mean - exact.mean < 1e-3 + 4.0 * error, "{} is more than 1", mean.mean);
        // Each scattering may lose 1 %, and the light within is scattered several times.
        assert!(mean.mean > 0.98 - 4.0 * error, "{}", mean.mean);
    }
}
