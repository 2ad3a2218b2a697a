//! The bounding volume hierarchy that the shader traverses: built binary, collapsed to four children a node, quantised.

mod binary;
mod collapse;
mod quantise;
mod validate;
mod wide;

pub use binary::{MAX_DEPTH, Primitive};
pub use quantise::{decode, inner_slot, is_present};
pub use validate::{TreeContents, validate};
pub use wide::{Appended, GROUP_BITS, Slot, empty_slot, triangles_in};

use super::PrepareError;
use super::bounds::Bounds;

/// A binary tree over primitives, ready to be written into slots.
#[derive(Debug)]
pub struct Tree {
    nodes: Vec<binary::Node>,
}

impl Tree {
    /// Builds over primitives (which it reorders); there may be none.
    pub fn build(primitives: &mut [Primitive]) -> Self {
        Self { nodes: binary::build(primitives) }
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
        wide::append(slots, &self.nodes, leaf)
    }
}
