//! Which leaves of the world are so large that nearly every ray has to do with them: the walls of a room, the ground that
//! things stand on. They have a tree of their own, in which that of the rest has the place of a leaf: a kernel that has them
//! compiled in searches the rest alone, the others all.

use super::attributes::Leaf;
use super::bounds::Bounds;
use super::bvh::{MOST_AROUND, Primitive};
use crate::layout::TRIANGLE_ALPHA;

/// What testing a leaf that is compiled in costs, in visits to a slot of the tree (docs/benchmarks).
const TEST_COST: f64 = 0.15;
/// What it costs a ray that there are any, likewise.
const FIXED_COST: f64 = 1.2;
/// Nodes above a leaf that there are for it: a node of four children makes four of one.
const NODES_A_LEAF: f64 = 1.0 / 3.0;

/// Visits that a ray does not make for a leaf that is compiled in, less what testing it costs. The nodes above a leaf are at
/// least as large as it is; of the walls of a box, which have a third of its surface area each, as large as the scene.
fn saved(share: f64) -> f64 {
    share + NODES_A_LEAF * (3.0 * share).min(1.0) - TEST_COST
}

/// Indices of the leaves that are apart, ascending; none if that would not pay. `primitives` are the boxes of all leaves and,
/// behind them, of what else is in the world's tree.
///
/// A random line through the scene's box meets a box in it by its share of the surface area (`MacDonald` and Booth 1990, "Heuristics
/// for ray tracing using space subdivision"). So that many visits does a leaf cost in the tree, beside those to the nodes
/// above it.
pub(super) fn choose(leaves: &[Leaf], primitives: &[Primitive]) -> Vec<u32> {
    let scene = primitives.iter().fold(Bounds::EMPTY, |bounds, primitive| bounds.union(primitive.bounds()));
    let share = |primitive: &Primitive| f64::from(primitive.bounds().half_area()) / f64::from(scene.half_area());
    let mut large: Vec<(f64, u32)> = leaves
        .iter()
        .zip(primitives)
        .filter(|(leaf, _)| leaf.first.kind & TRIANGLE_ALPHA == 0)
        .map(|(_, primitive)| (share(primitive), primitive.index()))
        .filter(|(share, _)| saved(*share) > 0.0)
        .collect();
    large.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    large.truncate(MOST_AROUND);
    let saved: f64 = large.iter().map(|(share, _)| saved(*share)).sum();
    // With nothing beside them there is no tree to be smaller.
    if saved <= FIXED_COST || large.len() == primitives.len() {
        return Vec::new();
    }
    let mut chosen: Vec<u32> = large.iter().map(|&(_, index)| index).collect();
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{LeafSlot, Triangle};

    /// A leaf of one triangle in a square of side `size` at height `y`.
    fn leaf(size: f32, y: f32, kind: u32) -> Leaf {
        let [a, b, c] = [[0.0, y, 0.0], [0.0, y, size], [size, y, size]];
        let slot = LeafSlot { vertices: [a, b, c, a] };
        Leaf { slot, first: Triangle { kind, ..Triangle::default() }, second: None }
    }

    fn chosen(leaves: &[Leaf]) -> Vec<u32> {
        let boxes = leaves.iter().zip(0..).map(|(leaf, i)| Primitive::new(i, &Bounds::around(leaf.slot.vertices)));
        choose(leaves, &boxes.collect::<Vec<_>>())
    }

    #[test]
    fn walls_are_apart_and_what_is_small_or_has_alpha_is_not() {
        let mut leaves = vec![leaf(0.01, 0.5, 0), leaf(1.0, 0.0, 0), leaf(1.0, 0.2, 0), leaf(1.0, 1.0, 0)];
        assert_eq!(chosen(&leaves), [1, 2, 3]);
        leaves[2].first.kind = TRIANGLE_ALPHA;
        leaves.push(leaf(0.9, 0.3, 0));
        assert_eq!(chosen(&leaves), [1, 3, 4]);
        assert_eq!(chosen(&leaves[..2]), [] as [u32; 0], "a ground alone does not pay");
    }

    /// A model's large faces are in no ray's way but of those near it; the tree finds that out for less than they cost.
    #[test]
    fn faces_of_a_model_are_not_walls() {
        let mut leaves: Vec<Leaf> = (0..30).map(|i| leaf(0.2, 0.03 * i as f32, 0)).collect();
        leaves.push(leaf(0.01, 1.0, 0));
        leaves.push(leaf(1.0, 0.0, 0));
        assert_eq!(chosen(&leaves), [] as [u32; 0]);
    }

    #[test]
    fn there_is_something_beside_them_and_they_are_not_too_many() {
        assert_eq!(chosen(&[leaf(1.0, 0.0, 0), leaf(1.0, 1.0, 0), leaf(1.0, 2.0, 0)]), [] as [u32; 0]);
        let many: Vec<Leaf> = (0..40).map(|i| leaf(1.0, 0.01 * i as f32, 0)).collect();
        assert_eq!(chosen(&many).len(), MOST_AROUND);
        assert_eq!(chosen(&[]), [] as [u32; 0]);
    }
}
