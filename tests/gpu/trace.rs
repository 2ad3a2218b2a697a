//! The trace interface, in the back end under test, against a loop over all triangles in f64.

use crate::common::kernel::{Random, TestKernel};
use crate::common::trace::{Hit, NO_TRIANGLE, Ray, TriangleId, icosphere, kernel, placements, scene_of, trace};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use sunfleck::layout::{LeafSlot, NONE, SceneArray};
use sunfleck::scene::{Primitive, Scene};

const ROUNDING: f64 = 1.0 / 16_777_216.0;

/// A triangle in rebased world space.
struct Triangle {
    id: TriangleId,
    vertices: [DVec3; 3],
    /// Condition number of the instance's matrix: by how much more the rounding of a ray counts there.
    condition: f64,
}

fn world_triangles(kernel: &TestKernel) -> Vec<Triangle> {
    let prepared = &kernel.prepared;
    let slots = &prepared.arrays[SceneArray::Slots as usize];
    let vertices = |slot: u32| {
        let leaf: LeafSlot = bytemuck::pod_collect_to_vec(&slots[3 * slot as usize..3 * slot as usize + 3])[0];
        leaf.vertices.map(|v| Vec3::from(v).as_dvec3())
    };
    let baked = prepared.triangle_slots(&prepared.meshes[0]);
    let mut all: Vec<Triangle> =
        baked.map(|slot| Triangle { id: [slot, NONE], vertices: vertices(slot), condition: 0.0 }).collect();
    for (i, instance) in prepared.instances.iter().enumerate() {
        let [x, y, z] = instance.record.object_to_world.map(|row| row.map(f64::from));
        let matrix =
            DMat3::from_cols_array_2d(&[[x[0], x[1], x[2]], [y[0], y[1], y[2]], [z[0], z[1], z[2]]]).transpose();
        let transform = DAffine3::from_mat3_translation(matrix, DVec3::new(x[3], y[3], z[3]));
        let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let condition = norm(matrix) * norm(matrix.inverse());
        all.extend(prepared.triangle_slots(&prepared.meshes[instance.mesh]).map(|slot| Triangle {
            id: [slot, i as u32],
            vertices: vertices(slot).map(|v| transform.transform_point3(v)),
            condition,
        }));
    }
    all
}

/// Where a ray meets a triangle's plane: t, how far inside of the edges, and how far off both may be by rounding.
struct Meeting {
    t: f64,
    /// Least distance from an edge, negative outside.
    margin: f64,
    /// Bound on the distance between the f32 hit and the exact one, along the ray or across it.
    error: f64,
    barycentric: [f64; 2],
}

/// Möller and Trumbore 1997, in f64. The f32 test subtracts the origin from the vertices and shears them (a handful of
/// roundings of coordinates relative to the origin); a hit at a grazing angle moves by the inverse cosine of that. An
/// instance's ray is rounded in object space, which counts as much as its matrix is badly conditioned.
fn meet(ray: &Ray, triangle: &Triangle) -> Option<Meeting> {
    let [a, b, c] = triangle.vertices;
    let (ab, ac) = (b - a, c - a);
    let p = ray.direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = ray.origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = ray.direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    let normal = ab.cross(ac);
    let altitude = |edge: DVec3| normal.length() / edge.length();
    let margins = [u * altitude(ac), v * altitude(ab), (1.0 - u - v) * altitude(c - b)];
    let length = ray.direction.length();
    let cosine = (normal.dot(ray.direction) / (normal.length() * length)).abs();
    let reach = [a, b, c].iter().map(|v| (*v - ray.origin).length()).fold(0.0, f64::max);
    let world = ray.origin.length() + reach;
    let error = ROUNDING * (24.0 * reach + 16.0 * triangle.condition * world) / cosine;
    Some(Meeting { t, margin: margins.into_iter().fold(f64::INFINITY, f64::min), error, barycentric: [u, v] })
}

/// Asserts that the hit is one that exact arithmetic allows: where it says, and with nothing certain in front of it.
fn check(triangles: &[Triangle], ray: &Ray, hit: &Hit) {
    let context = || format!("{ray:?}: {hit:?}");
    let length = ray.direction.length();
    let candidates: Vec<(&Triangle, Meeting)> = triangles
        .iter()
        .filter(|t| t.id != ray.from && t.id != ray.towards)
        .filter_map(|t| meet(ray, t).map(|m| (t, m)))
        .filter(|(_, m)| {
            m.margin > -m.error && m.t * length > -m.error && (m.t - f64::from(ray.t_max)) * length < m.error
        })
        .collect();
    let certain =
        |m: &Meeting| m.margin > m.error && m.t * length > m.error && (f64::from(ray.t_max) - m.t) * length > m.error;
    let mut nearest_allowed = f64::INFINITY;
    if hit.triangle != NO_TRIANGLE {
        let own = candidates.iter().find(|(t, _)| t.id == hit.triangle);
        let (triangle, own) = own.unwrap_or_else(|| panic!("that triangle is not there: {}", context()));
        assert!((hit.t - own.t).abs() * length <= own.error, "t is {}: {}", own.t, context());
        let [a, b, c] = triangle.vertices;
        let [u, v] = [0, 1].map(|i| hit.barycentric[i] - own.barycentric[i]);
        assert!(((b - a) * u + (c - a) * v).length() <= own.error, "{:?}: {}", own.barycentric, context());
        nearest_allowed = own.t * length - own.error;
    }
    if ray.any_hit && hit.triangle != NO_TRIANGLE {
        return;
    }
    for (triangle, m) in candidates.iter().filter(|(_, m)| certain(m)) {
        let missed = m.t * length + m.error < nearest_allowed;
        assert!(!missed, "{:?} at {} was missed: {}", triangle.id, m.t, context());
    }
}

/// Random triangles, some of them slivers, some in pairs that share an edge.
fn soup(random: &mut Random, pairs: usize) -> Primitive {
    let mut soup = Primitive::default();
    for _ in 0..pairs {
        let at = random.point(2.0);
        let width = 10.0_f64.powf(random.between(-5.0, 0.0));
        let corners = [at, at + random.direction(), at + width * random.direction(), at + 0.5 * random.direction()];
        let first = soup.positions.len() as u32;
        soup.positions.extend(corners.map(|v| v.as_vec3().to_array()));
        soup.triangles.extend([[first, first + 1, first + 2], [first + 1, first, first + 3]]);
    }
    soup
}

fn random_scene() -> Scene {
    let mut random = Random(21);
    scene_of(vec![
        (soup(&mut random, 120), vec![DAffine3::IDENTITY]),
        (soup(&mut random, 30), placements()),
        (icosphere(1), placements().into_iter().rev().take(2).collect()),
    ])
}

fn random_rays(count: usize, origin: DVec3) -> Vec<Ray> {
    let mut random = Random(22);
    let mut ray = |i: usize| {
        let mut direction = random.direction();
        // Some run along an axis or a plane; lengths differ.
        if i.is_multiple_of(7) {
            direction.x = 0.0;
        }
        if i.is_multiple_of(21) {
            direction = DVec3::Y * direction.y.signum();
        }
        Ray::new(random.point(3.0) - origin, direction * 10.0_f64.powf(random.between(-3.0, 3.0)))
    };
    (0..count).map(&mut ray).collect()
}

#[test]
fn hits_agree_with_brute_force() {
    let kernel = kernel(&random_scene());
    let triangles = world_triangles(&kernel);
    assert!(triangles.len() > 500 && kernel.prepared.instances.len() == 6);
    let rays = random_rays(8192, kernel.prepared.origin);
    let hits = trace(&kernel, &rays);
    rays.iter().zip(&hits).for_each(|(ray, hit)| check(&triangles, ray, hit));
    let found = hits.iter().filter(|hit| hit.triangle != NO_TRIANGLE).count();
    assert!(found > rays.len() / 8, "only {found} rays hit anything");

    // The same with the nearest triangle left out at the start or at the end, or with an end before or behind it.
    let mut again = rays.clone();
    for (i, (ray, hit)) in again.iter_mut().zip(&hits).enumerate() {
        match i % 5 {
            0 => ray.from = hit.triangle,
            // A ray ends at the triangle that it aims at.
            1 => (ray.towards, ray.t_max) = (hit.triangle, (hit.t as f32).next_up()),
            2 => ray.t_max = (hit.t * 0.99) as f32,
            3 => (ray.t_max, ray.any_hit) = ((hit.t * 1.01) as f32, true),
            _ => (ray.from, ray.any_hit) = (hit.triangle, true),
        }
    }
    let second = trace(&kernel, &again);
    again.iter().zip(&second).for_each(|(ray, hit)| check(&triangles, ray, hit));
    for ((ray, first), second) in again.iter().zip(&hits).zip(&second).filter(|(t, _)| t.1.triangle != NO_TRIANGLE) {
        let same = first.triangle == second.triangle;
        let excluded = ray.from == first.triangle || ray.towards == first.triangle || ray.t_max < first.t as f32;
        assert!(!(same && excluded), "{ray:?}: {second:?}");
    }
}

/// The comparison is not blind: a hit that is moved, taken away or given to another triangle is noticed.
#[test]
fn wrong_hits_are_noticed() {
    let kernel = kernel(&random_scene());
    let triangles = world_triangles(&kernel);
    let rays = random_rays(64, kernel.prepared.origin);
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
