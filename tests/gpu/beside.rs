//! A kernel is built beside one that renders, on the same device or on a second one, and its image is the same.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::common::gpu;
use crate::common::scenes::scene;
use sunfleck::film::aov::Aov;
use sunfleck::gpu::DeviceKind;
use sunfleck::render::{BindingOverride, OpenDevice, OtherScene, PathTracer, Settings, prepare_scene};
use sunfleck::scene::Scene;

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

#[test]
fn a_tracer_rebuilt_for_aovs_and_counters_has_them_and_without_again_the_same_image() {
    let (scene, plain) = (scene("instances"), gpu::settings(40, 30));
    let camera = &scene.cameras[0];
    let prepared = prepare_scene(&scene, camera, &plain).expect("the scene fits");
    let mut tracer = gpu::path_tracer(&scene, &plain);
    let reference = bits(&mut tracer);
    let counted = Settings { aovs: vec![Aov::Normal, Aov::Depth], statistics: true, ..plain.clone() };
    for (settings, is_counted) in [(&counted, true), (&plain, false)] {
        tracer.rebuild(&prepared, camera, settings).expect("it is built");
        let run = tracer.run(0, 0..4, None, &mut |_| ControlFlow::Continue(())).expect("it runs");
        assert_eq!((run.aovs.is_some(), run.statistics.is_some()), (is_counted, is_counted));
        if let (Some(mut aovs), Some(mut statistics)) = (run.aovs, run.statistics) {
            let normals = aovs.means(Aov::Normal, &run.film).expect("it is summed");
            assert!(normals.iter().flatten().any(|&x| x != 0.0));
            let (camera, before) = (statistics.camera.rays, aovs.clone());
            assert_eq!(camera, 4 * 40 * 30);
            // Joined with themselves, sums are twice as large.
            aovs.merge(&before);
            let mut film = run.film.clone();
            film.merge(&run.film);
            assert_eq!(aovs.means(Aov::Depth, &film), before.means(Aov::Depth, &run.film));
            let pixel = &aovs.pixel_means(17, &film)[0];
            assert_eq!((pixel.0, pixel.1.len()), (Aov::Normal, 3));
            assert_eq!(pixel.1[1], aovs.means(Aov::Normal, &film).expect("it is summed")[1][17]);
            let once = statistics.clone();
            statistics.merge(&once);
            assert_eq!(
                (statistics.camera.rays, statistics.slice_seconds.len()),
                (2 * camera, 2 * once.slice_seconds.len())
            );
        }
        assert!(bits(&mut tracer) == reference, "counted: {is_counted}");
    }
    gpu::assert_no_validation_messages();
}

/// What a kernel in front makes of another scene that it is built for; `None` if it is not.
fn taken(tracer: &mut PathTracer, scene: &Scene, settings: &Settings) -> Option<Vec<[u64; 3]>> {
    let camera = &scene.cameras[0];
    let prepared = prepare_scene(scene, camera, settings).expect("the scene fits");
    let overrides = BindingOverride::default();
    let other = OtherScene::upload(tracer.key(), tracer.buffers(), &prepared, camera, settings, overrides);
    tracer.take_scene(other.expect("it is uploaded")?).expect("it is bound");
    Some(bits(tracer))
}

#[test]
fn a_tracer_takes_another_scene_that_needs_the_same_kernel_and_no_other() {
    let (mut scene, settings) = (scene("instances"), gpu::settings(40, 30));
    let mut tracer = gpu::path_tracer(&scene, &settings);
    let before = bits(&mut tracer);
    let instance = scene.instances.last_mut().expect("there are some");
    instance.object_to_world.translation.y += 0.25;
    let moved = taken(&mut tracer, &scene, &settings).expect("the code is the same");
    assert!(moved == bits(&mut gpu::path_tracer(&scene, &settings)) && moved != before, "a moved instance");
    scene.cameras[0].lens_radius = 0.1;
    scene.cameras[0].focus_distance = 4.0;
    assert!(taken(&mut tracer, &scene, &settings).is_none(), "a lens is other code");
    assert!(bits(&mut tracer) == moved, "it is as it was");
    gpu::assert_no_validation_messages();
}
