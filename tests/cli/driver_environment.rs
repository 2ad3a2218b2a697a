//! What is set for lavapipe before it loads: the image does not depend on it, short runs compile quickly, and what the user
//! has set stays.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use sunfleck::film::exr::read_exr;

/// Renders to `folder/NAME.exr` with these variables and a shader cache of its own; returns the JSON object.
fn render(folder: &Path, name: &str, variables: &[(&str, &str)], arguments: &[&str]) -> Value {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"));
    for variable in ["LP_NATIVE_VECTOR_WIDTH", "MESA_SHADER_CACHE_DIR", "GALLIVM_PERF", "RUST_LOG"] {
        command.env_remove(variable);
    }
    let output = command
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder)
        .envs(variables.iter().copied())
        .args(["render", "--json", "--quiet", "-o", &format!("{name}.exr")])
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("shader cache"), "Mesa keeps no kernels: {said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Whether the device is a lavapipe; the others have no such variables.
fn is_lavapipe(report: &Value) -> bool {
    let lavapipe = report["device"].as_str().unwrap().contains("llvmpipe");
    if !lavapipe {
        eprintln!("not lavapipe: nothing to test");
    }
    lavapipe
}

/// A lane does the same operations whatever the width of the vectors and however LLVM arranges them: every bit is the same,
/// with textures and with a scene compiled in.
#[test]
fn the_image_is_the_same_at_every_width_and_without_optimisation() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for scene in ["textured.gltf", "cornell"] {
        let path = scenes.join(scene);
        let name = if path.exists() { path.to_str().unwrap() } else { scene };
        let arguments = [name, "--resolution", "48x32", "--spp", "8"];
        let mut images = Vec::new();
        for (width, optimisation) in [("128", "nopt"), ("256", ""), ("512", "")] {
            let variables = [("LP_NATIVE_VECTOR_WIDTH", width), ("GALLIVM_PERF", optimisation)];
            let report = render(folder.path(), "image", &variables, &arguments);
            if !is_lavapipe(&report) {
                return;
            }
            images.push(read_exr(&folder.path().join("image.exr")).unwrap().rgb().unwrap());
        }
        let bits = |image: &Vec<[f32; 3]>| image.iter().map(|rgb| rgb.map(f32::to_bits)).collect::<Vec<_>>();
        assert!(images[0].iter().any(|rgb| rgb[0] > 0.0), "{scene} is dark");
        assert!(images.windows(2).all(|pair| bits(&pair[0]) == bits(&pair[1])), "{scene} depends on the width");
    }
}

#[test]
fn the_report_says_what_was_set_and_why() {
    let folder = tempfile::tempdir().unwrap();
    let few = ["--resolution", "16x16", "--spp", "1"];
    let report = render(folder.path(), "few", &[], &few);
    if !is_lavapipe(&report) {
        return;
    }
    let environment = &report["driver_environment"];
    let version = report["driver"].as_str().unwrap().to_owned();
    if ["Mesa 25.", "Mesa 26."].iter().any(|new| version.contains(new)) {
        assert_eq!(environment["set"]["LP_NATIVE_VECTOR_WIDTH"], "128", "{environment}");
        assert_eq!(environment["set"]["GALLIVM_PERF"], "nopt", "{environment}");
        assert!(environment["reason"].as_str().unwrap().contains("256 paths"), "{environment}");
        assert!(report["device"].as_str().unwrap().contains("128 bits"), "{report}");
    }
    let report = render(folder.path(), "width", &[("LP_NATIVE_VECTOR_WIDTH", "256")], &few);
    assert!(report["driver_environment"]["set"]["LP_NATIVE_VECTOR_WIDTH"].is_null(), "{report}");
    assert!(report["device"].as_str().unwrap().contains("256 bits"), "{report}");
    let timed = render(folder.path(), "timed", &[], &["--resolution", "16x16", "--time", "10ms"]);
    assert!(timed["driver_environment"]["set"]["GALLIVM_PERF"].is_null(), "a time has no number of paths: {timed}");
}
