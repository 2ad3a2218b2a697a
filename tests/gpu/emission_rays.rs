//! Camera rays that ask for emission alone: what the camera sees keeps its mean, and lamps have smoother edges.

use glam::{DAffine3, DVec3};
use sunfleck::render::{Integrator, SamplerKind, Settings};
use sunfleck::scene::{AlphaMode, Bsdf, Environment, Instance, Material, Projection, Scene};

use crate::common::builder::{camera, rectangle, scene};
use crate::common::statistics::{Estimate, assert_agree, squared_deviations};
use crate::common::{gpu, scenes};

/// Lamps before a grey sky: one in the middle behind a sheet that is half there, one behind a post, a mirrored instance that
/// turns its front to the camera, one that turns its back and one that reaches behind the camera.
fn lamps() -> Scene {
    let lamp = |name: &str, emission| Material { emission, ..Material::lambertian(name, [0.3; 3]) };
    let sheet = Material {
        bsdf: Bsdf::Unlit,
        base_color: [0.2, 0.4, 0.8],
        alpha: 0.5,
        alpha_mode: AlphaMode::Blend,
        ..Material::default()
    };
    let materials = vec![
        lamp("warm", [9.0, 7.0, 4.0]),
        lamp("cold", [2.0, 5.0, 11.0]),
        Material::lambertian("post", [0.5; 3]),
        sheet,
    ];
    let upright = |x: f64, y: f64, z: f64, size: f64, material| {
        rectangle(DVec3::new(x, y, z), size * DVec3::new(1.0, 0.2, 0.0), size * DVec3::new(-0.2, 1.0, 0.0), material)
    };
    let primitives = vec![
        upright(-0.3, -0.3, 0.0, 0.7, 0),
        upright(-0.1, -0.5, 0.3, 0.6, 3),
        upright(0.7, 0.2, 0.0, 0.4, 1),
        upright(0.8, 0.1, 0.2, 0.2, 2),
        // Its back.
        rectangle(DVec3::new(-0.9, 0.4, 0.0), 0.4 * DVec3::Y, 0.4 * DVec3::X, 1),
        // From before the camera to behind it.
        rectangle(DVec3::new(-0.6, -0.8, 6.0), 0.1 * DVec3::X, -6.0 * DVec3::Z, 0),
    ];
    let view = camera(DVec3::new(0.1, 0.0, 3.0), DVec3::ZERO, 0.7);
    let mut scene = scene(primitives, materials, view);
    scene.environment = Environment::Constant([0.4, 0.5, 0.6]);
    scene.meshes.push(sunfleck::scene::Mesh {
        name: String::from("mirrored"),
        primitives: vec![rectangle(DVec3::new(-0.5, 0.5, 0.0), 0.3 * DVec3::Y, 0.3 * DVec3::X, 0)],
    });
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let place = |x: f64| Instance {
        mesh: 1,
        object_to_world: DAffine3::from_translation(DVec3::new(x, 0.0, -0.1)) * mirror,
        name: String::from("mirrored"),
    };
    scene.instances.extend([place(-0.9), place(-0.5)]);
    scene
}

fn mean(scene: &Scene, settings: &Settings) -> [Estimate; 3] {
    let mut tracer = gpu::path_tracer(scene, settings);
    assert_eq!(tracer.key().emission_rays, settings.emission_rays != Some(0));
    scenes::seeds(&mut tracer, settings, if scenes::slow_driver() { 4 } else { 16 }, 16).image()
}

/// A number of rays that is no power of two, too; by both samplers, both kinds of camera, and integrators that have them.
#[test]
fn what_the_camera_sees_keeps_its_mean() {
    let perspective = lamps();
    let mut orthographic = perspective.clone();
    orthographic.cameras[0].projection = Projection::Orthographic { ymag: 1.0 };
    let (width, height) = if scenes::slow_driver() { (24, 20) } else { (48, 40) };
    let emission = Settings { integrator: Integrator::Emission, ..gpu::settings(width, height) };
    let sobol = Settings { sampler: SamplerKind::Sobol, ..emission.clone() };
    let path = Settings { max_bounces: Some(2), ..gpu::settings(width, height) };
    for (name, scene, settings, rays) in [
        ("independent", &perspective, &emission, &[1, 8][..]),
        ("sobol", &perspective, &sobol, &[3]),
        ("orthographic", &orthographic, &sobol, &[8]),
        ("all light", &perspective, &path, &[4]),
    ] {
        let with = |rays| mean(scene, &Settings { emission_rays: Some(rays), ..settings.clone() });
        let without = with(0);
        for &rays in rays {
            assert_agree(&format!("{name}, {rays} rays"), without, with(rays));
        }
    }
}

/// The error of an edge that N stratified points a pixel find falls as N^−1.5: with eight rays to 1/22.
#[test]
fn lamps_have_smoother_edges() {
    let error = |emission_rays| {
        let settings = Settings {
            sampler: SamplerKind::Sobol,
            integrator: Integrator::Emission,
            emission_rays,
            ..gpu::settings(64, 64)
        };
        let mut tracer = gpu::path_tracer(&scenes::scene("cornell"), &settings);
        let images: Vec<_> = (0..8).map(|seed| gpu::run(&mut tracer, seed, 16).film.radiance()).collect();
        squared_deviations(&images)
    };
    let (without, chosen, eight) = (error(Some(0)), error(None), error(Some(8)));
    println!("{without:.3e}, {chosen:.3e}, {eight:.3e}: {:.4}", eight / without);
    assert_eq!(chosen, eight, "few pixels see the lamp, so they have the most rays");
    assert!(eight < without / 10.0);
}

/// Where no lamp is seen, or nearly everywhere, or what is seen does not count, the kernel has none.
#[test]
fn what_does_not_need_them_has_none() {
    let has = |scene: &Scene, settings: &Settings| gpu::path_tracer(scene, settings).key().emission_rays;
    let settings = gpu::settings(32, 32);
    let cornell = scenes::scene("cornell");
    assert!(has(&cornell, &settings));
    for integrator in [Integrator::Direct, Integrator::Indirect] {
        assert!(!has(&cornell, &Settings { integrator, ..settings.clone() }), "{integrator}");
    }
    let mut lens = cornell.clone();
    lens.cameras[0].lens_radius = 0.01;
    assert!(!has(&lens, &settings));
    let before = |eye: DVec3| {
        let lamp = Material { emission: [1.0; 3], ..Material::lambertian("lamp", [0.0; 3]) };
        let square = rectangle(DVec3::new(-1.0, -1.0, 0.0), 2.0 * DVec3::X, 2.0 * DVec3::Y, 0);
        scene(vec![square], vec![lamp], camera(eye, DVec3::ZERO, 0.5))
    };
    assert!(has(&before(DVec3::Z * 20.0), &settings), "far away");
    assert!(!has(&before(DVec3::Z * 2.0), &settings), "all of the film");
    assert!(!has(&before(DVec3::Z * -20.0), &settings), "from behind");
    assert!(has(&before(DVec3::Z * 2.0), &Settings { emission_rays: Some(2), ..settings }), "asked for");
}
