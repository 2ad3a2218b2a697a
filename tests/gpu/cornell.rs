//! The built-in Cornell box against Mitsuba's renderings of it (tests/reference/).

use crate::common::reference::{RESOLUTION, Reference, TILE};
use crate::common::scenes::{scene, short_form, slow_driver};
use crate::common::statistics::{Comparison, Estimate, TileStatistics};
use crate::common::{gpu, scenes};
use sunfleck::render::{Integrator, Settings};
use sunfleck::scene::Scene;

const SEEDS: u32 = 32;

fn settings(bounces: Option<u32>, integrator: Integrator) -> Settings {
    Settings { max_bounces: bounces, integrator, ..gpu::settings(RESOLUTION as u32, RESOLUTION as u32) }
}

/// Everything, and everything but the emission that the camera sees directly, from the same samples.
fn render(scene: &Scene, bounces: Option<u32>, spp: u32) -> (TileStatistics, TileStatistics) {
    let mut path = gpu::path_tracer(scene, &settings(bounces, Integrator::Path));
    let mut emission = gpu::path_tracer(scene, &settings(bounces, Integrator::Emission));
    let new = || TileStatistics::new(RESOLUTION, RESOLUTION, TILE);
    let (mut everything, mut reflected) = (new(), new());
    for seed in 0..SEEDS {
        let all = gpu::run(&mut path, seed, spp).film.radiance();
        let emitted = gpu::run(&mut emission, seed, spp).film.radiance();
        let rest: Vec<[f32; 3]> = all.iter().zip(&emitted).map(|(a, e)| [0, 1, 2].map(|c| a[c] - e[c])).collect();
        everything.add(&all);
        reflected.add(&rest);
    }
    (everything, reflected)
}

fn assert_means(what: &str, ours: [Estimate; 3], theirs: [Estimate; 3]) {
    for (channel, (a, b)) in ours.iter().zip(&theirs).enumerate() {
        let (ea, eb) = (100.0 * a.relative_error(), 100.0 * b.relative_error());
        println!("{what}, channel {channel}: {:.6} ± {ea:.3} % against {:.6} ± {eb:.3} %", a.mean, b.mean);
        assert!(ea < 0.1 && eb < 0.1, "{what}: standard errors of {ea} % and {eb} % are too large to tell");
        assert!(a.deviation(b) < 4.0, "{what}: the means differ by {} standard errors", a.deviation(b));
    }
}

fn compare(bounces: Option<u32>, spp: u32) {
    let (everything, reflected) = render(&scene("cornell"), bounces, spp);
    let reference = Reference::everything(bounces);
    let comparison = Comparison::new(&everything.tiles(), &reference.tiles, 0.01);
    println!("tiles: {comparison}");
    assert!(comparison.passed(), "tiles: {comparison}");
    if bounces == Some(0) {
        assert_means("emission", everything.image(), reference.image());
    } else {
        assert_means("all but emission", reflected.image(), Reference::reflected(bounces).image());
    }
}

#[test]
fn emission_agrees() {
    compare(Some(0), if slow_driver() { 4 } else { 8 });
}

#[test]
fn one_bounce_agrees() {
    // Four samples saw nothing of a tile that one in 2,700 samples lights: a mean without a variance, which no test can judge.
    if !short_form() {
        compare(Some(1), 16);
    }
}

#[test]
fn two_bounces_agree() {
    if !short_form() {
        compare(Some(2), 4);
    }
}

#[test]
fn seven_bounces_agree() {
    compare(Some(7), if slow_driver() { 2 } else { 4 });
}

#[test]
fn unlimited_bounces_agree() {
    if !short_form() {
        compare(None, 4);
    }
}

/// The test above would see a change of one albedo by one percent.
#[test]
fn a_changed_albedo_is_noticed() {
    if short_form() {
        return;
    }
    let mut scene = scene("cornell");
    let white = scene.materials.iter_mut().find(|m| m.name == "white").expect("a white material");
    white.base_color = white.base_color.map(|c| c * 1.01);
    let settings = settings(Some(7), Integrator::Path);
    let mut tracer = gpu::path_tracer(&scene, &settings);
    let ours = scenes::seeds(&mut tracer, &settings, SEEDS, 8);
    let comparison = Comparison::new(&ours.tiles(), &Reference::everything(Some(7)).tiles, 0.01);
    println!("tiles: {comparison}");
    assert!(!comparison.passed(), "an albedo 1 % too high went unnoticed");
}
