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
    /// Texture coordinates of set 1.
    pub texcoords_1: Option<Vec<[f32; 2]>>,
    /// Unit tangents, along the u of the normal texture's coordinates, and the sign (1 or −1) of the bitangent,
    /// sign·(normal × tangent), which points up the image. What needs tangents makes do without where they are missing.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// Linear colours and alpha, in [0, 1]; they multiply the material's.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Triangles, each index below `positions.len()`; counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into `Scene::materials`.
    pub material: usize,
}

impl Primitive {
    /// A set of texture coordinates, if the primitive has it.
    pub fn texcoord_set(&self, set: usize) -> Option<&[[f32; 2]]> {
        match set {
            0 => self.texcoords.as_deref(),
            1 => self.texcoords_1.as_deref(),
            _ => None,
        }
    }
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
