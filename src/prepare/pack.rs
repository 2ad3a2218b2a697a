//! Joins what the stages made into the arrays and constants of the layout.

use std::sync::Arc;

use bytemuck::Pod;

use super::acceleration::Acceleration;
use super::environment::PreparedEnvironment;
use super::features::Features;
use super::geometry::Geometry;
use super::lights::LightTable;
use super::materials::MaterialTable;
use super::textures::TextureTable;
use super::{PreparedInstance, Statistics};
use crate::layout::{RenderConstants, SCENE_ARRAYS, TRIANGLE_COLORS, TRIANGLE_NORMALS, TRIANGLE_TANGENTS, Texel};

/// Words in texels of four, the last padded with zeros.
pub(super) fn pack_words(words: &[u32]) -> Vec<Texel> {
    words
        .chunks(4)
        .map(|chunk| {
            let mut texel = Texel::default();
            texel[..chunk.len()].copy_from_slice(chunk);
            texel
        })
        .collect()
}

/// The same from chunks of anything: word k of a chunk is `word(chunk, k)`.
pub(super) fn pack<T>(chunks: impl Iterator<Item = T>, word: impl Fn(&T, usize) -> u32) -> Vec<Texel> {
    chunks.map(|chunk| [0, 1, 2, 3].map(|k| word(&chunk, k))).collect()
}

/// Appends records and returns the texel where they start.
fn append<T: Pod>(array: &mut Vec<Texel>, records: &[T]) -> u32 {
    let first = array.len() as u32;
    array.extend_from_slice(bytemuck::cast_slice(records));
    first
}

/// The arrays, and the scene's part of the constants.
pub(super) fn pack_arrays(
    geometry: Geometry,
    acceleration: Acceleration,
    materials: &MaterialTable,
    textures: TextureTable<'_>,
    environment: Arc<PreparedEnvironment>,
    lights: &LightTable,
    features: &Features,
) -> ([Vec<Texel>; SCENE_ARRAYS], RenderConstants) {
    let bounds = acceleration.bounds.to_f64();
    let mut attributes = Vec::new();
    let has_attributes = features.has_attributes();
    let mut vertices = 0;
    if has_attributes {
        append(&mut attributes, &acceleration.triangles);
        vertices = append(&mut attributes, &geometry.attributes.vertices.texels);
    } else {
        attributes = pack(acceleration.triangles.chunks(4), |four, k| four.get(k).map_or(0, |t| t.kind));
    }
    let mut tables = Vec::new();
    let (sin, cos) = environment.rotation_radians.sin_cos();
    let light_cdf = lights.cdf();
    let light_bvh_counts =
        if lights.near_lights() > 0 { super::cdf::count(&light_cdf, light_cdf.len() - 2) } else { 0 };
    let constants = RenderConstants {
        vertices,
        vertex_texels: if has_attributes { geometry.attributes.vertices.stride() } else { 0 },
        materials: append(&mut tables, &materials.records),
        textures: append(&mut tables, &textures.headers),
        lights: append(&mut tables, &lights.records),
        instances: append(&mut tables, &acceleration.instances),
        light_cdf_word: 4 * append(&mut tables, &pack_words(&light_cdf)),
        light_count: lights.records.len() as u32,
        environment_light: lights.environment,
        environment_width: environment.width,
        environment_height: environment.height,
        environment_marginal_word: environment.marginal_word,
        environment_conditional_word: environment.conditional_word,
        ggx_albedo: append_albedos(&mut tables, materials, features),
        environment_rgbe: environment.rgbe.into(),
        environment_radiance: environment.radiance,
        environment_cos: cos as f32,
        environment_sin: sin as f32,
        light_bvh: append(&mut tables, &lights.bvh.nodes),
        light_bvh_counts,
        near_lights: lights.near_lights(),
        scene_center: bounds.center().as_vec3().into(),
        ..RenderConstants::default()
    };
    let slots = acceleration.slots.into_flattened();
    let mut arrays = [slots, attributes, tables, textures.texels, Arc::unwrap_or_clone(environment).array];
    // A buffer of no bytes is not allowed.
    for array in arrays.iter_mut().filter(|array| array.is_empty()) {
        array.push(Texel::default());
    }
    (arrays, constants)
}

/// Appends the albedo tables that the materials need and says where that of GGX begins: that of rough dielectrics stands
/// before it, that of unequal roughness behind it.
fn append_albedos(tables: &mut Vec<Texel>, materials: &MaterialTable, features: &Features) -> u32 {
    if !materials.need_ggx() {
        return 0;
    }
    if materials.need_dielectrics() {
        append(tables, &super::ggx::dielectric_albedo_table());
    }
    let first = append(tables, &super::ggx::albedo_table());
    if features.anisotropy {
        append(tables, &super::ggx::anisotropic_albedo_table());
    }
    first
}

/// What the scene needs of the kernel.
pub(super) fn features(
    geometry: &Geometry,
    acceleration: &Acceleration,
    materials: &MaterialTable,
    textures: &TextureTable<'_>,
    environment: &PreparedEnvironment,
    lights: &LightTable,
) -> Features {
    let any = |flag: u32| geometry.attributes.flags & flag != 0;
    let mut features = Features {
        lights: lights.kinds(),
        instances: !acceleration.instances.is_empty(),
        normals: any(TRIANGLE_NORMALS),
        vertex_colors: any(TRIANGLE_COLORS),
        environment: environment.kind,
        environment_importance: environment.conditional_word != 0,
        environment_rgbe: environment.rgbe,
        light_choice: lights.choice,
        ..Features::default()
    };
    materials.add_features(textures, &mut features);
    // Without tangents it has no direction.
    features.anisotropy &= any(TRIANGLE_TANGENTS);
    features
}

/// The figures that the trees and lights give.
pub(super) fn statistics(acceleration: &Acceleration, lights: &LightTable) -> Statistics {
    let half_area = |size: glam::DVec3| size.x * size.y + size.y * size.z + size.z * size.x;
    let root_area = half_area(acceleration.bounds.to_f64().half_extent());
    let Some((world, shared)) = acceleration.meshes.split_first() else { return Statistics::default() };
    let mut statistics = Statistics {
        triangles: acceleration.meshes.iter().map(|mesh| u64::from(mesh.triangles)).sum(),
        placed_triangles: world.triangles.into(),
        instances: acceleration.instances.len() as u64,
        inner_slots: acceleration.meshes.iter().map(|mesh| u64::from(mesh.inner_slots)).sum(),
        depth: world.depth + shared.iter().map(|mesh| mesh.depth).max().unwrap_or(0),
        sah_cost: world.sah_cost,
        lights: lights.records.len() as u64,
        light_nodes: lights.bvh.nodes.len() as u64,
        ..Statistics::default()
    };
    for (&mesh, bounds) in acceleration.instance_meshes.iter().zip(&acceleration.instance_bounds) {
        let mesh = &acceleration.meshes[mesh];
        statistics.placed_triangles += u64::from(mesh.triangles);
        if root_area > 0.0 {
            statistics.sah_cost += half_area(bounds.to_f64().half_extent()) / root_area * mesh.sah_cost;
        }
    }
    statistics
}

/// The instances with where they come from.
pub(super) fn prepared_instances(acceleration: &Acceleration) -> Vec<PreparedInstance> {
    acceleration
        .instances
        .iter()
        .zip(&acceleration.instance_meshes)
        .zip(&acceleration.instance_sources)
        .map(|((&record, &mesh), &source)| PreparedInstance { record, mesh, source })
        .collect()
}
