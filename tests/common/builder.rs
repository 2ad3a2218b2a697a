//! Small scenes put together by a test: rectangles, solids and a camera that looks at a point.

use glam::{DAffine3, DMat3, DVec3};
use sunfleck::scene::{Camera, Instance, Material, Mesh, Primitive, Projection, Scene};

use super::gpu;
use super::scenes;
use super::statistics::Estimate;
use sunfleck::render::Settings;

/// The parallelogram `corner`, `corner + a`, `corner + a + b`, `corner + b`; its front is the side of a × b.
pub fn rectangle(corner: DVec3, a: DVec3, b: DVec3, material: usize) -> Primitive {
    let positions = [corner, corner + a, corner + a + b, corner + b].map(|p| p.as_vec3().to_array()).to_vec();
    Primitive { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], material, ..Primitive::default() }
}

/// A primitive scaled, moved and of another material.
pub fn placed(mut primitive: Primitive, scale: f64, centre: DVec3, material: usize) -> Primitive {
    for p in &mut primitive.positions {
        *p = (DVec3::from(p.map(f64::from)) * scale + centre).as_vec3().to_array();
    }
    primitive.material = material;
    primitive
}

/// A pinhole camera.
pub fn camera(eye: DVec3, target: DVec3, yfov_radians: f64) -> Camera {
    let up = if (target - eye).normalize().y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    let back = (eye - target).normalize();
    let right = up.cross(back).normalize();
    let turn = DMat3::from_cols(right, back.cross(right), back);
    Camera {
        name: String::from("camera"),
        camera_to_world: DAffine3::from_mat3_translation(turn, eye),
        projection: Projection::Perspective { yfov_radians },
        lens_radius: 0.0,
        focus_distance: 1.0,
    }
}

/// A scene of primitives in world space.
pub fn scene(primitives: Vec<Primitive>, materials: Vec<Material>, camera: Camera) -> Scene {
    Scene {
        name: String::from("stress"),
        cameras: vec![camera],
        meshes: vec![Mesh { name: String::from("stress"), primitives }],
        materials,
        instances: vec![Instance { mesh: 0, object_to_world: DAffine3::IDENTITY, name: String::from("stress") }],
        ..Scene::default()
    }
}

/// The mean radiance of the image in each channel, from independent seeds; every sample is finite.
pub fn mean(scene: &Scene, settings: &Settings, seeds: u32, spp: u32) -> [Estimate; 3] {
    scene.validate().expect("a valid scene");
    scenes::seeds(&mut gpu::path_tracer(scene, settings), settings, seeds, spp).image()
}
