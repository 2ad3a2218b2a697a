//! Estimators that must agree: the ways to look for light and to sample the environment, on every scene of the project.

use std::sync::Arc;

use crate::common::scenes::{all_scenes, scene, short_form};
use crate::common::statistics::{Estimate, assert_agree};
use crate::common::{gpu, scenes};
use sunfleck::render::{EnvironmentSampling, LightSampling, MisHeuristic, SamplerKind, Settings};
use sunfleck::scene::{Environment, Scene};

/// Small films: these tests compare means of images.
fn settings() -> Settings {
    gpu::settings(48, 48)
}

fn mean(scene: &Scene, settings: &Settings) -> [Estimate; 3] {
    let mut tracer = gpu::path_tracer(scene, settings);
    scenes::seeds(&mut tracer, settings, 16, if short_form() { 4 } else { 8 }).image()
}

#[test]
fn ways_to_look_for_light_agree_on_every_scene() {
    for name in all_scenes().iter().map(String::as_str).chain(["cornell"]) {
        // Their own tests hold the furnaces to exact numbers.
        if name.starts_with("furnace") {
            continue;
        }
        // Each scene takes four kernels, and a software driver seconds to compile each; the others need more samples than a
        // slow driver can draw.
        if short_form() && !["cornell", "environment", "punctual", "textured"].contains(&name) {
            continue;
        }
        let scene = scene(name);
        let base = Settings { max_bounces: Some(6), ..settings() };
        let reference = mean(&scene, &base);
        for mode in [LightSampling::Mixture, LightSampling::Nee, LightSampling::Bsdf] {
            // Light samples alone meet the narrow lobes of glass too seldom for a mean of this length to be normal.
            if name == "volumes" && mode == LightSampling::Nee {
                continue;
            }
            let other = mean(&scene, &Settings { light_sampling: mode, ..base.clone() });
            assert_agree(&format!("{name}, mis and {mode}"), reference, other);
        }
    }
}

#[test]
fn balance_and_power_heuristics_agree() {
    let scene = scene("metallic_roughness");
    let power = settings();
    let balance = Settings { mis_heuristic: MisHeuristic::Balance, ..power.clone() };
    assert_agree("power and balance", mean(&scene, &power), mean(&scene, &balance));
}

/// The Sobol' sampler has the mean of independent samples, and is by far the nearer to it.
#[test]
fn samplers_agree() {
    for name in ["cornell", "metallic_roughness", "environment", "volumes", "many_lights"] {
        if short_form() && name != "cornell" {
            continue;
        }
        let scene = scene(name);
        let independent = Settings { max_bounces: Some(6), ..settings() };
        for estimate in [false, true] {
            let sobol = Settings { sampler: SamplerKind::Sobol, estimate, ..independent.clone() };
            assert_agree(&format!("{name}, independent and sobol"), mean(&scene, &independent), mean(&scene, &sobol));
        }
    }
}

/// A dim sky with a small sun, off the texel grid's symmetries.
fn sky() -> Environment {
    let (width, height) = (32_u32, 16_u32);
    let texel = |x: u32, y: u32| {
        if (x, y) == (21, 4) { [40.0, 36.0, 30.0] } else { [0.2, 0.3, 0.1 + 0.02 * y as f32] }
    };
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| texel(x, y))).collect();
    Environment::Image {
        name: "sky".to_owned(),
        width,
        height,
        texels: Arc::new(texels),
        strength: 0.7,
        rotation_radians: 0.6,
    }
}

#[test]
fn environment_samplings_agree() {
    let mut scene = Scene { environment: sky(), ..scene("environment") };
    // Uniform light sampling meets a small sun in a narrow lobe so seldom, and then so brightly, that sixteen images do not
    // show its variance (with 32 times the samples the means agree to 0.3 standard errors).
    scene.materials.iter_mut().for_each(|material| material.roughness = material.roughness.max(0.7));
    let settings = settings();
    let reference = mean(&scene, &settings);
    for (env_sampling, light_sampling) in [
        (EnvironmentSampling::Uniform, LightSampling::Mis),
        (EnvironmentSampling::Importance, LightSampling::Mis),
        (EnvironmentSampling::Compensated, LightSampling::Mixture),
        (EnvironmentSampling::Compensated, LightSampling::Nee),
        (EnvironmentSampling::Importance, LightSampling::Nee),
        (EnvironmentSampling::Uniform, LightSampling::Nee),
        (EnvironmentSampling::Importance, LightSampling::Bsdf),
    ] {
        let other = Settings { env_sampling: Some(env_sampling), light_sampling, ..settings.clone() };
        assert_agree(&format!("compensated mis and {env_sampling} {light_sampling}"), reference, mean(&scene, &other));
    }
}
