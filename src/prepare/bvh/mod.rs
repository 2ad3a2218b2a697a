//! The bounding volume hierarchy that the shader traverses: built binary, collapsed to four children a node, quantised.

mod binary;
mod collapse;
mod quantise;
mod reinsert;
mod validate;
mod wide;

pub use binary::{MAX_DEPTH, Primitive};
pub use quantise::{decode, inner_slot, is_present};
pub use validate::{TreeContents, validate};
pub use wide::{Appended, GROUP_BITS, MOST_AROUND, NESTED, Slot, empty_slot, triangles_in};

use super::PrepareError;
use super::bounds::Bounds;
use crate::named_enum::named_enum;

named_enum! {
    /// How long a tree may take to build, for how fast it is traversed.
    BvhQuality, "BVH quality" {
        /// Binned surface-area heuristic.
        Fast = "fast",
        /// The same, and then large subtrees are moved to where they cost less.
        #[default]
        Default = "default",
        /// The same with all subtrees: seconds for millions of triangles.
        High = "high",
    }
}

/// A binary tree over primitives, ready to be written into slots.
#[derive(Debug)]
pub struct Tree {
    nodes: Vec<binary::Node>,
}

impl Tree {
    /// Builds over primitives (which it reorders); there may be none. The tree is the same whatever the number of threads.
    pub fn build(primitives: &mut [Primitive], quality: BvhQuality) -> Self {
        let nodes = binary::build(primitives);
        // Measured for two million triangles (docs/benchmarks): 2 % of the nodes take 75 ms and bring nearly all of what all
        // of them bring in 4 s. In smaller trees that time does for a larger share.
        let nodes = match quality {
            BvhQuality::Fast => nodes,
            BvhQuality::Default => {
                let share = (40_000.0 / nodes.len().max(1) as f32).clamp(0.02, 1.0);
                reinsert::reinsert(nodes, share)
            }
            BvhQuality::High => reinsert::reinsert(nodes, 1.0),
        };
        Self { nodes }
    }

    /// The box of everything in it.
    pub fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds::EMPTY, binary::Node::bounds)
    }

    /// Number of primitives.
    pub fn leaves(&self) -> usize {
        self.nodes.first().map_or(0, |root| root.leaves as usize)
    }

    /// At most `count` boxes that together contain everything: a tighter hull than one box once it is rotated.
    pub fn cover(&self, count: usize) -> Vec<Bounds> {
        let mut open: Vec<usize> = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while open.len() < count {
            let largest = (0..open.len())
                .filter(|&i| !self.nodes[open[i]].is_leaf())
                .max_by(|&a, &b| self.nodes[open[a]].half_area().total_cmp(&self.nodes[open[b]].half_area()));
            let Some(largest) = largest else { break };
            let node = open[largest];
            open[largest] = node + 1;
            open.push(node + self.nodes[node].right_or_primitive as usize);
        }
        open.iter().map(|&node| self.nodes[node].bounds()).collect()
    }

    /// Appends the tree to `slots` as four-wide nodes: a group that holds only the root, which is always an inner slot,
    /// then the others. `leaf` makes the slot of a primitive and is told where it will be.
    ///
    /// # Errors
    /// If there are more groups than [`GROUP_BITS`] can number.
    pub fn append(&self, slots: &mut Vec<Slot>, leaf: impl FnMut(u32, u32) -> Slot) -> Result<Appended, PrepareError> {
        wide::append(slots, &self.nodes, None, leaf)
    }

    /// The same with another tree in the place of the primitive [`NESTED`], behind all of this one.
    ///
    /// # Errors
    /// Those of [`Tree::append`].
    pub fn append_around(
        &self,
        nested: &Self,
        slots: &mut Vec<Slot>,
        leaf: impl FnMut(u32, u32) -> Slot,
    ) -> Result<Appended, PrepareError> {
        wide::append(slots, &self.nodes, Some(&nested.nodes), leaf)
    }
}
