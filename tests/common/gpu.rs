//! The GPU fixture: one device a test binary, the driver and back end from the environment, and no validation message
//! goes unnoticed.
//!
//! `SUNFLECK_TEST_TRACE` (`bvh` or `ray-query`) chooses the back end, `SUNFLECK_TEST_NO_BAKE=1` leaves small scenes out of
//! the kernel; the driver is the one that the loader finds (see
//! scripts/with-driver.sh).

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use sunfleck::gpu::shader_compiler::{Sources, read_sources};
use sunfleck::gpu::{Gpu, TraceBackend, take_validation_messages, validation_is_available};
use sunfleck::layout::RenderConstants;
use sunfleck::prepare::{Prepared, camera_constants};
use sunfleck::render::{
    Bake, BindingOverride, FunctionCall, PathTracer, Run, SamplerKind, Settings, TraceChoice, open_device,
    prepare_scene,
};
use sunfleck::scene::{Scene, builtin};

use super::mutation::SHADERS_VARIABLE;

/// The device under test, with its trace back end.
#[derive(Clone)]
pub struct TestDevice {
    pub gpu: Arc<Gpu>,
    pub trace: TraceBackend,
}

/// The device, opened once a process.
pub fn device() -> TestDevice {
    static DEVICE: OnceLock<TestDevice> = OnceLock::new();
    let device = DEVICE.get_or_init(|| {
        assert!(validation_is_available(), "the Khronos validation layer is missing, see `make deps`");
        let trace = match std::env::var("SUNFLECK_TEST_TRACE") {
            Ok(name) => name.parse().expect("SUNFLECK_TEST_TRACE is bvh or ray-query"),
            Err(_) => TraceChoice::Auto,
        };
        let open = open_device(&Settings { trace, ..Settings::default() }).expect("a Vulkan device (see `make deps`)");
        eprintln!("device under test: {} with {}", open.reason, open.gpu.info.driver);
        TestDevice { gpu: open.gpu, trace: open.trace }
    });
    device.clone()
}

/// Fails the test if the validation layer has said anything.
pub fn assert_no_validation_messages() {
    let messages = take_validation_messages();
    assert!(messages.is_empty(), "validation messages: {messages:#?}");
}

/// The folder of shader sources of a mutated run (tests/common/mutation.rs); `None` where the tree's are under test.
fn shaders_dir() -> Option<PathBuf> {
    std::env::var_os(SHADERS_VARIABLE).map(PathBuf::from)
}

/// Small default settings for tests, with independent samples: most tests take the variance of a mean from them.
pub fn settings(width: u32, height: u32) -> Settings {
    let sampler = SamplerKind::Independent;
    let bake = std::env::var_os("SUNFLECK_TEST_NO_BAKE").is_none();
    Settings { width, height, sampler, bake, shaders_dir: shaders_dir(), ..Settings::default() }
}

/// A scene on the device under test.
pub fn path_tracer(scene: &Scene, settings: &Settings) -> PathTracer {
    path_tracer_with(scene, settings, BindingOverride::default())
}

/// The same, bound in a chosen way.
pub fn path_tracer_with(scene: &Scene, settings: &Settings, overrides: BindingOverride) -> PathTracer {
    path_tracer_on(device().trace, scene, settings, overrides)
}

/// The same, with a chosen back end.
pub fn path_tracer_on(
    trace: TraceBackend,
    scene: &Scene,
    settings: &Settings,
    overrides: BindingOverride,
) -> PathTracer {
    let camera = &scene.cameras[0];
    let prepared = prepare_scene(scene, camera, settings).expect("the scene fits");
    let tracer = PathTracer::new(&device().gpu, trace, &prepared, camera, settings, overrides);
    let tracer = tracer.expect("the scene fits the device");
    assert_no_validation_messages();
    tracer
}

/// Renders samples `0..spp` of one seed and checks that every sample is finite.
pub fn run(tracer: &mut PathTracer, seed: u32, spp: u32) -> Run {
    let run = tracer.run(seed, 0..spp, None, &mut |_| ControlFlow::Continue(())).expect("the device works");
    assert_no_validation_messages();
    assert_eq!(run.non_finite_samples, 0, "non-finite samples: {:?}", run.first_non_finite);
    run
}

/// The shader sources under test: the tree's, or those of a mutated run.
pub fn sources() -> &'static Sources {
    static SOURCES: OnceLock<Sources> = OnceLock::new();
    SOURCES.get_or_init(|| {
        let folder = shaders_dir().unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"));
        read_sources(&folder).expect("the folder of shader sources is readable")
    })
}

/// A scene prepared for its first camera, with the constants that a kernel needs.
pub fn prepared(scene: &Scene, settings: &Settings) -> (Prepared, RenderConstants) {
    let prepared = prepare_scene(scene, &scene.cameras[0], settings).expect("the scene fits");
    let mut constants = prepared.constants;
    camera_constants(&scene.cameras[0], prepared.origin, settings.width, settings.height, &mut constants);
    (prepared, constants)
}

/// Calls a kernel of shaders/test/ that needs no scene of its own.
pub fn call(file: &str, inputs: &[[u32; 4]], lanes: u32, outputs_per_lane: u32) -> Vec<[u32; 4]> {
    let scene = builtin::builtin("cornell").expect("built in");
    call_with_scene(file, &scene, &[], inputs, lanes, outputs_per_lane)
}

/// Calls a kernel of shaders/test/ with a scene bound and with specialisation constants.
pub fn call_with_scene(
    file: &str,
    scene: &Scene,
    specialization: &[(u32, u32)],
    inputs: &[[u32; 4]],
    lanes: u32,
    outputs_per_lane: u32,
) -> Vec<[u32; 4]> {
    let device = device();
    let (prepared, constants) = prepared(scene, &settings(64, 64));
    let call = FunctionCall {
        sources: sources(),
        file: &format!("test/{file}"),
        trace: device.trace,
        prepared: &prepared,
        constants,
        specialization,
        bake: &Bake::default(),
        defines: &[],
    };
    let outputs = call.run(&device.gpu, inputs, lanes, outputs_per_lane).expect("the kernel runs");
    assert_no_validation_messages();
    outputs
}
