//! Usage of the command line: exit codes, messages that name what is wrong, nothing written on an error.

use std::path::Path;

use assert_cmd::Command;

/// Runs `sunfleck` in a folder; returns exit code, standard output, standard error.
fn run_in(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"))
        .current_dir(folder)
        .env_remove("RUST_LOG")
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Expects an exit code, a message with all of `words`, nothing on standard output and nothing in the folder.
fn refused(arguments: &[&str], code: i32, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let (status, stdout, stderr) = run_in(folder.path(), arguments);
    assert_eq!(status, code, "{arguments:?}: {stderr}");
    assert!(stderr.contains("error: "), "{arguments:?}: {stderr}");
    assert_eq!(stdout, "", "{arguments:?}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?} does not say '{word}': {stderr}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{arguments:?} left something behind");
}

#[test]
fn wrong_values_are_usage_errors_that_say_what_is_right() {
    for (flag, value, word) in [
        ("--resolution", "0x0", "at least 1x1"),
        ("--resolution", "640x0", "at least 1x1"),
        ("--resolution", "640", "1280x720"),
        ("--resolution", "100000x100000", "2^28"),
        ("--spp", "0", "--spp"),
        ("--spp", "-1", "--spp"),
        ("--time", "0s", "above 0"),
        ("--time", "10 parsecs", "unit"),
        ("--samples", "8..8", "A below B"),
        ("--samples", "8", "A..B"),
        ("--seed", "x", "--seed"),
        ("--adaptive", "1", "4..=4096"),
        ("--integrator", "photon", "path, direct, indirect, emission"),
        ("--sampler", "halton", "sobol, independent"),
        ("--light-sampling", "all", "mis, mixture, nee, bsdf"),
        ("--mis", "max", "balance, power"),
        ("--env-sampling", "all", "compensated, importance, uniform"),
        ("--env-strength", "-1", "not negative"),
        ("--env-rotation", "inf", "finite"),
        ("--exposure", "nan", "finite"),
        ("--look-at", "0,0,1", "EYE:TARGET"),
        ("--look-at", "0,0,1:0,0,0:0,0,1", "in line"),
        ("--tonemap", "filmic", "clip, exponential, reinhard, aces"),
        ("--trace", "rtx", "auto, ray-query, bvh"),
        ("--bvh-quality", "best", "fast, default, high"),
        ("--filter", "sinc", "box"),
        ("--aov", "motion", "albedo, normal, depth, position, coverage, cost"),
        ("--shaders", "no-such-folder", "no-such-folder"),
        ("-o", "image.jpg", ".exr"),
        ("-o", "image", ".png"),
    ] {
        let argument =
            if flag.starts_with("--") { vec![format!("{flag}={value}")] } else { vec![flag.into(), value.into()] };
        let mut arguments = vec!["render"];
        arguments.extend(argument.iter().map(String::as_str));
        refused(&arguments, 2, &[if flag == "--sampler" { "independent" } else { word }]);
    }
}

#[test]
fn impossible_combinations_are_usage_errors() {
    refused(&["render", "--spp", "4", "--samples", "0..4"], 2, &["--spp", "--samples"]);
    refused(&["render", "-o", "a.exr", "-o", "a.exr"], 2, &["a.exr", "twice"]);
    refused(&["merge", "-o", "a.exr"], 2, &["PART.exr"]);
    refused(&["merge", "a.exr"], 2, &["--output"]);
    refused(&["merge", "a.exr", "-o", "b.tiff"], 2, &[".exr"]);
    refused(&["compare", "a.exr"], 2, &["B.exr"]);
    refused(&["compare", "a.exr", "b.exr", "--heatmap", "c.exr"], 2, &["c.exr", ".png"]);
    refused(&["render", "--no-such-flag"], 2, &["--no-such-flag"]);
    refused(&["paint"], 2, &["paint"]);
}

#[test]
fn what_is_not_built_is_refused_by_name() {
    for (arguments, name) in [
        (&["bench", "--device", "all"] as &[&str], "--device all"),
        (&["watch", "--device", "all"], "--device all"),
        (&["render", "--denoise"], "--denoise"),
        (&["render", "--checkpoint", "c"], "--checkpoint"),
        (&["render", "--resume"], "--resume"),
        (&["render", "--filter", "gaussian"], "--filter gaussian"),
        (&["render", "--device", "all"], "--device all"),
    ] {
        refused(arguments, 2, &[name, "not built yet"]);
    }
    refused(&["render", "--denoise", "--resume"], 2, &["--denoise", "--resume"]);
}

#[test]
fn help_names_everything_of_the_contract_and_marks_what_is_not_built() {
    let here = Path::new(".");
    let (code, help, _) = run_in(here, &["render", "--help"]);
    assert_eq!(code, 0);
    for flag in
        "--resolution --camera --spp --time --target-error --samples --seed --max-bounces --integrator --sampler \
        --light-sampling --mis --filter --env --env-strength --env-rotation --env-sampling --aov --stats --denoise --exposure \
        --tonemap --device --trace --bvh-quality --checkpoint --resume --json --quiet --strict --shaders --estimate --output"
            .split_whitespace()
    {
        assert!(help.contains(flag), "{flag}");
    }
    assert!(help.contains("Denoise the image [not built yet]"), "{help}");
    let (_, help, _) = run_in(here, &["watch", "--help"]);
    for flag in "--shaders --port --bind --no-serve --resolution --spp --hang --exposure".split_whitespace() {
        assert!(help.contains(flag), "{flag}");
    }
    let (_, help, _) = run_in(here, &["shader-test", "--help"]);
    for flag in "[FILE]... --shaders --device --seed --json".split_whitespace() {
        assert!(help.contains(flag), "{flag}");
    }
    let (_, help, _) = run_in(here, &["--help"]);
    for command in
        ["render", "devices", "info", "compare", "merge", "bench", "watch", "shaders", "shader-test", "Exit codes"]
    {
        assert!(help.contains(command), "{command}");
    }
    let (code, version, _) = run_in(here, &["--version"]);
    assert_eq!((code, version.trim()), (0, concat!("sunfleck ", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn unusable_files_are_input_errors() {
    refused(&["render", "-o", "no-such-folder/a.exr"], 3, &["no-such-folder"]);
    refused(&["render", "no-such-scene.gltf", "-o", "a.exr"], 3, &["no-such-scene.gltf", "cornell"]);
    refused(&["render", "cornell", "--env", "no-such-sky.hdr"], 3, &["no-such-sky.hdr"]);
    refused(&["info", "no-such-scene.glb"], 3, &["no-such-scene.glb"]);
    refused(&["compare", "no-a.exr", "no-b.exr"], 3, &["no-a.exr"]);
    refused(&["merge", "no-a.exr", "-o", "b.exr"], 3, &["no-a.exr"]);
}

#[test]
fn info_describes_the_built_in_scene() {
    let (code, stdout, stderr) = run_in(Path::new("."), &["info", "cornell", "--json"]);
    assert_eq!(code, 0, "{stderr}");
    let info: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(info["materials_by_bsdf"]["lambertian"], info["materials"]);
    assert_eq!(info["material_list"][0]["lobes"], serde_json::json!(["diffuse"]));
    assert_eq!(info["cameras"].as_array().unwrap().len(), 1);
    assert!(info["triangles"].as_u64().unwrap() >= 30);
    assert!(stderr.contains("triangles"));
    let (code, stdout, _) = run_in(Path::new("."), &["info", "cornell"]);
    assert_eq!((code, stdout.as_str()), (0, ""), "what is for people goes to standard error");
}

#[test]
fn shaders_are_exported_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, stderr) = run_in(folder.path(), &["shaders", "export", "mine"]);
    assert_eq!(code, 0, "{stderr}");
    let kernel = folder.path().join("mine/path_trace.comp");
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/path_trace.comp");
    assert_eq!(std::fs::read(&kernel).unwrap(), std::fs::read(repository).unwrap());
    let removed = folder.path().join("mine/include/bsdf.glsl");
    std::fs::remove_file(&removed).unwrap();
    let (code, _, stderr) = run_in(folder.path(), &["shaders", "export", "mine"]);
    assert!(code == 2 && stderr.contains("are there already; --force"), "{code}: {stderr}");
    assert!(!removed.exists(), "nothing is written where something is in the way");
    assert_eq!(run_in(folder.path(), &["shaders", "export", "--force", "mine"]).0, 0);
    assert!(removed.exists());
    let (code, _, stderr) = run_in(folder.path(), &["shaders", "check", "mine"]);
    assert!(code == 0 && stderr.contains("kernels compile"), "{code}: {stderr}");
    let include = folder.path().join("mine/include/mis.glsl");
    let text = std::fs::read_to_string(&include).unwrap();
    std::fs::write(&include, format!("{text}\nfloat wrong = oops;\n")).unwrap();
    let line = text.lines().count() + 2;
    let (code, _, stderr) = run_in(folder.path(), &["shaders", "check", "mine"]);
    let place = format!("include/mis.glsl:{line}: error: 'oops'");
    assert!(code == 3 && stderr.contains(&place) && stderr.contains("| float wrong = oops;"), "{code}: {stderr}");
    assert!(stderr.contains("does not compile: path_trace.comp"), "{stderr}");
    let (code, _, _) = run_in(folder.path(), &["shaders", "export", "--force", "mine"]);
    assert_eq!((code, std::fs::read_to_string(&include).unwrap()), (0, text));
    let (code, _, stderr) = run_in(folder.path(), &["shaders", "check", "nowhere"]);
    assert!(code == 3 && stderr.contains("nowhere"), "{code}: {stderr}");
}

#[test]
fn a_port_in_use_is_an_error_that_says_what_to_do() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    refused(&["watch", "cornell", "--port", &port], 2, &["cannot listen", &port, "--port 0"]);
}
