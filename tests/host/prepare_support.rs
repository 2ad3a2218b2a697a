//! Small scenes made by hand, and a reference traversal of the slots.
#![allow(dead_code, unreachable_pub, reason = "each test crate uses its part")]

use glam::{DAffine3, DMat3, DVec3, Vec3};
use sunfleck::layout::{
    InnerSlot, InstanceRecord, InstanceSlot, LeafSlot, SLOT_INNER, SLOT_INSTANCE, SLOT_NO_LEAF, SceneArray,
};
use sunfleck::prepare::bvh::{Slot, decode, is_present, triangles_in};
use sunfleck::prepare::{PrepareOptions, Prepared, prepare};
use sunfleck::scene::{Instance, Material, Mesh, Primitive, Scene};

pub use crate::common::random::Random;

pub type TriangleVertices = [[f32; 3]; 3];

/// A primitive of separate triangles.
pub fn soup(triangles: &[TriangleVertices], material: usize) -> Primitive {
    Primitive {
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        material,
        ..Primitive::default()
    }
}

/// A scene of one mesh with one Lambertian material, placed by `transforms`.
pub fn scene_of(triangles: &[TriangleVertices], transforms: &[DAffine3]) -> Scene {
    Scene {
        meshes: vec![Mesh { name: "mesh".into(), primitives: vec![soup(triangles, 0)] }],
        materials: vec![Material::lambertian("grey", [0.5; 3])],
        instances: transforms
            .iter()
            .map(|&object_to_world| Instance { mesh: 0, object_to_world, name: "node".into() })
            .collect(),
        ..Scene::default()
    }
}

pub fn prepared(scene: &Scene) -> Prepared {
    prepare(scene, &PrepareOptions::default()).expect("the scene can be prepared")
}

pub fn slots(prepared: &Prepared) -> Vec<Slot> {
    prepared.arrays[SceneArray::Slots as usize].chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
}

pub fn random_triangles(random: &mut Random, count: usize, spread: f64, size: f64) -> Vec<TriangleVertices> {
    (0..count)
        .map(|_| {
            let center = random.point(1.0) * spread;
            [0, 1, 2].map(|_| (center + random.point(1.0) * size).as_vec3().into())
        })
        .collect()
}

/// Parameter of the hit of a ray with a triangle (Möller and Trumbore 1997, in f64, both sides).
pub fn intersect(origin: DVec3, direction: DVec3, triangle: &TriangleVertices) -> Option<f64> {
    let [a, b, c] = triangle.map(|v| Vec3::from(v).as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(e1);
    let v = direction.dot(q) / determinant;
    let t = e2.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

/// A hit: its parameter, the triangle's number, and the instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub t: f64,
    pub slot: u32,
    pub instance: Option<u32>,
}

/// Takes a world ray to an instance's object space with the shader's precision, f32.
pub fn to_object(record: &InstanceRecord, origin: DVec3, direction: DVec3) -> (DVec3, DVec3) {
    let rows = record.world_to_object;
    let (o, d) = (origin.as_vec3(), direction.as_vec3());
    let point = rows.map(|r| r[0] * o.x + r[1] * o.y + r[2] * o.z + r[3]);
    let vector = rows.map(|r| r[0] * d.x + r[1] * d.y + r[2] * d.z);
    (Vec3::from(point).as_dvec3(), Vec3::from(vector).as_dvec3())
}

/// Closest hit by the tree: boxes are decoded and widened by f64 rounding, triangles are tested in f64.
pub fn traverse(slots: &[Slot], root: u32, instances: &[InstanceRecord], ray: (DVec3, DVec3)) -> (Option<Hit>, usize) {
    let mut best = None;
    let mut visits = 0;
    visit(slots, root, instances, None, ray, &mut best, &mut visits);
    (best, visits)
}

fn visit(
    slots: &[Slot],
    root: u32,
    instances: &[InstanceRecord],
    inside: Option<u32>,
    ray: (DVec3, DVec3),
    best: &mut Option<Hit>,
    visits: &mut usize,
) {
    let mut stack = vec![root];
    while let Some(place) = stack.pop() {
        *visits += 1;
        let inner: InnerSlot = bytemuck::cast(slots[place as usize]);
        assert_eq!(inner.kind, SLOT_INNER);
        for index in 0..4 {
            if !is_present(&inner, index) || !hits_box(&inner, index, ray, best) {
                continue;
            }
            let child = inner.child_group * 4 + index as u32;
            let kind = slots[child as usize][2][3];
            if kind < SLOT_NO_LEAF {
                let [a, b, c, d] = bytemuck::cast::<Slot, LeafSlot>(slots[child as usize]).vertices;
                for (triangle, k) in [[a, b, c], [a, c, d]].into_iter().zip(0..triangles_in(&slots[child as usize])) {
                    if let Some(t) = intersect(ray.0, ray.1, &triangle)
                        && best.is_none_or(|hit| t < hit.t)
                    {
                        *best = Some(Hit { t, slot: 2 * child + k, instance: inside });
                    }
                }
            } else if kind == SLOT_INSTANCE {
                let instance: InstanceSlot = bytemuck::cast(slots[child as usize]);
                let record = &instances[instance.instance as usize];
                let ray = to_object(record, ray.0, ray.1);
                visit(slots, record.root_slot, instances, Some(instance.instance), ray, best, visits);
            } else {
                stack.push(child);
            }
        }
    }
}

fn hits_box(inner: &InnerSlot, index: usize, (origin, direction): (DVec3, DVec3), best: &Option<Hit>) -> bool {
    const SLACK: f64 = 1e-12;
    let (mut near, mut far) = (0.0f64, best.map_or(f64::INFINITY, |hit| hit.t));
    for axis in 0..3 {
        let [lower, upper] = decode(inner, index, axis).map(|(a, b)| a + b);
        let slack = SLACK * lower.abs().max(upper.abs());
        let (lower, upper) = (lower - slack, upper + slack);
        if direction[axis] == 0.0 {
            if origin[axis] < lower || origin[axis] > upper {
                return false;
            }
            continue;
        }
        let (a, b) = ((lower - origin[axis]) / direction[axis], (upper - origin[axis]) / direction[axis]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near * (1.0 - SLACK) <= far * (1.0 + SLACK)
}

/// A transform from a random rotation, a scale an axis and a translation.
pub fn random_transform(random: &mut Random, scale: DVec3, spread: f64) -> DAffine3 {
    let x = random.direction();
    let y = random.direction().reject_from(x).normalize();
    let rotation = DMat3::from_cols(x, y, x.cross(y));
    DAffine3 { matrix3: rotation * DMat3::from_diagonal(scale), translation: random.point(1.0) * spread }
}
