//! `sunfleck bench` on a tiny Cornell box: the report, the files, the verdicts, wrong input.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use sunfleck::film::exr::{ChannelValues, read_exr};

/// Runs `sunfleck bench` in a folder; returns exit code, the JSON object if there is one, standard error.
fn bench(folder: &Path, arguments: &[&str]) -> (i32, Value, String) {
    sunfleck(folder, &[&["bench"], arguments].concat())
}

fn sunfleck(folder: &Path, arguments: &[&str]) -> (i32, Value, String) {
    let program = assert_cmd::cargo::cargo_bin!("sunfleck");
    let output = Command::new(program).current_dir(folder).env_remove("RUST_LOG").args(arguments).output().unwrap();
    let value = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code().unwrap(), value, String::from_utf8(output.stderr).unwrap())
}

/// Indirect light alone: in so small an image the lamp's edges would make nearly all of the noise.
const TINY: [&str; 8] = ["--resolution", "16x16", "--max-bounces", "3", "--integrator", "indirect", "--seeds", "6"];

#[test]
fn bench_measures_a_scene_and_writes_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let (code, report, stderr) =
        bench(folder.path(), &[&["--spp", "4..32", "--json", "--strict", "-o", "out"], &TINY[..]].concat());
    assert_eq!(code, 0, "{stderr}");
    for name in ["device", "driver", "processor", "kernel_key", "reference", "bias", "seconds", "mse_over_spp"] {
        assert!(report.get(name).is_some(), "{name}: {report}");
    }
    for part in ["start_up", "load", "prepare", "compile", "upload", "render"] {
        assert!(report["seconds"][part].is_f64(), "{part}");
    }
    let points = report["points"].as_array().unwrap();
    let spp: Vec<_> = points.iter().map(|point| point["spp"].as_u64().unwrap()).collect();
    assert_eq!(spp, [4, 8, 16, 32]);
    assert!(points.iter().all(|point| point["runs"].as_array().unwrap().len() == 6));
    assert!(points[0]["runs"][5]["mse"].is_f64() && points[0]["runs"][5]["flip"].is_f64());
    // The error falls as 1 / spp. Its own interval is at 95 %; this one is three times as wide.
    let slope = &report["mse_over_spp"]["slope"];
    let [estimate, low, high] = ["estimate", "low", "high"].map(|name| slope[name].as_f64().unwrap());
    assert!((estimate + 1.0).abs() < 1.5 * (high - low), "{slope}");
    assert!(high < -0.5, "{slope}");
    assert!(report["reference"]["description"].as_str().unwrap().contains("mixture"));
    for words in ["processor", "start-up", "no bias seen; one above", "relMSE", "slope"] {
        assert!(stderr.contains(words), "{words}: {stderr}");
    }
    let svg = std::fs::read_to_string(folder.path().join("out/cornell.svg")).unwrap();
    assert!(svg.contains("render time in seconds") && svg.contains("32 spp"));
    assert!(image::open(folder.path().join("out/cornell.png")).unwrap().width() > 500);
    let written: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("out/cornell.json")).unwrap()).unwrap();
    assert_eq!(written, report);
}

#[test]
fn another_albedo_is_called_biased() {
    let folder = tempfile::tempdir().unwrap();
    let render = ["render", "--spp", "1024", "--seed", "99", "--quiet", "-o", "truth.exr"];
    let (code, _, stderr) = sunfleck(folder.path(), &[&render, &TINY[..6]].concat());
    assert_eq!(code, 0, "{stderr}");
    let arguments = [&["--spp", "16..64", "--strict", "--json"], &TINY[..]].concat();
    let (code, _, stderr) = bench(folder.path(), &[&arguments[..], &["--reference", "truth.exr"]].concat());
    assert_eq!(code, 0, "{stderr}");
    let (code, _, stderr) =
        bench(folder.path(), &[&arguments[..], &["--reference", "truth.exr", "--seed", "97"]].concat());
    assert!(code == 2 && stderr.contains("seed 99"), "{stderr}");
    // As if the surfaces reflected half as much red light in the left half of the image.
    let path = folder.path().join("truth.exr");
    let mut image = read_exr(&path).unwrap();
    let red = image.channels.iter_mut().find(|channel| channel.name == "R").unwrap();
    let ChannelValues::F32(values) = &mut red.values else { panic!("radiance is in floats") };
    values.iter_mut().enumerate().filter(|(i, _)| i % 16 < 8).for_each(|(_, value)| *value *= 0.5);
    image.write(&path).unwrap();
    let (code, report, stderr) = bench(folder.path(), &[&arguments[..], &["--reference", "truth.exr"]].concat());
    assert_eq!(code, 6, "{stderr}");
    assert!(stderr.contains("biased, tile at (0, ") || stderr.contains("biased, the whole image"), "{stderr}");
    assert_eq!((&report["bias"]["biased"], &report["bias"]["worst"]["channel"]), (&true.into(), &0.into()));
}

#[test]
fn compare_says_that_mis_beats_bsdf_sampling() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--spp", "16..16", "--json", "--compare", "--light-sampling bsdf", "-o", "out"];
    let (code, report, stderr) = bench(folder.path(), &[&arguments, &TINY[..]].concat());
    assert_eq!(code, 0, "{stderr}");
    assert!(report["verdict"].as_str().unwrap().starts_with("A is better"), "{stderr}");
    assert!(report["ratios"]["mse"]["low"].as_f64().unwrap() > 1.0, "{stderr}");
    assert_eq!(report["pairs"].as_array().unwrap().len(), 6);
    assert!(folder.path().join("out/cornell-compare.json").exists());
}

#[test]
fn compare_takes_another_program() {
    let folder = tempfile::tempdir().unwrap();
    let program = assert_cmd::cargo::cargo_bin!("sunfleck").display().to_string();
    let arguments = ["--spp", "4..4", "--seeds", "2", "--resolution", "8x8", "--json", "--compare", &program];
    let (code, report, stderr) = bench(folder.path(), &arguments);
    assert_eq!(code, 0, "{stderr}");
    // The same build with the same seeds renders the same bits.
    assert_eq!(report["ratios"]["mse"]["estimate"], 1.0, "{stderr}");
    assert_eq!(report["a"]["kernel_key"], report["b"]["kernel_key"]);
}

#[test]
fn a_suite_measures_its_scenes_and_writes_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let suite = r#"{"about": "A test.", "benches": [
        {"name": "one", "scene": "cornell", "flags": ["--spp=2..4", "--seeds=2", "--resolution=8x8"]},
        {"name": "two", "scene": "cornell", "flags": ["--spp=2..4", "--seeds=2", "--resolution=8x8", "--max-bounces=1"]}
    ]}"#;
    std::fs::write(folder.path().join("suite.json"), suite).unwrap();
    let (code, report, stderr) = bench(folder.path(), &["suite.json", "-o", "out", "--json", "--quiet"]);
    assert_eq!((code, stderr.as_str()), (0, ""));
    assert_eq!(report["benches"][1]["name"], "two");
    let index = std::fs::read_to_string(folder.path().join("out/README.md")).unwrap();
    assert!(index.contains("A test.") && index.contains("| [two](two.json) | 4 |"), "{index}");
    for name in ["one.json", "one.svg", "two.png"] {
        assert!(folder.path().join("out").join(name).exists(), "{name}");
    }
}

#[test]
fn flags_beside_a_suite_hold_for_each_of_its_benches() {
    let folder = tempfile::tempdir().unwrap();
    let suite = r#"{"about": "A test.", "benches": [
        {"name": "one", "scene": "cornell", "flags": ["--spp", "64..256", "--reference=gone.exr", "--resolution", "8x8"]},
        {"name": "two", "scene": "cornell", "flags": ["--seeds", "3", "--max-bounces=1", "--spp=2..8"]}
    ]}"#;
    std::fs::write(folder.path().join("suite.json"), suite).unwrap();
    let given = ["--spp=2..4", "--seeds=2", "--reference-spp=16", "--resolution=16x16", "--light-sampling=nee"];
    let (code, report, stderr) =
        bench(folder.path(), &[&["suite.json", "--trace=bvh", "--json", "--quiet"], &given[..]].concat());
    assert_eq!((code, stderr.as_str()), (0, ""));
    let flags =
        [vec!["--light-sampling=nee", "--trace=bvh"], vec!["--max-bounces=1", "--light-sampling=nee", "--trace=bvh"]];
    for (report, flags) in report["benches"].as_array().unwrap().iter().zip(flags) {
        assert_eq!((&report["width"], &report["flags"]), (&16.into(), &flags.into()));
        let points = report["points"].as_array().unwrap();
        assert_eq!((points.len(), points[0]["runs"].as_array().unwrap().len()), (2, 2), "{report}");
        assert!(report["reference"]["description"].as_str().unwrap().contains(" 16 samples"), "{report}");
    }
}

#[test]
fn wrong_input_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.json"), r#"{"about": "", "benches": [{"nam": 1}]}"#).unwrap();
    let flag = r#"{"about": "", "benches": [{"name": "a", "scene": "cornell", "flags": ["--sp"]}]}"#;
    std::fs::write(folder.path().join("flag.json"), flag).unwrap();
    for (name, flag) in [("json", "--json"), ("sobol", "--sampler=sobol")] {
        let text = format!(r#"{{"about": "", "benches": [{{"name": "a", "scene": "cornell", "flags": ["{flag}"]}}]}}"#);
        std::fs::write(folder.path().join(format!("{name}.json")), text).unwrap();
    }
    std::fs::write(folder.path().join("no.exr"), "not an image").unwrap();
    for (arguments, code, word) in [
        (&["--spp", "8..4"] as &[&str], 2, "MIN"),
        (&["--spp", "8"], 2, "MIN..MAX"),
        (&["--seeds", "1"], 2, "--seeds"),
        (&["--reference", "no.exr", "--reference-spp", "8"], 2, "--reference-spp"),
        (&["--compare", "no-such-program"], 2, "neither a program nor flags"),
        (&["--compare", "--light-sampling all", "--resolution", "8x8"], 2, "mis, mixture, nee, bsdf"),
        (&["--compare", "--light-sampling 'bsdf"], 2, "quote"),
        (&["bad.json", "--compare", "--mis balance"], 2, "--compare is for one scene"),
        (&["bad.json", "--camera", "0"], 2, "--camera is for one scene"),
        (&["bad.json", "--reference", "no.exr"], 2, "--reference is for one scene"),
        (&["json.json"], 3, "bench 'a': --json is for the command line"),
        (&["sobol.json"], 2, "--sampler sobol is not built yet"),
        (&["no-such-scene.gltf"], 3, "no-such-scene.gltf"),
        (&["--reference", "no-such.exr", "--resolution", "8x8"], 3, "no-such.exr"),
        (&["--reference", "no.exr", "--resolution", "8x8"], 3, "no.exr"),
        (&["no-such-suite.json"], 3, "no-such-suite.json"),
        (&["bad.json"], 3, "nam"),
        (&["flag.json"], 3, "--sp"),
        (&["-o", "no.exr"], 3, "no.exr"),
    ] {
        let (status, value, stderr) = bench(folder.path(), arguments);
        assert_eq!((status, value), (code, Value::Null), "{arguments:?}: {stderr}");
        assert!(stderr.contains("error: ") && stderr.contains(word), "{arguments:?} does not say '{word}': {stderr}");
    }
}
