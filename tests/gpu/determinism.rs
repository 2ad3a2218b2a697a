//! An image is a function of scene, settings, seed, sample range and kernel key alone.

use std::ops::{ControlFlow, Range};

use crate::common::gpu;
use crate::common::scenes::{scene, short_form, slow_driver};
use sunfleck::film::Film;
use sunfleck::gpu::ArrayForm;
use sunfleck::render::{BindingOverride, Integrator, PathTracer, Settings};

fn settings() -> Settings {
    gpu::settings(50, 37)
}

/// The short form takes the first scene alone: each brings kernels of its own.
fn some(scenes: &'static [&'static str]) -> &'static [&'static str] {
    if short_form() { &scenes[..1] } else { scenes }
}

fn film(name: &str, settings: &Settings, overrides: BindingOverride, samples: Range<u32>) -> Film {
    let mut tracer = gpu::path_tracer_with(&scene(name), settings, overrides);
    range(&mut tracer, samples)
}

fn range(tracer: &mut PathTracer, samples: Range<u32>) -> Film {
    let run = tracer.run(3, samples, None, &mut |_| ControlFlow::Continue(())).expect("the device works");
    gpu::assert_no_validation_messages();
    run.film
}

fn bits(film: &Film) -> Vec<[u64; 4]> {
    film.pixels().iter().map(|p| [p.rgb[0], p.rgb[1], p.rgb[2], p.luminance_squared].map(f64::to_bits)).collect()
}

#[test]
fn slices_workgroups_and_budgets_do_not_change_a_bit() {
    for name in some(&["instances", "cornell_spheres", "alpha"]) {
        let reference = film(name, &settings(), BindingOverride::default(), 0..40);
        for (slice_atoms, workgroup_size, ray_budget) in
            [(None, None, None), (Some(1000), Some(32), None), (Some(4096), Some(128), Some(3)), (None, None, Some(50))]
        {
            let overrides = BindingOverride { slice_atoms, workgroup_size, ray_budget, ..BindingOverride::default() };
            let other = film(name, &settings(), overrides, 0..40);
            assert_eq!(bits(&reference), bits(&other), "{name}, {overrides:?}");
        }
    }
}

/// Mesa's lavapipe leaves every loop once those of an invocation have had 65,535 rounds. A large slice would have several times as
/// many, were all of its atoms rendered by the lanes that come first, in searches and in the choice of lights.
#[test]
fn a_long_dispatch_does_not_change_a_bit() {
    let settings = gpu::settings(64, 64);
    for name in some(&["cornell", "many_lights", "environment"]) {
        let atoms = |count| BindingOverride { slice_atoms: Some(count), ..BindingOverride::default() };
        let samples = if slow_driver() { 0..16 } else { 0..128 };
        assert!(
            bits(&film(name, &settings, atoms(64 * 64 * 8), samples.clone()))
                == bits(&film(name, &settings, atoms(512), samples)),
            "{name}"
        );
    }
}

#[test]
fn the_form_of_the_arrays_and_their_chunks_do_not_change_a_bit() {
    let device = gpu::device();
    let scene_name = "textured";
    let reference = film(scene_name, &settings(), BindingOverride::default(), 0..16);
    let mut forms = vec![(ArrayForm::StorageBuffer, 31), (ArrayForm::StorageBuffer, 14)];
    if device.gpu.info.limits.texel_buffer_elements > 1 << 20 {
        forms.extend([(ArrayForm::TexelBuffer, 31), (ArrayForm::TexelBuffer, 14)]);
    }
    if device.gpu.info.buffer_device_address {
        forms.push((ArrayForm::DeviceAddress, 31));
    }
    for form in forms {
        let overrides = BindingOverride { array_form: Some(form), ..BindingOverride::default() };
        assert_eq!(bits(&reference), bits(&film(scene_name, &settings(), overrides, 0..16)), "{form:?}");
    }
}

/// Specialisation before the driver does what the driver's does, with every kind of material and light at least once.
#[test]
fn who_specializes_does_not_change_a_bit() {
    if slow_driver() {
        eprintln!("not run: SwiftShader compiles dead code too, which takes it minutes");
        return;
    }
    for name in some(&["textured", "cornell_spheres", "volumes", "environment", "punctual"]) {
        let by_driver = BindingOverride { driver_specializes: true, ..BindingOverride::default() };
        // A search that is compiled in rounds differently, and only our own specialisation compiles one in.
        let unbaked = Settings { bake: false, ..settings() };
        let [ours, driver] = [BindingOverride::default(), by_driver].map(|o| bits(&film(name, &unbaked, o, 0..16)));
        assert_eq!(ours, driver, "{name}");
    }
}

#[test]
fn integrators_add_up() {
    for name in some(&["cornell_spheres", "environment"]) {
        let part = |integrator| film(name, &Settings { integrator, ..settings() }, BindingOverride::default(), 0..24);
        let path = part(Integrator::Path);
        let parts = [Integrator::Emission, Integrator::Direct, Integrator::Indirect].map(part);
        for pixel in 0..path.pixels().len() {
            let whole = path.mean(pixel);
            for channel in 0..3 {
                let sum: f64 = parts.iter().map(|film| film.mean(pixel)[channel]).sum();
                let (sum, whole) = (sum as f32, whole[channel] as f32);
                assert!(
                    sum == whole || sum.next_up() == whole || sum.next_down() == whole,
                    "{name}, pixel {pixel}, channel {channel}: {sum} and {whole}"
                );
            }
        }
    }
}

#[test]
fn sample_ranges_add_up() {
    let mut tracer = gpu::path_tracer(&scene("cornell"), &settings());
    let whole = range(&mut tracer, 0..70);
    let mut parts = range(&mut tracer, 0..16);
    // Not on block boundaries either.
    parts.merge(&range(&mut tracer, 16..21));
    parts.merge(&range(&mut tracer, 21..70));
    for pixel in 0..whole.pixels().len() {
        for (a, b) in whole.mean(pixel).iter().zip(parts.mean(pixel)) {
            let (a, b) = (*a as f32, b as f32);
            assert!(a == b || a.next_up() == b || a.next_down() == b, "pixel {pixel}: {a} and {b}");
        }
    }
}
