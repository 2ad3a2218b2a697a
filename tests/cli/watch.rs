//! `watch --no-serve` as a shader is edited, broken and mended.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

fn sunfleck() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"))
}

fn export(folder: &Path, more: &[&str]) -> (Option<i32>, String) {
    let output = sunfleck().args(["shaders", "export"]).arg(folder).args(more).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// The shaders written to a new folder in this one; an include that every kernel has, and what is in it.
fn exported(folder: &Path) -> (PathBuf, PathBuf, String) {
    let shaders = folder.join("shaders");
    assert_eq!(export(&shaders, &[]).0, Some(0));
    let leaf = shaders.join("include/bsdf_lambertian.glsl");
    let original = std::fs::read_to_string(&leaf).unwrap();
    (shaders, leaf, original)
}

/// A running `sunfleck watch --no-serve`, killed when dropped.
pub(crate) struct Watch {
    child: Child,
    lines: Receiver<String>,
}

impl Watch {
    fn start(arguments: &[&str], shaders: &Path) -> Self {
        Self::of(Path::new("cornell"), &[&["--shaders", shaders.to_str().unwrap()], arguments].concat())
    }

    /// Watches a scene.
    pub(crate) fn of(scene: &Path, arguments: &[&str]) -> Self {
        let mut child = sunfleck()
            .arg("watch")
            .arg(scene)
            .arg("--no-serve")
            .args(if arguments.contains(&"--resolution") { &[][..] } else { &["--resolution", "32x32"] })
            .args(arguments)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (send, lines) = channel();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        std::thread::spawn(move || stderr.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        Self { child, lines }
    }

    /// The next line with all of `words`, within two minutes: drivers compile slowly, machines are loaded.
    pub(crate) fn expect(&self, words: &[&str]) -> String {
        let start = Instant::now();
        let mut seen = Vec::new();
        while let Some(left) = Duration::from_secs(120).checked_sub(start.elapsed()) {
            let Ok(line) = self.lines.recv_timeout(left) else { break };
            if words.iter().all(|word| line.contains(word)) {
                return line;
            }
            seen.push(line);
        }
        panic!("no line with {words:?} among {seen:#?}");
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_saved_shader_is_measured_a_broken_one_is_located_and_rendering_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (shaders, leaf, original) = exported(folder.path());
    let watch = Watch::start(&["--spp", "64"], &shaders);
    watch.expect(&["start:", "Mrays/s", "error", "64 spp"]);

    std::fs::write(&leaf, original.replace("p.color", "(0.5 * p.color)")).unwrap();
    watch.expect(&["include/bsdf_lambertian.glsl:", "compile", "first image", "(x", "64 spp"]);

    std::fs::write(&leaf, format!("{original}float broken() {{ return undeclared_name; }}\n")).unwrap();
    let line = original.lines().count() + 1;
    watch.expect(&[&format!("error: include/bsdf_lambertian.glsl:{line}:25:"), "undeclared_name"]);
    watch.expect(&["float broken() { return undeclared_name; }"]);

    std::fs::write(shaders.join("include/unused.glsl"), "nonsense").unwrap();
    watch.expect(&["unused.glsl", "does not include"]);

    std::fs::write(&leaf, original).unwrap();
    watch.expect(&["include/bsdf_lambertian.glsl:", "first image", "64 spp"]);
}

/// The process that renders (`watch-worker`) or compiles (`watch-compiler`), by its parent.
#[cfg(target_os = "linux")]
fn helper_of(server: u32, command: &str) -> Option<u32> {
    std::fs::read_dir("/proc").ok()?.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<u32>().ok()).find(
        |pid| {
            let read = |what: &str| std::fs::read_to_string(format!("/proc/{pid}/{what}")).unwrap_or_default();
            let is_child = |line: &str| line.split_whitespace().eq(["PPid:", &server.to_string()]);
            read("status").lines().any(is_child) && read("cmdline").split('\0').any(|word| word == command)
        },
    )
}

#[cfg(target_os = "linux")]
fn worker_of(server: u32) -> Option<u32> {
    helper_of(server, "watch-worker")
}

#[cfg(target_os = "linux")]
fn signal(process: u32, signal: &str) {
    assert!(Command::new("kill").args([signal, &process.to_string()]).status().unwrap().success());
}

#[cfg(target_os = "linux")]
#[test]
fn a_compiler_that_hangs_or_dies_is_replaced_and_the_loop_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (shaders, leaf, original) = exported(folder.path());
    let watch = Watch::start(&["--hang", "20s", "--spp", "64"], &shaders);
    watch.expect(&["start:", "spp"]);
    for (kills, words) in [(false, "has been at this for 20 s"), (true, "has crashed (signal: 9")] {
        let compiler = helper_of(watch.child.id(), "watch-compiler").expect("there is a compiler");
        signal(compiler, "-STOP");
        std::fs::write(&leaf, original.replace("p.color", &format!("(0.5 * p.color)/* {kills} */"))).unwrap();
        if kills {
            // The save is noticed first, so that there is an order that comes to nothing.
            std::thread::sleep(Duration::from_secs(1));
            signal(compiler, "-KILL");
        }
        watch.expect(&["error: path_trace.comp", "the compiler", words]);
        std::fs::write(&leaf, original.replace("p.color", &format!("(0.6 * p.color)/* {kills} */"))).unwrap();
        watch.expect(&["include/bsdf_lambertian.glsl:", "first image", "spp"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_worker_that_hangs_or_dies_is_replaced_and_the_loop_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (shaders, leaf, original) = exported(folder.path());
    // Samples without end, so that it is at work.
    let watch = Watch::start(&["--hang", "10s", "--spp", "100000000"], &shaders);
    watch.expect(&["start:", "spp"]);
    for (end, words) in [("-STOP", "silent for 10 s"), ("-KILL", "signal: 9")] {
        let worker = worker_of(watch.child.id()).expect("there is a worker");
        signal(worker, end);
        watch.expect(&["the worker", words, "path_trace.comp of edit", "started again"]);
        // The new one renders what is saved now.
        let edited = original.replace("p.color", &format!("(0.5 * p.color)/* {end} */"));
        std::fs::write(&leaf, edited).unwrap();
        watch.expect(&["include/bsdf_lambertian.glsl:", "first image", "spp"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_worker_that_ends_while_the_scene_is_broken_starts_once_it_is_mended() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.gltf");
    let whole = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/textured.gltf")).unwrap();
    std::fs::write(&scene, &whole).unwrap();
    let watch = Watch::of(&scene, &["--spp", "64"]);
    watch.expect(&["start:", "64 spp"]);
    std::fs::write(&scene, &whole[..whole.len() / 2]).unwrap();
    watch.expect(&["edit 1 cannot be shown", "scene.gltf"]);
    signal(worker_of(watch.child.id()).expect("there is a worker"), "-KILL");
    watch.expect(&["the worker", "signal: 9", "started again"]);
    watch.expect(&["scene.gltf"]);
    watch.expect(&["the worker starts once one of its files is saved"]);
    std::fs::write(&scene, &whole).unwrap();
    watch.expect(&["scene.gltf:", "first image", "64 spp"]);
}

#[test]
fn a_scene_that_was_gone_is_shown_once_it_is_back() {
    let folder = tempfile::tempdir().unwrap();
    let [scene, away] = ["scene.gltf", "away"].map(|name| folder.path().join(name));
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/textured.gltf"), &scene).unwrap();
    let watch = Watch::of(&scene, &["--spp", "16"]);
    watch.expect(&["start:", "16 spp"]);
    std::fs::rename(&scene, &away).unwrap();
    watch.expect(&["edit 1 cannot be shown", "scene.gltf", "no such file"]);
    std::fs::rename(&away, &scene).unwrap();
    watch.expect(&["scene.gltf:", "first image", "16 spp"]);
}

/// The text with a part replaced that must be in it.
#[cfg(target_os = "linux")]
fn replaced(text: &str, part: &str, by: &str) -> String {
    assert!(text.contains(part), "{part}");
    text.replace(part, by)
}

#[cfg(target_os = "linux")]
#[test]
fn a_kernel_that_hangs_or_kills_the_device_is_named_and_the_last_good_one_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (shaders, leaf, original) = exported(folder.path());
    let watch = Watch::start(&["--hang", "20s", "--spp", "64"], &shaders);
    watch.expect(&["start:", "64 spp"]);
    // The loop over samples never ends. (lavapipe leaves any loop of a shader after 65535 rounds; the lane is then resumed.)
    let kernel = shaders.join("path_trace.comp");
    let loop_ends = std::fs::read_to_string(&kernel).unwrap();
    std::fs::write(&kernel, replaced(&loop_ends, "lane.sample_index += 1u;", "")).unwrap();
    watch
        .expect(&["the worker has been silent for 20 s while it ran path_trace.comp of edit 1", "with that of edit 0"]);
    std::fs::write(&kernel, &loop_ends).unwrap();
    watch.expect(&["path_trace.comp:", "first image", "64 spp"]);
    let worker = worker_of(watch.child.id()).expect("there is another worker");
    // The good kernel renders again: the same worker is still there when the next edit is shown.
    std::fs::write(&leaf, original.replace("p.color", "(0.5 * p.color)")).unwrap();
    watch.expect(&["include/bsdf_lambertian.glsl:", "first image", "64 spp"]);
    assert_eq!(worker_of(watch.child.id()), Some(worker));

    // A write to nowhere: on a CPU device, address 8 of the worker.
    let header = "#extension GL_GOOGLE_include_directive : require\n";
    let pointers = "#extension GL_EXT_buffer_reference : require\n#extension GL_EXT_buffer_reference_uvec2 : require\n\
        layout(buffer_reference, std430) buffer Nowhere { uint word; };\n";
    let deadly = replaced(&loop_ends, header, &format!("{header}{pointers}"));
    let deadly =
        replaced(&deadly, "void main() {\n", "void main() {\n    Nowhere(uvec2(8u + slice.resume, 0u)).word = 1u;\n");
    std::fs::write(&kernel, deadly).unwrap();
    watch.expect(&["the worker has ended (signal: 11", "path_trace.comp of edit 4", "of edit 3"]);
    std::fs::write(&kernel, &loop_ends).unwrap();
    watch.expect(&["path_trace.comp:", "first image", "64 spp"]);
}

#[test]
fn printed_values_are_those_of_the_pixel_with_the_line_that_prints_them() {
    let folder = tempfile::tempdir().unwrap();
    let shaders = folder.path().join("shaders");
    assert_eq!(export(&shaders, &[]).0, Some(0));
    // The left wall is red, the right one green: what is printed is the pixel's own.
    let leaf = shaders.join("include/bsdf_lambertian.glsl");
    let original = std::fs::read_to_string(&leaf).unwrap();
    let print = "    DEBUG_PRINT(p.color); DEBUG_PRINT(uvec2(7, 8)); DEBUG_PRINT(wo.y > 0.0);\n";
    let scatter = "vec3 wi = sample_cosine_hemisphere(u.yz);\n";
    assert!(original.contains(scatter));
    std::fs::write(&leaf, original.replace(scatter, &format!("{scatter}{print}"))).unwrap();
    let line = original.lines().position(|line| line.contains(scatter.trim())).unwrap() + 2;
    let mut colours = Vec::new();
    for pixel in ["1,16", "30,16"] {
        let watch = Watch::start(&["--spp", "4", "--pixel", pixel], &shaders);
        watch.expect(&[&format!("pixel {pixel} prints"), "value"]);
        let place = format!("  include/bsdf_lambertian.glsl:{line}: ");
        let colour = watch.expect(&[&place, "p.color = ("]);
        colours.push(colour.rsplit(" = ").next().unwrap().to_owned());
        watch.expect(&[&place, "uvec2(7, 8) = (7, 8)"]);
        watch.expect(&[&place, "wo.y > 0.0 = true"]);
    }
    assert_ne!(colours[0], colours[1]);
}
