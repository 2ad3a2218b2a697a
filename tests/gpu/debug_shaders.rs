//! DEBUG_PIXEL and DEBUG_PRINT (shaders/include/debug.glsl): the value is the picture, and what is printed comes back.

use crate::common::gpu;
use crate::common::scenes::scene;
use sunfleck::gpu::shader_compiler::{Sources, compile};
use sunfleck::render::{PathTracer, Settings};
use sunfleck::watch::debug_calls::number_calls;

const KERNEL: &str = "path_trace.comp";

/// A tracer of the Cornell box (compiled in, or not) whose `lambertian_scatter` begins with `statements`.
fn tracer(statements: &str, macros: &[&str], settings: &Settings) -> PathTracer {
    let scene = scene("cornell");
    let key = *gpu::path_tracer(&scene, settings).key();
    let mut sources: Sources = gpu::sources().clone();
    let leaf = sources.get_mut("include/bsdf_lambertian.glsl").expect("it is there");
    let start = "BsdfSample lambertian_scatter(BsdfParameters p, vec3 wo, vec3 u) {\n";
    assert!(leaf.contains(start));
    *leaf = leaf.replace(start, &format!("{start}{statements}\n"));
    if macros.contains(&"DEBUG_PRINTS") {
        sources = number_calls(&sources, KERNEL).0;
    }
    let mut defines =
        vec![("TRACE_BACKEND", (key.trace as u32).to_string()), ("ARRAY_FORM", (key.array_form as u32).to_string())];
    defines.extend(macros.iter().map(|name| (*name, "1".to_owned())));
    let spirv = compile(&sources, KERNEL, &defines).expect("it compiles");
    gpu::path_tracer(&scene, &Settings { kernel_spirv: Some(spirv.into()), ..settings.clone() })
}

#[test]
fn the_picture_is_the_first_value_of_each_path() {
    for bake in [true, false] {
        let settings = Settings { bake, ..gpu::settings(32, 32) };
        let statements = "DEBUG_PIXEL(vec3(0.25, -2.0, 400.0)); DEBUG_PIXEL(1.0);";
        let run = gpu::run(&mut tracer(statements, &["DEBUG_VIEW"], &settings), 1, 4);
        // In the middle is the back wall; the corner looks past the box.
        let pixel = |x: usize, y: usize| run.film.pixels()[y * 32 + x].mean();
        assert_eq!(pixel(16, 12), [0.25, -2.0, 400.0]);
        assert_eq!(pixel(0, 0), [0.0; 3]);
        assert!(run.rays <= 2 * run.paths, "a sample ends with its value: {} rays of {} paths", run.rays, run.paths);
    }
}

#[test]
fn without_the_macros_the_calls_are_nothing() {
    let settings = gpu::settings(16, 16);
    let plain = gpu::run(&mut gpu::path_tracer(&scene("cornell"), &settings), 1, 4);
    let called = gpu::run(&mut tracer("DEBUG_PIXEL(p.color); DEBUG_PRINT(wo);", &[], &settings), 1, 4);
    assert!(plain.film.pixels() == called.film.pixels());
}

#[test]
fn printed_values_come_back_with_their_types_and_the_image_stays() {
    let settings = gpu::settings(32, 32);
    let statements = "DEBUG_PRINT(0.5); DEBUG_PRINT(vec4(1, 2, 3, -4)); DEBUG_PRINT(-7); DEBUG_PRINT(uvec2(8, 9));\n\
        DEBUG_PRINT(bvec3(true, false, true)); DEBUG_PRINT(ivec3(1, -2, 3));";
    let mut printing = tracer(statements, &["DEBUG_PRINTS"], &settings);
    let printed = printing.prints(1, (16, 12), 0).expect("the device works");
    let first: Vec<_> = printed.iter().take(6).map(|p| (p.place, p.value.as_str())).collect();
    let values = ["0.5", "(1, 2, 3, -4)", "-7", "(8, 9)", "(true, false, true)", "(1, -2, 3)"];
    assert_eq!(first, (1..).zip(values).collect::<Vec<_>>());
    assert!(printed.len().is_multiple_of(6) || printed.len() == 64, "{printed:?}");
    assert!(printing.prints(1, (0, 0), 0).expect("the device works").is_empty(), "the corner meets nothing");
    let plain = gpu::run(&mut gpu::path_tracer(&scene("cornell"), &settings), 1, 4);
    assert!(plain.film.pixels() == gpu::run(&mut printing, 1, 4).film.pixels());
}
