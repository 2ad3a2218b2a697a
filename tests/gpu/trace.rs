//! The trace interface, in the back end under test, against a loop over all triangles in f64.

use crate::common::brute_force::{assert_agrees, check, meet, world_triangles};
use crate::common::gpu;
use crate::common::kernel::Random;
use crate::common::scenes::scene;
use crate::common::trace::{Hit, NO_TRIANGLE, icosphere, kernel, placements, random_rays, scene_of, soup, trace};
use glam::DAffine3;
use sunfleck::gpu::TraceBackend;
use sunfleck::layout::NONE;
use sunfleck::render::{BindingOverride, Settings};
use sunfleck::scene::Scene;

fn random_scene() -> Scene {
    let mut random = Random(21);
    scene_of(vec![
        (soup(&mut random, 120), vec![DAffine3::IDENTITY]),
        (soup(&mut random, 30), placements()),
        (icosphere(1), placements().into_iter().rev().take(2).collect()),
    ])
}

#[test]
fn hits_agree_with_brute_force() {
    let kernel = kernel(&random_scene());
    assert!(world_triangles(&kernel).len() > 500 && kernel.prepared.instances.len() == 6);
    let rays = random_rays(Random(22), 8192, kernel.prepared.origin);
    let found = assert_agrees(&kernel, &rays);
    assert!(found > rays.len() / 8, "only {found} rays hit anything");
}

/// The comparison is not blind: a hit that is moved, taken away or given to another triangle is noticed.
#[test]
fn wrong_hits_are_noticed() {
    let kernel = kernel(&random_scene());
    let triangles = world_triangles(&kernel);
    let rays = random_rays(Random(22), 64, kernel.prepared.origin);
    let hits = trace(&kernel, &rays);
    let (ray, hit) = rays
        .iter()
        .zip(&hits)
        .find(|(ray, hit)| hit.triangle != NO_TRIANGLE && hit.triangle[1] == NONE && ray.direction.x != 0.0)
        .expect("a hit");
    let other = triangles.iter().find(|t| meet(ray, t).is_some_and(|m| m.margin < -0.1)).expect("a miss").id;
    let wrong = [
        Hit { t: hit.t * 1.001, ..*hit },
        Hit { triangle: NO_TRIANGLE, ..*hit },
        Hit { triangle: other, ..*hit },
        Hit { barycentric: [hit.barycentric[1] + 0.01, hit.barycentric[0]], ..*hit },
    ];
    for hit in wrong {
        assert!(std::panic::catch_unwind(|| check(&triangles, ray, &hit)).is_err(), "{hit:?}");
    }
}

/// Where rays are traced by ray query: both back ends find the same points, so that the same seed gives the same image. Only
/// a path whose hit is rounded across an edge or a lobe's choice may go another way.
#[test]
fn back_ends_draw_the_same_image() {
    if gpu::device().trace != TraceBackend::RayQuery {
        return;
    }
    for name in ["instances", "alpha", "metallic_roughness", "cornell"] {
        let scene = scene(name);
        let settings = Settings { max_bounces: Some(3), ..gpu::settings(64, 64) };
        let draw = |trace| {
            let mut tracer = gpu::path_tracer_on(trace, &scene, &settings, BindingOverride::default());
            gpu::run(&mut tracer, 5, 1).film.radiance()
        };
        let (bvh, queries) = (draw(TraceBackend::Bvh), draw(TraceBackend::RayQuery));
        let differs = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3 * a[c].max(b[c]));
        let different = bvh.iter().zip(&queries).filter(|(a, b)| differs((a, b))).count();
        println!("{name}: {different} of {} pixels differ", bvh.len());
        assert!(different * 100 < bvh.len(), "{name}: {different} of {} pixels differ", bvh.len());
        assert!(bvh.iter().flatten().any(|c| *c > 0.0), "{name} is black");
    }
}
