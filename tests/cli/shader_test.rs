//! `sunfleck shader-test` and `shaders new bsdf`: exit codes, messages with their places, the JSON report.

use std::path::Path;
use std::process::Command;

/// Runs `sunfleck` in a folder; returns exit code, standard output, standard error.
fn run_in(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    run_with(folder, arguments, None)
}

fn run_with(folder: &Path, arguments: &[&str], variable: Option<(&str, &str)>) -> (i32, String, String) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"));
    command.current_dir(folder).env_remove("RUST_LOG").args(arguments).envs(variable);
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Expects an exit code and an error with all of `words`.
fn refused(folder: &Path, arguments: &[&str], code: i32, words: &[&str]) {
    let (status, stdout, stderr) = run_in(folder, arguments);
    assert_eq!(status, code, "{arguments:?}: {stderr}");
    assert_eq!(stdout, "", "{arguments:?}");
    assert!(stderr.contains("error: "), "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?} does not say '{word}': {stderr}");
    }
}

fn passes(folder: &Path, arguments: &[&str], words: &[&str]) {
    let (code, stdout, stderr) = run_in(folder, arguments);
    assert_eq!((code, stdout.as_str()), (0, ""), "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?} does not say '{word}': {stderr}");
    }
}

/// A kernel and its expectations that need nothing of a source tree but the built-in includes.
const KERNEL: &str = "#version 460
#include \"../include/test_kernel.glsl\"
void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    outputs[lane] = floatBitsToUint(vec4(2.0 * uintBitsToFloat(inputs[lane].x), 0.0, 0.0, 0.0));
}
";
const DOUBLED: &str = "inputs = ['x']\noutputs = ['doubled']\n[[test]]\ncheck = 'values'\nrows = [[1, 2], [-4, -8]]\n";

#[test]
fn a_kernel_that_lies_alone_is_tested_with_the_built_in_includes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::write(path.join("twice.comp"), KERNEL).unwrap();
    refused(path, &["shader-test", "twice.comp"], 3, &["twice.comp: ", "no expectations", "twice.toml is missing"]);
    std::fs::write(path.join("twice.toml"), DOUBLED).unwrap();
    for file in ["twice.comp", "twice.toml", "./twice.comp"] {
        passes(path, &["shader-test", file], &["twice.toml\n", "ok    values: 2 rows", "1 file passed"]);
    }

    std::fs::write(path.join("twice.toml"), DOUBLED.replace("-8", "-9")).unwrap();
    refused(path, &["shader-test", "twice.comp"], 6, &["FAIL  values", "x -4: doubled is -8.0, expected -9.0 ± 0"]);
    refused(path, &["shader-test", "twice.comp"], 6, &["error: 1 check fails, in 1 of 1 file"]);

    std::fs::write(path.join("twice.toml"), DOUBLED.replace("rows", "row")).unwrap();
    refused(path, &["shader-test", "twice.comp"], 3, &["twice.toml: line 3: ", "unknown field `row`", "`rows`"]);
    std::fs::write(path.join("twice.toml"), format!("kernel = 'other.comp'\n{DOUBLED}")).unwrap();
    refused(path, &["shader-test", "twice.toml"], 3, &["twice.toml: its kernel test/other.comp does not exist"]);

    std::fs::write(path.join("twice.toml"), DOUBLED).unwrap();
    std::fs::write(path.join("twice.comp"), KERNEL.replace("2.0 *", "two *")).unwrap();
    let place = "test/twice.comp:6:42: 'two' : undeclared identifier";
    refused(path, &["shader-test", "twice.comp"], 3, &["error: twice.comp: does not compile:", place, "    ^"]);
}

#[test]
fn files_that_are_missing_or_none_are_input_errors_and_no_device_is_4() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    refused(path, &["shader-test", "nowhere.comp"], 3, &["nowhere.comp: no such file", "built-in shaders"]);
    refused(path, &["shader-test", "float_behaviour"], 3, &["no expectations", "test/float_behaviour.toml is missing"]);
    refused(path, &["shader-test", "--shaders", "nowhere"], 2, &["--shaders: 'nowhere' is not a folder"]);
    refused(path, &["shader-test", "--shaders", "."], 3, &["there are no expectations"]);
    refused(path, &["shader-test", "--seed", "x"], 2, &["--seed"]);
    refused(path, &["shader-test", "fresnel", "--device", "all"], 2, &["--device all", "not built yet"]);
    refused(path, &["shader-test", "fresnel", "--device", "no such device"], 4, &["no such device"]);
    std::fs::write(path.join("image.png"), "").unwrap();
    refused(path, &["shader-test", "image.png"], 3, &["image.png: expected a test kernel (.comp)"]);
    let no_driver = Some(("VK_DRIVER_FILES", "/nonexistent.json"));
    let (code, _, stderr) = run_with(path, &["shader-test", "fresnel"], no_driver);
    assert_eq!(code, 4, "{stderr}");
    // What is wrong with a file is said first.
    let (code, _, stderr) = run_with(path, &["shader-test", "nowhere.comp"], no_driver);
    assert_eq!(code, 3, "{stderr}");
}

#[test]
fn built_in_tests_are_found_by_name_and_reported_as_json() {
    let folder = tempfile::tempdir().unwrap();
    let (code, stdout, stderr) = run_in(folder.path(), &["shader-test", "fresnel", "test/sampler.comp", "--json"]);
    assert_eq!(code, 0, "{stderr}");
    let report: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!((&report["passed"], &report["seed"]), (&true.into(), &0.into()));
    assert!(report["device"].is_string() && report["driver"].is_string());
    let files = report["files"].as_array().unwrap();
    let names: Vec<_> = files.iter().map(|file| file["file"].as_str().unwrap()).collect();
    assert_eq!(names, ["test/fresnel.toml", "test/sampler.toml"]);
    let uniform = &files[1]["checks"][0];
    assert_eq!((uniform["check"].as_str(), uniform["failed"].as_u64()), (Some("uniform"), Some(0)));
    let numbers = &uniform["numbers"];
    assert_eq!((numbers["degrees_of_freedom"].as_u64(), numbers["significance"].as_f64()), (Some(63), Some(0.01)));
    let p = numbers["p_value"].as_f64().unwrap();
    assert!(p > numbers["threshold"].as_f64().unwrap() && p <= 1.0);
    // Another seed draws other samples.
    let (_, stdout, _) = run_in(folder.path(), &["shader-test", "sampler", "--seed", "7", "--json"]);
    let other: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_ne!(other["files"][0]["checks"][0]["numbers"]["p_value"].as_f64(), Some(p));
}

#[test]
fn a_new_lobe_is_written_once_and_only_where_it_belongs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let new = |name, dir| ["shaders", "new", "bsdf", name, "--dir", dir];
    refused(path, &new("velvet", "."), 3, &["is no folder of shader sources", "shaders export DIR"]);
    passes(path, &["shaders", "export", "mine"], &["mine"]);
    passes(
        path,
        &new("velvet", "mine"),
        &[
            "wrote mine/include/bsdf_velvet.glsl",
            "shader-test mine/test/bsdf_velvet.comp",
            "#include \"bsdf_velvet.glsl\"",
        ],
    );
    refused(path, &new("velvet", "mine"), 2, &["'velvet' is taken", "include/bsdf_velvet.glsl"]);
    refused(path, &new("lambertian", "mine"), 2, &["'lambertian' is taken", "lambertian_scatter"]);
    refused(path, &new("Velvet", "mine"), 2, &["'Velvet' is no name for a lobe", "lower-case"]);
    // A file that is in the way, though it defines nothing.
    let there = path.join("mine/test/bsdf_felt.toml");
    std::fs::write(&there, "mine").unwrap();
    refused(path, &new("felt", "mine"), 2, &["bsdf_felt.toml is there already"]);
    assert!(std::fs::read_to_string(there).unwrap() == "mine" && !path.join("mine/include/bsdf_felt.glsl").exists());
    // In the folder itself, by its own name and by the folder's.
    passes(&path.join("mine"), &["shader-test", "test/bsdf_velvet.toml"], &["1 file passed"]);
    passes(&path.join("mine/test"), &["shader-test", "bsdf_velvet.comp"], &["bsdf_velvet.toml: velvet: a lobe"]);
    passes(path, &["shader-test", "bsdf_velvet", "--shaders", "mine"], &["mine/test/bsdf_velvet.toml: velvet: a lobe"]);
    passes(path, &["shaders", "check", "mine"], &["kernels compile"]);
}

/// The example of the chapter on shader tests.
#[test]
fn the_example_of_the_chapter_works() {
    let chapter = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/shader-tests.md")).unwrap();
    let block = |language: &str| {
        let (_, rest) = chapter.split_once(&format!("```{language}\n")).expect("the block is there");
        rest.split_once("```").expect("the block ends").0.to_owned()
    };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("example.comp"), block("glsl")).unwrap();
    std::fs::write(folder.path().join("example.toml"), block("toml")).unwrap();
    passes(folder.path(), &["shader-test", "example.comp"], &["ok    values: 2 rows", "ok    range: 303 inputs"]);
}
