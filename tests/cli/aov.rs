//! `render --aov` and `--stats` as people call them: layers, pictures, merging, the report, and what is refused.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use sunfleck::film::exr::{ExrImage, read_exr};

fn sunfleck(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output =
        Command::new(assert_cmd::cargo::cargo_bin!("sunfleck")).current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Renders the Cornell box in 16×12 pixels by our own BVH, which can count.
fn render(folder: &Path, arguments: &[&str]) -> (String, String) {
    let all = [&["render", "cornell", "--resolution", "16x12", "--trace", "bvh"], arguments].concat();
    let (code, stdout, stderr) = sunfleck(folder, &all);
    assert_eq!(code, 0, "{arguments:?}: {stderr}");
    (stdout, stderr)
}

fn floats(image: &ExrImage, channel: &str) -> Vec<f32> {
    image.values(channel).unwrap_or_else(|| panic!("there is no {channel}")).to_f32()
}

const ALL: &str = "albedo,normal,depth,position,coverage,cost";
const CHANNELS: [&str; 12] = [
    "albedo.B",
    "albedo.G",
    "albedo.R",
    "cost.Y",
    "coverage.A",
    "depth.Z",
    "normal.X",
    "normal.Y",
    "normal.Z",
    "position.X",
    "position.Y",
    "position.Z",
];

#[test]
fn layers_merge_to_those_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    render(folder, &["--samples", "0..16", "--aov", ALL, "-o", "a.exr"]);
    render(folder, &["--samples", "16..48", "--aov", ALL, "-o", "b.exr"]);
    render(folder, &["--samples", "0..48", "--aov", ALL, "-o", "whole.exr"]);
    render(folder, &["--samples", "0..48", "-o", "plain.exr"]);
    let (code, _, stderr) = sunfleck(folder, &["merge", "b.exr", "a.exr", "-o", "merged.exr"]);
    assert!(code == 0 && !stderr.contains("warning"), "{stderr}");
    let [merged, whole, plain] = ["merged.exr", "whole.exr", "plain.exr"].map(|n| read_exr(&folder.join(n)).unwrap());
    let layers: Vec<_> = whole.channels.iter().map(|c| c.name.as_str()).filter(|n| n.contains('.')).collect();
    assert_eq!(layers, CHANNELS);
    for channel in CHANNELS {
        let (a, b) = (floats(&merged, channel), floats(&whole, channel));
        let most = b.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        assert!(most > 0.0, "{channel} is empty");
        for (a, b) in a.iter().zip(&b) {
            // What is not negative merges to 1 ulp; where signs cancel, to one of the parts' largest.
            let bound = if channel.starts_with("normal") || channel.starts_with("position") { most } else { *b };
            assert!((a - b).abs() <= bound.next_up() - bound, "{channel}: {a} and {b}");
        }
    }
    // Radiance has not a bit more or less, and stays what is compared.
    assert_eq!(whole.rgb(), plain.rgb());
    let (code, stdout, _) = sunfleck(folder, &["compare", "whole.exr", "plain.exr", "--json"]);
    assert_eq!((code, &serde_json::from_str::<Value>(&stdout).unwrap()["mse"]), (0, &0.0.into()));
    // A part without them takes them from the merged image, and that is said; so it is of a picture.
    render(folder, &["--samples", "48..64", "-o", "c.exr"]);
    let (code, _, stderr) = sunfleck(folder, &["merge", "whole.exr", "c.exr", "-o", "less.exr"]);
    assert!(code == 0 && stderr.contains("normal.X is left out"), "{stderr}");
    let (code, _, stderr) = sunfleck(folder, &["merge", "whole.exr", "-o", "whole.png"]);
    assert!(code == 0 && stderr.contains("not in a .png: albedo, cost, coverage, depth, normal, position"), "{stderr}");
}

#[test]
fn pictures_stand_beside_a_png() {
    let folder = tempfile::tempdir().unwrap();
    let (stdout, stderr) = render(
        folder.path(),
        &["--spp", "16", "--aov", ALL, "--aov", "depth", "--stats", "--json", "-o", "a.b.png", "-o", "a.exr"],
    );
    let names = ["albedo", "normal", "depth", "position", "coverage", "cost"].map(|aov| format!("a.b.{aov}.png"));
    let report: Value = serde_json::from_str(&stdout).unwrap();
    let outputs = report["outputs"].as_array().unwrap();
    let open = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgb8();
    for name in &names {
        assert!(outputs.contains(&name.as_str().into()) && stderr.contains(name.as_str()), "{name}: {stderr}");
        assert_eq!(open(name).dimensions(), (16, 12));
    }
    // The back wall above the boxes looks at the camera.
    let middle = |name: &str| open(name).get_pixel(8, 3).0;
    assert_eq!(middle("a.b.normal.png"), [128, 128, 255]);
    assert_eq!(middle("a.b.coverage.png"), [255; 3]);
    let albedo = floats(&read_exr(&folder.path().join("a.exr")).unwrap(), "albedo.R")[3 * 16 + 8];
    let encoded = sunfleck::film::tonemap::srgb_encode(albedo) * 255.0;
    assert!((f32::from(middle("a.b.albedo.png")[0]) - encoded).abs() <= 1.0, "{encoded}");
    assert!(stderr.contains("a.b.depth.png: white ") && stderr.contains("a.b.cost.png: black 0"), "{stderr}");
    assert_eq!(report["aovs"], serde_json::json!(["albedo", "normal", "depth", "position", "coverage", "cost"]));
    assert!(report["features"].as_array().unwrap().contains(&"aov-normal".into()));
    assert!(report["kernel_key"].as_str().unwrap().contains("statistics"));
}

#[test]
fn statistics_are_a_table_and_an_object() {
    let folder = tempfile::tempdir().unwrap();
    let (stdout, stderr) = render(folder.path(), &["--spp", "16", "--stats", "--json", "-o", "a.exr"]);
    let report: Value = serde_json::from_str(&stdout).unwrap();
    let statistics = &report["statistics"];
    let rays = statistics["rays"].as_array().unwrap();
    let of = |kind: &str| rays.iter().find(|rays| rays["kind"] == kind).unwrap();
    let count = |kind: &str| of(kind)["rays"].as_u64().unwrap();
    assert_eq!(Some(count("all")), report["rays"].as_u64());
    let paths = report["paths"].as_u64().unwrap();
    // The camera sends one a path, and emission rays to the lamp: eight a sample of the few pixels that see it.
    let camera = count("camera");
    assert!(camera > paths && (camera - paths).is_multiple_of(8 * 16) && camera < 2 * paths, "{camera} for {paths}");
    assert_eq!(count("all"), count("camera") + count("scattered") + count("shadow"));
    assert!(of("camera")["triangles_per_ray"].as_f64().unwrap() > 1.0);
    for share in ["search_occupancy", "shading_occupancy"] {
        let share = statistics[share].as_f64().unwrap();
        assert!(share > 0.0 && share <= 1.0, "{share}");
    }
    assert!(
        statistics["slices"]["count"].as_u64().unwrap() > 0 && statistics["slices"]["median"].as_f64().unwrap() > 0.0
    );
    assert_eq!(statistics["saturated"], false);
    for word in ["camera", "scattered", "shadow", "nodes/ray", "triangles/ray", "lanes that are busy", "slices"] {
        assert!(stderr.contains(word), "{word}: {stderr}");
    }
    let flags = ["--spp", "16", "--stats", "--emission-rays", "0", "--json", "-o", "a.exr"];
    let (stdout, _) = render(folder.path(), &flags);
    let without: Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(without["statistics"]["rays"][0]["rays"], without["paths"]);
    let has = |report: &Value| report["features"].as_array().unwrap().contains(&"emission-rays".into());
    assert!(has(&report) && !has(&without));
    // Nothing of it without the flag, and no table under --quiet.
    let (stdout, stderr) = render(folder.path(), &["--spp", "4", "--json", "-o", "a.exr"]);
    assert!(serde_json::from_str::<Value>(&stdout).unwrap()["statistics"].is_null());
    assert!(!stderr.contains("nodes/ray"), "{stderr}");
    let (_, stderr) = render(folder.path(), &["--spp", "4", "--stats", "--quiet", "-o", "a.exr"]);
    assert!(!stderr.contains("nodes/ray"), "{stderr}");
}

#[test]
fn what_cannot_be_done_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, code, words) in [
        (
            &["--aov", "albedo,motion"] as &[&str],
            2,
            &["motion", "albedo, normal, depth, position, coverage, cost"] as &[&str],
        ),
        (&["--aov", "albedo", "-o", "a.png", "-o", "a.albedo.png"], 2, &["a.albedo.png", "--aov albedo"]),
        (&["--aov", ""], 2, &["--aov"]),
    ] {
        let (status, stdout, stderr) = sunfleck(folder.path(), &[&["render"], arguments].concat());
        assert_eq!((status, stdout.as_str()), (code, ""), "{arguments:?}: {stderr}");
        for word in words {
            assert!(stderr.contains(word), "{arguments:?} does not say '{word}': {stderr}");
        }
    }
    // A picture that could not be written is found before anything is rendered.
    std::fs::create_dir(folder.path().join("b.normal.png")).unwrap();
    let (status, _, stderr) = sunfleck(folder.path(), &["render", "--aov", "normal", "-o", "b.png"]);
    assert!(status == 3 && stderr.contains("b.normal.png"), "{status}: {stderr}");
    assert!(!folder.path().join("b.png").exists());
}
