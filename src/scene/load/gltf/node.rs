//! The node hierarchy, flattened to world transforms in f64.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::Loader;
use super::json::Json;
use crate::scene::{Instance, SceneResult};

impl Loader<'_> {
    /// Walks the nodes of the scene to show, and loads what they hold.
    pub(super) fn load_nodes(&mut self) -> SceneResult<()> {
        let root = self.document.root();
        let scene = match root.refer_by("scene", "scenes")? {
            Some((_, scene)) => Some(scene),
            None => root.list("scenes")?.into_iter().next(),
        };
        let roots = match &scene {
            Some(scene) => {
                self.load_scene_extras(scene)?;
                scene.list("nodes")?.iter().map(|node| node.refer("nodes")).collect::<SceneResult<Vec<_>>>()?
            }
            None => root_nodes(&root)?,
        };
        self.walk(roots)
    }

    /// Visits every node once, parents before children. An explicit stack: files can nest deeper than ours.
    fn walk<'b>(&mut self, roots: Vec<(usize, Json<'b>)>) -> SceneResult<()> {
        let mut parents: HashMap<usize, Option<usize>> = HashMap::new();
        let mut stack: Vec<(usize, Json<'b>, Option<usize>, DAffine3)> =
            roots.into_iter().rev().map(|(index, node)| (index, node, None, DAffine3::IDENTITY)).collect();
        while let Some((index, node, parent, parent_to_world)) = stack.pop() {
            if parents.insert(index, parent).is_some() {
                return Err(node
                    .fail(visited_twice(index, parent, &parents))
                    .hint("nodes must form trees: export the file again, or duplicate the node"));
            }
            let local = local_transform(&node)?;
            let to_world = parent_to_world * local;
            if !to_world.is_finite() {
                return Err(node.fail("the node's world transform is not finite"));
            }
            self.load_node(index, &node, to_world)?;
            for child in node.list("children")?.into_iter().rev() {
                let (child_index, child) = child.refer("nodes")?;
                stack.push((child_index, child, Some(index), to_world));
            }
        }
        Ok(())
    }

    fn load_node(&mut self, index: usize, node: &Json<'_>, to_world: DAffine3) -> SceneResult<()> {
        let supported_here = ["KHR_lights_punctual"];
        if node.extension_names()?.iter().any(|name| !supported_here.contains(&name.as_str())) {
            self.warn_of_extensions(node)?;
        }
        if let Some((mesh_index, mesh)) = node.refer_by("mesh", "meshes")? {
            if node.get("skin")?.is_some() {
                self.warnings.add("skins are not supported yet: meshes are shown in their bind pose", &node.pointer);
            }
            if let Some(mesh) = self.mesh(mesh_index, &mesh)? {
                let named = Some(node.name()).filter(|name| !name.is_empty());
                let name = named.unwrap_or_else(|| format!("node {index}"));
                self.scene.instances.push(Instance { mesh, object_to_world: to_world, name });
            }
        }
        if let Some((_, camera)) = node.refer_by("camera", "cameras")? {
            self.load_camera(&camera, node, to_world)?;
        }
        if let Some(reference) = node.extension("KHR_lights_punctual")? {
            self.load_light(&reference, node, to_world)?;
        }
        Ok(())
    }
}

/// Without any scene: all nodes that are no node's child.
fn root_nodes<'a>(root: &Json<'a>) -> SceneResult<Vec<(usize, Json<'a>)>> {
    let nodes = root.list("nodes")?;
    let mut children = HashSet::new();
    for node in &nodes {
        for child in node.list("children")? {
            children.insert(child.refer("nodes")?.0);
        }
    }
    Ok(nodes.into_iter().enumerate().filter(|(index, _)| !children.contains(index)).collect())
}

/// What is wrong when `index` is reached again, this time from `parent`, which has been visited.
fn visited_twice(index: usize, parent: Option<usize>, parents: &HashMap<usize, Option<usize>>) -> String {
    let Some(parent) = parent else {
        return format!("node {index} is listed as a root of the scene, but is also reached otherwise");
    };
    // `parents` now maps `index` to `parent`: on a cycle the way up from there comes back to `index`.
    let mut ancestor = Some(parent);
    for _ in 0..parents.len() {
        match ancestor {
            Some(node) if node == index => return format!("the nodes form a cycle: node {index} is below itself"),
            Some(node) => ancestor = parents.get(&node).copied().flatten(),
            None => break,
        }
    }
    format!("node {index} has several parents, one of them node {parent}")
}

/// A node's own transform: `matrix`, or translation · rotation · scale.
fn local_transform(node: &Json<'_>) -> SceneResult<DAffine3> {
    if let Some(place) = node.get("matrix")? {
        let m = place.numbers::<16>()?;
        let is_affine = m[3].abs() < 1e-6 && m[7].abs() < 1e-6 && m[11].abs() < 1e-6 && (m[15] - 1.0).abs() < 1e-6;
        if !is_affine {
            return Err(place.fail("the matrix is not affine: its last row must be 0, 0, 0, 1"));
        }
        let column = |i: usize| DVec3::new(m[4 * i], m[4 * i + 1], m[4 * i + 2]);
        let matrix = DMat3::from_cols(column(0), column(1), column(2));
        return Ok(DAffine3::from_mat3_translation(matrix, column(3)));
    }
    let vector = |key: &str, default: DVec3| {
        let place = node.get(key)?;
        place.map_or(Ok(default), |place| place.numbers::<3>().map(DVec3::from))
    };
    let rotation = match node.get("rotation")? {
        Some(place) => {
            let quaternion = DQuat::from_array(place.numbers::<4>()?);
            let length = quaternion.length();
            if !(length > 1e-6 && length.is_finite()) {
                return Err(place.fail("the rotation is no quaternion of length 1"));
            }
            quaternion.normalize()
        }
        None => DQuat::IDENTITY,
    };
    Ok(DAffine3::from_scale_rotation_translation(
        vector("scale", DVec3::ONE)?,
        rotation,
        vector("translation", DVec3::ZERO)?,
    ))
}
