//! No ray leaves a closed mesh, and a ray that is no ray hits nothing.

use crate::common::gpu;
use crate::common::kernel::Random;
use crate::common::trace::{NO_TRIANGLE, Ray, cube, icosphere, kernel, placements, scene_of, trace};
use glam::{DAffine3, DVec3, Vec3};
use sunfleck::gpu::{DeviceKind, TraceBackend};
use sunfleck::scene::Primitive;

/// Rays from inside a mesh of the given placement at its vertices and at points of its edges, the rest anywhere.
fn rays_at_edges(mesh: &Primitive, place: &DAffine3, origin: DVec3, count: usize) -> Vec<Ray> {
    let mut random = Random(23);
    let corner = |i: u32| Vec3::from(mesh.positions[i as usize]).as_dvec3();
    let mut ray = |i: usize| {
        let [a, b, c] = mesh.triangles[random.below(mesh.triangles.len())].map(corner);
        let target = match i % 4 {
            0 => a,
            1 => 0.5 * (b + c),
            2 => b.lerp(c, random.unit()),
            _ => a.lerp(b, random.unit()).lerp(c, random.unit()),
        };
        let world = |p: DVec3| (place.transform_point3(p) - origin).as_vec3();
        let (from, to) = (world(random.point(0.4)), world(target));
        let direction = (to - from).as_dvec3();
        Ray::new(from.as_dvec3(), if i.is_multiple_of(3) { direction } else { direction.normalize() })
    };
    (0..count).map(&mut ray).collect()
}

/// A software driver's ray query (lavapipe 25: 0.4 % of the rays that are aimed at edges) misses where a box test rounds; our
/// own traversal does not, and is what such a device renders with. Hardware must be watertight.
fn driver_leaks() -> bool {
    let device = gpu::device();
    let leaks = device.trace == TraceBackend::RayQuery && device.gpu.info.kind == DeviceKind::Cpu;
    if leaks {
        eprintln!("skipped: the ray query of a software driver is not watertight");
    }
    leaks
}

#[test]
fn closed_meshes_are_watertight() {
    const RAYS: usize = 1 << 18;
    if driver_leaks() {
        return;
    }
    let far = DAffine3::from_translation(DVec3::new(3.0, -2.0, 500.0));
    let turned = placements()[0];
    // Two placements keep a mesh an instance; the second is out of the way.
    let aside = DAffine3::from_translation(DVec3::splat(50.0));
    let cases: [(Primitive, Vec<DAffine3>); 4] = [
        (icosphere(4), vec![DAffine3::IDENTITY]),
        (cube(12), vec![DAffine3::IDENTITY]),
        (icosphere(3), vec![far]),
        (cube(6), vec![turned, aside]),
    ];
    for (mesh, places) in cases {
        let kernel = kernel(&scene_of(vec![(mesh.clone(), places.clone())]));
        let mut rays = rays_at_edges(&mesh, &places[0], kernel.prepared.origin, RAYS);
        // Half of them as shadow rays.
        rays.iter_mut().skip(RAYS / 2).for_each(|ray| ray.any_hit = true);
        let hits = trace(&kernel, &rays);
        let leaks: Vec<&Ray> =
            rays.iter().zip(&hits).filter(|(_, hit)| hit.triangle == NO_TRIANGLE).map(|(ray, _)| ray).collect();
        assert!(leaks.is_empty(), "{} of {RAYS} rays leave {places:?}: {:?}", leaks.len(), leaks[0]);
    }
}

/// Rays along an axis that meet the vertices and edges of a cube's grid exactly.
#[test]
fn axis_parallel_rays_do_not_leak() {
    let kernel = kernel(&scene_of(vec![(cube(8), vec![DAffine3::IDENTITY])]));
    let grid = |i: usize| [i % 15, i / 15 % 15, i / 225].map(|k| (k as f64 - 7.0) / 8.0);
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let from = |i| DVec3::from(grid(i)) - kernel.prepared.origin;
    let rays: Vec<Ray> = (0..15 * 15 * 15).flat_map(|i| axes.map(|axis| Ray::new(from(i), axis))).collect();
    for (ray, hit) in rays.iter().zip(trace(&kernel, &rays)) {
        assert!(hit.triangle != NO_TRIANGLE, "{ray:?} leaks");
        let end = (ray.origin + ray.direction * hit.t + kernel.prepared.origin).dot(ray.direction);
        assert!((end - 1.0).abs() < 1e-6, "{ray:?} ends at {end}");
    }
}

/// A ray that is no ray hits nothing, whatever the back end would make of it.
#[test]
fn invalid_rays_hit_nothing() {
    let kernel = kernel(&scene_of(vec![(icosphere(1), vec![DAffine3::IDENTITY])]));
    let good = Ray::new(-kernel.prepared.origin, DVec3::new(0.3, 0.5, 0.7));
    let mut rays = Vec::new();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let spoil = |v: DVec3| DVec3::select(axis.cmpgt(DVec3::ZERO), DVec3::splat(bad), v);
            rays.push(Ray { origin: spoil(good.origin), ..good });
            rays.push(Ray { direction: spoil(good.direction), ..good });
        }
        rays.push(Ray { direction: DVec3::splat(bad), origin: DVec3::splat(bad), ..good });
    }
    rays.push(Ray { direction: DVec3::ZERO, ..good });
    rays.push(Ray { direction: DVec3::splat(-0.0), ..good });
    rays.push(Ray { direction: DVec3::new(1e-40, -1e-42, 1e-45), ..good });
    rays.extend([0.0, -1.0].map(|t_max| Ray { t_max, ..good }));
    let any: Vec<Ray> = rays.iter().map(|ray| Ray { any_hit: true, ..*ray }).collect();
    rays.extend(any);
    for (ray, hit) in rays.iter().zip(trace(&kernel, &rays)) {
        assert_eq!(hit.triangle, NO_TRIANGLE, "{ray:?}");
    }
    // A denormal origin is as good as zero.
    let denormal = Ray { origin: good.origin + DVec3::splat(1e-40), ..good };
    for hit in trace(&kernel, &[good, denormal]) {
        assert_ne!(hit.triangle, NO_TRIANGLE);
    }
}
