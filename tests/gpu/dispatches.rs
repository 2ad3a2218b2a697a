//! A dispatch leaves nothing behind. lavapipe keeps a copy of the kernel for every one, and makes it anew each time, where a
//! branch on nothing but uniforms takes much code away: textured models rendered at a fifth of their speed, and a run of
//! minutes took all memory.

use std::ops::{ControlFlow, Range};

use crate::common::gpu;
use crate::common::scenes::{scene, short_form};
use sunfleck::render::BindingOverride;
use sunfleck::scene::Projection;

/// Kilobytes that the process has in memory.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("and it in it");
    line.trim().trim_end_matches(" kB").parse().expect("a number")
}

/// Other tests come and go meanwhile, so this runs alone in a process of its own.
#[test]
fn a_dispatch_leaves_no_memory_behind() {
    const NAME: &str = "dispatches::a_dispatch_leaves_no_memory_behind";
    if std::env::var_os("SUNFLECK_TEST_ALONE").is_none() {
        let program = std::env::current_exe().expect("the test runs");
        let arguments = ["--exact", NAME, "--nocapture"];
        let status = std::process::Command::new(program).args(arguments).env("SUNFLECK_TEST_ALONE", "1").status();
        assert!(status.expect("it starts").success());
        return;
    }
    let mut scenes: Vec<_> = ["textured", "environment", "instances", "alpha"].map(|name| (name, scene(name))).into();
    let mut lens = scene("environment");
    lens.cameras[0].lens_radius = 0.1;
    let mut orthographic = scene("textured");
    orthographic.cameras[0].projection = Projection::Orthographic { ymag: 1.0 };
    scenes.extend([("lens", lens), ("orthographic", orthographic)]);
    scenes.truncate(if short_form() { 2 } else { scenes.len() });
    for (name, scene) in scenes {
        let overrides = BindingOverride { slice_atoms: Some(64), ..BindingOverride::default() };
        let mut tracer = gpu::path_tracer_with(&scene, &gpu::settings(64, 64), overrides);
        let mut run = |samples: Range<u32>| {
            tracer.run(0, samples, None, &mut |_| ControlFlow::Continue(())).expect("the device works");
        };
        run(0..1);
        let before = resident();
        run(1..4);
        // A kernel of these takes a megabyte and more, 192 of them would.
        let grown = resident().saturating_sub(before);
        println!("{name}: {grown} kB in 192 dispatches");
        assert!(grown < 32 << 10, "{name}: {grown} kB");
    }
}
