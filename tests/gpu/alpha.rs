//! Alpha: what a ray meets of a surface that is only partly there is what optics says, for path rays and shadow rays.

use std::f64::consts::PI;

use crate::common::builder::{camera, mean, rectangle, scene};
use crate::common::gpu;
use crate::common::irradiance::polygon_irradiance;
use crate::common::scenes::short_form;
use crate::common::statistics::{Estimate, sidak};
use glam::{DAffine3, DVec3};
use sunfleck::render::{LightSampling, Settings};
use sunfleck::scene::{
    AlphaMode, Bsdf, Environment, Filter, Image, Instance, Material, Primitive, PunctualKind, PunctualLight, Scene,
    Texels, Texture, TextureBinding, Wrap,
};

/// Level of each test here.
const LEVEL: f64 = 0.01;
/// The sheet's colour and the background.
const SHEET: [f32; 3] = [0.8, 0.3, 0.1];
const BACKGROUND: [f32; 3] = [0.1, 0.5, 2.0];

/// A surface that shows its colour and scatters nothing.
fn sheet(color: [f32; 3], alpha: f32) -> Material {
    Material { bsdf: Bsdf::Unlit, base_color: color, alpha, alpha_mode: AlphaMode::Blend, ..Material::default() }
}

fn floor(albedo: f32) -> Material {
    Material::lambertian("floor", [albedo; 3])
}

/// A square of half width `half` about the y axis, its front upwards.
fn square(y: f64, half: f64, material: usize) -> Primitive {
    rectangle(DVec3::new(-half, y, half), 2.0 * half * DVec3::X, -2.0 * half * DVec3::Z, material)
}

fn settings(max_bounces: u32) -> Settings {
    Settings { max_bounces: Some(max_bounces), ..gpu::settings(32, 32) }
}

fn image_mean(scene: &Scene, settings: &Settings) -> [Estimate; 3] {
    mean(scene, settings, 16, if short_form() { 8 } else { 16 })
}

fn p_value(estimate: &Estimate, exact: f64) -> f64 {
    estimate.welch(&Estimate::exact(exact))
}

/// The mean is `exact`, and it is known well enough to tell `wrong` from it.
fn assert_is(what: &str, estimate: &Estimate, exact: f64, wrong: f64, tests: usize) {
    let mean = estimate.mean;
    println!("{what}: {mean:.5} ± {:.1e}, exact {exact:.5}", estimate.standard_error());
    assert!(p_value(estimate, exact) > sidak(LEVEL, tests), "{what}: {estimate:?} instead of {exact}");
    assert!(p_value(estimate, wrong) < LEVEL, "{what}: {wrong} instead of {exact} is noticed: {estimate:?}");
}

/// Sheets below each other, baked or as instances of one mesh.
fn stack(layers: u32, alpha: f32, instanced: bool) -> Scene {
    let view = camera(DVec3::new(0.1, 3.0, 0.2), DVec3::new(0.0, 0.0, 0.0), 0.5);
    let heights = (0..layers).map(|i| -0.5 * f64::from(i));
    let mut scene = if instanced {
        let mut scene = scene(vec![square(0.0, 4.0, 0)], vec![], view);
        let place = |y| Instance {
            mesh: 0,
            object_to_world: DAffine3::from_translation(DVec3::new(0.0, y, 0.0)),
            name: String::from("sheet"),
        };
        scene.instances = heights.map(place).collect();
        scene
    } else {
        scene(heights.map(|y| square(y, 4.0, 0)).collect(), vec![], view)
    };
    scene.materials = vec![sheet(SHEET, alpha)];
    scene.environment = Environment::Constant(BACKGROUND);
    scene
}

/// What is seen where sheets let this share of the background through.
fn mix(channel: usize, through: f64) -> f64 {
    f64::from(SHEET[channel]) * (1.0 - through) + f64::from(BACKGROUND[channel]) * through
}

/// n sheets of alpha a let (1 − a)ⁿ of the background through, whichever of them the ray meets first.
#[test]
fn sheets_mix_with_the_background() {
    let cases = [(1, 0.3, false), (4, 0.3, false), (4, 0.3, true), (2, 0.9, true)];
    for (layers, alpha, instanced) in cases {
        let means = image_mean(&stack(layers, alpha, instanced), &settings(0));
        let through = |alpha: f64| (1.0 - alpha).powi(layers as i32);
        for (channel, mean) in means.iter().enumerate() {
            let what = format!("{layers} sheets of alpha {alpha}, instances {instanced}, channel {channel}");
            let (exact, wrong) = (through(alpha.into()), through(f64::from(alpha) - 0.02));
            assert_is(&what, mean, mix(channel, exact), mix(channel, wrong), 3 * cases.len());
        }
    }
}

/// Two triangles that share an edge share a leaf. A ray that crosses both asks each, whichever comes first.
#[test]
fn both_triangles_of_a_folded_leaf_are_asked() {
    let fold = |towards: f32| Primitive {
        positions: vec![[-8.0, 0.0, -4.0], [8.0, 0.0, -4.0], [0.0, 0.5 * towards, 12.0], [0.0, -0.5 * towards, 12.0]],
        triangles: vec![[0, 1, 2], [1, 0, 3]],
        ..square(0.0, 1.0, 0)
    };
    let alpha = 0.3;
    for towards in [1.0, -1.0] {
        let mut scene = stack(1, alpha, false);
        scene.meshes[0].primitives = vec![fold(towards)];
        let means = image_mean(&scene, &settings(0));
        for (channel, mean) in means.iter().enumerate() {
            let (both, one) = ((1.0 - f64::from(alpha)).powi(2), 1.0 - f64::from(alpha));
            assert_is(&format!("fold {towards}, {channel}"), mean, mix(channel, both), mix(channel, one), 6);
        }
    }
}

/// What needs no decision is exact: every sample is the sheet's colour, or the background's.
#[test]
fn alpha_of_zero_and_one_are_nothing_and_everything() {
    let masked = |alpha, cutoff| Material { alpha_mode: AlphaMode::Mask { cutoff }, ..sheet(SHEET, alpha) };
    let cases = [
        (sheet(SHEET, 0.0), BACKGROUND),
        (sheet(SHEET, 1.0), SHEET),
        (masked(0.5, 0.5), SHEET),
        (masked(0.4999, 0.5), BACKGROUND),
        (masked(1.0, 1.1), BACKGROUND),
        (Material { alpha_mode: AlphaMode::Opaque, ..sheet(SHEET, 0.2) }, SHEET),
    ];
    for (material, expected) in cases {
        let mut scene = stack(1, 1.0, false);
        scene.materials = vec![material];
        let run = gpu::run(&mut gpu::path_tracer(&scene, &settings(0)), 1, 1);
        let wrong = run.film.radiance().into_iter().find(|pixel| *pixel != expected);
        assert_eq!(wrong, None, "{:?} must show {expected:?}", scene.materials[0]);
    }
}

/// A floor lit by a directional light through black sheets; the camera is below them or above.
fn lit_through_sheets(layers: u32, alpha: f32, camera_height: f64) -> Scene {
    let view = camera(DVec3::new(0.0, camera_height, 0.3), DVec3::new(0.0, 0.0, 0.0), 0.3);
    let mut primitives = vec![square(0.0, 3.0, 0)];
    primitives.extend((0..layers).map(|i| square(2.0 + 0.1 * f64::from(i), 3.0, 1)));
    let mut scene = scene(primitives, vec![floor(0.5), sheet([0.0; 3], alpha)], view);
    scene.lights = vec![PunctualLight {
        name: String::from("sun"),
        kind: PunctualKind::Directional,
        intensity: [2.0; 3],
        position: DVec3::ZERO,
        direction: DVec3::NEG_Y,
    }];
    scene
}

/// Of the light that falls on the floor (1 − a)ⁿ passes, and of what the floor sends to a camera above the same again: the
/// decisions of the camera's ray and of the shadow ray are independent of each other.
#[test]
fn shadow_rays_pass_as_path_rays_do() {
    let reflected = 0.5 / PI * 2.0;
    for (layers, camera_height, passages) in [(1, 1.0, 1), (3, 1.0, 3), (1, 4.0, 2), (2, 4.0, 4)] {
        let scene = lit_through_sheets(layers, 0.4, camera_height);
        for mode in [LightSampling::Mis, LightSampling::Bsdf] {
            let settings = Settings { light_sampling: mode, ..settings(1) };
            let [red, ..] = image_mean(&scene, &settings);
            let exact = reflected * 0.6_f64.powi(passages);
            assert_is(&format!("{layers} sheets, camera at {camera_height}, {mode}"), &red, exact, exact * 1.05, 8);
        }
    }
}

/// A lamp of 2 × 1.2 at y = 1.5 over a floor, seen at a point of the floor that a pencil of rays from below the lamp meets.
fn lamp_scene(lamp: Material) -> Scene {
    let view = camera(DVec3::new(0.3, 1.0, 0.2), DVec3::new(0.3, 0.0, 0.2), 0.001);
    let mut rectangle = rectangle(LAMP[0], LAMP[1] - LAMP[0], LAMP[3] - LAMP[0], 1);
    rectangle.texcoords = Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    scene(vec![square(0.0, 3.0, 0), rectangle], vec![floor(0.7), lamp], view)
}

const LAMP: [DVec3; 4] =
    [DVec3::new(0.0, 1.5, 0.0), DVec3::new(2.0, 1.5, 0.0), DVec3::new(2.0, 1.5, 1.2), DVec3::new(0.0, 1.5, 1.2)];
const MODES: [LightSampling; 4] = [LightSampling::Mis, LightSampling::Mixture, LightSampling::Nee, LightSampling::Bsdf];

/// Holds all ways to look for light to `irradiance` under a lamp.
fn assert_irradiance(scene: &Scene, irradiance: f64) {
    for mode in MODES {
        let settings = Settings { light_sampling: mode, ..settings(1) };
        let [red, ..] = image_mean(scene, &settings);
        let exact = 0.7 / PI * irradiance;
        assert_is(&format!("{mode}"), &red, exact, 1.05 * exact, MODES.len());
    }
}

/// A lamp of alpha a gives a times the light of the opaque one, however it is found.
#[test]
fn a_lamp_that_is_partly_there_gives_its_share() {
    let lamp = Material { emission: [3.0; 3], ..Material { bsdf: Bsdf::Lambertian, ..sheet([0.5; 3], 0.35) } };
    let point = DVec3::new(0.3, 0.0, 0.2);
    assert_irradiance(&lamp_scene(lamp), 0.35 * 3.0 * polygon_irradiance(&LAMP, point, DVec3::Y));
}

/// An image of one row, white, with the given alphas.
fn add_alpha_texture(scene: &mut Scene, alphas: &[u8]) -> TextureBinding {
    let texels = Texels::Rgba8(alphas.iter().map(|a| [255, 255, 255, *a]).collect());
    let image = Image { name: String::from("alphas"), width: alphas.len() as u32, height: 1, texels };
    scene.images.push(image.into());
    let image = scene.images.len() - 1;
    scene.textures.push(Texture {
        image,
        wrap_u: Wrap::ClampToEdge,
        wrap_v: Wrap::ClampToEdge,
        filter: Filter::Nearest,
    });
    TextureBinding::new(scene.textures.len() - 1)
}

/// A lamp of which a mask leaves three quarters, and of these one quarter is a lamp of half the alpha by BLEND.
#[test]
fn textured_alpha_takes_its_share_of_a_lamp() {
    let strip = |from: f64, to: f64| {
        let at = |k: usize, share: f64| LAMP[k] + share * (LAMP[1] - LAMP[0]);
        [at(0, from), at(0, to), at(3, to), at(3, from)]
    };
    let point = DVec3::new(0.3, 0.0, 0.2);
    let light = |from, to| 3.0 * polygon_irradiance(&strip(from, to), point, DVec3::Y);
    let modes = [
        (AlphaMode::Mask { cutoff: 0.5 }, light(0.25, 1.0)),
        (AlphaMode::Blend, light(0.25, 0.5) * 200.0 / 255.0 + light(0.5, 1.0)),
    ];
    for (alpha_mode, irradiance) in modes {
        // Its black base colour does not matter: alpha is read nonetheless.
        let lamp = Material { emission: [3.0; 3], alpha_mode, ..Material::lambertian("lamp", [0.0; 3]) };
        let mut scene = lamp_scene(lamp);
        scene.materials[1].base_color_texture = Some(add_alpha_texture(&mut scene, &[0, 200, 255, 255]));
        assert_irradiance(&scene, irradiance);
    }
}

/// A wall cut into `strips` along x, over a floor under a sun at a slant: by a mask, or as geometry.
fn cut_wall(alphas: &[u8], by_mask: bool) -> Scene {
    let (corner, width, height) = (DVec3::new(-1.0, 0.0, 0.0), 2.0 * DVec3::X, 1.5 * DVec3::Y);
    let mut primitives = vec![square(0.0, 3.0, 0)];
    if by_mask {
        let mut wall = rectangle(corner, width, height, 1);
        wall.texcoords = Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        primitives.push(wall);
    } else {
        let part = width / alphas.len() as f64;
        let there = (0..alphas.len()).filter(|i| alphas[*i] > 127);
        primitives.extend(there.map(|i| rectangle(corner + i as f64 * part, part, height, 1)));
    }
    let view = camera(DVec3::new(0.5, 2.0, 4.0), DVec3::new(0.0, 0.5, 0.0), 0.8);
    let wall = Material::lambertian("wall", [0.6, 0.5, 0.4]);
    let mut scene = scene(primitives, vec![floor(0.7), wall], view);
    if by_mask {
        scene.materials[1].base_color_texture = Some(add_alpha_texture(&mut scene, alphas));
        scene.materials[1].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    }
    scene.lights = vec![PunctualLight {
        name: String::from("sun"),
        kind: PunctualKind::Directional,
        intensity: [2.0; 3],
        position: DVec3::ZERO,
        direction: DVec3::new(0.1, -0.6, 0.8).normalize(),
    }];
    scene.environment = Environment::Constant([0.3; 3]);
    scene
}

/// Surface, shadow and indirect light of a masked wall are those of the same wall cut out: the same seed gives the same
/// picture, but for pixels in which some sample's hit is rounded across an edge.
#[test]
fn a_mask_is_the_geometry_cut_out() {
    let alphas = [255, 0, 0, 128, 255, 127, 200, 20];
    let settings = Settings { max_bounces: Some(3), ..gpu::settings(64, 64) };
    let draw = |scene: &Scene| gpu::run(&mut gpu::path_tracer(scene, &settings), 3, 4).film.radiance();
    let different = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        let differs = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3 * a[c].max(b[c]));
        a.iter().zip(b).filter(differs).count()
    };
    let masked = draw(&cut_wall(&alphas, true));
    let cut = draw(&cut_wall(&alphas, false));
    let count = different(&masked, &cut);
    println!("{count} of {} pixels differ", cut.len());
    assert!(count * 50 < cut.len(), "{count} of {} pixels differ", cut.len());
    let other = draw(&cut_wall(&[255, 0, 0, 128, 255, 127, 20, 200], false));
    assert!(different(&masked, &other) * 20 > cut.len(), "another strip is noticed");
}
