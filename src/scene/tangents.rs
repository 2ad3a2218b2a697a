//! Tangents by MikkTSpace (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited"), so that normal maps look as the
//! tools that baked them mean it.

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::Vec3;

use super::{Primitive, TextureTransform};

impl Primitive {
    /// Makes tangents along the given set of texture coordinates, transformed. Corners that share a vertex but not a
    /// tangent get vertices of their own. Without the set, or where the algorithm finds no tangent anywhere, the
    /// primitive is left without tangents.
    pub fn generate_tangents(&mut self, set: usize, transform: &TextureTransform) {
        self.tangents = None;
        let Some(texcoords) = self.texcoord_set(set) else { return };
        let texcoords = texcoords.iter().map(|&uv| image_up(transform.apply(uv.map(f64::from)))).collect();
        let mut corners = Corners { primitive: self, texcoords, tangents: vec![None; self.triangles.len()] };
        // The error type has no values.
        if generate_tangents(&mut corners).is_err() {
            return;
        }
        let tangents = corners.tangents;
        if tangents.iter().any(Option::is_some) {
            self.split(&tangents);
        }
    }

    /// Gives each vertex its tangent; where another corner of it was there first with another one, a copy of the vertex.
    fn split(&mut self, corners: &[Option<[[f32; 4]; 3]>]) {
        // A triangle without any has no area, or its texture coordinates have none: it is shaded without a normal map.
        const NONE: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
        let mut tangents: Vec<Option<[f32; 4]>> = vec![None; self.positions.len()];
        let mut copies = std::collections::HashMap::new();
        let mut triangles = std::mem::take(&mut self.triangles);
        for (triangle, corner_tangents) in triangles.iter_mut().zip(corners) {
            for (vertex, tangent) in triangle.iter_mut().zip(corner_tangents.unwrap_or([NONE; 3])) {
                let first = *tangents[*vertex as usize].get_or_insert(tangent);
                if first != tangent {
                    *vertex = *copies.entry((*vertex, tangent.map(f32::to_bits))).or_insert_with(|| {
                        tangents.push(Some(tangent));
                        self.copy_vertex(*vertex as usize)
                    });
                }
            }
        }
        self.triangles = triangles;
        self.tangents = Some(tangents.into_iter().map(|tangent| tangent.unwrap_or(NONE)).collect());
    }

    /// Appends a copy of a vertex, but for its tangent, and returns its index.
    fn copy_vertex(&mut self, vertex: usize) -> u32 {
        fn copy<T: Copy>(values: &mut Option<Vec<T>>, vertex: usize) {
            if let Some(values) = values {
                values.push(values[vertex]);
            }
        }
        self.positions.push(self.positions[vertex]);
        copy(&mut self.normals, vertex);
        copy(&mut self.texcoords, vertex);
        copy(&mut self.texcoords_1, vertex);
        copy(&mut self.colors, vertex);
        self.positions.len() as u32 - 1
    }
}

/// The algorithm's v points up, glTF's down.
fn image_up([u, v]: [f64; 2]) -> [f32; 2] {
    [u as f32, (1.0 - v) as f32]
}

/// A primitive as the algorithm sees it.
struct Corners<'a> {
    primitive: &'a Primitive,
    texcoords: Vec<[f32; 2]>,
    tangents: Vec<Option<[[f32; 4]; 3]>>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.primitive.triangles[face][corner] as usize
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.primitive.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.primitive.positions[self.vertex(face, corner)]
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        if let Some(normals) = &self.primitive.normals {
            return normals[self.vertex(face, corner)];
        }
        let [a, b, c] = [0, 1, 2].map(|corner| Vec3::from(self.position(face, corner)).as_dvec3());
        (b - a).cross(c - a).normalize_or_zero().as_vec3().into()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.texcoords[self.vertex(face, corner)]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let Some(space) = space else { return };
        self.tangents[face].get_or_insert([[0.0, 0.0, 0.0, 1.0]; 3])[corner] = space.tangent_encoded();
    }
}
