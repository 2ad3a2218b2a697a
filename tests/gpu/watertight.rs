//! No ray leaves a closed mesh, and a ray that is no ray hits nothing.

use crate::common::trace::{
    NO_TRIANGLE, Ray, as_shadow_rays, assert_end_on_unit_cube, assert_watertight, axis_parallel_rays, cube,
    driver_leaks, icosphere, kernel, placements, scene_of, trace,
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
        assert_watertight(&kernel, &mesh, &places[0], RAYS);
    }
}

/// Rays along an axis that meet the vertices and edges of a cube's grid exactly.
#[test]
fn axis_parallel_rays_do_not_leak() {
    let kernel = kernel(&scene_of(vec![(cube(8), vec![DAffine3::IDENTITY])]));
    assert_end_on_unit_cube(&kernel, &axis_parallel_rays(15, kernel.prepared.origin));
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
    rays.extend(as_shadow_rays(&rays));
    for (ray, hit) in rays.iter().zip(trace(&kernel, &rays)) {
        assert_eq!(hit.triangle, NO_TRIANGLE, "{ray:?}");
    }
    // A denormal origin is as good as zero.
    let denormal = Ray { origin: good.origin + DVec3::splat(1e-40), ..good };
    for hit in trace(&kernel, &[good, denormal]) {
        assert_ne!(hit.triangle, NO_TRIANGLE);
    }
}
