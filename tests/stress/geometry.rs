//! Geometry under stress: scale, distance, degenerate and coincident triangles, extreme ratios, and transforms that mirror,
//! stretch or flatten.

use glam::{DAffine3, DMat3, DVec3};
use sunfleck::render::Settings;
use sunfleck::scene::{Instance, Material, Mesh, Primitive, Scene};

use crate::common::gpu;
use crate::common::kernel::{Random, camera, empty_scene};
use crate::common::scenes::{full_form, scene, seeds};
use crate::common::statistics::{Comparison, Estimate, TileStatistics};
use crate::common::trace::{cube, icosphere, placements};

/// How far from the origin a scene is moved.
const FAR: DVec3 = DVec3::new(1e6, -1e6, 1e6);

/// The scene made `scale` times as large, by its nodes, and then moved.
fn placed(mut scene: Scene, scale: f64, offset: DVec3) -> Scene {
    let place = |m: &DAffine3| DAffine3::from_translation(offset) * DAffine3::from_scale(DVec3::splat(scale)) * *m;
    scene.instances.iter_mut().for_each(|i| i.object_to_world = place(&i.object_to_world));
    for camera in &mut scene.cameras {
        // A camera has no size: only its place and its lens scale.
        camera.camera_to_world.translation = camera.camera_to_world.translation * scale + offset;
        camera.lens_radius *= scale;
        camera.focus_distance *= scale;
    }
    assert!(scene.lights.is_empty(), "a point light's intensity is not scale-free");
    scene
}

/// The same by its vertices.
fn with_scaled_vertices(mut scene: Scene, scale: f32) -> Scene {
    for position in scene.meshes.iter_mut().flat_map(|m| &mut m.primitives).flat_map(|p| &mut p.positions) {
        *position = position.map(|x| x * scale);
    }
    for instance in &mut scene.instances {
        instance.object_to_world.translation *= f64::from(scale);
    }
    for camera in &mut scene.cameras {
        camera.camera_to_world.translation *= f64::from(scale);
        camera.lens_radius *= f64::from(scale);
        camera.focus_distance *= f64::from(scale);
    }
    scene
}

/// Images of a few seeds; those of another `series` share no random number with them.
fn images(scene: &Scene, series: u32) -> TileStatistics {
    let settings = gpu::settings(48, 48);
    let mut tracer = gpu::path_tracer(scene, &settings);
    let mut statistics = TileStatistics::new(48, 48, 8);
    let (count, spp) = if full_form() { (16, 32) } else { (8, 16) };
    for seed in 0..count {
        statistics.add(&gpu::run(&mut tracer, 1000 * series + seed, spp).film.radiance());
    }
    statistics
}

fn assert_same_image(what: &str, a: &TileStatistics, b: &TileStatistics) {
    let comparison = Comparison::new(&a.tiles(), &b.tiles(), 0.01);
    let (a, b) = (a.image()[1], b.image()[1]);
    println!(
        "{what}: {:.6} ± {:.1e}, {:.6} ± {:.1e}; {comparison}",
        a.mean,
        a.standard_error(),
        b.mean,
        b.standard_error()
    );
    assert!(comparison.passed(), "{what}: {comparison}");
}

/// Scenes with lamps, glass, instances, gloss.
fn scale_free_scenes() -> &'static [&'static str] {
    if full_form() {
        &["cornell", "cornell_spheres", "instances", "metallic_roughness", "many_lights"]
    } else {
        &["cornell"]
    }
}

fn scales() -> &'static [f64] {
    if full_form() { &[1e-6, 1e-3, 1e3, 1e6] } else { &[1e-6, 1e6] }
}

/// An area light's radiance, and an environment's, know no length: a scene looks the same at every scale.
#[test]
fn scaled_scenes_look_the_same() {
    for name in scale_free_scenes() {
        let original = images(&scene(name), 0);
        for (series, scale) in scales().iter().enumerate() {
            let scaled = images(&placed(scene(name), *scale, DVec3::ZERO), 1 + series as u32);
            assert_same_image(&format!("{name}, nodes scaled by {scale:e}"), &original, &scaled);
            let extreme = *scale <= 1e-6 || *scale >= 1e6;
            if full_form() && extreme {
                let scaled = images(&with_scaled_vertices(scene(name), *scale as f32), 101 + series as u32);
                assert_same_image(&format!("{name}, vertices scaled by {scale:e}"), &original, &scaled);
            }
        }
    }
}

/// Nodes and camera a million units from the origin: the image is the same.
#[test]
fn moved_scenes_look_the_same() {
    for name in scale_free_scenes() {
        let original = images(&scene(name), 0);
        assert_same_image(&format!("{name}, moved"), &original, &images(&placed(scene(name), 1.0, FAR), 201));
        if full_form() {
            let small = placed(scene(name), 1e-3, FAR);
            assert_same_image(&format!("{name}, scaled by 1e-3 and moved"), &original, &images(&small, 202));
        }
    }
}

/// The comparison is not blind: a wall a few per cent darker is another image.
#[test]
fn another_albedo_is_another_image() {
    let mut other = scene("cornell");
    other.materials[0].base_color[0] *= 0.95;
    let comparison = Comparison::new(&images(&scene("cornell"), 0).tiles(), &images(&other, 301).tiles(), 0.01);
    assert!(!comparison.passed(), "{comparison}");
}

/// A closed room that emits 1 at albedo ½: every pixel is 2, whatever stands in it, as long as that does so too. Albedo and
/// emission of a surface seen from either side are the same.
fn furnace(meshes: Vec<(Primitive, Vec<DAffine3>)>, camera_to_world: DAffine3) -> Scene {
    let wall = Material { emission: [1.0; 3], double_sided: true, ..Material::lambertian("wall", [0.5; 3]) };
    let mut scene = Scene { materials: vec![wall], ..empty_scene() };
    scene.cameras[0].camera_to_world = camera_to_world;
    for (mesh, (primitive, places)) in meshes.into_iter().enumerate() {
        scene.meshes.push(Mesh { name: format!("mesh {mesh}"), primitives: vec![primitive] });
        let place = |m| Instance { mesh, object_to_world: m, name: format!("mesh {mesh}") };
        scene.instances.extend(places.into_iter().map(place));
    }
    scene
}

/// A closed box around the origin.
fn room(triangles: Primitive) -> Scene {
    furnace(vec![(triangles, vec![DAffine3::IDENTITY])], DAffine3::IDENTITY)
}

fn furnace_images(scene: &Scene) -> TileStatistics {
    let settings: Settings = gpu::settings(32, 32);
    let spp = if full_form() { 128 } else { 24 };
    seeds(&mut gpu::path_tracer(scene, &settings), &settings, 8, spp)
}

/// The mean is within 0.5 % of 2, and known well enough to say so; no tile stands out.
fn assert_reads_two(what: &str, scene: &Scene) {
    scene.validate().expect("a valid scene");
    let statistics = furnace_images(scene);
    for mean in statistics.image() {
        let error = mean.standard_error() / 2.0;
        println!("{what}: {:.5} ± {:.3} %", mean.mean, 100.0 * error);
        assert!(error < 1.25e-3, "{what}: a standard error of {error} cannot show 0.5 %");
        assert!((mean.mean - 2.0).abs() <= 0.005 * 2.0, "{what}: {}", mean.mean);
    }
    let tiles = statistics.tiles();
    let comparison = Comparison::new(&tiles, &vec![Estimate::exact(2.0); tiles.len()], 0.01);
    assert!(comparison.passed(), "{what}: {comparison}");
}

#[test]
fn furnace_holds_at_every_scale() {
    for scale in scales() {
        let scaled = placed(scene("furnace_box"), *scale, DVec3::ZERO);
        assert_reads_two(&format!("furnace scaled by {scale:e}"), &scaled);
    }
    assert_reads_two("furnace moved", &placed(scene("furnace_box"), 1.0, FAR));
    assert_reads_two("furnace scaled by 1e-3 and moved", &placed(scene("furnace_box"), 1e-3, FAR));
}

/// Each wall given twice, turned around too, and the room given twice: one of them is seen, the others lie behind it.
#[test]
fn furnace_with_coincident_walls() {
    let twice = |mut mesh: Primitive, turned: bool| {
        let again: Vec<[u32; 3]> =
            mesh.triangles.iter().map(|&[a, b, c]| if turned { [b, a, c] } else { [b, c, a] }).collect();
        mesh.triangles.extend(again);
        mesh
    };
    assert_reads_two("walls given twice", &room(twice(cube(2), false)));
    assert_reads_two("walls given twice, turned around", &room(twice(cube(2), true)));
    let two = furnace(vec![(cube(2), vec![DAffine3::IDENTITY; 2])], DAffine3::IDENTITY);
    assert_reads_two("the room given twice by nodes", &two);
}

/// Needles and triangles of no area, all over the room, some collinear but for rounding.
fn degenerate(random: &mut Random, count: usize) -> Primitive {
    let mut mesh = Primitive::default();
    for i in 0..count {
        let (a, along) = (random.point(0.9), 0.5 * random.direction());
        let c = match i % 5 {
            0 => a,
            1 => a + 0.5 * along,
            2 => a + random.unit() * along,
            3 => a + random.unit() * along + 1e-8 * random.direction(),
            _ => a + random.unit() * along + 10.0_f64.powf(random.between(-12.0, -1.0)) * random.direction(),
        };
        let b = if i % 25 == 0 { a } else { a + along };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([a, b, c].map(|p| p.as_vec3().to_array()));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

#[test]
fn furnace_with_slivers_needles_and_triangles_of_no_area() {
    let mesh = degenerate(&mut Random(41), 2000);
    let scene =
        furnace(vec![(cube(2), vec![DAffine3::IDENTITY]), (mesh, vec![DAffine3::IDENTITY])], DAffine3::IDENTITY);
    assert_reads_two("2000 degenerate triangles", &scene);
}

/// A lamp of slivers in one plane, of which f32 hardly knows where they face: what light it gives is finite, and a pixel
/// of the room without it is not changed by more than it emits.
#[test]
fn lamps_that_are_slivers_give_finite_light() {
    let mut random = Random(42);
    let mut lamp = Primitive { material: 1, ..Primitive::default() };
    for _ in 0..500 {
        let (x, y) = (random.between(0.1, 0.9), random.between(0.1, 0.9));
        let t = random.unit();
        let first = lamp.positions.len() as u32;
        let width = 10.0_f64.powf(random.between(-9.0, -6.0));
        let corners = [(-x, -y), (x, y), (-x + 2.0 * t * x, -y + 2.0 * t * y + width)];
        lamp.positions.extend(corners.map(|(x, y)| [x as f32, y as f32, -0.5]));
        lamp.triangles.push([first, first + 1, first + 2]);
    }
    let identity = || vec![DAffine3::IDENTITY];
    let mut scene = furnace(vec![(cube(2), identity()), (lamp, identity())], DAffine3::IDENTITY);
    scene.materials.push(Material { emission: [1e3; 3], double_sided: true, ..Material::lambertian("lamp", [0.0; 3]) });
    scene.materials[0].emission = [0.0; 3];
    let settings = gpu::settings(32, 32);
    gpu::run(&mut gpu::path_tracer(&scene, &settings), 1, 16);
}

/// A cube of one unit before the camera, in a room of ten million.
#[test]
fn furnace_with_sizes_ten_million_to_one() {
    let places = |scale: f64, at: DVec3| {
        vec![DAffine3::from_scale_rotation_translation(DVec3::splat(scale), glam::DQuat::from_rotation_y(0.5), at)]
    };
    let at = DVec3::new(0.0, 0.0, -4.0);
    let scene = furnace(vec![(cube(2), places(5e6, DVec3::ZERO)), (cube(2), places(0.5, at))], DAffine3::IDENTITY);
    assert_reads_two("1e7 to 1", &scene);
    // The same with the small part in a corner of the large one.
    let corner = DVec3::splat(4.9e6);
    let camera = DAffine3::from_translation(corner + DVec3::Z * 4.0);
    let scene = furnace(vec![(cube(2), places(1e7, DVec3::ZERO)), (icosphere(2), places(1.0, corner))], camera);
    assert_reads_two("1e7 to 1, in the corner", &scene);
}

/// Rooms that are stretched, turned, sheared and mirrored, baked and as instances.
#[test]
fn furnace_stretched_and_mirrored() {
    let aside = DAffine3::from_translation(DVec3::splat(1e3));
    let shear = DMat3::from_cols(DVec3::new(1.0, 0.2, 0.0), DVec3::new(3.0, 1.0, 0.0), DVec3::new(0.0, 0.5, -2.0));
    let thin = DAffine3::from_scale(DVec3::new(1e-4, 1.0, 1e4));
    let mut all = placements();
    all.extend([DAffine3::from_mat3(shear), thin]);
    let step = if full_form() { 1 } else { 3 };
    for (number, place) in all.into_iter().enumerate().step_by(step) {
        let camera = DAffine3::from_translation(place.translation);
        assert_reads_two(&format!("placement {number}, baked"), &furnace(vec![(cube(2), vec![place])], camera));
        let instances = furnace(vec![(cube(2), vec![place, aside])], camera);
        assert_reads_two(&format!("placement {number}, as an instance"), &instances);
    }
}

/// Boxes pressed to a plane, to a line and to a point inside of the room.
#[test]
fn furnace_with_singular_transforms() {
    let flat = |x: f64, y: f64, z: f64, at: f64| {
        DAffine3::from_mat3_translation(
            DMat3::from_rotation_x(0.7) * DMat3::from_diagonal(DVec3::new(x, y, z)),
            DVec3::new(at, 0.1, -0.5),
        )
    };
    let places =
        vec![flat(0.2, 0.0, 0.2, -0.4), flat(0.0, 0.3, 0.0, 0.1), flat(0.0, 0.0, 0.0, 0.3), flat(0.2, 0.3, 1e-30, 0.5)];
    let scene = furnace(vec![(cube(2), vec![DAffine3::IDENTITY]), (cube(2), places)], DAffine3::IDENTITY);
    assert_reads_two("pressed flat", &scene);
}

/// Surfaces of different materials in one plane that overlap: which is seen is not said, but it is finite, and the same in
/// every run.
#[test]
fn overlapping_coplanar_surfaces_are_finite_and_deterministic() {
    let mut scene = scene("cornell");
    let mut overlap = scene.meshes[0].clone();
    // Every surface again, a little smaller about its own middle, in the next material; the lamps overlap too.
    for primitive in &mut overlap.primitives {
        let middle = primitive.positions.iter().map(|p| DVec3::from(p.map(f64::from))).sum::<DVec3>()
            / primitive.positions.len() as f64;
        let shrink = |p: &mut [f32; 3]| *p = middle.lerp(DVec3::from(p.map(f64::from)), 0.75).as_vec3().to_array();
        primitive.positions.iter_mut().for_each(shrink);
        primitive.material = (primitive.material + 1) % scene.materials.len();
    }
    scene.meshes.push(overlap);
    scene.instances.push(Instance { mesh: 1, object_to_world: DAffine3::IDENTITY, name: String::from("overlap") });
    let settings = gpu::settings(32, 32);
    let image = || gpu::run(&mut gpu::path_tracer(&scene, &settings), 5, 16).film.radiance();
    let (first, second) = (image(), image());
    assert!(first.iter().flatten().all(|x| x.is_finite()));
    assert_eq!(first, second, "two runs differ");
    assert!(first.iter().flatten().any(|x| *x > 0.0), "{:?}", camera().name);
}
