//! Which files a scene is made of: the scene file and those that it names.

use std::path::{Path, PathBuf};

use serde_json::Value;

/// The scene file and the buffers, images, environments and material libraries that it names. What cannot be read names
/// nothing: the loader says what is wrong with it.
pub fn files_of(scene: &Path) -> Vec<PathBuf> {
    let folder = scene.parent().unwrap_or(Path::new(""));
    let mut files = vec![scene.to_owned()];
    let extension = scene.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "gltf" => files.extend(std::fs::read(scene).iter().flat_map(|bytes| gltf_uris(bytes, folder))),
        "glb" => files.extend(std::fs::read(scene).iter().flat_map(|bytes| gltf_uris(glb_json(bytes), folder))),
        "obj" => {
            for library in named_in(scene, &["mtllib"]) {
                let library = folder.join(library);
                let maps = named_in(&library, &["map_", "norm", "bump", "disp"]);
                let beside = library.parent().unwrap_or(folder).to_owned();
                files.extend(maps.iter().map(|map| beside.join(map)));
                files.push(library);
            }
        }
        _ => {}
    }
    files
}

fn gltf_uris(json: &[u8], folder: &Path) -> Vec<PathBuf> {
    let Ok(root) = serde_json::from_slice::<Value>(json) else { return Vec::new() };
    let entries = ["buffers", "images"].iter().filter_map(|list| root[list].as_array()).flatten();
    let scenes = root["scenes"].as_array().into_iter().flatten();
    let skies = scenes.filter_map(|scene| scene.pointer("/extras/sunfleck/environment/file")?.as_str());
    let uris = entries.filter_map(|entry| entry["uri"].as_str()).chain(skies).filter(|uri| !uri.starts_with("data:"));
    uris.map(|uri| folder.join(&*percent_encoding::percent_decode_str(uri).decode_utf8_lossy())).collect()
}

/// The first chunk of a .glb, after a header of 12 bytes and its own of 8.
fn glb_json(bytes: &[u8]) -> &[u8] {
    let length = bytes.get(12..16).map_or(0, |l| u32::from_le_bytes([l[0], l[1], l[2], l[3]]) as usize);
    bytes.get(20..20 + length).unwrap_or_default()
}

/// The last word of the lines that begin with one of `keywords`.
fn named_in(file: &Path, keywords: &[&str]) -> Vec<String> {
    let Ok(text) = std::fs::read(file) else { return Vec::new() };
    let text = String::from_utf8_lossy(&text);
    let lines = text.lines().map(str::trim).filter(|line| keywords.iter().any(|word| line.starts_with(word)));
    lines.filter_map(|line| line.split_whitespace().skip(1).last()).map(|name| name.replace('\\', "/")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_its_file_and_what_that_names() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let gltf = r#"{"buffers":[{"uri":"a%20b.bin"},{"uri":"data:x"}],"images":[{"uri":"t/c.png"},{"bufferView":0}],
                "scenes":[{},{"extras":{"sunfleck":{"environment":{"file":"sky.exr"}}}}]}"#;
        write("s.gltf", gltf);
        write("s.obj", "v 0 0 0\nmtllib s.mtl\n");
        write("s.mtl", "newmtl a\nmap_Kd -s 1 1 1 d.png\nnorm n.png\n");
        let mut glb = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        glb.extend((gltf.len() as u32).to_le_bytes());
        glb.extend(b"JSON");
        glb.extend(gltf.as_bytes());
        std::fs::write(folder.path().join("s.glb"), glb).unwrap();
        for (scene, expected) in [
            ("s.gltf", &["s.gltf", "a b.bin", "t/c.png", "sky.exr"] as &[&str]),
            ("s.glb", &["s.glb", "a b.bin", "t/c.png", "sky.exr"]),
            ("s.obj", &["s.obj", "d.png", "n.png", "s.mtl"]),
            ("none.gltf", &["none.gltf"]),
        ] {
            let files = files_of(&folder.path().join(scene));
            assert_eq!(files, expected.iter().map(|name| folder.path().join(name)).collect::<Vec<_>>());
        }
    }
}
