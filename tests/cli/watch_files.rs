//! `watch --tev` as the files of a scene are saved: a listener that takes the pictures as tev does sees each change.

use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::watch::Watch;

/// The address of a viewer, and what [`pictures`] gets of it.
fn viewer() -> (String, Receiver<[f32; 3]>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    (listener.local_addr().unwrap().to_string(), pictures(listener))
}

/// Mean of the channels R, G and B of each picture that a viewer is sent.
fn pictures(listener: TcpListener) -> Receiver<[f32; 3]> {
    let (send, means) = channel();
    std::thread::spawn(move || {
        while let Ok((mut stream, _)) = listener.accept() {
            while let Some(packet) = packet(&mut stream) {
                const UPDATE: u8 = 6;
                // R, G, B and variance, one after the other at the packet's end.
                let floats: Vec<f32> = packet[packet.len().saturating_sub(4 * 4 * 32 * 32)..]
                    .chunks_exact(4)
                    .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
                    .collect();
                let mean = |channel: usize| floats[channel * 1024..][..1024].iter().sum::<f32>() / 1024.0;
                if packet[0] == UPDATE && send.send([0, 1, 2].map(mean)).is_err() {
                    return;
                }
            }
        }
    });
    means
}

/// The length, which counts itself, and the rest.
fn packet(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).ok()?;
    let mut rest = vec![0; u32::from_le_bytes(length) as usize - 4];
    stream.read_exact(&mut rest).ok()?;
    Some(rest)
}

/// The next picture that is as it should be, within two minutes: drivers compile slowly, machines are loaded.
fn expect(pictures: &Receiver<[f32; 3]>, what: &str, is_wanted: impl Fn([f32; 3]) -> bool) -> [f32; 3] {
    let (start, mut seen) = (Instant::now(), Vec::new());
    while let Some(left) = Duration::from_secs(120).checked_sub(start.elapsed()) {
        let Ok(mean) = pictures.recv_timeout(left) else { break };
        if is_wanted(mean) {
            return mean;
        }
        seen.push(mean);
    }
    panic!("{what}: among {seen:?}");
}

fn paint(path: &Path, color: [u8; 3]) {
    image::RgbImage::from_pixel(8, 4, image::Rgb(color)).save(path).unwrap();
}

/// The textured scene with its first image in a file.
fn scene_of_files(folder: &Path) -> (std::path::PathBuf, Value) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/textured.gltf");
    let mut json: Value = serde_json::from_slice(&std::fs::read(source).unwrap()).unwrap();
    json["images"][0]["uri"] = "floor.png".into();
    let scene = folder.join("scene.gltf");
    std::fs::write(&scene, json.to_string()).unwrap();
    (scene, json)
}

#[test]
fn a_saved_texture_or_scene_is_the_new_picture_in_the_viewer() {
    let folder = tempfile::tempdir().unwrap();
    let texture = folder.path().join("floor.png");
    let (scene, mut json) = scene_of_files(folder.path());
    paint(&texture, [255; 3]);
    let (address, seen) = viewer();
    let watch = Watch::of(&scene, &["--spp", "16", "--tev", &address]);
    let [red, _, blue] = expect(&seen, "a picture", |mean| mean[0] > 0.0);

    paint(&texture, [255, 0, 0]);
    watch.expect(&["floor.png:", "1 of 2 images decoded", "tree kept", "kernel kept", "first image"]);
    let [floor_red, ..] = expect(&seen, "a red floor", |mean| mean[0] / mean[2] > 1.2 * red / blue);

    std::fs::write(&scene, "{").unwrap();
    watch.expect(&["cannot be shown", "scene.gltf"]);
    json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = serde_json::json!([0, 0, 0, 1]);
    std::fs::write(&scene, json.to_string()).unwrap();
    watch.expect(&["scene.gltf:", "image kept", "tree kept", "first image"]);
    expect(&seen, "a black floor", |mean| mean[0] < 0.9 * floor_red);
}

#[test]
fn a_saved_environment_is_the_new_picture_in_the_viewer() {
    let folder = tempfile::tempdir().unwrap();
    let sky = folder.path().join("sky.png");
    paint(&sky, [128; 3]);
    let (address, seen) = viewer();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/furnace_sphere_lambertian.gltf");
    let watch = Watch::of(&scene, &["--spp", "16", "--env", sky.to_str().unwrap(), "--tev", &address]);
    let [red, _, blue] = expect(&seen, "a picture", |mean| mean[0] > 0.0);

    paint(&sky, [0, 0, 255]);
    watch.expect(&["sky.png:", "first image"]);
    expect(&seen, "a blue sky", |mean| mean[2] > blue && mean[0] < 0.5 * red);
}

#[test]
fn a_reload_that_another_one_overtakes_has_its_line_too() {
    let folder = tempfile::tempdir().unwrap();
    let texture = folder.path().join("floor.png");
    let (scene, _) = scene_of_files(folder.path());
    paint(&texture, [255; 3]);
    // So many pixels that none comes to 64 samples between two saves.
    let watch = Watch::of(&scene, &["--resolution", "1024x1024", "--spp", "64"]);
    watch.expect(&[" on "]);
    for red in 0..3 {
        std::thread::sleep(Duration::from_millis(600));
        paint(&texture, [red, 0, 0]);
    }
    watch.expect(&["start:", "superseded"]);
    // The last one would come to 64 samples, but not before minutes where rays are slow.
    for _ in 0..2 {
        watch.expect(&["floor.png:", "superseded"]);
    }
}
