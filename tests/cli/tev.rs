//! `render --tev`: a listener that takes the packets as tev does, and what happens without one.

use std::io::{ErrorKind, Read};
use std::net::TcpListener;
use std::path::Path;
use std::thread;

use assert_cmd::Command;
use sunfleck::film::exr::{ChannelValues, read_exr};

fn render(folder: &Path, resolution: &str, arguments: &[&str]) -> (i32, String) {
    let output = Command::new(assert_cmd::cargo::cargo_bin!("sunfleck"))
        .current_dir(folder)
        .args(["render", "cornell", "--resolution", resolution, "--spp", "4", "-o", "a.exr"])
        .args(arguments)
        .output()
        .unwrap();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}

/// Reads packets: their length, which counts itself, and the rest.
fn packets(listener: TcpListener) -> Vec<Vec<u8>> {
    let (mut stream, _) = listener.accept().unwrap();
    let mut packets = Vec::new();
    loop {
        let mut length = [0; 4];
        match stream.read_exact(&mut length) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return packets,
            result => result.unwrap(),
        }
        let mut rest = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut rest).unwrap();
        packets.push(rest);
    }
}

#[test]
fn the_viewer_gets_the_image_and_its_aovs() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let reader = thread::spawn(move || packets(listener));
    let (code, stderr) = render(folder.path(), "24x16", &["--aov", "depth", "--tev", &address]);
    assert_eq!(code, 0, "{stderr}");
    let packets = reader.join().unwrap();
    const CREATE: u8 = 4;
    const UPDATE: u8 = 6;
    assert_eq!(packets[0][0], CREATE, "an image is made first");
    assert!(packets.len() >= 2 && packets[1..].iter().all(|packet| packet[0] == UPDATE));
    let image = read_exr(&folder.path().join("a.exr")).unwrap();
    let names = ["R", "G", "B", "depth.Z"];
    for name in names {
        let text = [name.as_bytes(), &[0]].concat();
        assert!(packets[0].windows(text.len()).any(|window| window == text), "{name}");
    }
    // The last picture is what the file has, channel after channel, at the packet's end.
    let floats: Vec<f32> = image
        .channels
        .iter()
        .filter_map(|channel| match &channel.values {
            ChannelValues::F32(values) => Some(values.clone()),
            ChannelValues::U32(_) => None,
        })
        .flatten()
        .collect();
    let last = packets.last().unwrap();
    let sent: Vec<f32> = last[last.len() - 4 * floats.len()..]
        .chunks_exact(4)
        .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
        .collect();
    let sorted = |mut values: Vec<f32>| {
        values.sort_by(f32::total_cmp);
        values
    };
    assert_eq!(sorted(sent), sorted(floats), "in whatever order the file keeps its channels");
}

#[test]
fn without_a_viewer_nothing_is_rendered_and_one_that_goes_away_stops_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let gone = thread::spawn(move || drop(listener.accept().unwrap()));
    let (code, stderr) = render(folder.path(), "512x512", &["--tev", &address]);
    gone.join().unwrap();
    assert_eq!(code, 0, "{stderr}");
    assert!(folder.path().join("a.exr").exists());

    std::fs::remove_file(folder.path().join("a.exr")).unwrap();
    let (code, stderr) = render(folder.path(), "24x16", &["--tev", &address]);
    assert_eq!(code, 3, "{stderr}");
    assert!(stderr.contains("tev") && stderr.contains(&address), "{stderr}");
    assert!(!folder.path().join("a.exr").exists());
}
