//! `sunfleck devices`: calibration is measured when asked for, kept, used and forgotten.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;

/// Runs `sunfleck` with a cache folder of its own; returns exit code, the JSON object if there is one, standard error.
fn sunfleck(cache: &Path, arguments: &[&str]) -> (i32, Value, String) {
    let program = assert_cmd::cargo::cargo_bin!("sunfleck");
    let output = Command::new(program).env("XDG_CACHE_HOME", cache).env_remove("RUST_LOG").args(arguments).output();
    let output = output.unwrap();
    let value = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code().unwrap(), value, String::from_utf8(output.stderr).unwrap())
}

fn kept(cache: &Path) -> Vec<PathBuf> {
    let folder = std::fs::read_dir(cache.join("sunfleck/calibration"));
    folder.into_iter().flatten().map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn what_calibration_measures_is_kept_used_and_forgotten() {
    let cache = tempfile::tempdir().unwrap();
    let devices = |arguments: &[&str]| {
        let (code, report, stderr) = sunfleck(cache.path(), &[&["devices", "--json"], arguments].concat());
        assert_eq!(code, 0, "{stderr}");
        (report["devices"].as_array().unwrap().clone(), stderr)
    };
    assert!(devices(&[]).0.iter().all(|device| device["calibration"].is_null()));
    assert!(kept(cache.path()).is_empty(), "nothing is measured unasked");

    let (measured, stderr) = devices(&["--calibrate"]);
    assert!(stderr.contains("measuring bvh") && stderr.contains("kept in"), "{stderr}");
    let (again, _) = devices(&[]);
    for (device, later) in measured.iter().zip(&again).filter(|(device, _)| device["unusable"].is_null()) {
        let calibration = &device["calibration"];
        assert_eq!(calibration["scenes"], serde_json::json!(["cornell", "bumpy"]), "{device}");
        let variants = calibration["variants"].as_array().unwrap();
        assert!(variants.len() >= 2, "{calibration}");
        for variant in variants {
            let rates = variant["paths_per_second"].as_array().unwrap();
            assert!(rates.len() == 2 && rates.iter().all(|rate| rate.as_f64().unwrap() > 0.0), "{variant}");
        }
        let traces: Vec<_> = variants.iter().map(|variant| variant["trace"].as_str().unwrap()).collect();
        assert_eq!(traces.contains(&"ray-query"), device["ray_query"].as_bool().unwrap(), "{traces:?}");
        assert_eq!(calibration, &later["calibration"], "what was written is read");
        if device["ray_query"] == true {
            assert!(device["trace_auto_reason"].as_str().unwrap().starts_with("calibrated"), "{device}");
        }
    }

    // A file that is no calibration costs nothing but the measurements.
    let files = kept(cache.path());
    std::fs::write(&files[0], "{ damaged").unwrap();
    assert!(devices(&[]).0.iter().any(|device| device["calibration"].is_null()));
    let (forgotten, _) = devices(&["--forget"]);
    assert!(forgotten.iter().all(|device| device["calibration"].is_null()) && kept(cache.path()).is_empty());
    assert_eq!(sunfleck(cache.path(), &["devices", "--forget", "--calibrate"]).0, 2);
}
