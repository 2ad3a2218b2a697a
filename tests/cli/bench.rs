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
    let spp: Vec<_> = points.iter().map(|point| point["spp"].as_f64().unwrap()).collect();
    assert_eq!(spp, [4.0, 8.0, 16.0, 32.0]);
    assert!(points[0]["efficiency"]["standard_error"].as_f64().unwrap() > 0.0, "{report}");
    assert_eq!((&points[0]["in_fit"], &report["interrupted"]), (&true.into(), &false.into()));
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
fn times_are_rows_plots_are_named_files_and_short_references_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--times", "0.2s..0.4s", "--seeds", "2", "--resolution", "16x16", "--json"];
    let plots = ["--plot", "error.svg", "--plot", "error.PNG"];
    let (code, report, stderr) = bench(folder.path(), &[&arguments[..], &plots].concat());
    assert_eq!(code, 0, "{stderr}");
    for (point, limit) in report["points"].as_array().unwrap().iter().zip([0.2, 0.4]) {
        let runs = point["runs"].as_array().unwrap();
        let numbers = |name| runs.iter().map(move |run| run[name].as_f64().unwrap());
        assert!(numbers("seconds").all(|seconds| seconds >= limit), "{point}");
        let mean = numbers("spp").sum::<f64>() / runs.len() as f64;
        assert!(mean >= 1.0 && (point["spp"].as_f64().unwrap() - mean).abs() < 1e-9, "{point}");
    }
    assert_eq!(report["points"].as_array().unwrap().len(), 2);
    assert!(std::fs::read_to_string(folder.path().join("error.svg")).unwrap().contains("render time in seconds"));
    assert!(image::open(folder.path().join("error.PNG")).unwrap().width() > 500);
    let (_, _, stderr) = bench(folder.path(), &["--spp=8..8", "--seeds=2", "--resolution=8x8", "--reference-spp=8"]);
    assert!(stderr.contains("note: the reference has fewer samples"), "{stderr}");
    let (code, _, stderr) = bench(folder.path(), &["--times", "1ms..1ms", "--resolution", "1024x1024"]);
    assert!(code == 2 && stderr.contains("not every pixel gets a sample"), "{stderr}");
}

/// Runs `sunfleck bench -o out` until standard error says `word`, sends it SIGINT, and returns its exit code and what it
/// said after that.
#[cfg(unix)]
fn interrupted(folder: &Path, arguments: &[&str], word: &str) -> (i32, String) {
    use std::io::{BufRead, BufReader, Read};
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"))
        .current_dir(folder)
        .env("RUST_LOG", "info")
        .args([&["bench", "-o", "out"], arguments].concat())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains(word) {
        line.clear();
        assert!(stderr.read_line(&mut line).unwrap() > 0, "it ended without '{word}'");
    }
    let kill = std::process::Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status();
    assert!(kill.unwrap().success());
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).unwrap();
    (child.wait().unwrap().code().unwrap(), rest)
}

#[cfg(unix)]
#[test]
fn what_an_interrupted_bench_has_is_shown_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    let arguments = ["--spp", "2..4", "--seeds", "4000", "--resolution", "8x8", "--reference-spp", "512"];
    let (code, stderr) = interrupted(folder.path(), &arguments, "seed 4, 4 spp");
    assert_eq!(code, 130, "{stderr}");
    assert!(stderr.contains("interrupted: of ") && stderr.contains("95 % interval"), "{stderr}");
    let report: Value = serde_json::from_str(&read("cornell.json")).unwrap();
    let seeds: Vec<_> =
        report["points"].as_array().unwrap().iter().map(|p| p["runs"].as_array().unwrap().len()).collect();
    assert!(seeds.len() == 2 && seeds[0] == seeds[1] && (5..4000).contains(&seeds[0]), "{seeds:?}");
    assert_eq!(report["interrupted"], true);

    let suite = format!(
        r#"{{"about": "A test.", "benches": [
            {{"name": "one", "scene": "cornell", "flags": ["--spp=2..4", "--seeds=2", "--resolution=8x8"]}},
            {{"name": "two", "scene": "cornell", "flags": {arguments:?}}}, {{"name": "three", "scene": "cornell"}}
        ]}}"#
    );
    std::fs::write(folder.path().join("suite.json"), suite).unwrap();
    let (code, stderr) = interrupted(folder.path(), &["suite.json"], "seed 0, 4 spp");
    assert_eq!(code, 130, "{stderr}");
    let index = read("README.md");
    assert!(
        index.contains("Interrupted: ") && index.contains("[one](one.json)") && !index.contains("three"),
        "{index}"
    );
}

#[cfg(unix)]
#[test]
fn an_interrupted_comparison_gives_the_ratios_so_far() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        ["--spp=1..1", "--seeds=4000", "--resolution=8x8", "--reference-spp=512", "--compare", "--mis balance"];
    let (code, stderr) = interrupted(folder.path(), &arguments, "1 spp, pair 2 of 4000");
    assert_eq!(code, 130, "{stderr}");
    assert!(stderr.contains("B over A") && stderr.contains("2 pairs in each row"), "{stderr}");
    let text = std::fs::read_to_string(folder.path().join("out/cornell-compare.json")).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["interrupted"], true);
    assert_eq!(report["rows"][0]["pairs"].as_array().unwrap().len(), 2);
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
fn a_wrong_shader_is_called_biased() {
    let folder = tempfile::tempdir().unwrap();
    let shaders = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let mine = folder.path().join("mine");
    std::fs::create_dir_all(mine.join("include")).unwrap();
    for part in [".", "include"] {
        for entry in std::fs::read_dir(shaders.join(part)).unwrap().map(Result::unwrap) {
            if entry.path().is_file() {
                std::fs::copy(entry.path(), mine.join(part).join(entry.file_name())).unwrap();
            }
        }
    }
    // Two thirds of the albedo, where light samples are weighed and where a path goes on.
    let path = mine.join("include/bsdf_lambertian.glsl");
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text.matches("p.color").count(), 2, "{text}");
    std::fs::write(&path, text.replace("p.color", "0.67 * p.color")).unwrap();
    let arguments = [&["--spp", "16..64", "--strict", "--json", "--shaders", "mine"], &TINY[..]].concat();
    let (code, report, stderr) = bench(folder.path(), &arguments);
    assert!(code == 6 && stderr.contains("biased"), "{code} {stderr}");
    assert!(report["reference"]["description"].as_str().unwrap().contains("the built-in shaders"), "{report}");
}

#[test]
fn compare_says_that_mis_beats_bsdf_sampling() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--spp", "8..16", "--json", "--compare", "--light-sampling bsdf", "-o", "out", "--seeds", "4"];
    let (code, report, stderr) = bench(folder.path(), &[&arguments, &TINY[..6]].concat());
    assert_eq!(code, 0, "{stderr}");
    assert!(report["verdict"].as_str().unwrap().starts_with("A is better"), "{stderr}");
    assert!(report["ratios"]["mse"]["low"].as_f64().unwrap() > 1.0, "{stderr}");
    let rows = report["rows"].as_array().unwrap();
    assert_eq!(rows.iter().map(|row| row["budget"].as_str().unwrap()).collect::<Vec<_>>(), ["8 spp", "16 spp"]);
    for row in rows {
        assert_eq!((row["pairs"].as_array().unwrap().len(), row["ratios"]["mse"]["low"].is_f64()), (4, true), "{row}");
    }
    assert!(folder.path().join("out/cornell-compare.json").exists());
}

#[test]
fn compare_takes_another_program() {
    let folder = tempfile::tempdir().unwrap();
    let program = assert_cmd::cargo::cargo_bin!("sunfleck").display().to_string();
    let arguments = [
        "--spp",
        "4..4",
        "--seeds",
        "2",
        "--resolution",
        "8x8",
        "--json",
        "--reference-spp",
        "256",
        "--compare",
        &program,
    ];
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
    for (name, flag) in [("json", "--json"), ("devices", "--device=all")] {
        let text = format!(r#"{{"about": "", "benches": [{{"name": "a", "scene": "cornell", "flags": ["{flag}"]}}]}}"#);
        std::fs::write(folder.path().join(format!("{name}.json")), text).unwrap();
    }
    std::fs::write(folder.path().join("no.exr"), "not an image").unwrap();
    for (arguments, code, word) in [
        (&["--spp", "8..4"] as &[&str], 2, "MIN"),
        (&["--spp", "8"], 2, "MIN..MAX"),
        (&["--seeds", "1"], 2, "--seeds"),
        (&["--times", "2s..1s"], 2, "MIN"),
        (&["--times", "1s..2s", "--spp", "4..8"], 2, "cannot be used with"),
        (&["--plot", "error.pdf"], 2, "use .svg or .png"),
        (&["--plot", "a.svg", "--plot", "a.svg"], 2, "given twice"),
        (&["--plot", "a.svg", "--compare", "--mis balance"], 2, "--compare"),
        (&["--plot", "gone/a.svg"], 3, "gone"),
        (&["bad.json", "--plot", "a.svg"], 2, "--plot is for one scene"),
        (&["--reference", "no.exr", "--reference-spp", "8"], 2, "--reference-spp"),
        (&["--compare", "no-such-program"], 2, "neither a program nor flags"),
        (&["--compare", "--light-sampling all", "--resolution", "8x8"], 2, "mis, mixture, nee, bsdf"),
        (&["--compare", "--light-sampling 'bsdf"], 2, "quote"),
        (&["bad.json", "--compare", "--mis balance"], 2, "--compare is for one scene"),
        (&["bad.json", "--camera", "0"], 2, "--camera is for one scene"),
        (&["bad.json", "--reference", "no.exr"], 2, "--reference is for one scene"),
        (&["json.json"], 3, "bench 'a': --json is for the command line"),
        (&["devices.json"], 2, "--device all is not built yet"),
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
