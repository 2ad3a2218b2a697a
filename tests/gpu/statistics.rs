//! Counters against counts by hand: how many rays of which kind, and what their searches visit.

use glam::DVec3;

use crate::common::builder::{camera, rectangle, scene};
use crate::common::gpu;
use crate::common::scenes::{scene as scene_file, short_form};
use sunfleck::film::aov::Aov;
use sunfleck::gpu::{DeviceKind, TraceBackend};
use sunfleck::layout::{InnerSlot, LeafSlot, SLOT_INNER, SceneArray};
use sunfleck::prepare::Prepared;
use sunfleck::render::{BindingOverride, Run, Settings, Statistics};
use sunfleck::scene::{Camera, Environment, Material, Primitive, Projection, PunctualKind, PunctualLight, Scene};

fn counted(width: u32, height: u32) -> Settings {
    Settings { statistics: true, ..gpu::settings(width, height) }
}

fn run(scene: &Scene, settings: &Settings, spp: u32) -> Run {
    gpu::run(&mut gpu::path_tracer(scene, settings), 1, spp)
}

fn statistics(run: &Run) -> &Statistics {
    run.statistics.as_ref().expect("the settings ask for them")
}

fn counts_visits() -> bool {
    gpu::device().trace == TraceBackend::Bvh
}

/// An orthographic camera over the square from −side/2 to side/2, looking down −z from 4.
fn pixel_camera(side: f64) -> Camera {
    let projection = Projection::Orthographic { ymag: 0.5 * side };
    Camera { projection, ..camera(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 1.0) }
}

/// A flat grid of squares of 2 in the plane z = 0 on a square of `side`, one colour.
fn tiles(side: u32) -> Vec<Primitive> {
    let corner = |i: u32| -0.5 * f64::from(side) + 2.0 * f64::from(i);
    (0..side / 2)
        .flat_map(|y| (0..side / 2).map(move |x| (x, y)))
        .map(|(x, y)| rectangle(DVec3::new(corner(x), corner(y), 0.0), DVec3::X * 2.0, DVec3::Y * 2.0, 0))
        .collect()
}

/// Nodes and triangles.
struct Visits {
    nodes: u64,
    triangles: u64,
}

/// What a ray along z through (x, y) visits, counted from the boxes alone: everything is in one plane, so no hit hides a
/// box, and the order in which they are visited does not matter.
fn visits(prepared: &Prepared, x: f64, y: f64) -> Visits {
    let slots = &prepared.arrays[SceneArray::Slots as usize];
    let words = |slot: u32| -> [u32; 12] {
        bytemuck::cast([slots[3 * slot as usize], slots[3 * slot as usize + 1], slots[3 * slot as usize + 2]])
    };
    let mut found = Visits { nodes: 0, triangles: 0 };
    let mut pending = vec![prepared.constants.root_slot];
    while let Some(slot) = pending.pop() {
        let words = words(slot);
        if words[11] != SLOT_INNER {
            let LeafSlot { vertices } = bytemuck::cast(words);
            found.triangles += if vertices[3] == vertices[0] { 1 } else { 2 };
            continue;
        }
        found.nodes += 1;
        let inner: InnerSlot = bytemuck::cast(words);
        for child in 0..4 {
            let byte = |word: u32| f64::from((word >> (8 * child)) & 255);
            let holds = |axis: usize, point: f64| {
                let step = f64::from(f32::from_bits(((inner.exponents >> (8 * axis)) & 255) << 23));
                let origin = f64::from(inner.origin[axis]);
                (origin + byte(inner.lower[axis]) * step..=origin + byte(inner.upper[axis]) * step).contains(&point)
            };
            if holds(0, x) && holds(1, y) {
                pending.push(4 * inner.child_group + child);
            }
        }
    }
    found
}

/// Every pixel sees its rays through the same boxes: their sides lie on the grid of half pixels, since the steps of the quantised
/// boxes are powers of two.
#[test]
fn visits_agree_with_a_count_by_hand() {
    if !counts_visits() {
        eprintln!("not run: what ray queries visit cannot be counted");
        return;
    }
    const SIDE: u32 = 16;
    let materials = vec![Material::lambertian("tile", [0.5; 3])];
    let scene = scene(tiles(SIDE), materials, pixel_camera(f64::from(SIDE)));
    let settings = Settings { max_bounces: Some(0), bake: false, aovs: vec![Aov::Cost], ..counted(SIDE, SIDE) };
    let (prepared, _) = gpu::prepared(&scene, &settings);
    let run = run(&scene, &settings, 16);
    let cost = run.aovs.as_ref().and_then(|aovs| aovs.means(Aov::Cost, &run.film)).expect("it is kept").remove(0);
    let (mut nodes, mut triangles) = (0, 0);
    for (pixel, &cost) in (0..SIDE * SIDE).zip(&cost) {
        // Not the middle, through which an edge may go: the side that a box has there is not the pixel's.
        let (column, row) = (f64::from(pixel % SIDE) + 0.4, f64::from(pixel / SIDE) + 0.3);
        let half = 0.5 * f64::from(SIDE);
        let rebased = DVec3::new(column - half, half - row, 0.0) - prepared.origin;
        let by_hand = visits(&prepared, rebased.x, rebased.y);
        assert_eq!(cost, (by_hand.nodes + by_hand.triangles) as f64, "pixel {pixel}");
        nodes += 16 * by_hand.nodes;
        triangles += 16 * by_hand.triangles;
    }
    let statistics = statistics(&run);
    assert_eq!((statistics.camera.nodes, statistics.camera.triangles), (nodes, triangles));
    assert_eq!((statistics.camera.rays, statistics.all().rays), (256 * 16, run.rays));
    assert!(nodes > 256 * 16, "more than the root is visited: {nodes}");
}

/// A wall that fills the view, and a point light in front of it: at one scattering event each sample sends a ray from the
/// camera, one to the light, and one that goes on into the dark.
#[test]
fn rays_are_counted_by_their_kind() {
    let wall = rectangle(DVec3::new(-5.0, -5.0, 0.0), DVec3::X * 10.0, DVec3::Y * 10.0, 0);
    let mut scene = scene(vec![wall], vec![Material::lambertian("wall", [0.5; 3])], pixel_camera(4.0));
    scene.lights.push(PunctualLight {
        name: String::from("lamp"),
        kind: PunctualKind::Point,
        intensity: [1.0; 3],
        position: DVec3::new(0.0, 0.0, 3.0),
        direction: DVec3::NEG_Z,
    });
    for bake in [false, true] {
        let run = run(&scene, &Settings { max_bounces: Some(1), bake, ..counted(8, 8) }, 20);
        let (statistics, samples) = (statistics(&run), 64 * 20);
        // Only CPU devices are given small scenes.
        let bakes = bake && gpu::device().gpu.info.kind == DeviceKind::Cpu;
        let rays = [statistics.camera.rays, statistics.shadow.rays, statistics.scattered.rays];
        assert_eq!(rays, [samples; 3], "compiled in: {bake}");
        assert_eq!(statistics.all().rays, run.rays);
        if counts_visits() {
            // A root above one leaf of two triangles; compiled in, there are the triangles alone. Whether a scattered ray looks into
            // the flat box that it leaves is decided by rounding.
            assert_eq!(statistics.camera.triangles, 2 * samples, "compiled in: {bake}");
            assert_eq!(statistics.all().nodes, if bakes { 0 } else { 3 * samples });
            assert!(statistics.all().triangles <= 6 * samples);
            assert!(!bakes || statistics.all().triangles == 6 * samples);
        } else {
            assert!(statistics.report().rays.iter().all(|kind| kind.nodes.is_none() && kind.triangles.is_none()));
        }
    }
}

/// In scenes of every kind, the parts add up, and budgets and slices do not change a count.
#[test]
fn counts_add_up_and_do_not_depend_on_slices() {
    let cost = if counts_visits() { vec![Aov::Cost] } else { Vec::new() };
    for name in if short_form() { &["cornell"][..] } else { &["cornell", "instances", "alpha"] } {
        let scene = scene_file(name);
        let settings = Settings { aovs: cost.clone(), ..counted(40, 30) };
        let of = |overrides: BindingOverride| gpu::run(&mut gpu::path_tracer_with(&scene, &settings, overrides), 2, 24);
        let run = of(BindingOverride::default());
        let statistics = statistics(&run);
        let all = statistics.all();
        assert_eq!(all.rays, run.rays, "{name}");
        // A ray a path, and in the pixels that see a lamp emission rays for each of their 24 samples.
        let beyond = statistics.camera.rays - run.paths;
        assert!(beyond.is_multiple_of(2 * 24) && (beyond > 0 || *name != "cornell"), "{name}: {beyond}");
        if let Some(cost) = run.aovs.as_ref().and_then(|aovs| aovs.means(Aov::Cost, &run.film)) {
            let sum: f64 =
                cost[0].iter().zip(run.film.pixels()).map(|(mean, pixel)| mean * f64::from(pixel.count)).sum();
            assert_eq!(sum.round(), (all.nodes + all.triangles) as f64, "{name}");
        }
        let cut = of(BindingOverride { slice_atoms: Some(1000), ray_budget: Some(7), ..BindingOverride::default() });
        let other = cut.statistics.as_ref().expect("asked for");
        assert_eq!(
            (statistics.camera, statistics.scattered, statistics.shadow),
            (other.camera, other.scattered, other.shadow),
            "{name}"
        );
        // Two blocks of 40 × 32 atoms, 1000 a slice.
        assert_eq!(other.slice_seconds.len(), 3, "{name}");
        assert!(other.dispatches > other.slice_seconds.len() as u64, "paths are longer than 7 rays in {name}");
    }
}

/// Vectors cannot be fuller than full, nor empty, and a scene in which all lanes do the same has full ones: in slices of one
/// workgroup, where no other thread takes a part of the atoms that a vector could have.
#[test]
fn occupancy_is_a_share() {
    let settings = Settings { bake: false, ..counted(64, 64) };
    let one_workgroup =
        BindingOverride { slice_atoms: Some(64), workgroup_size: Some(64), ..BindingOverride::default() };
    let spheres = run(&scene_file("cornell_spheres"), &settings, 16);
    let statistics = statistics(&spheres);
    for occupancy in [statistics.search, statistics.shading] {
        let share = occupancy.share().expect("something ran");
        assert!(share > 0.05 && share <= 1.0, "{share}");
    }
    // A wall that no ray meets, and a black one that every ray does.
    for (corner, size, shading) in [(100.0, 1.0, None), (-4.0, 8.0, Some(1.0))] {
        let wall = rectangle(DVec3::new(corner, corner, 0.0), DVec3::X * size, DVec3::Y * size, 0);
        let mut alike = scene(vec![wall], vec![Material::lambertian("wall", [0.0; 3])], pixel_camera(4.0));
        alike.environment = Environment::Constant([1.0; 3]);
        let run = gpu::run(&mut gpu::path_tracer_with(&alike, &settings, one_workgroup), 1, 16);
        let report = run.statistics.expect("asked for").report();
        assert_eq!((report.search_occupancy, report.shading_occupancy), (Some(1.0), shading), "{report:?}");
    }
}
