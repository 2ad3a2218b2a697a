//! Valid OBJ and MTL: what is read, and what is warned of.

use crate::scene_support::{Folder, png};
use sunfleck::scene::load::load_scene;
use sunfleck::scene::{Bsdf, Scene, Wrap};

fn load(files: &[(&str, &str)]) -> Scene {
    let folder = Folder::new();
    let paths: Vec<_> = files.iter().map(|(name, text)| folder.write(name, text)).collect();
    folder.write("a texture.png", png(2, 2, [255; 4]));
    let scene = load_scene(&paths[0]).unwrap_or_else(|error| panic!("{error}"));
    scene.validate().expect("a scene that loads is valid");
    scene
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn triangles(scene: &Scene) -> usize {
    scene.meshes.iter().flat_map(|mesh| &mesh.primitives).map(|primitive| primitive.triangles.len()).sum()
}

#[test]
fn faces_of_every_form() {
    for face in [
        "f 1 2 3 4",
        "f -4 -3 -2 -1",
        "f 1 2 \\\n3 4",
        "f 1/1 2/1 3/1 4/1",
        "f 1//1 2//1 3//1 4//1",
        "f 1/1/1 2/1/1 3/1/1 4/1/1 # square",
    ] {
        let scene = load(&[("a.obj", &format!("{SQUARE}vt 0.25 0.25\nvn 0 0 2\n{face}\n"))]);
        assert_eq!(triangles(&scene), 2, "{face}");
        let primitive = &scene.meshes[0].primitives[0];
        assert_eq!(primitive.positions.len(), 4);
        assert_eq!(primitive.normals.is_some(), face.contains("/1/1") || face.contains("//"), "{face}");
        assert!(primitive.normals.iter().flatten().all(|normal| *normal == [0.0, 0.0, 1.0]));
        assert!(primitive.texcoords.iter().flatten().all(|texcoord| *texcoord == [0.25, 0.75]));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
}

#[test]
fn utf_16_and_windows_lines() {
    let folder = Folder::new();
    let text = format!("{SQUARE}f 1 2 3\n").replace('\n', "\r\n");
    let big: Vec<u8> = [0xfe, 0xff].into_iter().chain(text.encode_utf16().flat_map(u16::to_be_bytes)).collect();
    let little: Vec<u8> = [0xff, 0xfe].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    for bytes in [text.into_bytes(), big, little] {
        let scene = load_scene(&folder.write("a.obj", bytes)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(triangles(&scene), 1);
    }
}

#[test]
fn faces_with_and_without_normals_are_kept_apart() {
    let scene = load(&[("a.obj", &format!("{SQUARE}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n"))]);
    let [smooth, flat] = &scene.meshes[0].primitives[..] else { panic!("two primitives") };
    assert!(smooth.normals.is_some() && flat.normals.is_none());
}

#[test]
fn materials() {
    let mtl = "
newmtl wall
Kd 0.1 0.2 0.3
illum 2
newmtl lamp
Kd 0 0 0
Ke 3 2 1
newmtl mirror
Ks 0.9 0.8 0.7
illum 3
newmtl glass
Ni 1.33
Tf 1 1 1
illum 7
newmtl glass of dissolve
d 0.5
illum 4
newmtl water
Ni 1.2
illum 6
newmtl opaque
Kd 1 1 1
Ni 1
illum 4
newmtl textured
map_Kd -clamp on a texture.png
newmtl never used
map_Kd gone.png
";
    let names = ["wall", "lamp", "mirror", "glass", "glass of dissolve", "water", "opaque", "textured", "unknown"];
    let faces: String = names.iter().map(|name| format!("usemtl {name}\nf 1/1 2/1 3/1\n")).collect();
    let obj = format!("mtllib the library.mtl\n{SQUARE}vt 0 0\n{faces}");
    let scene = load(&[("a.obj", &obj), ("the library.mtl", mtl)]);
    let bsdfs: Vec<Bsdf> = scene.materials.iter().map(|material| material.bsdf).collect();
    use Bsdf::{Glass, Lambertian, Mirror, Refract};
    assert_eq!(bsdfs, [Lambertian, Lambertian, Mirror, Glass, Glass, Refract, Lambertian, Lambertian, Lambertian]);
    assert_eq!(scene.materials[0].base_color, [0.1, 0.2, 0.3]);
    assert_eq!(scene.materials[1].emission, [3.0, 2.0, 1.0]);
    assert_eq!(scene.materials[2].base_color, [0.9, 0.8, 0.7]);
    assert_eq!((scene.materials[3].ior, scene.materials[4].ior, scene.materials[5].ior), (1.33, 1.5, 1.2));
    assert_eq!((scene.images.len(), scene.textures[0].wrap_u), (1, Wrap::ClampToEdge));
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("\"unknown\""));
}

#[test]
fn what_is_not_covered_is_said_once() {
    let mtl = "newmtl a\nKs 1 1 1\nillum 2\nbump b.png\nd 0.5\nnewmtl b\nKs 1 1 1\nillum 2\nbump b.png\n";
    let obj = format!("mtllib m.mtl\nmtllib gone.mtl\n{SQUARE}p 1\np 2\nl 1 2\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n");
    let scene = load(&[("a.obj", &obj), ("m.mtl", mtl)]);
    for subject in ["glossy", "bump", "opacity", "points and lines", "gone.mtl"] {
        let count = scene.warnings.iter().filter(|warning| warning.contains(subject)).count();
        assert_eq!(count, 1, "{subject}: {:?}", scene.warnings);
    }
    assert_eq!(scene.warnings.len(), 5, "{:?}", scene.warnings);
}
