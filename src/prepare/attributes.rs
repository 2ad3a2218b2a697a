//! Triangles of a primitive in the space they are traced in, with their shading attributes.

use glam::{DAffine3, DMat3, DVec3, Vec3, Vec3Swizzles};

use super::coincident::SeenTriangles;
use super::materials::{MaterialTable, MaterialUse};
use super::{COORDINATE_LIMIT, PrepareError};
use crate::layout::{
    LeafSlot, MATERIAL_DOUBLE_SIDED, NONE, SLOT_ALPHA, SLOT_LEAF, TRIANGLE_NORMALS, TRIANGLE_TEXCOORDS, Triangle,
    Vertex,
};
use crate::scene::Primitive;

/// The records of all meshes.
#[derive(Debug, Default)]
pub(super) struct Attributes {
    pub(super) triangles: Vec<Triangle>,
    pub(super) vertices: Vec<Vertex>,
}

/// The triangles of one traced mesh: the baked world, or a mesh that instances share.
#[derive(Debug, Default)]
pub(super) struct MeshGeometry {
    pub(super) name: String,
    pub(super) leaves: Vec<LeafSlot>,
    /// By [`LeafSlot::light`].
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
    /// Where it is, once the tree is built.
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
    let first_vertex = attributes.vertices.len() as u32;
    let available = add_vertices(primitive, transform, used, &mut attributes.vertices);
    if attributes.vertices.len() > (u32::MAX / 2) as usize {
        return Err(PrepareError::TooManyVertices);
    }
    let mirrored = transform.matrix3.determinant() < 0.0;
    let map = materials.emission_map(used.record);
    let double_sided = materials.records[used.record as usize].kind_flags & MATERIAL_DOUBLE_SIDED != 0;
    let kind = SLOT_LEAF | used.record | if used.alpha { SLOT_ALPHA } else { 0 };
    mesh.leaves.reserve(primitive.triangles.len());
    attributes.triangles.reserve(primitive.triangles.len());
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
        let mut light = NONE;
        if used.emissive {
            let mean_luminance = match map {
                Some(map) => map.mean(corners.map(|corner| texcoord(primitive, corner))),
                None => super::luminance(materials.records[used.record as usize].emission),
            } * materials.largest_opacity(used.record);
            if mean_luminance > 0.0 {
                light = mesh.emissive.len() as u32;
                mesh.emissive.push(EmissiveTriangle { vertices, material: used.record, mean_luminance, slot: NONE });
            }
        }
        let triangle = attributes.triangles.len() as u32;
        mesh.leaves.push(LeafSlot { vertices, triangle, light, kind });
        attributes.triangles.push(available.triangle(corners, first_vertex, &attributes.vertices));
    }
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

fn texcoord(primitive: &Primitive, corner: u32) -> [f32; 2] {
    // The shader too takes missing coordinates as zero.
    primitive.texcoords.as_ref().map_or([0.0; 2], |texcoords| texcoords[corner as usize])
}

/// Which attributes a primitive's vertices were stored with.
#[derive(Clone, Copy)]
struct Available {
    normals: bool,
    texcoords: bool,
}

impl Available {
    fn triangle(self, corners: [u32; 3], first_vertex: u32, vertices: &[Vertex]) -> Triangle {
        let indices = corners.map(|corner| first_vertex + corner);
        // A normal that the transform destroyed is stored as zero: that triangle is flat.
        let normals = self.normals && indices.iter().all(|&index| vertices[index as usize].normal != [0.0; 3]);
        let mut flags = if normals { TRIANGLE_NORMALS } else { 0 };
        if self.texcoords {
            flags |= TRIANGLE_TEXCOORDS;
        }
        Triangle { vertices: if flags == 0 { [0; 3] } else { indices }, flags }
    }
}

/// Appends the vertices if anything of them is used.
fn add_vertices(
    primitive: &Primitive,
    transform: &DAffine3,
    used: MaterialUse,
    vertices: &mut Vec<Vertex>,
) -> Available {
    let normal_matrix = normal_matrix(&transform.matrix3);
    let normals = primitive.normals.as_ref().filter(|_| used.shaded).zip(normal_matrix);
    let texcoords = primitive.texcoords.as_ref().filter(|_| used.textured);
    let available = Available { normals: normals.is_some(), texcoords: texcoords.is_some() };
    if !available.normals && !available.texcoords {
        return available;
    }
    vertices.extend((0..primitive.positions.len()).map(|index| {
        let normal = normals.map_or([0.0; 3], |(normals, matrix)| {
            let normal = matrix * Vec3::from(normals[index]).as_dvec3();
            normal.normalize_or_zero().as_vec3().into()
        });
        let [u, v] = texcoords.map_or([0.0; 2], |texcoords| texcoords[index]);
        Vertex { normal, u, v, unused: [0.0; 3] }
    }));
    available
}

/// The inverse transpose up to a positive factor: the cofactor matrix times the determinant's sign. Columns are scaled
/// to unit length first, so that neither tiny nor huge scales leave f64. `None` if it is singular.
fn normal_matrix(matrix: &DMat3) -> Option<DMat3> {
    let lengths = DVec3::new(matrix.x_axis.length(), matrix.y_axis.length(), matrix.z_axis.length());
    if lengths.min_element() <= 0.0 || !lengths.is_finite() {
        return None;
    }
    let (x, y, z) = (matrix.x_axis / lengths.x, matrix.y_axis / lengths.y, matrix.z_axis / lengths.z);
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let determinant = x.dot(cofactors.x_axis);
    if determinant == 0.0 {
        return None;
    }
    // M = M̂·diag(lengths), so M⁻ᵀ = M̂⁻ᵀ·diag(1/lengths); relative to the shortest, no factor exceeds 1.
    let factors = lengths.min_element() / lengths * determinant.signum();
    Some(DMat3::from_cols(cofactors.x_axis * factors.x, cofactors.y_axis * factors.y, cofactors.z_axis * factors.z))
}
