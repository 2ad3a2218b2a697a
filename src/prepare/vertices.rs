//! Shading attributes of vertices as the shader reads them, with no more texels a vertex than the scene needs.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::PrepareError;
use super::materials::{MaterialTable, MaterialUse};
use crate::layout::{
    TRIANGLE_COLORS, TRIANGLE_NORMALS, TRIANGLE_TANGENTS, TRIANGLE_TEXCOORDS, Texel, Triangle, Vertex,
};
use crate::scene::{Primitive, Scene};

/// The vertex records of all meshes.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    /// `TRIANGLE_*` bits of everything that some primitive stores.
    all: u32,
    /// Records, [`Vertices::stride`] texels each.
    pub(super) texels: Vec<Texel>,
}

/// A primitive's vertices.
#[derive(Clone, Copy)]
pub(super) struct Stored {
    /// Index of the first.
    first: u32,
    /// `TRIANGLE_*` bits of what they have.
    flags: u32,
}

impl Vertices {
    /// No vertices yet, with room in each record for what the scene's primitives need.
    pub(super) fn for_scene(scene: &Scene, materials: &MaterialTable) -> Self {
        let placed = scene.instances.iter().flat_map(|instance| &scene.meshes[instance.mesh].primitives);
        let needs = placed.filter(|p| !p.triangles.is_empty()).map(|p| flags(p, materials.used(p.material)));
        Self { all: needs.fold(0, |all, flags| all | flags), texels: Vec::new() }
    }

    /// Texels a vertex takes.
    pub(super) fn stride(&self) -> u32 {
        1 + u32::from(self.has_second_texel())
            + u32::from(self.has(TRIANGLE_TANGENTS))
            + u32::from(self.has(TRIANGLE_COLORS))
    }

    fn has(&self, flag: u32) -> bool {
        self.all & flag != 0
    }

    fn has_second_texel(&self) -> bool {
        self.has(TRIANGLE_TEXCOORDS | TRIANGLE_TANGENTS)
    }

    /// Stores the vertices of a primitive, transformed, if anything of them is used.
    ///
    /// # Errors
    /// If there are more than the layout can address.
    pub(super) fn add(
        &mut self,
        primitive: &Primitive,
        transform: &DAffine3,
        used: MaterialUse,
    ) -> Result<Stored, PrepareError> {
        let stride = self.stride() as usize;
        let first = (self.texels.len() / stride) as u32;
        let matrix = normal_matrix(&transform.matrix3);
        let mut flags = flags(primitive, used);
        if matrix.is_none() {
            flags &= !(TRIANGLE_NORMALS | TRIANGLE_TANGENTS);
        }
        if flags == 0 {
            return Ok(Stored { first, flags });
        }
        self.texels.reserve(primitive.positions.len() * stride);
        for index in 0..primitive.positions.len() {
            let vertex = vertex(primitive, index, flags, &transform.matrix3, &matrix.unwrap_or_default());
            self.push(&vertex);
        }
        if self.texels.len() > (u32::MAX / 2) as usize {
            return Err(PrepareError::TooManyVertices);
        }
        Ok(Stored { first, flags })
    }

    fn push(&mut self, vertex: &Vertex) {
        let [first, second, third, color]: [Texel; 4] = bytemuck::cast(*vertex);
        self.texels.push(first);
        if self.has_second_texel() {
            self.texels.push(second);
        }
        if self.has(TRIANGLE_TANGENTS) {
            self.texels.push(third);
        }
        if self.has(TRIANGLE_COLORS) {
            self.texels.push(color);
        }
    }

    /// The record of a triangle with these corners of a primitive.
    /// Its kind has nothing but the `TRIANGLE_*` bits of what the vertices carry.
    pub(super) fn triangle(&self, stored: Stored, corners: [u32; 3]) -> Triangle {
        let mut flags = stored.flags;
        if flags == 0 {
            return Triangle::default();
        }
        let vertices = corners.map(|corner| stored.first + corner);
        let normal = |vertex: u32| &self.texels[(vertex * self.stride()) as usize][..3];
        // A normal that the transform destroyed is stored as zero: that triangle is flat.
        if vertices.iter().any(|&vertex| normal(vertex) == [0; 3]) {
            flags &= !TRIANGLE_NORMALS;
        }
        Triangle { vertices, kind: flags }
    }
}

/// `TRIANGLE_*` bits of what a primitive has and its material uses.
fn flags(primitive: &Primitive, used: MaterialUse) -> u32 {
    let texcoords = (0..2).any(|set| used.texcoord_sets[set] && primitive.texcoord_set(set).is_some());
    let bits = [
        (TRIANGLE_NORMALS, used.shaded && primitive.normals.is_some()),
        (TRIANGLE_TEXCOORDS, texcoords),
        (TRIANGLE_TANGENTS, used.tangents && primitive.tangents.is_some()),
        (TRIANGLE_COLORS, primitive.colors.is_some()),
    ];
    bits.into_iter().filter(|(_, kept)| *kept).fold(0, |flags, (flag, _)| flags | flag)
}

/// Vertex `index` of a primitive with the attributes of `flags`. Normals go by `normal_matrix`, tangents, which are
/// differences of points, by `matrix`.
fn vertex(primitive: &Primitive, index: usize, flags: u32, matrix: &DMat3, normal_matrix: &DMat3) -> Vertex {
    let mut vertex = Vertex::default();
    let along = |matrix: &DMat3, v: Vec3| -> [f32; 3] { (*matrix * v.as_dvec3()).normalize_or_zero().as_vec3().into() };
    if let Some(normals) = primitive.normals.as_ref().filter(|_| flags & TRIANGLE_NORMALS != 0) {
        vertex.normal = along(normal_matrix, Vec3::from(normals[index]));
    }
    if flags & TRIANGLE_TEXCOORDS != 0 {
        let set = |set| primitive.texcoord_set(set).map_or([0.0; 2], |texcoords| texcoords[index]);
        [[vertex.u, vertex.v], [vertex.u_1, vertex.v_1]] = [set(0), set(1)];
    }
    if let Some(tangents) = primitive.tangents.as_ref().filter(|_| flags & TRIANGLE_TANGENTS != 0) {
        let [x, y, z, sign] = tangents[index];
        vertex.tangent = along(matrix, Vec3::new(x, y, z));
        // M(n × t) = det(M)·M⁻ᵀ(n) × M(t)·…: a mirror turns the cross product around, and the image with it.
        vertex.bitangent_sign = if matrix.determinant() < 0.0 { -sign } else { sign };
    }
    if let Some(colors) = &primitive.colors {
        vertex.color = colors[index];
    }
    vertex
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
