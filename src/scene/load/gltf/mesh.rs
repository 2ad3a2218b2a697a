//! Meshes: vertex attributes and indices to triangles, with only the vertices that some triangle uses.

use super::Loader;
use super::accessor::Accessor;
use super::attributes::AttributeReader;
use super::json::Json;
use crate::scene::load::warnings::NO_DIRECTION;
use crate::scene::{Mesh, Primitive, SceneResult};

/// How a list of vertices forms triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topology {
    Triangles,
    Strip,
    Fan,
}

impl Loader<'_> {
    /// The index in `Scene::meshes` of a glTF mesh, loaded on first use; `None` if it has no triangles.
    pub(super) fn mesh(&mut self, index: usize, place: &Json<'_>) -> SceneResult<Option<usize>> {
        if let Some(&known) = self.meshes.get(&index) {
            return Ok(known);
        }
        let mut mesh = Mesh { name: place.name(), primitives: Vec::new() };
        for primitive in place.require("primitives")?.elements()? {
            mesh.primitives.extend(self.primitive(&primitive)?);
        }
        let loaded = (!mesh.primitives.is_empty()).then(|| {
            self.scene.meshes.push(mesh);
            self.scene.meshes.len() - 1
        });
        self.meshes.insert(index, loaded);
        Ok(loaded)
    }

    fn primitive(&mut self, place: &Json<'_>) -> SceneResult<Option<Primitive>> {
        let Some(topology) = self.topology(place)? else { return Ok(None) };
        let attributes = place.require("attributes")?;
        let Some((_, positions_place)) = attributes.refer_by("POSITION", "accessors")? else {
            self.warnings.add("primitives without POSITION are skipped", &place.pointer);
            return Ok(None);
        };
        let positions = Accessor::vec3(&positions_place, &mut self.buffers)?;
        let indices = self.indices(place, &positions)?;
        if topology == Topology::Triangles && indices.len() % 3 != 0 {
            self.warnings.add("vertices that complete no triangle are ignored", &place.pointer);
        }
        let (triangles, vertices) = compact(assemble(topology, &indices), positions.count());
        drop(indices);
        if triangles.is_empty() {
            return Ok(None);
        }
        self.warn_of_attributes(place)?;

        let has_texcoords = [attributes.get("TEXCOORD_0")?.is_some(), attributes.get("TEXCOORD_1")?.is_some()];
        let material = self.material(place.refer_by("material", "materials")?, has_texcoords)?;
        let reader = AttributeReader { attributes: &attributes, positions: &positions, vertices: &vertices };
        let mut primitive = Primitive {
            positions: finite_positions(&positions, &positions_place, &vertices)?,
            normals: reader.normals(self)?,
            colors: reader.colors(self)?,
            triangles,
            material,
            ..Primitive::default()
        };
        let tangents = self.scene.materials[material].tangent_coordinates();
        let [first, second] = self.scene.materials[material].texcoord_sets();
        if first || tangents.is_some_and(|(set, _)| set == 0) {
            primitive.texcoords = reader.texcoords(self, "TEXCOORD_0")?;
        }
        if second {
            primitive.texcoords_1 = reader.texcoords(self, "TEXCOORD_1")?;
        }
        if let Some((set, transform)) = tangents {
            // Without normals a file's tangents are to be ignored (glTF 2.0, section 3.7.2.1).
            primitive.tangents = if primitive.normals.is_some() { reader.tangents(self)? } else { None };
            if primitive.tangents.is_none() {
                primitive.generate_tangents(set, &transform);
            }
            if primitive.tangents.is_none() && self.scene.materials[material].anisotropy > 0.0 {
                self.warnings.add(NO_DIRECTION, &place.pointer);
            }
        }
        Ok(Some(primitive))
    }

    /// The primitive's topology; `None` for points and lines.
    fn topology(&mut self, place: &Json<'_>) -> SceneResult<Option<Topology>> {
        match place.unsigned_or("mode", 4)? {
            4 => Ok(Some(Topology::Triangles)),
            5 => Ok(Some(Topology::Strip)),
            6 => Ok(Some(Topology::Fan)),
            0..=3 => {
                self.warnings.add("points and lines have no surface and are skipped", &place.pointer);
                Ok(None)
            }
            mode => Err(place.fail(format!("mode {mode} is no primitive mode of glTF 2.0"))),
        }
    }

    /// The vertices in drawing order, each below the number of positions.
    fn indices(&mut self, place: &Json<'_>, positions: &Accessor) -> SceneResult<Vec<u32>> {
        let count = positions.count();
        let Some((_, indices_place)) = place.refer_by("indices", "accessors")? else {
            let count = u32::try_from(count).map_err(|_| place.fail("more than 2³² vertices"))?;
            return Ok((0..count).collect());
        };
        let accessor = Accessor::indices(&indices_place, &mut self.buffers)?;
        let indices: Vec<u32> = (0..accessor.count()).map(|i| accessor.get_index(i)).collect();
        match indices.iter().position(|&index| index as usize >= count) {
            None => Ok(indices),
            Some(at) => {
                let message =
                    format!("vertex index {} (element {at}) is out of range: POSITION has {count}", indices[at]);
                Err(accessor.fail(place, message).hint("the file is damaged: export it again"))
            }
        }
    }

    fn warn_of_attributes(&mut self, place: &Json<'_>) -> SceneResult<()> {
        if !place.list("targets")?.is_empty() {
            self.warnings.add("morph targets are not supported yet: meshes are shown unmorphed", &place.pointer);
        }
        self.warn_of_extensions(place)
    }
}

fn finite_positions(accessor: &Accessor, place: &Json<'_>, vertices: &[u32]) -> SceneResult<Vec<[f32; 3]>> {
    let positions: Vec<[f32; 3]> = vertices.iter().map(|&v| accessor.get(v as usize)).collect();
    match positions.iter().position(|position| !position.iter().all(|x| x.is_finite())) {
        None => Ok(positions),
        Some(at) => {
            let [x, y, z] = positions[at];
            let message = format!("the position of vertex {} is ({x}, {y}, {z})", vertices[at]);
            Err(place.fail(message).hint("positions must be finite: repair the mesh and export it again"))
        }
    }
}

/// Vertices in drawing order to triangles (glTF 2.0 section 3.7.2.1). Triangles with a vertex twice have no area and are
/// left out; strips use them to turn.
fn assemble(topology: Topology, v: &[u32]) -> Vec<[u32; 3]> {
    let (chunks, windows) = match topology {
        Topology::Triangles => (v.len() / 3, 0),
        Topology::Strip | Topology::Fan => (0, v.len().saturating_sub(2)),
    };
    let triangles = (0..chunks).map(|i| [v[3 * i], v[3 * i + 1], v[3 * i + 2]]);
    let connected = (0..windows).map(|i| match topology {
        Topology::Fan => [v[i + 1], v[i + 2], v[0]],
        _ => [v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]],
    });
    triangles.chain(connected).filter(|&[a, b, c]| a != b && b != c && c != a).collect()
}

/// Renumbers the triangles so that only used vertices remain; returns those in their old order.
fn compact(mut triangles: Vec<[u32; 3]>, count: usize) -> (Vec<[u32; 3]>, Vec<u32>) {
    const UNUSED: u32 = u32::MAX;
    let used = || triangles.iter().flatten().copied();
    let (Some(low), Some(high)) = (used().min(), used().max()) else { return (Vec::new(), Vec::new()) };
    debug_assert!((high as usize) < count);
    // The table spans only the used range: files often share one array among many primitives.
    let mut renumbered = vec![UNUSED; (high - low) as usize + 1];
    used().for_each(|vertex| renumbered[(vertex - low) as usize] = 0);
    let mut vertices = Vec::new();
    for (offset, entry) in renumbered.iter_mut().enumerate().filter(|(_, entry)| **entry != UNUSED) {
        *entry = vertices.len() as u32;
        vertices.push(low + offset as u32);
    }
    triangles.iter_mut().flatten().for_each(|vertex| *vertex = renumbered[(*vertex - low) as usize]);
    (triangles, vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_winding() {
        let v = [0, 1, 2, 3, 4];
        assert_eq!(assemble(Topology::Strip, &v), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(assemble(Topology::Fan, &v), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        assert_eq!(assemble(Topology::Triangles, &v), [[0, 1, 2]]);
        assert!(assemble(Topology::Strip, &v[..2]).is_empty());
        assert!(assemble(Topology::Fan, &[]).is_empty());
    }

    #[test]
    fn unused_vertices_are_dropped() {
        let (triangles, vertices) = compact(vec![[7, 3, 9], [9, 3, 4]], 10);
        assert_eq!(vertices, [3, 4, 7, 9]);
        assert_eq!(triangles, [[2, 0, 3], [3, 0, 1]]);
    }
}
