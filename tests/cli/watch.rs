//! `shaders export`, and `watch --no-serve` as a shader is edited, broken and mended.

use std::io::{BufRead, BufReader};
use std::path::Path;
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

#[test]
fn export_writes_every_source_and_overwrites_none_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let shaders = folder.path().join("new/shaders");
    assert_eq!(export(&shaders, &[]).0, Some(0));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    for name in ["path_trace.comp", "include/bsdf.glsl"] {
        assert_eq!(std::fs::read(shaders.join(name)).unwrap(), std::fs::read(root.join(name)).unwrap(), "{name}");
    }
    let edited = shaders.join("include/bsdf.glsl");
    std::fs::write(&edited, "mine").unwrap();
    std::fs::remove_file(shaders.join("path_trace.comp")).unwrap();
    let (code, message) = export(&shaders, &[]);
    assert!(code == Some(2) && message.contains("--force"), "{message}");
    assert_eq!(std::fs::read_to_string(&edited).unwrap(), "mine");
    assert!(!shaders.join("path_trace.comp").exists(), "nothing is written where something is in the way");
    assert_eq!(export(&shaders, &["--force"]).0, Some(0));
    assert_ne!(std::fs::read_to_string(&edited).unwrap(), "mine");
}

/// A running `sunfleck watch --no-serve`, killed when dropped.
struct Watch {
    child: Child,
    lines: Receiver<String>,
}

impl Watch {
    fn start(arguments: &[&str], shaders: &Path) -> Self {
        let mut child = sunfleck()
            .args(["watch", "cornell", "--no-serve", "--resolution", "32x32", "--shaders"])
            .arg(shaders)
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
    fn expect(&self, words: &[&str]) -> String {
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
    let shaders = folder.path().join("shaders");
    assert_eq!(export(&shaders, &[]).0, Some(0));
    let leaf = shaders.join("include/bsdf_lambertian.glsl");
    let original = std::fs::read_to_string(&leaf).unwrap();
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

/// The process that renders, by its parent.
#[cfg(target_os = "linux")]
fn worker_of(server: u32) -> Option<u32> {
    std::fs::read_dir("/proc").ok()?.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<u32>().ok()).find(
        |pid| {
            let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
            status.lines().any(|line| line.split_whitespace().eq(["PPid:", &server.to_string()]))
        },
    )
}

#[cfg(target_os = "linux")]
#[test]
fn a_worker_that_hangs_or_dies_is_replaced_and_the_loop_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let shaders = folder.path().join("shaders");
    assert_eq!(export(&shaders, &[]).0, Some(0));
    let leaf = shaders.join("include/bsdf_lambertian.glsl");
    let original = std::fs::read_to_string(&leaf).unwrap();
    // Samples without end, so that it is at work.
    let watch = Watch::start(&["--hang", "10s", "--spp", "100000000"], &shaders);
    watch.expect(&["start:", "spp"]);
    for (signal, words) in [("-STOP", "silent for 10 s"), ("-KILL", "signal: 9")] {
        let worker = worker_of(watch.child.id()).expect("there is a worker");
        assert!(Command::new("kill").args([signal, &worker.to_string()]).status().unwrap().success());
        watch.expect(&["the worker", words, "path_trace.comp of edit", "started again"]);
        // The new one renders what is saved now.
        let edited = original.replace("p.color", &format!("(0.5 * p.color)/* {signal} */"));
        std::fs::write(&leaf, edited).unwrap();
        watch.expect(&["include/bsdf_lambertian.glsl:", "first image", "spp"]);
    }
}
