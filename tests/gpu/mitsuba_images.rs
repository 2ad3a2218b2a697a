//! Twelve balls of twelve materials against Mitsuba's rendering of them, with the known differences of its models
//! multiplied in there (tests/reference/make_bsdf_images.py).

use std::path::Path;

use crate::common::gpu;
use crate::common::reference::Reference;
use crate::common::scenes::{short_form, slow_driver};
use crate::common::statistics::{Comparison, TileStatistics};
use sunfleck::render::Settings;
use sunfleck::scene::{Scene, load};

/// As in the script.
const WIDTH: usize = 96;
const HEIGHT: usize = 72;
const TILE: usize = 4;
const BOUNCES: u32 = 8;

fn balls() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/bsdf_balls.gltf");
    load::load_scene(&path).expect("the scene loads")
}

fn compare(scene: &Scene, seeds: u32, spp: u32) -> Comparison {
    let settings = Settings { max_bounces: Some(BOUNCES), ..gpu::settings(WIDTH as u32, HEIGHT as u32) };
    let mut tracer = gpu::path_tracer(scene, &settings);
    let mut ours = TileStatistics::new(WIDTH, HEIGHT, TILE);
    for seed in 0..seeds {
        ours.add(&gpu::run(&mut tracer, seed, spp).film.radiance());
    }
    let reference = Reference::read("bsdf_balls.exr");
    for (channel, (a, b)) in ours.image().iter().zip(reference.image()).enumerate() {
        let (ea, eb) = (100.0 * a.relative_error(), 100.0 * b.relative_error());
        println!("channel {channel}: {:.6} ± {ea:.3} % against {:.6} ± {eb:.3} %", a.mean, b.mean);
    }
    let comparison = Comparison::new(&ours.tiles(), &reference.tiles, 0.01);
    println!("tiles: {comparison}");
    comparison
}

#[test]
fn twelve_materials_agree() {
    let comparison = compare(&balls(), 32, if slow_driver() { 8 } else { 16 });
    assert!(comparison.passed(), "tiles: {comparison}");
}

/// A roughness of 0.4 that is a tenth too high is noticed.
#[test]
fn a_changed_material_is_noticed() {
    if short_form() {
        return;
    }
    let mut scene = balls();
    let metal = scene.materials.iter_mut().find(|m| m.name == "metal" && m.roughness < 0.5).expect("a smooth metal");
    metal.roughness *= 1.1;
    let comparison = compare(&scene, 16, 16);
    assert!(!comparison.passed(), "{comparison}");
}
