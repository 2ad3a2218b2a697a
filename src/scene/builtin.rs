//! Scenes that are part of the binary.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DMat4, DVec3};

use super::{Camera, Instance, Material, Mesh, Primitive, Projection, Scene};

/// The names [`builtin`] knows.
pub fn names() -> &'static [&'static str] {
    &["cornell", "bumpy"]
}

/// The built-in scene of that name.
pub fn builtin(name: &str) -> Option<Scene> {
    match name {
        "cornell" => Some(cornell()),
        "bumpy" => Some(bumpy()),
        _ => None,
    }
}

/// The Cornell box of Mitsuba 3's `cornell_box()`: its geometry, numbers and camera (`mitsuba/python/util.py`, 3.9.1).
///
/// Every surface there is one-sided, so the backs are black here. Its field of view of 39.3077° belongs to the smaller
/// axis of a square film; it is the vertical one here. 36 triangles, flat-shaded, baked in f64.
fn cornell() -> Scene {
    let one_sided = |name, albedo| Material { black_back: true, ..Material::lambertian(name, albedo) };
    let lamp = Material { emission: [18.387, 13.9873, 6.75357], ..one_sided("light", WHITE) };
    let translate = |x, y, z| DMat4::from_translation(DVec3::new(x, y, z));
    let rotate_x = |degrees: f64| DMat4::from_rotation_x(degrees.to_radians());
    let rotate_y = |degrees: f64| DMat4::from_rotation_y(degrees.to_radians());
    let scale = |x, y, z| DMat4::from_scale(DVec3::new(x, y, z));

    let small_box = translate(0.335, -0.7, 0.38) * rotate_y(-17.0) * scale(0.3, 0.3, 0.3);
    let large_box = translate(-0.33, -0.4, -0.28) * rotate_y(18.25) * scale(0.3, 0.61, 0.3);
    let primitives = vec![
        rectangle(translate(0.0, 0.99, 0.01) * rotate_x(90.0) * scale(0.23, 0.19, 0.19), 3),
        rectangle(translate(0.0, -1.0, 0.0) * rotate_x(-90.0), 0),
        rectangle(translate(0.0, 1.0, 0.0) * rotate_x(90.0), 0),
        rectangle(translate(0.0, 0.0, -1.0), 0),
        rectangle(translate(1.0, 0.0, 0.0) * rotate_y(-90.0), 1),
        rectangle(translate(-1.0, 0.0, 0.0) * rotate_y(90.0), 2),
        cube(small_box, 0),
        cube(large_box, 0),
    ];
    Scene {
        name: String::from("cornell"),
        cameras: vec![Camera {
            name: String::from("camera"),
            camera_to_world: DAffine3::from_translation(DVec3::new(0.0, 0.0, 3.9)),
            projection: Projection::Perspective { yfov_radians: 39.3077_f64.to_radians() },
            lens_radius: 0.0,
            focus_distance: 1000.0,
        }],
        meshes: vec![Mesh { name: String::from("cornell"), primitives }],
        materials: vec![
            one_sided("white", WHITE),
            one_sided("green", [0.105421, 0.37798, 0.076425]),
            one_sided("red", [0.570068, 0.0430135, 0.0443706]),
            lamp,
        ],
        instances: vec![Instance { mesh: 0, object_to_world: DAffine3::IDENTITY, name: String::from("cornell") }],
        ..Scene::default()
    }
}

/// The walls and the lamp of [`cornell`] around a sphere with bumps: 9,800 triangles, flat-shaded.
fn bumpy() -> Scene {
    let mut scene = cornell();
    scene.name = String::from("bumpy");
    let primitives = &mut scene.meshes[0].primitives;
    primitives.truncate(6);
    primitives.push(bumpy_sphere(DVec3::new(0.0, -0.3, 0.0), 0.6, 50));
    scene
}

const WHITE: [f32; 3] = [0.885809, 0.698859, 0.666422];

/// Mitsuba's `rectangle`: [−1, 1]² in the plane z = 0, its front towards +Z.
fn rectangle(to_world: DMat4, material: usize) -> Primitive {
    let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    Primitive {
        positions: corners.map(|corner| bake(to_world, corner)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material,
        ..Primitive::default()
    }
}

/// Mitsuba's `cube`: [−1, 1]³, its faces outwards.
fn cube(to_world: DMat4, material: usize) -> Primitive {
    // Corner i has x, y, z = ±1 by its bits 0, 1, 2. Each face runs counter-clockwise seen from outside.
    let sign = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
    let corner = |i: u32| [sign(i & 1), sign(i & 2), sign(i & 4)];
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Primitive {
        positions: (0..8).map(|i| bake(to_world, corner(i))).collect(),
        triangles: faces.iter().flat_map(|&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]]).collect(),
        material,
        ..Primitive::default()
    }
}

/// A sphere of `n` latitudes and 2n longitudes, 4n(n − 1) triangles, their fronts outwards, with two waves on its radius.
fn bumpy_sphere(centre: DVec3, radius: f64, n: u32) -> Primitive {
    let longitudes = 2 * n;
    let point = |theta: f64, phi: f64| {
        let waves = 0.12 * (13.0 * phi).sin() * (11.0 * theta).sin() + 0.03 * (57.0 * phi).sin() * (61.0 * theta).sin();
        let direction = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        (centre + radius * (1.0 + waves) * direction).to_array().map(|x| x as f32)
    };
    let angle = |i: u32, count: u32, turn: f64| f64::from(i) / f64::from(count) * turn;
    let mut positions: Vec<_> = (1..n)
        .flat_map(|i| (0..longitudes).map(move |j| (i, j)))
        .map(|(i, j)| point(angle(i, n, PI), angle(j, longitudes, TAU)))
        .collect();
    let north = (n - 1) * longitudes;
    positions.extend([point(0.0, 0.0), point(PI, 0.0)]);
    let mut triangles = Vec::new();
    for j in 0..longitudes {
        let next = (j + 1) % longitudes;
        for ring in 0..n - 2 {
            let (upper, lower) = (ring * longitudes, (ring + 1) * longitudes);
            triangles.extend([[upper + j, upper + next, lower + j], [upper + next, lower + next, lower + j]]);
        }
        let last = (n - 2) * longitudes;
        triangles.extend([[north, next, j], [north + 1, last + j, last + next]]);
    }
    Primitive { positions, triangles, material: 0, ..Primitive::default() }
}

fn bake(to_world: DMat4, corner: [f64; 3]) -> [f32; 3] {
    to_world.transform_point3(DVec3::from(corner)).to_array().map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_a_valid_scene() {
        for name in names() {
            builtin(name).expect("a listed name exists").validate().expect("a built-in scene is valid");
        }
        assert!(builtin("no such scene").is_none());
    }

    #[test]
    fn the_bumpy_sphere_is_closed_and_faces_outwards() {
        let scene = bumpy();
        let sphere = &scene.meshes[0].primitives[6];
        assert_eq!(sphere.triangles.len(), 9800);
        let centre = DVec3::new(0.0, -0.3, 0.0);
        let mut edges = std::collections::HashMap::new();
        for triangle in &sphere.triangles {
            let [a, b, c] = triangle.map(|i| DVec3::from(sphere.positions[i as usize].map(f64::from)));
            assert!((b - a).cross(c - a).dot(a - centre) > 0.0, "{triangle:?}");
            for k in 0..3 {
                *edges.entry((triangle[k], triangle[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(edges.iter().all(|(&(a, b), &count)| count == 1 && edges.get(&(b, a)) == Some(&1)));
    }

    /// Seen from inside, every wall faces the camera's side; the boxes face outwards; the lamp faces down.
    #[test]
    fn cornell_faces_are_turned_as_in_mitsuba() {
        let scene = cornell();
        let triangles: usize = scene.meshes[0].primitives.iter().map(|p| p.triangles.len()).sum();
        assert_eq!(triangles, 36);
        let centres = [DVec3::new(0.335, -0.7, 0.38), DVec3::new(-0.33, -0.4, -0.28)];
        for (index, primitive) in scene.meshes[0].primitives.iter().enumerate() {
            for triangle in &primitive.triangles {
                let [a, b, c] = triangle.map(|i| DVec3::from(primitive.positions[i as usize].map(f64::from)));
                let normal = (b - a).cross(c - a);
                let outwards = if index < 6 { -a } else { a - centres[index - 6] };
                assert!(normal.dot(outwards) > 0.0, "primitive {index}");
            }
        }
        let (low, high) = scene.bounds().expect("there is geometry");
        // The large box reaches 0.01 below the floor, as in Mitsuba.
        assert!((low - DVec3::new(-1.0, -1.01, -1.0)).length() < 1e-6 && (high - DVec3::ONE).length() < 1e-6);
    }
}
