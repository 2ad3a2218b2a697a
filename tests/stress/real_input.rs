//! Not one non-finite sample in any scene of `scenes/` or of the shared collection of real input, and the proof that one
//! would be counted, located and, under `--strict`, refused.

use std::ops::ControlFlow;
use std::path::Path;

use assert_cmd::Command;
use sunfleck::render::{BindingOverride, NonFiniteSample, PathTracer, Run, Settings, prepare_scene};
use sunfleck::scene::Scene;
use sunfleck::scene::load::load_scene;

use crate::common::assets::{collection, files};
use crate::common::mutation::write_sources;
use crate::common::scenes::{all_scenes, full_form, scene};
use crate::common::{builder, gpu};

/// Side of the images in pixels.
const SIDE: u32 = 16;

fn run(tracer: &mut PathTracer, spp: u32) -> Run {
    let run = tracer.run(0, 0..spp, None, &mut |_| ControlFlow::Continue(())).expect("the device works");
    gpu::assert_no_validation_messages();
    run
}

/// Asserts that the device sums up finite numbers alone.
fn assert_finite(name: &str, run: &Run) {
    assert_eq!(run.non_finite_samples, 0, "{name}: non-finite samples: {:?}", run.first_non_finite);
    assert_eq!(run.film.non_finite_pixels(), 0, "{name}: a sum of finite samples is not finite");
}

#[test]
fn every_scene_of_the_project_is_finite() {
    let spp = if full_form() { 64 } else { 4 };
    let settings = gpu::settings(SIDE, SIDE);
    for name in all_scenes().iter().map(String::as_str).chain(["cornell"]) {
        assert_finite(name, &run(&mut gpu::path_tracer(&scene(name), &settings), spp));
    }
}

/// Renders a scene of the collection; `None` if it is refused, and then the reason is printed.
fn render_real(path: &Path) -> Option<Run> {
    let mut scene: Scene = load_scene(path).inspect_err(|error| println!("refused: {error}")).ok()?;
    scene.frame_if_no_camera();
    scene.light_if_dark();
    let settings = gpu::settings(SIDE, SIDE);
    let device = gpu::device();
    let camera = &scene.cameras[0];
    let tracer = prepare_scene(&scene, camera, &settings).and_then(|prepared| {
        PathTracer::new(&device.gpu, device.trace, &prepared, camera, &settings, BindingOverride::default())
    });
    match tracer {
        Ok(mut tracer) => Some(run(&mut tracer, if full_form() { 2 } else { 1 })),
        Err(error) => {
            println!("{}: refused: {error}", path.display());
            None
        }
    }
}

/// The short form takes every 60th file, the full one every second; SUNFLECK_STRESS_ASSETS=all takes all of them.
#[test]
fn real_scenes_are_finite() {
    let Some(folder) = collection() else { return };
    let all = std::env::var("SUNFLECK_STRESS_ASSETS").is_ok_and(|which| which == "all");
    let paths = files(&folder, &["gltf", "glb", "obj"]);
    let stride = if all {
        1
    } else if full_form() {
        2
    } else {
        60
    };
    let (mut rendered, mut refused, mut paths_traced) = (0, 0, 0);
    for path in paths.iter().step_by(stride) {
        match render_real(path) {
            Some(run) => {
                assert_finite(&path.display().to_string(), &run);
                rendered += 1;
                paths_traced += run.paths;
            }
            None => refused += 1,
        }
    }
    println!(
        "one file in {stride} of {}: {rendered} rendered, {refused} refused; {paths_traced} paths, all finite, \
         no validation message",
        paths.len()
    );
    assert!(rendered > 0, "the collection holds no scene that can be rendered");
}

/// Where and what is injected: a NaN in green and an infinity in blue, of one sample each.
const PLANTED: [NonFiniteSample; 2] =
    [NonFiniteSample { x: 5, y: 3, sample: 9 }, NonFiniteSample { x: 12, y: 10, sample: 20 }];

/// Writes shaders that plant the two, as a fault of the light transport would: into a sample's radiance and its sum.
fn write_faulty_shaders(folder: &Path) {
    const FINISH: &str = "    uint bit = 1u << (lane.sample_index % BLOCK_SAMPLES);\n";
    let fault = |at: &NonFiniteSample, light: &str| {
        let (pixel, sample) = (at.x | at.y << 16, at.sample);
        format!(
            "    if (lane.pixel == {pixel}u && lane.sample_index == {sample}u) {{\n        \
             lane.radiance += {light};\n        accumulate(lane, {light});\n    }}\n"
        )
    };
    let faults = fault(&PLANTED[0], "vec3(0.0, uintBitsToFloat(0x7fc00000u), 0.0)")
        + &fault(&PLANTED[1], "vec3(0.0, 0.0, INFINITY)");
    write_sources(folder, |name, text| {
        if name != "path_trace.comp" {
            return text.to_owned();
        }
        assert_eq!(text.matches(FINISH).count(), 1, "the place for the fault");
        text.replace(FINISH, &(faults.clone() + FINISH))
    });
}

/// A small closed scene, so that the planted samples are the only odd ones.
fn grey_room() -> Scene {
    scene("furnace_box")
}

#[test]
fn planted_samples_are_counted_and_located() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    write_faulty_shaders(folder.path());
    let settings = Settings { shaders_dir: Some(folder.path().to_owned()), ..gpu::settings(SIDE, SIDE) };
    let run = run(&mut gpu::path_tracer(&grey_room(), &settings), 32);
    assert_eq!(run.non_finite_samples, 2, "{:?}", run.first_non_finite);
    assert_eq!(run.first_non_finite, PLANTED, "in the order of their blocks");
    // They are not hidden either: each leaves its pixel non-finite, and spreads to no other.
    let odd = run.film.pixels().iter().zip(0_u32..).filter(|(p, _)| !p.mean().iter().all(|c| c.is_finite()));
    assert_eq!(odd.map(|(_, i)| (i % SIDE, i / SIDE)).collect::<Vec<_>>(), PLANTED.map(|p| (p.x, p.y)));
}

#[test]
fn strict_runs_of_the_program_refuse_planted_samples() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let shaders = folder.path().join("shaders");
    write_faulty_shaders(&shaders);
    let render = |strict: &[&str]| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"));
        command.current_dir(folder.path()).args(["render", "cornell", "--resolution", "16x16", "--spp", "32"]);
        let output = command.arg("--shaders").arg(&shaders).args(["-o", "a.exr"]).args(strict).output().expect("runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, message) = render(&["--strict"]);
    assert_eq!(code, Some(6), "{message}");
    for expected in ["2 samples", "(5, 3)", "sample 9", "(12, 10)", "sample 20"] {
        assert!(message.contains(expected), "`{expected}` is not in: {message}");
    }
    assert!(folder.path().join("a.exr").exists(), "the image is written all the same");
    let (code, message) = render(&[]);
    assert_eq!(code, Some(0), "without --strict it is a warning: {message}");
    assert!(message.contains("(5, 3)"), "{message}");
}

/// Emission that no f32 can hold is refused by the scene's checks, not rendered.
#[test]
fn non_finite_scenes_are_refused() {
    use sunfleck::scene::Material;
    for (emission, color) in [(f32::NAN, 0.5), (f32::INFINITY, 0.5), (-1.0, 0.5), (1.0, f32::NAN), (1.0, 1e6)] {
        let material = Material { emission: [emission, 0.0, 0.0], ..Material::lambertian("odd", [color; 3]) };
        let camera = builder::camera(glam::DVec3::Z, glam::DVec3::ZERO, 1.0);
        let error = builder::scene(Vec::new(), vec![material], camera).validate().expect_err("it is refused");
        assert!(error.to_string().contains("materials[0]"), "{error}");
    }
}
