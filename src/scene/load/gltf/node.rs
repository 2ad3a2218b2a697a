//! The node hierarchy, flattened to world transforms in f64.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::Loader;
use super::json::Json;
use crate::scene::{Instance, SceneResult};

/// How often nodes may be shown again below a further parent: a few nodes, each twice below the one before, would
/// unfold to any number.
const MAX_REPEATS: usize = 1 << 18;

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
        let mut listed = HashSet::new();
        self.walk(roots.into_iter().filter(|(index, _)| listed.insert(*index)).collect())
    }

    /// Visits the nodes, parents before children. The specification wants trees; where a node has several parents it is
    /// shown below each. An explicit stack: files can nest deeper than ours.
    fn walk<'b>(&mut self, roots: Vec<(usize, Json<'b>)>) -> SceneResult<()> {
        let (shared, count) = check_hierarchy(&roots)?;
        let mut visits = 0;
        let mut stack: Vec<(usize, Json<'b>, DAffine3)> =
            roots.into_iter().rev().map(|(index, node)| (index, node, DAffine3::IDENTITY)).collect();
        while let Some((index, node, parent_to_world)) = stack.pop() {
            visits += 1;
            if visits > count + MAX_REPEATS {
                let message = format!("nodes with several parents unfold to more than {MAX_REPEATS} further ones");
                return Err(node.fail(message).hint("instance the mesh by plain nodes instead"));
            }
            if shared.contains(&index) {
                self.warnings.add("nodes with several parents are shown below each of them", &node.pointer);
            }
            let to_world = parent_to_world * local_transform(&node)?;
            if !to_world.is_finite() {
                return Err(node.fail("the node's world transform is not finite"));
            }
            self.load_node(index, &node, to_world)?;
            for child in node.list("children")?.into_iter().rev() {
                let (child_index, child) = child.refer("nodes")?;
                stack.push((child_index, child, to_world));
            }
        }
        Ok(())
    }

    fn load_node(&mut self, index: usize, node: &Json<'_>, to_world: DAffine3) -> SceneResult<()> {
        self.warn_of_extensions(node)?;
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

/// Refuses cycles, and roots that are also below another node (they would be shown twice in one place). Returns the
/// nodes with several parents, and the number of nodes.
fn check_hierarchy(roots: &[(usize, Json<'_>)]) -> SceneResult<(HashSet<usize>, usize)> {
    #[derive(PartialEq)]
    enum State {
        Open,
        Done,
    }
    enum Step<'a> {
        Enter(usize, Json<'a>),
        Leave(usize),
    }
    const HINT: &str = "nodes must form trees: export the file again";
    let root_indices: HashSet<usize> = roots.iter().map(|(index, _)| *index).collect();
    let mut states: HashMap<usize, State> = HashMap::new();
    let mut shared = HashSet::new();
    let mut stack: Vec<Step<'_>> = roots.iter().map(|(index, node)| Step::Enter(*index, node.clone())).collect();
    while let Some(step) = stack.pop() {
        let (index, node) = match step {
            Step::Enter(index, node) => (index, node),
            Step::Leave(index) => {
                states.insert(index, State::Done);
                continue;
            }
        };
        match states.insert(index, State::Open) {
            None => {}
            Some(State::Open) => {
                return Err(node.fail(format!("the nodes form a cycle: node {index} is below itself")).hint(HINT));
            }
            Some(State::Done) => {
                states.insert(index, State::Done);
                shared.insert(index);
                continue;
            }
        }
        stack.push(Step::Leave(index));
        for child in node.list("children")? {
            let (child_index, child_node) = child.refer("nodes")?;
            if root_indices.contains(&child_index)
                && child_index != index
                && states.get(&child_index) != Some(&State::Open)
            {
                let message = format!("node {child_index} is a root of the scene and also a child of node {index}");
                return Err(child.fail(message).hint(HINT));
            }
            stack.push(Step::Enter(child_index, child_node));
        }
    }
    Ok((shared, states.len()))
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
