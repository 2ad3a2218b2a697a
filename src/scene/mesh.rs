//! Meshes and their placement.

use glam::DAffine3;

/// A mesh: primitives that share one transform.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name from the file; may be empty.
    pub name: String,
    /// Parts with one material each.
    pub primitives: Vec<Primitive>,
}

/// Triangles with one material, in object space. All per-vertex arrays have the length of `positions`.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Vertex positions, finite.
    pub positions: Vec<[f32; 3]>,
    /// Unit shading normals; without them the primitive is flat-shaded.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates of set 0, v downwards as in glTF.
    pub texcoords: Option<Vec<[f32; 2]>>,
    /// Triangles, each index below `positions.len()`; counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into `Scene::materials`.
    pub material: usize,
}

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Index into `Scene::meshes`.
    pub mesh: usize,
    /// Object space to world space; may mirror (negative determinant flips the front face) or be singular.
    pub object_to_world: DAffine3,
    /// Name of the node, for messages.
    pub name: String,
}
