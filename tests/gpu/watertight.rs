//! No ray leaves a closed mesh, and a ray that is no ray hits nothing.

use crate::common::trace::{
    NO_TRIANGLE, Ray, cube, driver_leaks, icosphere, kernel, placements, rays_at_edges, scene_of, trace,
};
use glam::{DAffine3, DVec3};
use sunfleck::scene::Primitive;

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
