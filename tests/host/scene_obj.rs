//! Valid OBJ and MTL: what is read, and what is warned of.

use crate::scene_support::{Folder, png};
use sunfleck::scene::load::load_scene;
use sunfleck::scene::{AlphaMode, Bsdf, Material, Scene, Texels, Wrap};

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
    let mtl = "newmtl a\nPs 0.5\nbump b.png\nPr 1.5\nnewmtl b\nPs 0.1\nPc 0\nbump b.png\n";
    let obj = format!("mtllib m.mtl\nmtllib gone.mtl\n{SQUARE}p 1\np 2\nl 1 2\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n");
    let scene = load(&[("a.obj", &obj), ("m.mtl", mtl)]);
    for subject in ["sheen", "bump", "outside of [0, 1]", "points and lines", "gone.mtl"] {
        let count = scene.warnings.iter().filter(|warning| warning.contains(subject)).count();
        assert_eq!(count, 1, "{subject}: {:?}", scene.warnings);
    }
    assert_eq!(scene.warnings.len(), 5, "{:?}", scene.warnings);
}

/// The materials of a library by their order, and the scene.
fn library(mtl: &str, images: &[(&str, Vec<u8>)]) -> Scene {
    let folder = Folder::new();
    for (name, bytes) in images {
        folder.write(name, bytes);
    }
    let names = mtl.lines().filter_map(|line| line.strip_prefix("newmtl "));
    let faces: String = names.map(|name| format!("usemtl {name}\nf 1/1 2/1 3/1\n")).collect();
    folder.write("m.mtl", mtl);
    let obj = folder.write("a.obj", format!("mtllib m.mtl\n{SQUARE}vt 0 0\n{faces}"));
    let scene = load_scene(&obj).unwrap_or_else(|error| panic!("{error}"));
    scene.validate().expect("a scene that loads is valid");
    scene
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() < 1e-6
}

#[test]
fn the_pbr_extension() {
    let scene = library(
        "newmtl all\nKd 0.1 0.2 0.3\nPr 0.4\nPm 0.6\naniso 0.7\nanisor 0.25\nNi 1.4\nKs 1 1 1\nillum 3\n\
         newmtl defaults\nPm 0\n\
         newmtl exponent\nPm 1\nNs 30\n\
         newmtl sheet\nPr 0\nd 0.25\nTf 0.5 0.75 0.1\nillum 2\n\
         newmtl pane\nPr 0\nTf 0.5 0.75 0.1\nillum 7\n",
        &[],
    );
    let warned = |beginning: &str| scene.warnings.len() == 1 && scene.warnings[0].starts_with(beginning);
    assert!(warned("anisotropy on meshes without tangents"), "{:?}", scene.warnings);
    assert!(scene.materials.iter().all(|m| m.bsdf == Bsdf::MetallicRoughness));
    let [all, defaults, exponent, sheet, pane] = &scene.materials[..] else { panic!("five materials") };
    assert_eq!((all.base_color, all.roughness, all.metallic, all.ior), ([0.1, 0.2, 0.3], 0.4, 0.6, 1.4));
    assert_eq!(all.anisotropy, 0.7);
    assert!(close(all.anisotropy_rotation_radians, std::f32::consts::FRAC_PI_2));
    assert_eq!((defaults.base_color, defaults.roughness, defaults.metallic), ([0.8; 3], 1.0, 0.0));
    assert!(close(exponent.roughness, (2.0_f32 / 32.0).sqrt().sqrt()));
    assert_eq!((sheet.alpha_mode, sheet.alpha, sheet.transmission), (AlphaMode::Blend, 0.25, 0.0));
    assert_eq!((pane.alpha_mode, pane.transmission), (AlphaMode::Opaque, 0.75));
}

#[test]
fn classic_highlights() {
    let scene = library(
        "newmtl plastic\nKd 0.5 0.1 0.1\nKs 0.5 0.25 1\nNs 30\nNi 1.2\nillum 2\n\
         newmtl no model\nKd 0.5 0.1 0.1\nKs 0.5 0.5 0.5\nNs -1.960784\n\
         newmtl metal\nKd 0 0 0\nKs 0.9 0.7 0.3\nNs 1000\nillum 2\n\
         newmtl without highlights\nKd 0.5 0.1 0.1\nKs 0.5 0.5 0.5\nillum 1\n\
         newmtl bright\nKd 0.5 0.1 0.1\nKs 9 0 0\n\
         newmtl faded\nKd 0.5 0.1 0.1\nTr 0.25\n",
        &[],
    );
    let [plastic, no_model, metal, diffuse, bright, faded] = &scene.materials[..] else { panic!("six materials") };
    // 0.08·Ks at normal incidence, over the 0.04 of an index of 1.5.
    assert_eq!((plastic.bsdf, plastic.metallic, plastic.ior), (Bsdf::MetallicRoughness, 0.0, 1.5));
    assert!(plastic.specular_color.iter().zip([1.0, 0.5, 2.0]).all(|(&a, b)| close(a, b)), "{plastic:?}");
    assert!(close(plastic.roughness, 0.5));
    assert_eq!((no_model.bsdf, no_model.roughness), (Bsdf::MetallicRoughness, 1.0));
    assert_eq!((metal.bsdf, metal.metallic, metal.base_color), (Bsdf::MetallicRoughness, 1.0, [0.9, 0.7, 0.3]));
    assert!(metal.roughness < 0.25);
    assert_eq!(diffuse.bsdf, Bsdf::Lambertian);
    assert_eq!(bright.specular_color, [2.0, 0.0, 0.0]);
    assert_eq!((faded.bsdf, faded.alpha_mode, faded.alpha), (Bsdf::Lambertian, AlphaMode::Blend, 0.75));
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
}

/// The image that a material's texture shows.
fn texels(scene: &Scene, binding: Option<sunfleck::scene::TextureBinding>) -> (u32, u32, Vec<[u8; 4]>) {
    let image = &scene.images[scene.textures[binding.expect("a texture").texture].image];
    match &image.texels {
        Texels::Rgba8(texels) => (image.width, image.height, texels.clone()),
        Texels::Rgba16(texels) => panic!("{} texels of 16 bits", texels.len()),
    }
}

#[test]
fn maps_of_several_files_become_one_image() {
    let images = [
        ("color.png", png(2, 1, [10, 20, 30, 255])),
        ("matte.png", png(2, 1, [40, 40, 40, 255])),
        ("cut.png", png(4, 2, [0, 0, 0, 50])),
        ("rough.png", png(2, 2, [60, 0, 0, 255])),
        ("metal.png", png(1, 1, [70, 0, 0, 255])),
        ("normal.png", png(1, 1, [128, 128, 255, 255])),
    ];
    let scene = library(
        "newmtl matte\nmap_Kd color.png\nmap_d matte.png\n\
         newmtl cut\nKd 0.5 0.5 0.5\nmap_d cut.png\nd 0.5\n\
         newmtl larger alpha\nmap_Kd color.png\nmap_d cut.png\n\
         newmtl both\nmap_Pr rough.png\nmap_Pm metal.png\nPm 0.5\nnorm -bm 2 normal.png\n\
         newmtl rough\nmap_Pr -clamp on rough.png\n\
         newmtl same\nmap_Pr rough.png\nmap_Pm metal.png\n\
         newmtl colour\nmap_Kd color.png\n",
        &images,
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let [matte, cut, larger, both, rough, same, colour] = &scene.materials[..] else { panic!("seven materials") };
    let base = |m: &Material| texels(&scene, m.base_color_texture);
    assert_eq!(base(matte), (2, 1, vec![[10, 20, 30, 40]; 2]));
    assert_eq!((matte.alpha_mode, matte.alpha, matte.base_color), (AlphaMode::Blend, 1.0, [1.0; 3]));
    assert_eq!(base(cut), (4, 2, vec![[255, 255, 255, 50]; 8]));
    assert_eq!((cut.alpha, cut.base_color), (0.5, [0.5; 3]));
    assert_eq!(base(larger), (4, 2, vec![[10, 20, 30, 50]; 8]));
    let packed = |m: &Material| texels(&scene, m.metallic_roughness_texture);
    assert_eq!(packed(both), (2, 2, vec![[255, 60, 70, 255]; 4]));
    assert_eq!((both.roughness, both.metallic, both.normal_scale), (1.0, 0.5, 2.0));
    assert_eq!(texels(&scene, both.normal_texture), (1, 1, vec![[128, 128, 255, 255]]));
    assert_eq!(packed(rough), (2, 2, vec![[255, 60, 255, 255]; 4]));
    assert_eq!((rough.roughness, rough.metallic), (1.0, 0.0));
    let wrap = |m: &Material| scene.textures[m.metallic_roughness_texture.expect("a texture").texture].wrap_u;
    assert_eq!((wrap(rough), wrap(both)), (Wrap::ClampToEdge, Wrap::Repeat));
    // What is made once is used again.
    assert_eq!(same.metallic_roughness_texture, both.metallic_roughness_texture);
    assert_eq!((base(colour), colour.alpha_mode), ((2, 1, vec![[10, 20, 30, 255]; 2]), AlphaMode::Opaque));
}

/// Blender writes normals as `map_Bump`; heights are grey.
#[test]
fn a_bump_map_of_normals_is_one() {
    let images = [
        ("normals.png", png(2, 2, [120, 135, 240, 255])),
        ("heights.png", png(2, 2, [200, 200, 200, 255])),
        ("norm.png", png(1, 1, [128, 128, 255, 255])),
    ];
    let scene = library(
        "newmtl normals\nmap_Bump -bm 0.5 normals.png\n\
         newmtl heights\nbump heights.png\n\
         newmtl other heights\nPr 1\nmap_bump heights.png\n\
         newmtl both\nmap_Bump gone.png\nnorm norm.png\n",
        &images,
    );
    let [normals, heights, other, both] = &scene.materials[..] else { panic!("four materials") };
    assert_eq!((texels(&scene, normals.normal_texture).2[0], normals.normal_scale), ([120, 135, 240, 255], 0.5));
    assert!(heights.normal_texture.is_none() && other.normal_texture.is_none());
    assert_eq!((texels(&scene, both.normal_texture).0, both.normal_scale), (1, 1.0));
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("heights") && scene.warnings[0].contains("2 times"), "{:?}", scene.warnings);
}

/// An enlarged map keeps its texels where they were.
#[test]
fn maps_of_different_sizes_are_aligned() {
    let mut small = vec![0; 3 * 12];
    small[9 * 3..].fill(200);
    let encode = |width: u32, height: u32, bytes: &[u8]| {
        let mut out = std::io::Cursor::new(Vec::new());
        let buffer = image::RgbImage::from_raw(width, height, bytes.to_vec()).expect("enough bytes");
        buffer.write_to(&mut out, image::ImageFormat::Png).expect("it encodes");
        out.into_inner()
    };
    // 4 × 3 texels whose last row but for its first texel is 200, beside 8 × 6.
    let files = [("small.png", encode(4, 3, &small)), ("large.png", encode(8, 6, &[90; 144]))];
    let scene = library("newmtl a\nmap_Pr large.png\nmap_Pm small.png\n", &files);
    let (width, height, all) = texels(&scene, scene.materials[0].metallic_roughness_texture);
    assert_eq!((width, height), (8, 6));
    for (i, texel) in all.iter().enumerate() {
        let (x, y) = (i % 8, i / 8);
        let expected = if y >= 4 && x >= 2 { 200 } else { 0 };
        assert_eq!((texel[1], texel[2]), (90, expected), "at {x}, {y}");
    }
}
