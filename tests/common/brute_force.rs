//! What a ray meets by a loop over all triangles in f64, and whether a hit in f32 is one that exact arithmetic allows.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use sunfleck::layout::NONE;

use super::kernel::TestKernel;
use super::trace::{Hit, NO_TRIANGLE, Ray, TriangleId, trace};

const ROUNDING: f64 = 1.0 / 16_777_216.0;

/// A triangle in rebased world space.
pub struct Triangle {
    pub id: TriangleId,
    pub vertices: [DVec3; 3],
    /// Condition number of the instance's matrix: by how much more the rounding of a ray counts there.
    pub condition: f64,
}

pub fn world_triangles(kernel: &TestKernel) -> Vec<Triangle> {
    let prepared = &kernel.prepared;
    let vertices = |slot: u32| prepared.triangle(slot).vertices.map(|v| Vec3::from(v).as_dvec3());
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
pub struct Meeting {
    pub t: f64,
    /// Least distance from an edge, negative outside.
    pub margin: f64,
    /// Bound on how far the f32 test is off across the ray: by which side of an edge it passes.
    pub error: f64,
    /// Bound on the distance between the f32 hit and the exact one, along the ray and in the triangle.
    pub hit_error: f64,
    pub barycentric: [f64; 2],
}

/// Möller and Trumbore 1997, in f64. The f32 test subtracts the origin from the vertices and shears them (a handful of
/// roundings of coordinates relative to the origin); a hit at a grazing angle moves by the inverse cosine of that. An
/// instance's ray is rounded in object space, which counts as much as its matrix is badly conditioned.
///
/// Whether the ray passes is decided as if the sheared vertices were each off by that much (the signs of the edge functions
/// are exact for them), so every edge moves by no more. Where it passes is the quotient of an edge function, off by that much
/// times the longest edge L, and of the determinant, twice the projected area: the weights are off by error · L / 2A, and the
/// point by L times that. L²/2A is 1.15 for an equilateral triangle and as large as a sliver is long for its width.
pub fn meet(ray: &Ray, triangle: &Triangle) -> Option<Meeting> {
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
    let longest = [ab, ac, c - b].iter().map(|edge| edge.length_squared()).fold(0.0, f64::max);
    let hit_error = error * (longest / normal.length()).max(1.0);
    let margin = margins.into_iter().fold(f64::INFINITY, f64::min);
    Some(Meeting { t, margin, error, hit_error, barycentric: [u, v] })
}

/// Asserts that the hit is one that exact arithmetic allows: where it says, and with nothing certain in front of it.
pub fn check(triangles: &[Triangle], ray: &Ray, hit: &Hit) {
    let context = || format!("{ray:?}: {hit:?}");
    let length = ray.direction.length();
    let candidates: Vec<(&Triangle, Meeting)> = triangles
        .iter()
        .filter(|t| t.id != ray.from && t.id != ray.towards)
        .filter_map(|t| meet(ray, t).map(|m| (t, m)))
        .filter(|(_, m)| {
            m.margin > -m.error && m.t * length > -m.hit_error && (m.t - f64::from(ray.t_max)) * length < m.hit_error
        })
        .collect();
    let certain = |m: &Meeting| {
        m.margin > m.error && m.t * length > m.hit_error && (f64::from(ray.t_max) - m.t) * length > m.hit_error
    };
    let mut nearest_allowed = f64::INFINITY;
    if hit.triangle != NO_TRIANGLE {
        let own = candidates.iter().find(|(t, _)| t.id == hit.triangle);
        let (triangle, own) = own.unwrap_or_else(|| panic!("that triangle is not there: {}", context()));
        assert!((hit.t - own.t).abs() * length <= own.hit_error, "t is {}: {}", own.t, context());
        let [a, b, c] = triangle.vertices;
        let [u, v] = [0, 1].map(|i| hit.barycentric[i] - own.barycentric[i]);
        assert!(((b - a) * u + (c - a) * v).length() <= own.hit_error, "{:?}: {}", own.barycentric, context());
        nearest_allowed = own.t * length - own.hit_error;
    }
    if ray.any_hit && hit.triangle != NO_TRIANGLE {
        return;
    }
    for (triangle, m) in candidates.iter().filter(|(_, m)| certain(m)) {
        let missed = m.t * length + m.hit_error < nearest_allowed;
        assert!(!missed, "{:?} at {} was missed: {}", triangle.id, m.t, context());
    }
}

/// The hits of the rays are those of the loop, and again with the nearest triangle left out at the start or at the end, or
/// with an end before or behind it. Returns how many rays hit something.
pub fn assert_agrees(kernel: &TestKernel, rays: &[Ray]) -> usize {
    let triangles = world_triangles(kernel);
    let hits = trace(kernel, rays);
    rays.iter().zip(&hits).for_each(|(ray, hit)| check(&triangles, ray, hit));
    let mut again = rays.to_vec();
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
    let second = trace(kernel, &again);
    again.iter().zip(&second).for_each(|(ray, hit)| check(&triangles, ray, hit));
    for ((ray, first), second) in again.iter().zip(&hits).zip(&second).filter(|(t, _)| t.1.triangle != NO_TRIANGLE) {
        let same = first.triangle == second.triangle;
        let excluded = ray.from == first.triangle || ray.towards == first.triangle || ray.t_max < first.t as f32;
        assert!(!(same && excluded), "{ray:?}: {second:?}");
    }
    hits.iter().filter(|hit| hit.triangle != NO_TRIANGLE).count()
}
