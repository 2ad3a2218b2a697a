//! Clear thin walls: light samples pass them, what paths find behind them is weighed against that, and nothing is counted
//! twice.

use std::f64::consts::PI;

use crate::common::builder::{self, camera, placed, rectangle, scene};
use crate::common::gpu;
use crate::common::scenes::{short_form, slow_driver};
use crate::common::statistics::assert_agree;
use crate::common::trace::icosphere;
use glam::DVec3;
use sunfleck::render::{Integrator, LightChoice, LightSampling, Settings};
use sunfleck::scene::{Bsdf, Environment, Material, Primitive, PunctualKind, PunctualLight, Scene};

fn pane(color: [f32; 3], transmission: f32) -> Material {
    let glass = Material { bsdf: Bsdf::MetallicRoughness, ior: 1.5, ..Material::lambertian("pane", color) };
    Material { metallic: 0.0, roughness: 0.0, transmission, double_sided: true, ..glass }
}

fn square(z: f64, half: f64, material: usize) -> Primitive {
    rectangle(DVec3::new(-half, -half, z), DVec3::X * 2.0 * half, DVec3::Y * 2.0 * half, material)
}

/// A diffuse plate at z = −1, seen along a slanted ray that meets no pane, with panes above it at z = 0.1 and 0.3: a light at
/// z = 1 reaches all of it through them alone.
fn under_panes(panes: usize, light: Scene) -> Scene {
    let mut objects = vec![square(-1.0, 1.0, 0)];
    objects.extend((0..panes).map(|i| square(0.1 + 0.2 * i as f64, 0.6, 1)));
    let mut materials = vec![Material::lambertian("plate", [0.5; 3]), pane([0.9, 0.6, 0.3], 0.75)];
    for mut primitive in light.meshes.into_iter().flat_map(|mesh| mesh.primitives) {
        primitive.material += materials.len();
        objects.push(primitive);
    }
    materials.extend(light.materials);
    let view = camera(DVec3::new(4.0, 0.0, 2.0), DVec3::new(0.0, 0.0, -1.0), 1e-3);
    Scene { lights: light.lights, environment: light.environment, ..scene(objects, materials, view) }
}

fn point_light() -> Scene {
    Scene {
        lights: vec![PunctualLight {
            name: String::from("light"),
            kind: PunctualKind::Point,
            intensity: [1.0; 3],
            position: DVec3::new(0.0, 0.0, 1.0),
            direction: DVec3::NEG_Z,
        }],
        ..Scene::default()
    }
}

fn lamp() -> Scene {
    let material = Material { emission: [3.0, 2.0, 1.0], ..Material::lambertian("lamp", [0.0; 3]) };
    let corner = DVec3::new(-0.2, -0.2, 1.0);
    scene(
        vec![rectangle(corner, DVec3::Y * 0.4, DVec3::X * 0.4, 0)],
        vec![material],
        camera(DVec3::Z, DVec3::ZERO, 1.0),
    )
}

fn settings() -> Settings {
    gpu::settings(4, 4)
}

/// A point light, which no path can find: what comes through n panes at normal incidence is known.
#[test]
fn a_point_light_shines_through_panes() {
    for panes in [0, 1, 2] {
        let settings = Settings { max_bounces: Some(1 + panes as u32), ..settings() };
        let mean = builder::mean(&under_panes(panes, point_light()), &settings, 4, 16);
        for (channel, color) in [0.9, 0.6, 0.3].into_iter().enumerate() {
            // F0 = 0.04 is reflected, and three quarters of the rest go through.
            let through = f64::powi(color * 0.75 * 0.96, panes as i32);
            let expected = 0.5 / PI / 4.0 * through;
            let value = mean[channel].mean;
            println!("{panes} panes, channel {channel}: {value} for {expected}");
            // The image spans 5 mm of the plate, off the axis by half of that.
            assert!((value / expected - 1.0).abs() < 1e-4, "{panes} panes: {value} instead of {expected}");
        }
    }
}

/// Each pane is a scattering event: beyond the bound, and for another integrator, its light is not there.
#[test]
fn a_pane_is_a_scattering_event() {
    let scene = under_panes(1, point_light());
    let sum = |max_bounces, integrator| {
        let settings = Settings { max_bounces: Some(max_bounces), integrator, ..settings() };
        gpu::run(&mut gpu::path_tracer(&scene, &settings), 0, 16).film.radiance().iter().map(|p| p[0]).sum::<f32>()
    };
    assert_eq!(sum(1, Integrator::Path), 0.0);
    assert_eq!(sum(2, Integrator::Direct), 0.0);
    assert!(sum(2, Integrator::Path) > 0.0);
    assert_eq!(sum(2, Integrator::Indirect), sum(2, Integrator::Path));
}

/// A lamp, and a sky, by both strategies and by each alone; picked by a table and by a tree.
#[test]
fn ways_to_look_for_light_agree_behind_panes() {
    let sky = || Scene { environment: Environment::Constant([0.5, 1.0, 2.0]), ..Scene::default() };
    let bulbs = || {
        let mut bulbs = lamp();
        let ball = placed(icosphere(1), 0.1, DVec3::new(0.3, 0.1, 0.8), 0);
        bulbs.meshes[0].primitives.push(ball);
        bulbs
    };
    let lights: [(&str, Scene); 3] = [("lamp", lamp()), ("sky", sky()), ("bulbs", bulbs())];
    let (seeds, spp) = if short_form() { (8, 64) } else { (16, 512) };
    for (name, light) in lights {
        // Each takes four kernels, which a slow driver compiles for seconds.
        if slow_driver() && name != "bulbs" {
            continue;
        }
        // A curved pane too: an open sphere of glass around a part of the light's way.
        let mut scene = under_panes(2, light);
        scene.meshes[0].primitives.push(placed(icosphere(2), 0.3, DVec3::new(-0.3, 0.0, -0.5), 1));
        for light_choice in [LightChoice::Power, LightChoice::Bvh] {
            if light_choice == LightChoice::Bvh && name != "bulbs" {
                continue;
            }
            let base = Settings { light_choice, max_bounces: Some(8), ..settings() };
            let mean = |light_sampling| {
                let settings = Settings { light_sampling, ..base.clone() };
                builder::mean(&scene, &settings, seeds, spp)
            };
            let reference = mean(LightSampling::Mis);
            for way in [LightSampling::Mixture, LightSampling::Nee, LightSampling::Bsdf] {
                let other = mean(way);
                assert_agree(&format!("{name}, mis and {way}"), reference, other);
            }
        }
    }
}

/// A white ball in boxes of white panes before a white sky: what the panes reflect and what they let through is all.
#[test]
fn a_white_furnace_of_panes() {
    let mut objects = vec![placed(icosphere(2), 0.5, DVec3::ZERO, 0)];
    objects.extend([0.8, 1.0].map(|scale| placed(icosphere(1), scale, DVec3::ZERO, 1)));
    let materials = vec![Material::lambertian("white", [1.0; 3]), pane([1.0; 3], 1.0)];
    let view = camera(DVec3::Z * 4.0, DVec3::ZERO, 0.4);
    let scene = Scene { environment: Environment::Constant([1.0; 3]), ..scene(objects, materials, view) };
    let mean = builder::mean(&scene, &gpu::settings(16, 16), 8, if short_form() { 64 } else { 256 })[1];
    println!("{:.5} ± {:.1e}", mean.mean, mean.standard_error());
    assert!((mean.mean - 1.0).abs() < 4.0 * mean.standard_error() + 1e-5, "{mean:?}");
    assert!(mean.standard_error() < 5e-3);
}

/// The variance falls by far: a small lamp behind a pane was found by chance.
#[test]
fn light_samples_find_a_small_lamp_behind_a_pane() {
    let scene = under_panes(1, lamp());
    let error = |light_sampling| {
        let settings = Settings { light_sampling, max_bounces: Some(2), ..settings() };
        builder::mean(&scene, &settings, 16, 16)[1].relative_error()
    };
    let (mis, bsdf) = (error(LightSampling::Mis), error(LightSampling::Bsdf));
    println!("relative error by mis {mis:.4}, by bsdf {bsdf:.4}");
    assert!(mis < 0.3 * bsdf);
}
