//! Scenes for tests, and images of them over several seeds.

use std::path::Path;

use sunfleck::render::{PathTracer, Settings};
use sunfleck::scene::{Scene, load};

use super::gpu;
use super::statistics::TileStatistics;

/// A built-in scene or one of `scenes/`, completed as the command line does.
pub fn scene(name: &str) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(format!("{name}.gltf"));
    let name = if file.exists() { file.display().to_string() } else { name.to_owned() };
    let mut scene = load::resolve(&name).expect("the scene loads");
    scene.frame_if_no_camera();
    scene.light_if_dark();
    scene
}

/// Names of all scenes in `scenes/`.
pub fn all_scenes() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .expect("scenes/ is there")
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            (path.extension()? == "gltf").then(|| path.file_stem()?.to_str().map(str::to_owned))?
        })
        .collect();
    names.sort();
    names
}

/// True where the whole suite runs on several drivers in turn: statistical tests then take fewer samples, and fewer scenes
/// and modes, since a software driver takes seconds to compile each kernel.
pub fn short_form() -> bool {
    std::env::var("SUNFLECK_TEST_DRIVER").is_ok_and(|driver| driver != "system")
}

/// True where the stress suite runs in full (`make stress`); otherwise it takes fewer scenes and samples.
pub fn full_form() -> bool {
    std::env::var("SUNFLECK_STRESS").is_ok_and(|form| form == "full")
}

/// True where rendering is slower by an order of magnitude (SwiftShader, and the ray queries of a software driver);
/// statistical tests then take fewer samples still.
pub fn slow_driver() -> bool {
    let is = |name: &str, value: &str| std::env::var(name).is_ok_and(|text| text == value);
    short_form() && (is("SUNFLECK_TEST_DRIVER", "swiftshader") || is("SUNFLECK_TEST_TRACE", "ray-query"))
}

/// Renders `seeds` independent images.
pub fn seeds(tracer: &mut PathTracer, settings: &Settings, seeds: u32, spp: u32) -> TileStatistics {
    let mut statistics = TileStatistics::new(settings.width as usize, settings.height as usize, 8);
    for seed in 0..seeds {
        statistics.add(&gpu::run(tracer, seed, spp).film.radiance());
    }
    statistics
}
