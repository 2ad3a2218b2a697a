//! A kernel is built beside one that renders, on the same device or on a second one, and its image is the same.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::common::gpu;
use crate::common::scenes::scene;
use sunfleck::gpu::DeviceKind;
use sunfleck::render::{BindingOverride, OpenDevice, PathTracer, prepare_scene};

fn bits(tracer: &mut PathTracer) -> Vec<[u64; 3]> {
    let run = tracer.run(5, 0..8, None, &mut |_| ControlFlow::Continue(())).expect("the device works");
    run.film.pixels().iter().map(|pixel| pixel.rgb.map(f64::to_bits)).collect()
}

#[test]
fn a_tracer_beside_another_gives_the_same_image_while_that_renders() {
    let device = gpu::device();
    let open = OpenDevice { gpu: device.gpu, trace: device.trace, reason: String::new() };
    let second = open.for_building().expect("a second device");
    assert_eq!(Arc::ptr_eq(&second, &open.gpu), open.gpu.info.kind != DeviceKind::Cpu);
    let (scene, settings) = (scene("instances"), gpu::settings(40, 30));
    let camera = &scene.cameras[0];
    let prepared = prepare_scene(&scene, camera, &settings).expect("the scene fits");
    let mut front = gpu::path_tracer(&scene, &settings);
    let reference = bits(&mut front);
    let buffers = Arc::clone(front.buffers());
    for target in [&open.gpu, &second] {
        let build = || {
            let overrides = BindingOverride::default();
            let mut behind = PathTracer::beside(&buffers, target, &prepared, camera, &settings, overrides)?;
            behind.rebuild(&prepared, camera, &settings)?;
            sunfleck::Result::Ok(behind)
        };
        let mut behind = std::thread::scope(|scope| {
            let thread = scope.spawn(build);
            while !thread.is_finished() {
                assert!(bits(&mut front) == reference, "the one that renders");
            }
            thread.join().expect("no panic").expect("it is built")
        });
        assert!(bits(&mut behind) == reference, "the one that was built");
    }
    gpu::assert_no_validation_messages();
}
