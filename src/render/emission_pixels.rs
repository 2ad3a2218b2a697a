//! In which pixels a sample has camera rays that ask for emission alone (shaders/include/emission_rays.glsl), and how many.
//!
//! What the camera sees of a lamp without scattering has the error of an edge: a pixel's share of the lamp's radiance, many
//! times that of all else. It can be found by camera rays alone, the cheapest there are. So the pixels that a lamp may be seen in
//! have more of them. Which pixels these are decides only how fast the image gets better: each sum has the same mean.

use std::sync::Arc;

use ash::vk::BufferUsageFlags as Usage;
use glam::{DVec2, DVec3, Vec3};

use super::settings::{Integrator, Settings};
use crate::gpu::{Buffer, Gpu, GpuResult};
use crate::layout::{
    LIGHT_TEXELS, LIGHT_TRIANGLE, Light, MATERIAL_TEXELS, Material, NONE, PROJECTION_ORTHOGRAPHIC, RenderConstants,
    SceneArray, Texel, emits_from_both_sides,
};
use crate::prepare::{Prepared, camera_constants};
use crate::scene::Camera;

/// Fewest and most emission rays of a sample that are chosen without being asked for.
const FEWEST_RAYS: u64 = 2;
const MOST_RAYS: u64 = 8;
/// For so many samples of the image it has at most one emission ray that is not asked for (docs/benchmarks).
const SAMPLES_A_RAY: u64 = 2;

/// The pixels, and the rays of each of their samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct EmissionPixels {
    /// A bit a pixel, row by row; empty if `rays` is 0.
    pub(super) words: Vec<u32>,
    /// Emission rays of a sample, 0 if there are none.
    pub(super) rays: u32,
}

impl EmissionPixels {
    /// Those of a scene seen by a camera. A lens has none: it blurs what the rays are for.
    pub(super) fn choose(prepared: &Prepared, camera: &Camera, settings: &Settings) -> Self {
        let adds_emission = matches!(settings.integrator, Integrator::Path | Integrator::Emission);
        let wanted = settings.emission_rays;
        if !adds_emission || camera.lens_radius > 0.0 || wanted == Some(0) {
            return Self::default();
        }
        let mut constants = prepared.constants;
        camera_constants(camera, prepared.origin, settings.width, settings.height, &mut constants);
        let pixels = u64::from(settings.width) * u64::from(settings.height);
        let most_pixels = if wanted.is_some() { pixels } else { pixels / SAMPLES_A_RAY / FEWEST_RAYS };
        let mut film = LampPixels::new(settings.width, settings.height);
        for polygon in lamps(prepared, &constants) {
            film.add(&polygon);
            if film.count > most_pixels {
                return Self::default();
            }
        }
        if film.count == 0 {
            return Self::default();
        }
        let affordable = (pixels / SAMPLES_A_RAY / film.count).clamp(FEWEST_RAYS, MOST_RAYS);
        let rays = wanted.unwrap_or(1 << affordable.ilog2());
        Self { words: film.words, rays }
    }

    /// What the kernel reads, if it has such rays.
    pub(super) fn upload(&self, gpu: &Arc<Gpu>) -> GpuResult<Option<Buffer>> {
        let upload = || Buffer::with_data(gpu, "emission pixels", &self.words, Usage::STORAGE_BUFFER);
        (self.rays > 0).then(upload).transpose()
    }
}

/// A convex polygon on the film, in pixels from its top left.
type Polygon = Vec<DVec2>;

/// The emissive triangles whose emitting side the camera is on, as it sees them.
fn lamps<'a>(prepared: &'a Prepared, constants: &'a RenderConstants) -> impl Iterator<Item = Polygon> + 'a {
    let eye = Eye::new(constants);
    let tables = &prepared.arrays[SceneArray::Tables as usize];
    let lights = (0..constants.light_count).map(|i| -> Light { record(tables, constants.lights + LIGHT_TEXELS * i) });
    // Triangles are the first of all lights.
    lights.take_while(|light| light.kind == LIGHT_TRIANGLE).filter_map(move |light| {
        let material: Material = record(tables, constants.materials + MATERIAL_TEXELS * light.material);
        let (vertices, mirrored) = place(prepared, &light);
        (emits_from_both_sides(material.kind_flags) || eye.is_before(vertices, mirrored)).then(|| eye.project(vertices))
    })
}

fn record<T: bytemuck::Pod>(table: &[Texel], first: u32) -> T {
    let first = first as usize;
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(&table[first..first + size_of::<T>() / size_of::<Texel>()]))
}

/// The triangle's vertices in rebased space, and whether its instance mirrors it.
fn place(prepared: &Prepared, light: &Light) -> ([DVec3; 3], bool) {
    let vertices = prepared.triangle(light.slot).vertices.map(|vertex| Vec3::from(vertex).as_dvec3());
    if light.instance == NONE {
        return (vertices, false);
    }
    let instance = &prepared.instances[light.instance as usize].record;
    let rows = instance.object_to_world.map(|[x, y, z, t]| (Vec3::new(x, y, z).as_dvec3(), f64::from(t)));
    let placed = vertices.map(|v| DVec3::from(rows.map(|(row, translation)| row.dot(v) + translation)));
    (placed, instance.mirrored != 0)
}

/// The camera, turned around: from a point to its place on the film.
struct Eye {
    origin: DVec3,
    forward: DVec3,
    /// Rows that give the film's coordinates, −1 to 1, times w.
    across: DVec3,
    down: DVec3,
    size: DVec2,
    orthographic: bool,
}

impl Eye {
    fn new(constants: &RenderConstants) -> Self {
        let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let (right, up) = (vector(constants.camera_right), vector(constants.camera_up));
        Self {
            origin: vector(constants.camera_origin),
            forward: vector(constants.camera_forward),
            across: right / right.length_squared(),
            down: -up / up.length_squared(),
            size: DVec2::new(constants.width.into(), constants.height.into()),
            orthographic: constants.projection == PROJECTION_ORTHOGRAPHIC,
        }
    }

    /// Whether the camera is before the triangle's front.
    fn is_before(&self, [a, b, c]: [DVec3; 3], mirrored: bool) -> bool {
        let normal = (b - a).cross(c - a) * if mirrored { -1.0 } else { 1.0 };
        let to_eye = if self.orthographic { -self.forward } else { self.origin - a };
        normal.dot(to_eye) > 0.0
    }

    /// What of a triangle is on the film.
    fn project(&self, vertices: [DVec3; 3]) -> Polygon {
        let mut polygon: Vec<Seen> = vertices.into_iter().map(|vertex| self.see(vertex)).collect();
        // Before the camera, and between the film's four edges; with these alone w ≥ 0.
        let sides: [fn(&Seen) -> f64; 5] =
            [|v| v.depth, |v| v.w + v.film.x, |v| v.w - v.film.x, |v| v.w + v.film.y, |v| v.w - v.film.y];
        for side in sides {
            polygon = clip(&polygon, side, Seen::between);
        }
        let pixels = |v: Seen| (v.film / v.w + 1.0) * 0.5 * self.size;
        polygon.into_iter().filter(|v| v.w > 0.0).map(pixels).collect()
    }

    fn see(&self, vertex: DVec3) -> Seen {
        let offset = vertex - self.origin;
        let depth = offset.dot(self.forward);
        let film = DVec2::new(offset.dot(self.across), offset.dot(self.down));
        Seen { film, w: if self.orthographic { 1.0 } else { depth }, depth }
    }
}

/// A point before the camera.
#[derive(Clone, Copy)]
struct Seen {
    /// Its place on the film, −1 to 1, times `w`.
    film: DVec2,
    w: f64,
    /// Its distance along the viewing direction.
    depth: f64,
}

impl Seen {
    fn between(self, other: Self, t: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * t;
        Self { film: self.film.lerp(other.film, t), w: mix(self.w, other.w), depth: mix(self.depth, other.depth) }
    }
}

/// The part of a convex polygon where `side` is not negative (Sutherland and Hodgman 1974).
fn clip<V: Copy>(polygon: &[V], side: impl Fn(&V) -> f64, between: impl Fn(V, V, f64) -> V) -> Vec<V> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &vertex) in polygon.iter().enumerate() {
        let next = polygon[(i + 1) % polygon.len()];
        let (here, there) = (side(&vertex), side(&next));
        if here >= 0.0 {
            kept.push(vertex);
        }
        if (here < 0.0) != (there < 0.0) {
            kept.push(between(vertex, next, here / (here - there)));
        }
    }
    kept
}

/// Pixels that polygons touch.
struct LampPixels {
    width: usize,
    height: usize,
    words: Vec<u32>,
    count: u64,
}

impl LampPixels {
    fn new(width: u32, height: u32) -> Self {
        let (width, height) = (width as usize, height as usize);
        Self { width, height, words: vec![0; (width * height).div_ceil(32)], count: 0 }
    }

    /// Adds the pixels that a convex polygon touches, row by row.
    fn add(&mut self, polygon: &[DVec2]) {
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        // Floats beyond the range of an integer become its ends.
        let cells = |(low, high): (f64, f64), count: usize| low as usize..(high as usize + 1).min(count);
        let rows = range(&mut polygon.iter().map(|v| v.y));
        if rows.0 > rows.1 {
            return;
        }
        for y in cells(rows, self.height) {
            let (top, bottom) = (y as f64, y as f64 + 1.0);
            let band = clip(polygon, |v| v.y - top, DVec2::lerp);
            let band = clip(&band, |v| bottom - v.y, DVec2::lerp);
            let columns = range(&mut band.iter().map(|v| v.x));
            if columns.0 > columns.1 {
                continue;
            }
            for x in cells(columns, self.width) {
                let pixel = y * self.width + x;
                let (word, bit) = (&mut self.words[pixel / 32], 1 << (pixel % 32));
                self.count += u64::from(*word & bit == 0);
                *word |= bit;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DMat3};

    use super::*;
    use crate::render::prepare_scene;
    use crate::scene::{Projection, builtin};

    const SIZE: u32 = 24;
    /// Rays along a pixel's side, at its edges too.
    const RAYS: u32 = 9;

    fn settings() -> Settings {
        Settings { width: SIZE, height: SIZE, emission_rays: Some(1), ..Settings::default() }
    }

    /// The Cornell box from a place, looking along −z of the turned camera.
    fn chosen_and_met(eye: DVec3, turn: DMat3, projection: Projection) -> (Vec<bool>, Vec<bool>) {
        let scene = builtin::builtin("cornell").unwrap();
        let mut camera = scene.cameras[0].clone();
        camera.camera_to_world = DAffine3::from_mat3_translation(turn, eye);
        camera.projection = projection;
        let prepared = prepare_scene(&scene, &camera, &settings()).unwrap();
        let words = EmissionPixels::choose(&prepared, &camera, &settings()).words;
        let bit = |pixel: u32| words.get(pixel as usize / 32).is_some_and(|word| word >> (pixel % 32) & 1 == 1);
        let lamp: Vec<_> = (0..2)
            .map(|i| {
                record::<Light>(
                    &prepared.arrays[SceneArray::Tables as usize],
                    prepared.constants.lights + LIGHT_TEXELS * i,
                )
            })
            .map(|light| place(&prepared, &light).0)
            .collect();
        let mut constants = prepared.constants;
        camera_constants(&camera, prepared.origin, SIZE, SIZE, &mut constants);
        let meets = |x: f64, y: f64| {
            let (origin, direction) = ray(&constants, x, y);
            lamp.iter().any(|&triangle| meets_front(origin, direction, triangle))
        };
        let at = |i: u32, step: u32| f64::from(i) + f64::from(step) / f64::from(RAYS - 1);
        let met = |pixel: u32| {
            let steps = (0..RAYS).flat_map(|i| (0..RAYS).map(move |j| (i, j)));
            steps.into_iter().any(|(i, j)| meets(at(pixel % SIZE, i), at(pixel / SIZE, j)))
        };
        ((0..SIZE * SIZE).map(bit).collect(), (0..SIZE * SIZE).map(met).collect())
    }

    /// As `camera_ray` of camera.glsl.
    fn ray(constants: &RenderConstants, x: f64, y: f64) -> (DVec3, DVec3) {
        let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let film = DVec2::new(x, y) / f64::from(SIZE) * 2.0 - 1.0;
        let offset = vector(constants.camera_right) * film.x - vector(constants.camera_up) * film.y;
        let (eye, forward) = (vector(constants.camera_origin), vector(constants.camera_forward));
        if constants.projection == PROJECTION_ORTHOGRAPHIC { (eye + offset, forward) } else { (eye, forward + offset) }
    }

    fn meets_front(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
        let normal = (b - a).cross(c - a);
        let t = (a - origin).dot(normal) / direction.dot(normal);
        let point = origin + direction * t;
        let inside = |p: DVec3, q: DVec3| (q - p).cross(point - p).dot(normal) >= 0.0;
        direction.dot(normal) < 0.0 && t > 0.0 && inside(a, b) && inside(b, c) && inside(c, a)
    }

    #[test]
    fn the_pixels_are_those_that_see_a_lamp() {
        let scene = builtin::builtin("cornell").unwrap();
        let own = &scene.cameras[0];
        let lamp_below = DVec3::new(0.1, 0.7, -0.1);
        let up = DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let wide = Projection::Perspective { yfov_radians: 2.4 };
        let cases = [
            ("from outside", own.camera_to_world.translation, own.camera_to_world.matrix3, own.projection, true),
            ("from below", lamp_below, up, wide, true),
            // The lamp's plane cuts the view, and a part of the lamp is behind the camera.
            ("aslant", lamp_below, DMat3::from_rotation_x(0.9) * DMat3::from_rotation_z(0.4), wide, true),
            ("orthographic", lamp_below, up, Projection::Orthographic { ymag: 0.7 }, true),
            ("away", lamp_below, DMat3::from_rotation_x(-0.9), Projection::Perspective { yfov_radians: 0.5 }, false),
            ("from above", DVec3::new(0.0, 40.0, 0.0), DMat3::from_rotation_x(-1.5), wide, false),
        ];
        for (name, eye, turn, projection, seen) in cases {
            let (chosen, met) = chosen_and_met(eye, turn, projection);
            assert_eq!(met.contains(&true), seen, "{name}");
            let near = |pixel: usize| {
                let (x, y) = (pixel as u32 % SIZE, pixel as u32 / SIZE);
                let around = |v: u32| v.saturating_sub(1)..=(v + 1).min(SIZE - 1);
                around(x).any(|x| around(y).any(|y| met[(y * SIZE + x) as usize]))
            };
            for pixel in 0..chosen.len() {
                assert!(chosen[pixel] || !met[pixel], "{name}: pixel {pixel} sees the lamp and is not chosen");
                assert!(!chosen[pixel] || near(pixel), "{name}: pixel {pixel} is chosen and far from all that do");
            }
        }
    }
}
