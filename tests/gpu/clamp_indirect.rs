//! `--clamp-indirect` takes light away from indirect light alone, and only above its bound.

use crate::common::gpu;
use crate::common::scenes::scene;
use sunfleck::render::{Integrator, Settings};

fn pixels(clamp_indirect: Option<f32>, integrator: Integrator) -> Vec<[f64; 3]> {
    let settings = Settings { clamp_indirect, integrator, max_bounces: Some(5), ..gpu::settings(16, 16) };
    let film = gpu::run(&mut gpu::path_tracer(&scene("cornell"), &settings), 1, 16).film;
    film.pixels().iter().map(|p| p.rgb).collect()
}

#[test]
fn a_bound_that_nothing_reaches_changes_no_bit() {
    assert_eq!(pixels(Some(1e30), Integrator::Path), pixels(None, Integrator::Path));
}

#[test]
fn what_is_seen_and_direct_light_are_never_cut() {
    for integrator in [Integrator::Emission, Integrator::Direct] {
        assert_eq!(pixels(Some(1e-6), integrator), pixels(None, integrator), "{integrator}");
    }
}

/// Each of 16 samples may bring the bound at events 2 to 5, by a light sample and by a BSDF sample.
#[test]
fn indirect_light_keeps_the_bound_and_its_colour() {
    const BOUND: f32 = 0.01;
    let cut = pixels(Some(BOUND), Integrator::Indirect);
    let whole = pixels(None, Integrator::Indirect);
    let most = 16.0 * 8.0 * f64::from(BOUND) * (1.0 + 1e-5);
    assert!(cut.iter().flatten().all(|&c| (0.0..=most).contains(&c)));
    assert!(cut.iter().zip(&whole).all(|(a, b)| a.iter().zip(b).all(|(a, b)| *a <= b * (1.0 + 1e-6))));
    let sum = |image: &[[f64; 3]], c: usize| image.iter().map(|p| p[c]).sum::<f64>();
    assert!(sum(&cut, 1) < 0.5 * sum(&whole, 1), "the bound acts");
    assert!(sum(&cut, 1) > 0.0);
}
