//! The four-wide tree in slots: the binary tree collapsed, children in groups of four.

use bytemuck::Zeroable;

use super::binary::Node;
use super::collapse::{choose, wide_children};
use super::quantise::inner_slot;
use crate::layout::{LeafSlot, SLOT_GROUP, SLOT_NO_LEAF, Texel};
use crate::prepare::PrepareError;
use crate::prepare::bounds::Bounds;

/// A slot as it lies in the array.
pub type Slot = [Texel; 3];

/// Traversal packs a group index and the ordered list of its children into one word; this many bits are the index.
pub const GROUP_BITS: u32 = 25;

/// The primitive in whose place another tree stands; no tree has so many.
pub const NESTED: u32 = u32::MAX;

/// Most primitives beside [`NESTED`] in a tree around another, which is no deeper than that.
pub const MOST_AROUND: usize = 32;

/// What a tree became.
#[derive(Clone, Copy, Debug)]
pub struct Appended {
    /// Slot of the root.
    pub root_slot: u32,
    /// Slot of the root of the tree in it; without one, the root.
    pub nested_root_slot: u32,
    /// Inner slots on the longest path, 1 or more.
    pub depth: u32,
    /// Number of inner slots.
    pub inner_slots: u32,
    /// Slots that a random ray through the root's box is expected to visit: Σ area / root area over all slots.
    pub sah_cost: f64,
}

/// The slot of an absent child.
pub fn empty_slot() -> Slot {
    bytemuck::cast(LeafSlot::zeroed())
}

/// The number of triangles in a slot: 0 of one that is empty or no leaf.
pub fn triangles_in(slot: &Slot) -> u32 {
    if slot[2][3] >= SLOT_NO_LEAF || *slot == empty_slot() {
        return 0;
    }
    let vertices = bytemuck::cast::<Slot, LeafSlot>(*slot).vertices.map(|vertex| vertex.map(f32::to_bits));
    if vertices[3] == vertices[0] { 1 } else { 2 }
}

/// Appends a tree to `slots`: a group that holds only the root, which is always an inner slot, then the others.
/// `leaf` makes the slot of a primitive and is told where it will be. In place of the primitive [`NESTED`] stands the tree
/// `nested`, behind all of the other.
pub(super) fn append(
    slots: &mut Vec<Slot>,
    nodes: &[Node],
    nested: Option<&[Node]>,
    mut leaf: impl FnMut(u32, u32) -> Slot,
) -> Result<Appended, PrepareError> {
    let root_slot = allocate_group(slots)? * SLOT_GROUP;
    let mut appended = Appended { root_slot, nested_root_slot: root_slot, depth: 0, inner_slots: 0, sah_cost: 1.0 };
    let root_area = nodes.first().map_or(0.0, |root| f64::from(root.half_area()));
    let relative_area = if root_area > 0.0 { 1.0 / root_area } else { 0.0 };
    let mut root_depth = 1u32;
    for nodes in [nodes].into_iter().chain(nested) {
        let choices = choose(nodes);
        // Inner nodes whose slot is allocated but not written yet.
        let mut pending = vec![(0u32, appended.nested_root_slot, root_depth)];
        while let Some((node, slot, depth)) = pending.pop() {
            appended.inner_slots += 1;
            appended.depth = appended.depth.max(depth);
            let (children, count) = wide_children(nodes, &choices, node);
            let children = &children[..count];
            let group = allocate_group(slots)?;
            let mut boxes = [Bounds::EMPTY; SLOT_GROUP as usize];
            for (index, &child) in children.iter().enumerate() {
                boxes[index] = nodes[child as usize].bounds();
            }
            slots[slot as usize] = bytemuck::cast(inner_slot(&boxes[..count], group));
            // In reverse, so that the first child's subtree comes next to its parent.
            for (index, &child) in children.iter().enumerate().rev() {
                let place = group * SLOT_GROUP + index as u32;
                let node = &nodes[child as usize];
                appended.sah_cost += f64::from(node.half_area()) * relative_area;
                if !node.is_leaf() {
                    pending.push((child, place, depth + 1));
                } else if node.right_or_primitive == NESTED {
                    (appended.nested_root_slot, root_depth) = (place, depth + 1);
                } else {
                    slots[place as usize] = leaf(node.right_or_primitive, place);
                }
            }
        }
    }
    Ok(appended)
}

fn allocate_group(slots: &mut Vec<Slot>) -> Result<u32, PrepareError> {
    let group = slots.len() / SLOT_GROUP as usize;
    if group >= 1 << GROUP_BITS {
        return Err(PrepareError::TooManySlots);
    }
    slots.resize(slots.len() + SLOT_GROUP as usize, empty_slot());
    Ok(group as u32)
}
