//! `render --adaptive` as people call it: the report, the files, and parts that merge to the whole.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use sunfleck::film::exr::{ChannelValues, ExrImage, read_exr};

fn sunfleck(folder: &Path, arguments: &[&str]) -> (String, String) {
    let output =
        Command::new(assert_cmd::cargo::cargo_bin!("sunfleck")).current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let stderr = text(output.stderr);
    assert!(output.status.success(), "{arguments:?}: {stderr}");
    (text(output.stdout), stderr)
}

/// Small lamps, some of which glossy floors mirror: noise stands in few pixels.
fn render(folder: &Path, arguments: &[&str]) -> (Value, String) {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/many_lights.gltf");
    let all = [&["render", scene, "--resolution", "48x32", "--max-bounces", "4", "--json"], arguments].concat();
    let (stdout, stderr) = sunfleck(folder, &all);
    (serde_json::from_str(&stdout).unwrap(), stderr)
}

fn counts(image: &ExrImage) -> Vec<u32> {
    let Some(ChannelValues::U32(counts)) = image.values("samples") else { panic!("there are no counts") };
    counts.clone()
}

#[test]
fn noisy_pixels_have_more_samples_and_parts_merge() {
    let folder = tempfile::tempdir().unwrap();
    let image = |name: &str| read_exr(&folder.path().join(name)).unwrap();
    let (report, stderr) = render(folder.path(), &["--adaptive", "--spp", "20", "-o", "whole.exr"]);
    let counts = counts(&image("whole.exr"));
    let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    let found = &report["adaptive"];
    assert_eq!((*least, u64::from(most / 20)), (20, found["most_samples"].as_u64().unwrap()));
    assert!(*most > 20);
    let noisy = counts.iter().filter(|&&count| count > 20).count();
    assert_eq!(found["noisy_pixels"].as_u64(), Some(noisy as u64));
    assert_eq!((found["samples"].as_u64(), &report["samples"]), (Some(8), &serde_json::json!([0, 20])));
    assert!(report["spp"].as_f64().unwrap() > 20.0);
    assert!(stderr.contains("pilot of 8 samples per pixel"), "{stderr}");
    assert_eq!(image("whole.exr").metadata.sampler.as_deref(), Some("sobol, adaptive by a pilot of 8"));

    render(folder.path(), &["--adaptive=8", "--samples", "0..5", "-o", "a.exr"]);
    render(folder.path(), &["--adaptive=8", "--samples", "5..20", "-o", "b.exr"]);
    sunfleck(folder.path(), &["merge", "a.exr", "b.exr", "-o", "merged.exr"]);
    assert_eq!(self::counts(&image("merged.exr")), counts);
    let (merged, whole) = (image("merged.exr").rgb().unwrap(), image("whole.exr").rgb().unwrap());
    let near = |(a, b): (&f32, &f32)| (a - b).abs() <= f32::EPSILON * b.abs();
    assert!(merged.iter().flatten().zip(whole.iter().flatten()).all(near));

    let (report, stderr) = render(folder.path(), &["--spp", "1", "-o", "even.exr"]);
    assert!(report["adaptive"].is_null() && !stderr.contains("pilot"), "{stderr}");
}
