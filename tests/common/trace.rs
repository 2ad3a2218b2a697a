//! Rays and meshes for tests of the trace interface, by way of shaders/test/trace.comp.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use sunfleck::gpu::{DeviceKind, TraceBackend};
use sunfleck::scene::{Instance, Material, Mesh, Primitive, Scene};

use super::gpu;
use super::kernel::{Random, TestKernel, empty_scene, floats, vector_texel};

/// A triangle's number and its instance.
pub type TriangleId = [u32; 2];
pub const NO_TRIANGLE: TriangleId = [u32::MAX; 2];

#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
    pub t_max: f32,
    pub any_hit: bool,
    pub from: TriangleId,
    pub towards: TriangleId,
}

impl Ray {
    /// Rounded to f32 as the shader gets it.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
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
pub struct Hit {
    pub triangle: TriangleId,
    pub t: f64,
    pub barycentric: [f64; 2],
}

pub fn kernel(scene: &Scene) -> TestKernel {
    let mut kernel = TestKernel::with_scene("trace.comp", scene);
    kernel.trace = gpu::device().trace;
    kernel
}

pub fn trace(kernel: &TestKernel, rays: &[Ray]) -> Vec<Hit> {
    let inputs: Vec<[u32; 4]> = rays.iter().flat_map(Ray::texels).collect();
    let outputs = kernel.run(&inputs, rays.len(), 2);
    let hit = |t: &[[u32; 4]]| Hit {
        triangle: [t[0][0], t[0][1]],
        t: f32::from_bits(t[0][2]).into(),
        barycentric: [floats(t[1])[0].into(), floats(t[1])[1].into()],
    };
    outputs.chunks_exact(2).map(hit).collect()
}

/// A scene of meshes, each with its placements.
pub fn scene_of(meshes: Vec<(Primitive, Vec<DAffine3>)>) -> Scene {
    let mut scene = Scene { materials: vec![Material::lambertian("grey", [0.5; 3])], ..empty_scene() };
    for (mesh, (primitive, placements)) in meshes.into_iter().enumerate() {
        scene.meshes.push(Mesh { name: format!("mesh {mesh}"), primitives: vec![primitive] });
        let place = |m| Instance { mesh, object_to_world: m, name: format!("mesh {mesh}") };
        scene.instances.extend(placements.into_iter().map(place));
    }
    scene
}

/// Turned, stretched, mirrored and small placements.
pub fn placements() -> Vec<DAffine3> {
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

/// A closed mesh of radius 1: the icosahedron, each face split in four `steps` times, vertices shared.
pub fn icosphere(steps: u32) -> Primitive {
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
        let mut middles = HashMap::new();
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

pub fn closed(points: &[DVec3], faces: &[[usize; 3]]) -> Primitive {
    Primitive {
        positions: points.iter().map(|p| p.as_vec3().to_array()).collect(),
        triangles: faces.iter().map(|face| face.map(|i| i as u32)).collect(),
        ..Primitive::default()
    }
}

/// The cube [−1, 1]³ with n × n squares of two triangles a face, vertices shared.
pub fn cube(n: usize) -> Primitive {
    let mut points: Vec<DVec3> = Vec::new();
    let mut index = HashMap::new();
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
pub fn rays_at_edges(mesh: &Primitive, place: &DAffine3, origin: DVec3, count: usize) -> Vec<Ray> {
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

/// Rays from anywhere to anywhere; some run along an axis or in a plane, and lengths differ.
pub fn random_rays(mut random: Random, count: usize, origin: DVec3) -> Vec<Ray> {
    let mut ray = |i: usize| {
        let mut direction = random.direction();
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

/// None of `count` rays from inside of a closed mesh leaves it; half of them are shadow rays.
pub fn assert_watertight(kernel: &TestKernel, mesh: &Primitive, place: &DAffine3, count: usize) {
    let mut rays = rays_at_edges(mesh, place, kernel.prepared.origin, count);
    rays.iter_mut().skip(count / 2).for_each(|ray| ray.any_hit = true);
    let hits = trace(kernel, &rays);
    let leaks: Vec<&Ray> =
        rays.iter().zip(&hits).filter(|(_, hit)| hit.triangle == NO_TRIANGLE).map(|(ray, _)| ray).collect();
    assert!(leaks.is_empty(), "{} of {count} rays leave {place:?}: {:?}", leaks.len(), leaks[0]);
}

/// Rays along every axis, both ways, from `across`³ points of a grid within the unit cube.
pub fn axis_parallel_rays(across: usize, origin: DVec3) -> Vec<Ray> {
    let middle = (across - 1) as f64 / 2.0;
    let grid =
        |i: usize| [i % across, i / across % across, i / across.pow(2)].map(|k| (k as f64 - middle) / (middle + 1.0));
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    (0..across.pow(3)).flat_map(|i| axes.map(|axis| Ray::new(DVec3::from(grid(i)) - origin, axis))).collect()
}

/// Every ray ends on the wall of the unit cube.
pub fn assert_end_on_unit_cube(kernel: &TestKernel, rays: &[Ray]) {
    for (ray, hit) in rays.iter().zip(trace(kernel, rays)) {
        assert!(hit.triangle != NO_TRIANGLE, "{ray:?} leaks");
        let end = (ray.origin + ray.direction * hit.t + kernel.prepared.origin).dot(ray.direction);
        assert!((end - 1.0).abs() < 1e-6, "{ray:?} ends at {end}");
    }
}

/// The same rays as shadow rays.
pub fn as_shadow_rays(rays: &[Ray]) -> Vec<Ray> {
    rays.iter().map(|ray| Ray { any_hit: true, ..*ray }).collect()
}

/// A software driver's ray query (lavapipe 25: 0.4 % of the rays that are aimed at edges) misses where a box test rounds; our
/// own traversal does not, and is what such a device renders with. Hardware must be watertight.
pub fn is_leaky_driver() -> bool {
    let device = gpu::device();
    device.trace == TraceBackend::RayQuery && device.gpu.info.kind == DeviceKind::Cpu
}

/// [`is_leaky_driver`], said.
pub fn driver_leaks() -> bool {
    if is_leaky_driver() {
        eprintln!("skipped: the ray query of a software driver is not watertight");
    }
    is_leaky_driver()
}

/// Random triangles, some of them slivers, some in pairs that share an edge.
pub fn soup(random: &mut Random, pairs: usize) -> Primitive {
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
