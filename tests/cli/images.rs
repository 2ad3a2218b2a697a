//! `sunfleck compare` and `sunfleck merge` on real files.

use std::path::Path;

use assert_cmd::Command;
use sunfleck::film::Film;
use sunfleck::film::exr::{ExrImage, read_exr};
use sunfleck::film::metadata::Metadata;

fn sunfleck(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output =
        Command::new(assert_cmd::cargo::cargo_bin!("sunfleck")).current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Writes an image of `side` × `side` pixels of this radiance, from `count` samples that begin at index `start`.
fn write(folder: &Path, name: &str, side: u32, radiance: f64, start: u32, count: u32) {
    let mut film = Film::new(side, side);
    for pixel in 0..(side * side) as usize {
        let sum = radiance * f64::from(count);
        film.add_block(pixel, [sum; 3], sum * radiance, count);
    }
    let mut metadata = Metadata { seed: Some(0), ..Metadata::default() };
    metadata.sample_ranges.push(start..start + count);
    ExrImage::from_film(&film, metadata).write(&folder.join(name)).unwrap();
}

#[test]
fn compare_measures_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.exr", 16, 0.75, 0, 4);
    write(folder.path(), "b.exr", 16, 0.5, 0, 4);
    let (code, stdout, stderr) =
        sunfleck(folder.path(), &["compare", "a.exr", "b.exr", "--json", "--heatmap", "heat.png"]);
    assert_eq!(code, 0, "{stderr}");
    let report: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(report["mse"], 0.0625);
    assert_eq!(report["mean_difference"][1], 0.25);
    assert!((report["rel_mse"].as_f64().unwrap() - 0.0625 / 0.2501).abs() < 1e-9);
    assert!(report["flip"].as_f64().unwrap() > 0.01);
    assert!(stderr.contains("relMSE") && stderr.contains("FLIP"), "{stderr}");
    assert_eq!(image::open(folder.path().join("heat.png")).unwrap().into_rgb8().dimensions(), (16, 16));
}

#[test]
fn compare_refuses_other_sizes_and_other_files() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.exr", 16, 0.75, 0, 4);
    write(folder.path(), "b.exr", 8, 0.5, 0, 4);
    std::fs::write(folder.path().join("c.exr"), "not an image").unwrap();
    let (code, _, stderr) = sunfleck(folder.path(), &["compare", "a.exr", "b.exr", "--heatmap", "heat.png"]);
    assert_eq!(code, 3);
    assert!(stderr.contains("16x16") && stderr.contains("8x8"), "{stderr}");
    let (code, _, stderr) = sunfleck(folder.path(), &["compare", "a.exr", "c.exr"]);
    assert_eq!(code, 3);
    assert!(stderr.contains("c.exr"), "{stderr}");
    assert!(!folder.path().join("heat.png").exists());
}

#[test]
fn compare_says_where_nan_is() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.exr", 4, f64::NAN, 0, 4);
    write(folder.path(), "b.exr", 4, 0.5, 0, 4);
    let (code, stdout, stderr) = sunfleck(folder.path(), &["compare", "a.exr", "b.exr", "--json"]);
    assert_eq!(code, 0);
    assert!(stderr.contains("a.exr: 16 pixels are NaN or infinite"), "{stderr}");
    let report: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!((&report["non_finite_a"], &report["compared_pixels"]), (&16.into(), &0.into()));
    assert!(report["mse"].is_null(), "nothing was compared, so nothing is known");
}

#[test]
fn merge_weighs_by_sample_counts() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.exr", 4, 1.0, 0, 6);
    write(folder.path(), "b.exr", 4, 2.0, 6, 2);
    let (code, stdout, stderr) = sunfleck(folder.path(), &["merge", "b.exr", "a.exr", "-o", "out.exr"]);
    assert_eq!((code, stdout.as_str()), (0, ""), "{stderr}");
    let merged = read_exr(&folder.path().join("out.exr")).unwrap();
    assert_eq!(merged.rgb().unwrap(), vec![[1.25; 3]; 16]);
    assert_eq!(merged.metadata.sample_ranges, vec![0..8]);
    assert_eq!(merged.metadata.samples_per_pixel, Some(8.0));
    let (code, ..) = sunfleck(folder.path(), &["merge", "a.exr", "b.exr", "-o", "out.png"]);
    assert_eq!(code, 0);
    assert!(folder.path().join("out.png").exists());
}

#[test]
fn merge_refuses_the_same_part_twice() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.exr", 4, 1.0, 0, 6);
    let (code, _, stderr) = sunfleck(folder.path(), &["merge", "a.exr", "a.exr", "-o", "out.exr"]);
    assert_eq!(code, 3);
    assert!(stderr.contains("0..6"), "{stderr}");
    assert!(!folder.path().join("out.exr").exists());
}
