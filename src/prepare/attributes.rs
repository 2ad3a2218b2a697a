//! Triangles of a primitive in the space they are traced in.

use glam::{DAffine3, DVec3, Vec3, Vec3Swizzles};

use super::coincident::SeenTriangles;
use super::materials::MaterialTable;
use super::pairs::{leaf_slot, pairs, turned};
use super::vertices::Vertices;
use super::{COORDINATE_LIMIT, PrepareError};
use crate::layout::{
    LeafSlot, MATERIAL_DOUBLE_SIDED, NONE, TRIANGLE_ALPHA, TRIANGLE_ATTRIBUTES, TRIANGLE_INDEX_MASK, TRIANGLE_LIGHT,
    Triangle,
};
use crate::scene::Primitive;

/// The records of all meshes.
#[derive(Debug, Default)]
pub(super) struct Attributes {
    pub(super) vertices: Vertices,
    /// `TRIANGLE_*` bits of what the vertices of some triangle carry.
    pub(super) flags: u32,
}

/// What becomes a [`LeafSlot`]: one triangle or two.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub(super) slot: LeafSlot,
    pub(super) first: Triangle,
    pub(super) second: Option<Triangle>,
}

/// The triangles of one traced mesh: the baked world, or a mesh that instances share.
#[derive(Debug, Default)]
pub(super) struct MeshGeometry {
    pub(super) name: String,
    pub(super) leaves: Vec<Leaf>,
    /// Triangles in the leaves.
    pub(super) triangles: u32,
    /// By the index in the `kind` of those with [`TRIANGLE_LIGHT`].
    pub(super) emissive: Vec<EmissiveTriangle>,
    /// By which those given twice are known.
    pub(super) seen: SeenTriangles,
}

/// A triangle that emits.
#[derive(Clone, Copy, Debug)]
pub(super) struct EmissiveTriangle {
    pub(super) vertices: [[f32; 3]; 3],
    pub(super) material: u32,
    /// Mean over the triangle of the emission's luminance.
    pub(super) mean_luminance: f64,
    /// The triangle's number, once the tree is built.
    pub(super) slot: u32,
}

/// Puts the triangles of a primitive, transformed, into `mesh`. Those without area have no normal and are left out, and so
/// are those whose alpha leaves nothing of them and emissive ones that are there already; a mirroring transform would turn the winding around, so two corners change
/// places.
pub(super) fn add_primitive(
    primitive: &Primitive,
    transform: &DAffine3,
    materials: &MaterialTable,
    attributes: &mut Attributes,
    mesh: &mut MeshGeometry,
) -> Result<(), PrepareError> {
    let used = materials.used(primitive.material);
    if used.absent {
        return Ok(());
    }
    let positions = transform_positions(primitive, transform)
        .ok_or_else(|| PrepareError::TooFar { name: mesh.name.clone(), limit: COORDINATE_LIMIT })?;
    let stored = attributes.vertices.add(primitive, transform, used)?;
    let mirrored = transform.matrix3.determinant() < 0.0;
    let map = materials.emission_map(used.record);
    let double_sided = materials.records[used.record as usize].kind_flags & MATERIAL_DOUBLE_SIDED != 0;
    let kind = used.record | if used.alpha { TRIANGLE_ALPHA } else { 0 };
    let mut kept = Vec::with_capacity(primitive.triangles.len());
    let mut records = Vec::with_capacity(primitive.triangles.len());
    for &[a, b, c] in &primitive.triangles {
        let corners = if mirrored { [a, c, b] } else { [a, b, c] };
        let vertices = corners.map(|corner| positions[corner as usize]);
        if is_degenerate(vertices) {
            continue;
        }
        // With a texture, its coordinates too would have to agree.
        if used.emissive && map.is_none() && !mesh.seen.is_new(vertices, used.record, double_sided) {
            continue;
        }
        let mut record = attributes.vertices.triangle(stored, corners);
        record.kind |= kind;
        if used.emissive {
            let mean_luminance = match map {
                Some(map) => map.mean(corners.map(|corner| texcoord(primitive, map.set, corner))),
                None => super::luminance(materials.records[used.record as usize].emission),
            } * materials.largest_opacity(used.record);
            if mean_luminance > 0.0 {
                let light = mesh.emissive.len() as u32;
                if light > TRIANGLE_INDEX_MASK {
                    return Err(PrepareError::TooManyLights);
                }
                record.kind = (record.kind & !TRIANGLE_INDEX_MASK) | TRIANGLE_LIGHT | light;
                mesh.emissive.push(EmissiveTriangle { vertices, material: used.record, mean_luminance, slot: NONE });
            }
        }
        attributes.flags |= record.kind & TRIANGLE_ATTRIBUTES;
        kept.push(corners);
        records.push(record);
    }
    mesh.triangles += kept.len() as u32;
    mesh.leaves.extend(pairs(&kept, &positions).into_iter().map(|pair| {
        let pair = if materials.has_alpha { pair.begun(&kept, &positions, used.alpha) } else { pair };
        let vertices = |(index, corner): (u32, usize)| {
            turned(kept[index as usize], corner).map(|vertex| positions[vertex as usize])
        };
        let record = |(index, corner): (u32, usize)| {
            let record = records[index as usize];
            Triangle { vertices: turned(record.vertices, corner), ..record }
        };
        Leaf {
            slot: leaf_slot(vertices(pair.first), pair.second.map(vertices)),
            first: record(pair.first),
            second: pair.second.map(record),
        }
    }));
    Ok(())
}

/// Positions rounded once, from f64, or `None` if one is beyond the limit.
fn transform_positions(primitive: &Primitive, transform: &DAffine3) -> Option<Vec<[f32; 3]>> {
    let identity = *transform == DAffine3::IDENTITY;
    primitive
        .positions
        .iter()
        .map(|&position| {
            let position = Vec3::from(position).as_dvec3();
            let point = if identity { position } else { transform.transform_point3(position) };
            // A NaN fails the comparison too.
            let fits = point.abs().max_element() <= COORDINATE_LIMIT && point.is_finite();
            fits.then(|| point.as_vec3().into())
        })
        .collect()
}

/// Whether the triangle has no area: corners on a line, in exact arithmetic (differences of f32 and their products are
/// exact or nearly so in f64) or in that of the shader, which could not tell where its normal points
/// (`surface_point` in shaders/include/geometry.glsl).
fn is_degenerate(vertices: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = vertices.map(Vec3::from);
    let (ab, ac) = (b - a, c - a);
    let in_shader = ab.yzx() * ac.zxy() - ab.zxy() * ac.yzx();
    let [a, b, c] = [a, b, c].map(|v| v.as_dvec3());
    // A device may take denormals for zeros.
    in_shader.abs().max_element() < f32::MIN_POSITIVE || (b - a).cross(c - a) == DVec3::ZERO
}

fn texcoord(primitive: &Primitive, set: usize, corner: u32) -> [f32; 2] {
    // The shader too takes missing coordinates as zero.
    primitive.texcoord_set(set).map_or([0.0; 2], |texcoords| texcoords[corner as usize])
}
