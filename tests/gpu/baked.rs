//! Scenes that are compiled into the kernel: the search finds what a loop over all triangles finds, closed meshes stay
//! closed, images are the same, and what is not compiled in is said.

use crate::common::brute_force::assert_agrees;
use crate::common::builder::rectangle;
use crate::common::gpu;
use crate::common::kernel::{Random, TestKernel};
use crate::common::scenes::scene;
use crate::common::spirv::{assert_valid, bytes, validator_is_there, words};
use crate::common::trace::{
    NO_TRIANGLE, Ray, as_shadow_rays, assert_end_on_unit_cube, assert_watertight, axis_parallel_rays, cube, icosphere,
    kernel, random_rays, scene_of, soup, trace,
};
use glam::{DAffine3, DVec3};
use sunfleck::gpu::specialize::{bake, specialize};
use sunfleck::gpu::{DeviceKind, TraceBackend, embedded};
use sunfleck::render::{Bake, BindingOverride, KernelKey, Settings, prepare_scene};
use sunfleck::scene::{Instance, Material, Mesh, Primitive, Scene};

/// A kernel that traces by the baked search, however many triangles there are.
fn baked(scene: &Scene) -> TestKernel {
    let mut kernel = kernel(scene);
    kernel.trace = TraceBackend::Bvh;
    kernel.bake.add_geometry(&kernel.prepared);
    kernel
}

/// A kernel that has the large faces compiled in before the tree of the rest.
fn with_large_faces(scene: &Scene) -> TestKernel {
    let mut kernel = kernel(scene);
    kernel.trace = TraceBackend::Bvh;
    kernel.bake.add_large_faces(&kernel.prepared);
    assert!(kernel.bake.has_large_faces());
    kernel
}

fn one(mesh: Primitive) -> Scene {
    scene_of(vec![(mesh, vec![DAffine3::IDENTITY])])
}

/// The scene with four walls, a floor and a ceiling around it, and the camera within them.
fn in_a_room(mut scene: Scene) -> Scene {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * 40.0);
    let low = DVec3::splat(-20.0);
    let material = scene.materials.len();
    scene.materials.push(Material::lambertian("wall", [0.5; 3]));
    let sides = [(low, x, y), (low + z, x, y), (low, y, z), (low + x, y, z), (low, z, x), (low + y, z, x)];
    let primitives = sides.map(|(corner, a, b)| rectangle(corner, a, b, material)).to_vec();
    scene.instances.push(Instance {
        mesh: scene.meshes.len(),
        object_to_world: DAffine3::IDENTITY,
        name: String::from("room"),
    });
    scene.meshes.push(Mesh { name: String::from("room"), primitives });
    scene
}

#[test]
fn hits_agree_with_brute_force() {
    let cases = [soup(&mut Random(30), 40), cube(2), icosphere(1)];
    for mesh in cases {
        let kernel = baked(&one(mesh));
        let rays = random_rays(Random(31), 4096, kernel.prepared.origin);
        assert!(assert_agrees(&kernel, &rays) > rays.len() / 64);
    }
}

/// The cube [−1, 1]³, each face a square with a frame around it: the squares are compiled in, the frames stand in the tree.
fn framed_cube() -> Primitive {
    let mut mesh = cube(3);
    for x in mesh.positions.as_flattened_mut() {
        *x = if x.abs() < 0.5 { 0.75 * x.signum() } else { *x };
    }
    mesh
}

#[test]
fn hits_of_large_faces_and_the_rest_agree_with_brute_force() {
    let room = || (framed_cube(), vec![DAffine3::IDENTITY]);
    let small = DAffine3::from_scale(DVec3::splat(0.3));
    let shifted = DAffine3::from_translation(DVec3::X * 0.4);
    let cases = [
        scene_of(vec![room()]),
        scene_of(vec![room(), (icosphere(2), vec![small])]),
        // Two placements stay instances.
        scene_of(vec![room(), (icosphere(2), vec![small, shifted * small])]),
    ];
    for scene in cases {
        let kernel = with_large_faces(&scene);
        let rays = random_rays(Random(32), 8192, kernel.prepared.origin);
        assert!(assert_agrees(&kernel, &rays) > rays.len() / 64);
    }
}

#[test]
fn large_faces_and_the_rest_are_watertight_together() {
    let far = DAffine3::from_translation(DVec3::new(3.0, -2.0, 500.0));
    let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let mesh = framed_cube();
    for place in [DAffine3::IDENTITY, turned, far * turned] {
        let kernel = with_large_faces(&scene_of(vec![(mesh.clone(), vec![place])]));
        assert_watertight(&kernel, &mesh, &place, 1 << 18);
    }
    let kernel = with_large_faces(&one(mesh));
    let mut rays = axis_parallel_rays(9, kernel.prepared.origin);
    rays.extend(as_shadow_rays(&rays));
    assert_end_on_unit_cube(&kernel, &rays);
}

#[test]
fn closed_meshes_are_watertight() {
    const RAYS: usize = 1 << 18;
    let far = DAffine3::from_translation(DVec3::new(3.0, -2.0, 500.0));
    let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let cases = [
        (icosphere(1), DAffine3::IDENTITY),
        (icosphere(1), far),
        (cube(2), DAffine3::IDENTITY),
        (cube(1), turned),
        (cube(1), far * turned),
    ];
    for (mesh, place) in cases {
        let kernel = baked(&scene_of(vec![(mesh.clone(), vec![place])]));
        assert_watertight(&kernel, &mesh, &place, RAYS);
    }
}

/// Rays along an axis that meet vertices, edges and diagonals exactly: their edge functions are zeros of either sign.
#[test]
fn axis_parallel_rays_do_not_leak() {
    let kernel = baked(&one(cube(3)));
    let mut rays = axis_parallel_rays(11, kernel.prepared.origin);
    rays.extend(as_shadow_rays(&rays));
    assert_end_on_unit_cube(&kernel, &rays);
}

#[test]
fn invalid_rays_hit_nothing() {
    let kernel = baked(&one(icosphere(1)));
    let good = Ray::new(-kernel.prepared.origin, DVec3::new(0.3, 0.5, 0.7));
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(DVec3::splat);
    let mut rays: Vec<Ray> = bad.iter().map(|&origin| Ray { origin, ..good }).collect();
    rays.extend(bad.iter().map(|&direction| Ray { direction, ..good }));
    rays.extend([DVec3::ZERO, DVec3::splat(-0.0)].map(|direction| Ray { direction, ..good }));
    rays.extend([0.0, -1.0].map(|t_max| Ray { t_max, ..good }));
    rays.extend(as_shadow_rays(&rays));
    for (ray, hit) in rays.iter().zip(trace(&kernel, &rays)) {
        assert_eq!(hit.triangle, NO_TRIANGLE, "{ray:?}");
    }
    assert_ne!(trace(&kernel, &[good])[0].triangle, NO_TRIANGLE);
}

/// The same seed gives the same image with and without what is compiled in: only a path whose hit is rounded across an edge
/// may go another way.
#[test]
fn images_are_those_without() {
    if gpu::device().gpu.info.kind != DeviceKind::Cpu {
        return;
    }
    for name in ["cornell", "metallic_roughness", "instances"] {
        let scene = scene(name);
        let draw = |bake: bool| {
            let settings = Settings { max_bounces: Some(4), bake, ..gpu::settings(64, 64) };
            let mut tracer = gpu::path_tracer_on(TraceBackend::Bvh, &scene, &settings, BindingOverride::default());
            assert_eq!(tracer.key().baked.parts != 0, bake, "{name}");
            gpu::run(&mut tracer, 5, 1).film.radiance()
        };
        let (with, without) = (draw(true), draw(false));
        let differs = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3 * a[c].max(b[c]));
        let different = with.iter().zip(&without).filter(|(a, b)| differs((a, b))).count();
        println!("{name}: {different} of {} pixels differ", with.len());
        assert!(different * 200 < with.len(), "{name}: {different} of {} pixels differ", with.len());
        assert!(with.iter().flatten().any(|c| *c > 0.0), "{name} is black");
    }
}

/// What is met keeps its order, so large faces change no bit of an image, among alpha and instances neither: only a path that
/// ends on an edge between two of them may go on from the other.
#[test]
fn large_faces_do_not_change_an_image() {
    if gpu::device().gpu.info.kind != DeviceKind::Cpu {
        return;
    }
    for name in ["alpha", "instances", "volumes"] {
        let scene = in_a_room(scene(name));
        let draw = |bake: bool| {
            let settings = Settings { max_bounces: Some(4), bake, ..gpu::settings(48, 48) };
            let mut tracer = gpu::path_tracer_on(TraceBackend::Bvh, &scene, &settings, BindingOverride::default());
            assert_eq!(tracer.bake_report().parts.contains(&"large faces"), bake, "{name}");
            gpu::run(&mut tracer, 5, 1).film.radiance()
        };
        let (with, without) = (draw(true), draw(false));
        let different = with.iter().zip(&without).filter(|(a, b)| a != b).count();
        println!("{name}: {different} of {} pixels differ", with.len());
        assert!(different * 500 < with.len(), "{name}: {different} of {} pixels differ", with.len());
        assert!(with.iter().flatten().any(|c| *c > 0.0), "{name} is black");
    }
}

/// The kernel of a scene is the same every time, valid, and its specialisation too.
#[test]
fn kernels_are_valid_and_always_the_same() {
    let scene = scene("cornell");
    let (camera, settings) = (&scene.cameras[0], gpu::settings(16, 16));
    let prepared = prepare_scene(&scene, camera, &settings).expect("the scene fits");
    for spirv in embedded::PATH_TRACE[TraceBackend::Bvh as usize] {
        let make = || {
            let mut all = Bake::default();
            all.add_all(&prepared);
            all.apply(words(spirv))
        };
        let ((first, key), (second, other_key)) = (make(), make());
        assert_eq!(key.parts, 7);
        assert_eq!((&first, key), (&second, other_key));
        let form = sunfleck::gpu::ArrayForm::TexelBuffer;
        let mut kernel_key = KernelKey::new(&prepared, camera, &settings, TraceBackend::Bvh, (form, 31));
        kernel_key.baked = key;
        let values: Vec<_> = kernel_key.specialization().into_iter().chain([(0, 64)]).collect();
        let specialized = specialize(&first, &values).expect("understood");
        if validator_is_there() {
            assert_valid("baked", &bytes(&first));
            assert_valid("baked and specialised", &bytes(&specialized));
        }
    }
    assert_eq!(bake(&[1, 2, 3], &sunfleck::gpu::specialize::BakedScene::default()), None);
}

/// What the rule says.
#[test]
fn the_rule_says_why() {
    let info = &gpu::device().gpu.info;
    let prepare = |name| {
        let scene = scene(name);
        prepare_scene(&scene, &scene.cameras[0], &gpu::settings(16, 16)).expect("the scene fits")
    };
    let choose = |prepared: &_, trace, wanted| Bake::choose(prepared, info.kind, trace, wanted);
    let cornell = prepare("cornell");
    assert_eq!(choose(&cornell, TraceBackend::Bvh, false).reason, "--no-bake");
    if info.kind != DeviceKind::Cpu {
        assert_eq!(choose(&cornell, TraceBackend::Bvh, true).reason, "the device is no CPU");
        return;
    }
    assert!(choose(&cornell, TraceBackend::Bvh, true).has_geometry());
    assert!(!choose(&cornell, TraceBackend::RayQuery, true).has_geometry());
    let instances = choose(&prepare("instances"), TraceBackend::Bvh, true);
    assert!(!instances.has_geometry(), "{}", instances.reason);
    // A speck of 10⁻⁴ in a room of 2: distances across the room would not tell its sides from each other.
    let mut speck = scene("cornell");
    speck.meshes[0].primitives.push(rectangle(DVec3::ZERO, DVec3::X * 1e-4, DVec3::Y * 1e-4, 0));
    let speck = prepare_scene(&speck, &speck.cameras[0], &gpu::settings(16, 16)).expect("the scene fits");
    let speck = choose(&speck, TraceBackend::Bvh, true);
    assert!(!speck.has_geometry() && speck.reason.contains("4096th"), "{}", speck.reason);
}
