//! What is seen in the middle of a pixel: the nearest triangle along its ray, for the inspector.
//!
//! In f64 over all triangles, without a tree: it is asked for at the pace of a hand, and knows nothing of the kernel that is
//! being edited.

use glam::DVec3;

use crate::layout::{PROJECTION_ORTHOGRAPHIC, RenderConstants};
use crate::prepare::camera_constants;
use crate::scene::{Camera, Instance, Scene};
use crate::watch::messages::Seen;

struct Ray {
    origin: DVec3,
    direction: DVec3,
}

struct Nearest {
    t: f64,
    instance: usize,
    primitive: usize,
    triangle: usize,
    is_back: bool,
}

/// What a camera sees in the middle of pixel (`x`, `y`), counted from the top left of `size` pixels.
pub(super) fn seen_at(scene: &Scene, camera: &Camera, size: [u32; 2], (x, y): (u32, u32)) -> Option<Seen> {
    let ray = ray_of(camera, size, (x, y));
    let mut nearest: Option<Nearest> = None;
    for (index, instance) in scene.instances.iter().enumerate() {
        trace_instance(scene, instance, index, &ray, &mut nearest);
    }
    let nearest = nearest?;
    let instance = &scene.instances[nearest.instance];
    let mesh = &scene.meshes[instance.mesh];
    let primitive = &mesh.primitives[nearest.primitive];
    let material = scene.materials.get(primitive.material)?;
    Some(Seen {
        material: named(&material.name, primitive.material),
        bsdf: material.bsdf.name().to_owned(),
        mesh: named(&mesh.name, instance.mesh),
        instance: named(&instance.name, nearest.instance),
        primitive: nearest.primitive,
        triangle: nearest.triangle,
        distance: nearest.t * ray.direction.length(),
        is_back: nearest.is_back,
    })
}

fn named(name: &str, number: usize) -> String {
    if name.is_empty() { format!("#{number}") } else { name.to_owned() }
}

/// As `camera_ray` of shaders/include/camera.glsl, for a pinhole.
fn ray_of(camera: &Camera, [width, height]: [u32; 2], (x, y): (u32, u32)) -> Ray {
    let mut constants = RenderConstants::default();
    let eye = camera.camera_to_world.translation;
    camera_constants(camera, eye, width, height, &mut constants);
    let axis = |v: [f32; 3]| glam::Vec3::from(v).as_dvec3();
    let film = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
    let offset = axis(constants.camera_right) * film(x, width) - axis(constants.camera_up) * film(y, height);
    let forward = axis(constants.camera_forward);
    if constants.projection == PROJECTION_ORTHOGRAPHIC {
        Ray { origin: eye + offset, direction: forward }
    } else {
        Ray { origin: eye, direction: forward + offset }
    }
}

fn trace_instance(scene: &Scene, instance: &Instance, index: usize, world: &Ray, nearest: &mut Option<Nearest>) {
    // A flat instance has no inverse, and is seen from nowhere but along itself.
    let to_object = instance.object_to_world.inverse();
    if !to_object.is_finite() {
        return;
    }
    let ray = Ray {
        origin: to_object.transform_point3(world.origin),
        direction: to_object.transform_vector3(world.direction),
    };
    for (number, primitive) in scene.meshes[instance.mesh].primitives.iter().enumerate() {
        for (triangle, corners) in primitive.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|i| glam::Vec3::from(primitive.positions[i as usize]).as_dvec3());
            let Some((t, is_front)) = hit_triangle(&ray, a, b, c) else { continue };
            if nearest.as_ref().is_none_or(|nearest| t < nearest.t) {
                *nearest = Some(Nearest { t, instance: index, primitive: number, triangle, is_back: !is_front });
            }
        }
    }
}

/// Möller and Trumbore 1997, in object space, where the front is counter-clockwise whether or not the instance mirrors: the
/// distance in units of the direction, and whether the ray meets the front.
fn hit_triangle(ray: &Ray, a: DVec3, b: DVec3, c: DVec3) -> Option<(f64, bool)> {
    let (ab, ac) = (b - a, c - a);
    let p = ray.direction.cross(ac);
    let determinant = ab.dot(p);
    let from_a = ray.origin - a;
    let u = from_a.dot(p) / determinant;
    let q = from_a.cross(ab);
    let v = ray.direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    // Written so that the NaN of a degenerate triangle is no hit.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, determinant > 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    fn cornell() -> Scene {
        builtin::builtin("cornell").expect("it is built in")
    }

    #[test]
    fn the_back_wall_and_the_lamp_of_the_cornell_box_are_named() {
        let scene = cornell();
        let camera = scene.cameras[0].clone();
        let middle = seen_at(&scene, &camera, [101, 101], (50, 20)).expect("the back wall");
        assert!(!middle.is_back, "{middle:?}");
        assert!(middle.distance > 1.0 && middle.bsdf == "lambertian", "{middle:?}");
        let names: std::collections::BTreeSet<_> =
            (0..101).filter_map(|x| seen_at(&scene, &camera, [101, 101], (x, 50))).map(|seen| seen.material).collect();
        assert!(names.len() >= 3, "left, right and white walls: {names:?}");
    }

    #[test]
    fn behind_the_camera_there_is_nothing_and_mirrored_fronts_stay_fronts() {
        let mut scene = cornell();
        let mut camera = scene.cameras[0].clone();
        let before = seen_at(&scene, &camera, [9, 9], (4, 2)).expect("a wall");
        for instance in &mut scene.instances {
            let mirror = glam::DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
            instance.object_to_world = mirror * instance.object_to_world;
        }
        camera.camera_to_world = glam::DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)) * camera.camera_to_world;
        let mirrored = seen_at(&scene, &camera, [9, 9], (4, 2)).expect("the same wall");
        assert!((before.distance - mirrored.distance).abs() < 1e-9 && !mirrored.is_back, "{before:?} {mirrored:?}");
        camera.camera_to_world.matrix3.z_axis *= -1.0;
        assert_eq!(seen_at(&scene, &camera, [9, 9], (4, 4)), None);
    }
}
