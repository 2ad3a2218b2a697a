//! Better binary trees by reinsertion (Meister and Bittner 2018, "Parallel Reinsertion for Bounding Volume Hierarchy
//! Optimization"; the crate `obvhs`): subtrees move to where the sum of areas becomes less.

use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;

use super::binary::{MAX_DEPTH, Node};

/// The tree with its subtrees moved; as it was where that would make it deeper than [`MAX_DEPTH`]. `share` of the nodes are
/// tried in the first of 16 rounds, the largest, and ever fewer in the others (the crate's own sequence).
pub(super) fn reinsert(nodes: Vec<Node>, share: f32) -> Vec<Node> {
    if nodes.len() < 7 {
        return nodes;
    }
    let mut bvh = to_pairs(&nodes);
    ReinsertionOptimizer::default().run(&mut bvh, share, None);
    to_preorder(&bvh, &nodes).unwrap_or(nodes)
}

/// The same tree in the crate's order, where siblings stand beside each other. Only relations of areas count: boxes are
/// taken relative to the root's, so that no area overflows. Leaves name their node in `nodes`.
fn to_pairs(nodes: &[Node]) -> Bvh2 {
    let root = nodes[0].bounds();
    let scale = 1.0 / (root.max - root.min).max_element().max(f32::MIN_POSITIVE);
    let make = |index: usize, first_index: u32| {
        let bounds = nodes[index].bounds();
        let relative = |corner: glam::Vec3| ((corner - root.min) * scale).into();
        let aabb = Aabb { min: relative(bounds.min), max: relative(bounds.max) };
        Bvh2Node::new(aabb, u32::from(nodes[index].is_leaf()), first_index)
    };
    let mut bvh = Bvh2::default();
    bvh.nodes.reserve(nodes.len());
    bvh.nodes.push(make(0, 1));
    // Level by level: what `sources` holds are the nodes that those of the crate stand for.
    let mut sources = vec![0usize];
    let mut at = 0;
    while at < sources.len() {
        let index = sources[at];
        let node = &nodes[index];
        if node.is_leaf() {
            bvh.nodes[at].first_index = index as u32;
        } else {
            bvh.nodes[at].first_index = sources.len() as u32;
            for child in [index + 1, index + node.right_or_primitive as usize] {
                sources.push(child);
                bvh.nodes.push(make(child, 0));
            }
        }
        at += 1;
    }
    bvh
}

/// Back in preorder, with the leaves of `original` and boxes made of them; `None` if it is too deep.
fn to_preorder(bvh: &Bvh2, original: &[Node]) -> Option<Vec<Node>> {
    let mut nodes: Vec<Node> = Vec::with_capacity(original.len());
    // Nodes to come, with their depth and, for right children, the parent that waits to know where they are.
    let mut pending = vec![(0u32, 0u32, None::<usize>)];
    while let Some((index, depth, parent)) = pending.pop() {
        if depth > MAX_DEPTH {
            return None;
        }
        let at = nodes.len();
        if let Some(parent) = parent {
            nodes[parent].right_or_primitive = (at - parent) as u32;
        }
        let node = &bvh.nodes[index as usize];
        if node.is_leaf() {
            nodes.push(original[node.first_index as usize]);
        } else {
            nodes.push(Node::default());
            pending.push((node.first_index + 1, depth + 1, Some(at)));
            pending.push((node.first_index, depth + 1, None));
        }
    }
    for at in (0..nodes.len()).rev() {
        if nodes[at].is_leaf() {
            continue;
        }
        let (left, right) = (nodes[at + 1], nodes[at + nodes[at].right_or_primitive as usize]);
        let bounds = left.bounds().union(right.bounds());
        let node = &mut nodes[at];
        (node.min, node.max, node.leaves) = (bounds.min.into(), bounds.max.into(), left.leaves + right.leaves);
    }
    Some(nodes)
}
