//! The trace interface, in the back end under test, against a loop over all triangles in f64; and no ray leaves a closed
//! mesh.

mod common;

use common::gpu;
use common::kernel::{Random, TestKernel, empty_scene, floats, vector_texel};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use sunfleck::layout::{LeafSlot, NONE, SceneArray};
use sunfleck::scene::{Instance, Material, Mesh, Primitive, Scene};

const ROUNDING: f64 = 1.0 / 16_777_216.0;

/// A slot and its instance.
type TriangleId = [u32; 2];
const NO_TRIANGLE: TriangleId = [NONE; 2];

#[derive(Clone, Copy, Debug)]
struct Ray {
    origin: DVec3,
    direction: DVec3,
    t_max: f32,
    any_hit: bool,
    from: TriangleId,
    towards: TriangleId,
}

impl Ray {
    /// Rounded to f32 as the shader gets it.
    fn new(origin: DVec3, direction: DVec3) -> Self {
        let round = |v: DVec3| v.as_vec3().as_dvec3();
        let (origin, direction) = (round(origin), round(direction));
        Self { origin, direction, t_max: f32::INFINITY, any_hit: false, from: NO_TRIANGLE, towards: NO_TRIANGLE }
    }

    fn texels(&self) -> [[u32; 4]; 3] {
        let [a, b] = self.from;
        let [c, d] = self.towards;
        [
            vector_texel(self.origin, self.t_max.to_bits()),
            vector_texel(self.direction, u32::from(self.any_hit)),
            [a, b, c, d],
        ]
    }
}

#[derive(Clone, Copy, Debug)]
struct Hit {
    triangle: TriangleId,
    t: f64,
    barycentric: [f64; 2],
}

fn kernel(scene: &Scene) -> TestKernel {
    let mut kernel = TestKernel::with_scene("trace.comp", scene);
    kernel.trace = gpu::device().trace;
    kernel
}

fn trace(kernel: &TestKernel, rays: &[Ray]) -> Vec<Hit> {
    let inputs: Vec<[u32; 4]> = rays.iter().flat_map(Ray::texels).collect();
    let outputs = kernel.run(&inputs, rays.len(), 2);
    let hit = |t: &[[u32; 4]]| Hit {
        triangle: [t[0][0], t[0][1]],
        t: f32::from_bits(t[0][2]).into(),
        barycentric: [floats(t[1])[0].into(), floats(t[1])[1].into()],
    };
    outputs.chunks_exact(2).map(hit).collect()
}

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

fn scene_of(meshes: Vec<(Primitive, Vec<DAffine3>)>) -> Scene {
    let mut scene = Scene { materials: vec![Material::lambertian("grey", [0.5; 3])], ..empty_scene() };
    for (mesh, (primitive, placements)) in meshes.into_iter().enumerate() {
        scene.meshes.push(Mesh { name: format!("mesh {mesh}"), primitives: vec![primitive] });
        let place = |m| Instance { mesh, object_to_world: m, name: format!("mesh {mesh}") };
        scene.instances.extend(placements.into_iter().map(place));
    }
    scene
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

/// Turned, stretched, mirrored and small placements.
fn placements() -> Vec<DAffine3> {
    let turn = |x: f64, y: f64| DMat3::from_rotation_x(x) * DMat3::from_rotation_y(y);
    let scale = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
    let place = DAffine3::from_mat3_translation;
    vec![
        place(turn(0.4, 1.0) * scale(0.3, 0.8, 0.1), DVec3::new(1.0, 0.5, -0.5)),
        place(turn(2.0, 0.3) * scale(-0.5, 0.5, 0.5), DVec3::new(-1.0, 0.2, 0.7)),
        place(scale(0.02, 0.02, 0.02), DVec3::new(0.1, -1.2, 0.3)),
        place(turn(0.1, 4.0) * scale(1.0, -0.05, -2.0), DVec3::new(0.0, 1.5, 0.0)),
    ]
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
        if i % 7 == 0 {
            direction.x = 0.0;
        }
        if i % 21 == 0 {
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
            1 => ray.towards = hit.triangle,
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

/// A closed mesh of radius 1: the icosahedron, each face split in four `steps` times, vertices shared.
fn icosphere(steps: u32) -> Primitive {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let rectangle = |f: fn(f64, f64) -> DVec3| {
        [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)].map(|(a, b)| f(a, b))
    };
    let mut points: Vec<DVec3> = [
        rectangle(|a, b| DVec3::new(a, b, 0.0)),
        rectangle(|a, b| DVec3::new(0.0, a, b)),
        rectangle(|a, b| DVec3::new(b, 0.0, a)),
    ]
    .concat();
    // Faces: triples of mutually nearest vertices (distance 2), turned outwards.
    let near = |a: usize, b: usize, p: &[DVec3]| (p[a] - p[b]).length() < 2.1;
    let mut faces = Vec::new();
    for (a, b, c) in (0..12).flat_map(|a| (a + 1..12).flat_map(move |b| (b + 1..12).map(move |c| (a, b, c)))) {
        if near(a, b, &points) && near(b, c, &points) && near(a, c, &points) {
            let outwards = (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
            faces.push(if outwards { [a, b, c] } else { [a, c, b] });
        }
    }
    points.iter_mut().for_each(|p| *p = p.normalize());
    for _ in 0..steps {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a] + points[b]).normalize());
                points.len() - 1
            })
        };
        let split = |[a, b, c]: [usize; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    closed(&points, &faces)
}

fn closed(points: &[DVec3], faces: &[[usize; 3]]) -> Primitive {
    Primitive {
        positions: points.iter().map(|p| p.as_vec3().to_array()).collect(),
        triangles: faces.iter().map(|face| face.map(|i| i as u32)).collect(),
        ..Primitive::default()
    }
}

/// The cube [−1, 1]³ with n × n squares of two triangles a face, vertices shared.
fn cube(n: usize) -> Primitive {
    let mut points: Vec<DVec3> = Vec::new();
    let mut index = std::collections::HashMap::new();
    let mut vertex = |corner: [usize; 3]| {
        *index.entry(corner).or_insert_with(|| {
            points.push(DVec3::from(corner.map(|k| 2.0 * k as f64 / n as f64 - 1.0)));
            points.len() - 1
        })
    };
    let mut faces = Vec::new();
    for (axis, side) in (0..3).flat_map(|axis| [0, n].map(|side| (axis, side))) {
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let mut corner = |di: usize, dj: usize| {
                let mut c = [0; 3];
                (c[axis], c[(axis + 1) % 3], c[(axis + 2) % 3]) = (side, i + di, j + dj);
                vertex(c)
            };
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    closed(&points, &faces)
}

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
        Ray::new(from.as_dvec3(), if i % 3 == 0 { direction } else { direction.normalize() })
    };
    (0..count).map(&mut ray).collect()
}

#[test]
fn closed_meshes_are_watertight() {
    const RAYS: usize = 1 << 18;
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
