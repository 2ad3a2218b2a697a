//! Normals that are not the surface's own: what they make of light from one direction, and that they neither make light nor
//! lose it.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::common::builder::{camera, rectangle, scene};
use crate::common::kernel::Random;
use crate::common::{gpu, scenes};
use glam::{DVec3, Vec3};
use sunfleck::render::{LightSampling, Settings};
use sunfleck::scene::{
    Bsdf, Environment, Filter, Image, Material, Primitive, Projection, PunctualKind, PunctualLight, Scene, Texels,
    Texture, TextureBinding, TextureTransform, Wrap,
};

/// Normals are the same code for every driver and mode: where rendering is slow, one of these will do.
fn modes() -> &'static [LightSampling] {
    let all = &[LightSampling::Mis, LightSampling::Mixture, LightSampling::Bsdf];
    if scenes::slow_driver() { &all[..1] } else { all }
}

fn settings(size: u32, light_sampling: LightSampling) -> Settings {
    Settings { light_sampling, ..gpu::settings(size, size) }
}

fn sun(towards: DVec3, irradiance: f32) -> PunctualLight {
    PunctualLight {
        name: String::from("sun"),
        kind: PunctualKind::Directional,
        intensity: [irradiance; 3],
        position: DVec3::ZERO,
        direction: -towards.normalize(),
    }
}

/// A tangent-space normal as a texel of 16 bits.
fn normal_texel(normal: DVec3) -> [u16; 4] {
    let code = |x: f64| ((0.5 * x + 0.5) * 65535.0).round() as u16;
    [code(normal.x), code(normal.y), code(normal.z), 65535]
}

/// The normal that the texel stands for on `mapped_plane`: x along the tangent, y along the bitangent, z up.
fn plane_normal(texel: [u16; 4]) -> DVec3 {
    let [x, y, z, _] = texel.map(|c| f64::from(c) / 65535.0 * 2.0 - 1.0);
    DVec3::new(x, z, -y).normalize()
}

/// The square [−1, 1]² in the plane y = 0, seen from above, with a normal map: its tangent is +X, its bitangent −Z.
fn mapped_plane(material: Material, texels: Vec<[u16; 4]>, width: u32) -> Scene {
    let mut plane = rectangle(DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 0);
    plane.texcoords = Some(vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    plane.generate_tangents(0, &TextureTransform::IDENTITY);
    let mut view = camera(DVec3::new(0.0, 2.0, 0.0), DVec3::ZERO, 1.0);
    view.projection = Projection::Orthographic { ymag: 0.9 };
    let mut scene = scene(vec![plane], vec![material], view);
    let height = texels.len() as u32 / width;
    scene.images.push(Image { name: String::from("map"), width, height, texels: Texels::Rgba16(texels) }.into());
    let wrap = Wrap::Repeat;
    scene.textures.push(Texture { image: 0, wrap_u: wrap, wrap_v: wrap, filter: Filter::Nearest });
    scene.materials[0].normal_texture = Some(TextureBinding::new(0));
    scene
}

fn white() -> Material {
    Material::lambertian("white", [1.0; 3])
}

/// Every pixel's red, of one seed.
fn pixels(scene: &Scene, settings: &Settings, spp: u32) -> Vec<f64> {
    scene.validate().expect("a valid scene");
    let run = gpu::run(&mut gpu::path_tracer(scene, settings), 1, spp);
    run.film.radiance().iter().map(|pixel| f64::from(pixel[0])).collect()
}

/// A plane whose map tilts it everywhere alike reflects sunlight as the tilted plane does, and besides what the plane
/// mirrors up to it: E/π·(max(0, n·l) + max(0, n·l′)). The second term is zero unless the light is nearer to the horizon
/// than the tilt.
#[test]
fn a_tilted_map_is_a_tilted_plane() {
    let suns =
        [[0.0, 1.0, 0.0], [0.5, 1.0, 0.3], [-0.8, 0.6, 0.2], [0.9, 0.15, -0.2], [0.3, -0.5, 0.2], [-0.9, 0.1, 0.1]];
    let tilts = [[0.3, 0.2, 1.0], [-0.6, 0.1, 1.0], [0.9, -0.3, 0.6]];
    let texels = tilts.map(|tilt| normal_texel(DVec3::from(tilt).normalize()));
    let mut grazing = 0;
    for sun_direction in suns {
        let light = DVec3::from(sun_direction).normalize();
        let mut scene = mapped_plane(white(), texels.to_vec(), 3);
        scene.cameras[0].projection = Projection::Orthographic { ymag: 1.0 };
        scene.lights.push(sun(light, 2.0));
        // Two columns of pixels a texel; the camera's right is −X.
        for (pixel, value) in pixels(&scene, &settings(6, LightSampling::Mis), 4).iter().enumerate() {
            let normal = plane_normal(texels[2 - pixel % 6 / 2]);
            let second = normal.dot(DVec3::new(light.x, -light.y, light.z)).max(0.0);
            grazing += usize::from(light.y > 0.0 && second > 0.0);
            let expected = if light.y > 0.0 { 2.0 / PI * (normal.dot(light).max(0.0) + second) } else { 0.0 };
            assert!((value - expected).abs() < 1e-5, "{normal} under {light}: {value} instead of {expected}");
        }
    }
    assert!(grazing > 0, "some suns are low");
}

/// The same with geometry on the other side: a plane that is tilted itself, under suns above both.
#[test]
fn a_tilted_plane_agrees() {
    let texel = normal_texel(DVec3::new(0.4, 0.2, 1.0).normalize());
    let normal = plane_normal(texel);
    for sun_direction in [[0.1, 1.0, 0.2], [-0.6, 0.9, 0.3]] {
        let lights = vec![sun(DVec3::from(sun_direction), 3.0)];
        let map = Scene { lights: lights.clone(), ..mapped_plane(white(), vec![texel], 1) };
        let (a, b) = (normal.cross(DVec3::Z).normalize(), normal);
        let side = a.cross(b);
        let plane = rectangle(-(a + side) * 2.0, side * 4.0, a * 4.0, 0);
        let tilted = Scene { lights, ..scene(vec![plane], vec![white()], map.cameras[0].clone()) };
        let settings = settings(8, LightSampling::Mis);
        for (map, plane) in pixels(&map, &settings, 1).iter().zip(pixels(&tilted, &settings, 1)) {
            assert!(plane > 0.1 && (map - plane).abs() < 1e-5, "{map} and {plane} differ");
        }
    }
}

/// Facets tilted at random up to 80°, one a texel.
fn rough_texels(n: usize) -> Vec<[u16; 4]> {
    let mut random = Random(41);
    let mut texel = |_| {
        let (tilt, phi) = (random.unit() * 80.0_f64.to_radians(), random.unit() * TAU);
        normal_texel(DVec3::new(tilt.sin() * phi.cos(), tilt.sin() * phi.sin(), tilt.cos()))
    };
    (0..n * n).map(&mut texel).collect()
}

/// A white furnace: by BSDF sampling every path of a Lambertian has weight 1, and the other modes have the same mean. A
/// rough white metal gets from its facets what it loses flat, no more; seen from the side too.
#[test]
fn no_normal_map_gains_or_loses_light() {
    let furnace = |material, eye| {
        let mut scene = mapped_plane(material, rough_texels(16), 16);
        scene.environment = Environment::Constant([1.0; 3]);
        scene.cameras = vec![camera(eye, DVec3::ZERO, 0.2)];
        scene
    };
    let (above, aside) = (DVec3::new(0.0, 2.0, 0.0), DVec3::new(3.0, 0.4, 1.0));
    for eye in [above, aside] {
        for value in pixels(&furnace(white(), eye), &settings(16, LightSampling::Bsdf), 16) {
            assert!((value - 1.0).abs() < 1e-5, "a path of weight {value}");
        }
    }
    for mode in modes().iter().copied() {
        let settings = settings(16, mode);
        let mean = |material, eye| {
            let mut tracer = gpu::path_tracer(&furnace(material, eye), &settings);
            scenes::seeds(&mut tracer, &settings, 32, 64).image()[0]
        };
        let lambertian = mean(white(), aside);
        let error = lambertian.standard_error();
        println!("{mode}: Lambertian {:.5} ± {error:.5} (exact: 1)", lambertian.mean);
        assert!((lambertian.mean - 1.0).abs() <= 4.0 * error + 1e-5 && error < 1e-3, "{mode}: {lambertian:?}");
        for eye in [above, aside] {
            let metal = mean(Material { roughness: 0.5, ..Material::default() }, eye);
            println!("{mode}: metal {:.5} ± {:.5}", metal.mean, metal.standard_error());
            assert!(metal.mean < 1.001 + 4.0 * metal.standard_error(), "{mode}: {metal:?}");
            assert!(metal.mean > 0.85, "{mode}: {metal:?}");
        }
    }
}

/// White mirrors and boundaries under the roughest map return every ray.
#[test]
fn normal_maps_on_delta_lobes_lose_nothing() {
    for bsdf in [Bsdf::Mirror, Bsdf::Glass] {
        let material = Material { bsdf, ..white() };
        let mut scene = mapped_plane(material, rough_texels(16), 16);
        scene.environment = Environment::Constant([1.0; 3]);
        // Radiance that goes through the boundary grows with the index of refraction: here there is none.
        scene.materials[0].ior = 1.0;
        for value in pixels(&scene, &settings(16, LightSampling::Mis), 4) {
            assert!((value - 1.0).abs() < 1e-5, "{bsdf:?}: {value}");
        }
    }
}

/// A sphere by longitude and latitude with the sphere's normals.
fn sphere(centre: DVec3, radius: f64, across: u32, down: u32, material: usize) -> Primitive {
    let direction = |i: u32, j: u32| {
        let (theta, phi) = (PI * f64::from(j) / f64::from(down), TAU * f64::from(i) / f64::from(across));
        DVec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin())
    };
    let normals: Vec<DVec3> = (0..=down).flat_map(|j| (0..=across).map(move |i| direction(i, j))).collect();
    let index = |i: u32, j: u32| j * (across + 1) + i;
    let cells = (0..down).flat_map(|j| (0..across).map(move |i| (i, j)));
    let triangles = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [index(i, j), index(i, j + 1), index(i + 1, j + 1), index(i + 1, j)];
        let (upper, lower) = ((j > 0).then_some([a, c, d]), (j + 1 < down).then_some([a, b, c]));
        upper.into_iter().chain(lower)
    });
    Primitive {
        positions: normals.iter().map(|n| (centre + *n * radius).as_vec3().into()).collect(),
        triangles: triangles.collect(),
        normals: Some(normals.iter().map(|n| n.as_vec3().into()).collect()),
        material,
        ..Primitive::default()
    }
}

/// A closed box whose normals are interpolated around its corners, and in it coarse smooth spheres: where everything emits 1
/// and reflects half, the radiance is 2 everywhere. A ray that leaked would find darkness.
#[test]
fn a_closed_box_with_interpolated_normals_leaks_nothing() {
    let mut furnace = scenes::scene("furnace_box");
    let walls = &mut furnace.meshes[0].primitives[0];
    walls.normals = Some(walls.positions.iter().map(|&p| (-Vec3::from(p)).normalize().into()).collect());
    // One of them touches the floor, whose y is −1.2.
    furnace.meshes[0].primitives.push(sphere(DVec3::new(-0.4, -0.8, -0.5), 0.4, 8, 6, 0));
    furnace.meshes[0].primitives.push(sphere(DVec3::new(0.4, 0.4, -0.4), 0.3, 16, 8, 0));
    for mode in modes().iter().copied() {
        let settings = settings(32, mode);
        let mean = scenes::seeds(&mut gpu::path_tracer(&furnace, &settings), &settings, 16, 128).image()[0];
        println!("{mode}: {:.5} ± {:.5} (exact: 2)", mean.mean, mean.standard_error());
        assert!(mean.standard_error() < 0.001, "{mode}: too noisy to say: {mean:?}");
        assert!((mean.mean - 2.0).abs() <= 4.0 * mean.standard_error(), "{mode}: {mean:?}");
    }
}

/// Radiance along the equator of a coarse sphere lit from the side, from the lit to the dark limb.
fn terminator_profile(across: u32, down: u32) -> Vec<f64> {
    let (width, height) = (256, 8);
    let mut view = camera(DVec3::new(0.0, 0.02, 5.0), DVec3::new(0.0, 0.02, 0.0), 1.0);
    view.projection = Projection::Orthographic { ymag: f64::from(height) / f64::from(width) };
    let mut scene = scene(vec![sphere(DVec3::ZERO, 1.0, across, down, 0)], vec![white()], view);
    scene.lights.push(sun(DVec3::new(-1.0, 0.0, 0.35), PI as f32));
    let settings = Settings { max_bounces: Some(1), ..gpu::settings(width, height) };
    let values = pixels(&scene, &settings, 64);
    values.chunks(width as usize).nth(height as usize / 2).expect("a row").to_vec()
}

/// No triangle that turns its back on the light is dark before the smooth surface is: the radiance falls as on the sphere,
/// without a step.
#[test]
fn a_coarse_sphere_has_a_smooth_terminator() {
    for (across, down) in [(16, 8), (24, 13)] {
        let profile = terminator_profile(across, down);
        let light = DVec3::new(-1.0, 0.0, 0.35).normalize();
        let at = |pixel: usize| (pixel as f64 + 0.5) / 128.0 - 1.0;
        // The silhouette of the polygon lies inside the circle.
        let inside = (FRAC_PI_2 * 2.0 / f64::from(across)).cos() - 0.02;
        let seen: Vec<usize> = (0..profile.len()).filter(|&pixel| at(pixel).abs() < inside).collect();
        let mut worst = 0.0_f64;
        for &pixel in &seen {
            let x = at(pixel);
            let exact = light.dot(DVec3::new(x, 0.02, (1.0 - x * x - 0.0004).sqrt())).max(0.0);
            worst = worst.max((profile[pixel] - exact).abs());
        }
        let peak = seen.iter().copied().max_by(|a, b| profile[*a].total_cmp(&profile[*b])).expect("pixels");
        let rise = seen.iter().filter(|&&p| p > peak).map(|&p| profile[p] - profile[p - 1]).fold(0.0, f64::max);
        println!("{across}×{down}: worst distance from the sphere {worst:.4}, largest rise {rise:.5}");
        // Interpolated normals are off by half of an eighth of the squared angle of a cell at most, and points by the same.
        let angle = TAU / f64::from(across);
        assert!(worst < 0.5 * angle * angle, "{across}×{down}: {worst}");
        assert!(rise < 0.01, "{across}×{down}: the radiance rises by {rise} on the way to the dark");
    }
}
