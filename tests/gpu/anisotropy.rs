//! Anisotropic roughness from the scene to the pixel: in which direction a surface is rough, by its rotation, its texture
//! and its tangents, against the model in f64.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::common::bsdf::{Configuration, MetallicRoughness};
use crate::common::builder::{camera, rectangle, scene};
use crate::common::gpu;
use glam::DVec3;
use sunfleck::layout::BSDF_METALLIC_ROUGHNESS;
use sunfleck::scene::{
    Filter, Image, Material, Projection, PunctualKind, PunctualLight, Scene, Texels, Texture, TextureBinding,
    TextureTransform, Wrap,
};

const ROUGHNESS: f32 = 0.5;
const IRRADIANCE: f64 = 3.0;
/// From the plane to the camera and to the sun.
const EYE: DVec3 = DVec3::new(0.3, 1.0, 0.5);
const SUN: DVec3 = DVec3::new(-0.2, 0.7, 0.4);

/// A metal plane y = 0 under a sun, seen as in a parallel projection; its tangent is +X and its bitangent −Z, turned by
/// `turn` radians from one to the other by its texture coordinates.
fn plane(material: Material, turn: f64) -> Scene {
    let mut plane = rectangle(DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 0);
    let (s, c) = turn.sin_cos();
    let along = |position: &[f32; 3]| {
        let (right, up) = (f64::from(position[0]), -f64::from(position[2]));
        [(right * c + up * s) as f32, (right * s - up * c) as f32]
    };
    plane.texcoords = Some(plane.positions.iter().map(along).collect());
    plane.generate_tangents(0, &TextureTransform::IDENTITY);
    let mut view = camera(EYE * 2.0, DVec3::ZERO, 1.0);
    view.projection = Projection::Orthographic { ymag: 0.2 };
    let mut scene = scene(vec![plane], vec![material], view);
    scene.lights.push(PunctualLight {
        name: String::from("sun"),
        kind: PunctualKind::Directional,
        intensity: [IRRADIANCE as f32; 3],
        position: DVec3::ZERO,
        direction: -SUN.normalize(),
    });
    scene
}

fn metal(strength: f32, rotation_radians: f64) -> Material {
    Material {
        roughness: ROUGHNESS,
        anisotropy: strength,
        anisotropy_rotation_radians: rotation_radians as f32,
        ..Material::default()
    }
}

/// The plane with an anisotropy texture of one texel.
fn textured(strength: f32, rotation_radians: f64, texel: [u16; 3]) -> Scene {
    let mut scene = plane(metal(strength, rotation_radians), 0.0);
    let texels = Texels::Rgba16(vec![[texel[0], texel[1], texel[2], 65535]]);
    scene.images.push(Image { name: String::from("direction"), width: 1, height: 1, texels }.into());
    let wrap = Wrap::Repeat;
    scene.textures.push(Texture { image: 0, wrap_u: wrap, wrap_v: wrap, filter: Filter::Linear });
    scene.materials[0].anisotropy_texture = Some(TextureBinding::new(0));
    scene
}

/// A texel whose direction is at an angle from the tangent, and the angle and strength that it stands for once rounded.
fn texel(angle: f64, strength: f64) -> ([u16; 3], f64, f64) {
    let code = |x: f64| (x * 65535.0).round() as u16;
    let texel = [code(0.5 + 0.5 * angle.cos()), code(0.5 + 0.5 * angle.sin()), code(strength)];
    let [x, y, strength] = texel.map(|c| f64::from(c) / 65535.0);
    (texel, (2.0 * y - 1.0).atan2(2.0 * x - 1.0), strength)
}

/// The radiance of every pixel; they see the same.
fn radiance(scene: &Scene) -> f64 {
    scene.validate().expect("a valid scene");
    let film = gpu::run(&mut gpu::path_tracer(scene, &gpu::settings(4, 4)), 1, 2).film;
    let pixels: Vec<f64> = film.radiance().iter().map(|pixel| f64::from(pixel[0])).collect();
    assert!(pixels.iter().all(|p| (p - pixels[0]).abs() < 1e-5 * pixels[0]), "{pixels:?}");
    pixels[0]
}

/// What the model gives if the surface is rougher along the direction at `angle` from +X towards −Z.
fn expected(angle: f64, strength: f64) -> f64 {
    let along = DVec3::new(angle.cos(), 0.0, -angle.sin());
    let across = DVec3::new(-angle.sin(), 0.0, -angle.cos());
    let local = |w: DVec3| DVec3::new(w.dot(along), w.y, w.dot(across));
    let (wo, wi) = (local(EYE.normalize()), local(SUN.normalize()));
    let smaller = f64::from(ROUGHNESS * ROUGHNESS);
    let larger = smaller + (1.0 - smaller) * strength * strength;
    let c = Configuration {
        alpha: (smaller * larger).sqrt() as f32,
        stretch: (larger / smaller).sqrt() as f32,
        metallic: 1.0,
        ..Configuration::new(BSDF_METALLIC_ROUGHNESS, [1.0; 3], wo)
    };
    MetallicRoughness::new(&c, wo).evaluate(wo, wi).x * wi.y * IRRADIANCE
}

fn assert_close(value: f64, expected: f64, what: &str) {
    println!("{what}: {value:.6}, expected {expected:.6}");
    assert!((value - expected).abs() < 2e-5 * expected, "{what}: {value} instead of {expected}");
}

#[test]
fn rotation_turns_the_rough_direction() {
    let mut values = Vec::new();
    for eighth in 0..8 {
        let angle = TAU * f64::from(eighth) / 8.0 + 0.1;
        values.push(radiance(&plane(metal(0.8, angle), 0.0)));
        assert_close(values[eighth as usize], expected(angle, f64::from(0.8_f32)), &format!("rotated by {angle:.3}"));
    }
    // The test could tell: directions differ, but for half a turn.
    for (i, value) in values.iter().enumerate() {
        assert!((value - values[(i + 4) % 8]).abs() < 1e-5 * value, "{values:?}");
        assert!((1..4).all(|k| (value / values[(i + k) % 8] - 1.0).abs() > 0.02), "{values:?}");
    }
}

#[test]
fn tangents_turn_the_rough_direction() {
    for (turn, rotation) in [(0.0, 0.0), (0.7, 0.0), (FRAC_PI_2, 0.0), (-1.2, 0.0), (0.7, -0.7), (1.0, 0.5)] {
        let value = radiance(&plane(metal(1.0, rotation), turn));
        assert_close(value, expected(turn + rotation, 1.0), &format!("turned by {turn}, rotated by {rotation}"));
    }
}

#[test]
fn the_texture_gives_direction_and_strength() {
    for (direction, rotation, strength) in
        [(0.0, 0.0, 1.0), (FRAC_PI_2, 0.0, 1.0), (0.6, 0.0, 0.5), (-2.0, 0.0, 0.8), (0.6, 0.9, 1.0), (PI, -0.3, 0.7)]
    {
        let (texel, angle, share) = texel(direction, strength);
        let value = radiance(&textured(0.9, rotation, texel));
        let expected = expected(angle + rotation, f64::from(0.9_f32) * share);
        assert_close(value, expected, &format!("texture {direction}, rotated by {rotation}, strength {strength}"));
    }
    // A right angle by the texture is one by the rotation.
    let quarter = radiance(&plane(metal(1.0, FRAC_PI_2), 0.0));
    assert_close(radiance(&textured(1.0, 0.0, texel(FRAC_PI_2, 1.0).0)), quarter, "a quarter by the texture");
}

/// A back is the same surface: it is rough along the same line.
#[test]
fn the_back_is_rough_along_the_same_direction() {
    let mut below = plane(metal(0.8, 0.5), 0.0);
    let mirror = |v: DVec3| DVec3::new(v.x, -v.y, v.z);
    below.cameras[0] = camera(mirror(EYE) * 2.0, DVec3::ZERO, 1.0);
    below.cameras[0].projection = Projection::Orthographic { ymag: 0.2 };
    below.lights[0].direction = mirror(below.lights[0].direction);
    assert_close(radiance(&below), expected(0.5, f64::from(0.8_f32)), "from below");
}

/// Without strength nothing of it is in the kernel, and the picture is that of a surface that knows nothing of it.
#[test]
fn no_strength_changes_nothing() {
    let images = [metal(0.0, 0.5), metal(0.0, 0.0)].map(|material| {
        let scene = plane(material, 0.3);
        let (prepared, _) = gpu::prepared(&scene, &gpu::settings(4, 4));
        assert!(!prepared.features.anisotropy);
        gpu::run(&mut gpu::path_tracer(&scene, &gpu::settings(4, 4)), 1, 2).film.radiance()
    });
    assert_eq!(images[0], images[1]);
    // Strength without tangents: the highlight is round.
    let mut bare = plane(metal(1.0, 0.5), 0.0);
    bare.meshes[0].primitives[0].tangents = None;
    let (prepared, _) = gpu::prepared(&bare, &gpu::settings(4, 4));
    assert!(!prepared.features.anisotropy);
    assert_close(radiance(&bare), expected(0.0, 0.0), "without tangents");
}
