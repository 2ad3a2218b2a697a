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
    LIGHT_TEXELS, LIGHT_TRIANGLE, Light, MATERIAL_BLACK_BACK, MATERIAL_DOUBLE_SIDED, MATERIAL_TEXELS, Material, NONE,
    PROJECTION_ORTHOGRAPHIC, RenderConstants, SceneArray, Texel,
};
use crate::prepare::{Prepared, camera_constants};
use crate::scene::Camera;

/// Most emission rays of a sample that are chosen without being asked for.
const MOST_RAYS: u64 = 8;
/// Emission rays a sample, as a mean over the image, are fewer than its pixels over this. Measured: docs/benchmarks.
const PIXELS_A_RAY: u64 = 2;

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
        let most_pixels = if wanted.is_some() { pixels } else { pixels / PIXELS_A_RAY / 2 };
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
        let affordable = (pixels / PIXELS_A_RAY / film.count).clamp(1, MOST_RAYS);
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
        let two_sided = material.kind_flags & (MATERIAL_DOUBLE_SIDED | MATERIAL_BLACK_BACK) == MATERIAL_DOUBLE_SIDED;
        let (vertices, mirrored) = place(prepared, &light);
        (two_sided || eye.is_before(vertices, mirrored)).then(|| eye.project(vertices))
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
    let rows = prepared.instances[light.instance as usize].record.object_to_world;
    let rows = rows.map(|[x, y, z, t]| (Vec3::new(x, y, z).as_dvec3(), f64::from(t)));
    let mirrored = rows[0].0.dot(rows[1].0.cross(rows[2].0)) < 0.0;
    let placed = vertices.map(|v| DVec3::from(rows.map(|(row, translation)| row.dot(v) + translation)));
    (placed, mirrored)
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
        let seen = vertices.map(|vertex| {
            let offset = vertex - self.origin;
            let depth = offset.dot(self.forward);
            let w = if self.orthographic { 1.0 } else { depth };
            (DVec3::new(offset.dot(self.across), offset.dot(self.down), w), depth)
        });
        let mut polygon: Vec<(DVec3, f64)> = seen.to_vec();
        // Before the camera, and between the film's four edges; with these alone w ≥ 0.
        let sides: [fn(&(DVec3, f64)) -> f64; 5] =
            [|v| v.1, |v| v.0.z + v.0.x, |v| v.0.z - v.0.x, |v| v.0.z + v.0.y, |v| v.0.z - v.0.y];
        for side in sides {
            polygon = clip(&polygon, side, |a, b, t| (a.0.lerp(b.0, t), a.1 + (b.1 - a.1) * t));
        }
        let size = self.size;
        let pixels = |v: DVec3| (v.truncate() / v.z + 1.0) * 0.5 * size;
        polygon.into_iter().filter(|(v, _)| v.z > 0.0).map(|(v, _)| pixels(v)).collect()
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
