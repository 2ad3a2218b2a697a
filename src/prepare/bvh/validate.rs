//! Checks a tree in slots: every child once, no cycle, every box around what is below it.

use super::binary::MAX_DEPTH;
use super::quantise::{compare_sum, decode, is_present};
use super::wide::{MOST_AROUND, Slot, empty_slot};
use crate::layout::{InnerSlot, InstanceSlot, LeafSlot, SLOT_GROUP, SLOT_INNER, SLOT_INSTANCE, SLOT_NO_LEAF};
use crate::prepare::bounds::Bounds;

/// What a valid tree holds.
#[derive(Clone, Debug, Default)]
pub struct TreeContents {
    /// Slots of its leaves.
    pub leaf_slots: Vec<u32>,
    /// Slots of its instances.
    pub instance_slots: Vec<u32>,
    /// Inner slots.
    pub inner_slots: usize,
    /// Inner slots on the longest path.
    pub depth: u32,
    /// Expected work of a random ray that meets the root's box, in slots visited: Σ area / root area over inner slots and
    /// leaves, with the boxes as quantised.
    pub sah_cost: f64,
    /// The exact box of its triangles and instances.
    pub bounds: Option<Bounds>,
}

/// Walks the tree at `root`. `instance_bounds` are the boxes of instances by index.
///
/// # Errors
/// What is wrong and in which slot.
pub fn validate(slots: &[Slot], root: u32, instance_bounds: &[Bounds]) -> Result<TreeContents, String> {
    let mut walk = Walk {
        slots,
        instance_bounds,
        group_seen: vec![false; slots.len() / SLOT_GROUP as usize],
        contents: TreeContents::default(),
        area_sum: 0.0,
    };
    let root_slot: InnerSlot = bytemuck::cast(*slots.get(root as usize).ok_or("the root is out of range")?);
    if root_slot.kind != SLOT_INNER {
        return Err(format!("the root {root} is no inner slot"));
    }
    let bounds = walk.inner(root, &root_slot, 1)?;
    let root_area = decoded_union_area(&root_slot);
    walk.contents.sah_cost = 1.0 + if root_area > 0.0 { walk.area_sum / root_area } else { 0.0 };
    walk.contents.bounds = (!bounds.is_empty()).then_some(bounds);
    Ok(walk.contents)
}

struct Walk<'a> {
    slots: &'a [Slot],
    instance_bounds: &'a [Bounds],
    group_seen: Vec<bool>,
    contents: TreeContents,
    area_sum: f64,
}

impl Walk<'_> {
    /// Exact bounds of what is below an inner slot. Recursion ends at [`MAX_DEPTH`].
    fn inner(&mut self, place: u32, slot: &InnerSlot, depth: u32) -> Result<Bounds, String> {
        // The binary root's depth is 0, the wide root's is 1, a lone leaf still has a root above it, and a tree of a few large
        // leaves may stand around the other.
        if depth > MAX_DEPTH + 1 + MOST_AROUND as u32 {
            return Err(format!("slot {place} is deeper than {MAX_DEPTH}"));
        }
        self.contents.depth = self.contents.depth.max(depth);
        self.contents.inner_slots += 1;
        let seen = self.group_seen.get_mut(slot.child_group as usize);
        match seen {
            Some(seen) if !*seen => *seen = true,
            Some(_) => return Err(format!("group {} has two parents, one is slot {place}", slot.child_group)),
            None => return Err(format!("slot {place}: group {} is out of range", slot.child_group)),
        }
        let mut union = Bounds::EMPTY;
        for index in 0..SLOT_GROUP as usize {
            let child_place = slot.child_group * SLOT_GROUP + index as u32;
            let child = self.slots[child_place as usize];
            if !is_present(slot, index) {
                let marked = slot.lower.iter().all(|w| (w >> (8 * index)) & 0xff == 255)
                    && slot.upper.iter().all(|w| (w >> (8 * index)) & 0xff == 0);
                if child != empty_slot() || !marked {
                    return Err(format!("slot {child_place} should be empty"));
                }
                continue;
            }
            self.area_sum += decoded_area(slot, index);
            let bounds = self.child(child_place, child, depth)?;
            check_contains(slot, index, &bounds).map_err(|error| format!("slot {place}: {error}"))?;
            union = union.union(bounds);
        }
        Ok(union)
    }

    fn child(&mut self, place: u32, slot: Slot, depth: u32) -> Result<Bounds, String> {
        let kind = slot[2][3];
        if kind < SLOT_NO_LEAF {
            let leaf: LeafSlot = bytemuck::cast(slot);
            self.contents.leaf_slots.push(place);
            Ok(Bounds::around(leaf.vertices))
        } else if kind == SLOT_INSTANCE {
            let instance: InstanceSlot = bytemuck::cast(slot);
            self.contents.instance_slots.push(place);
            self.instance_bounds
                .get(instance.instance as usize)
                .copied()
                .ok_or_else(|| format!("slot {place}: instance {} does not exist", instance.instance))
        } else {
            self.inner(place, &bytemuck::cast(slot), depth + 1)
        }
    }
}

fn check_contains(slot: &InnerSlot, index: usize, bounds: &Bounds) -> Result<(), String> {
    for axis in 0..3 {
        let [lower, upper] = decode(slot, index, axis);
        let (min, max) = (f64::from(bounds.min[axis]), f64::from(bounds.max[axis]));
        if compare_sum(lower.0, lower.1, min).is_gt() || compare_sum(upper.0, upper.1, max).is_lt() {
            return Err(format!("box {index} on axis {axis} [{lower:?}, {upper:?}] does not contain [{min}, {max}]"));
        }
    }
    Ok(())
}

fn half_area(size: [f64; 3]) -> f64 {
    size[0] * size[1] + size[1] * size[2] + size[2] * size[0]
}

fn decoded_area(slot: &InnerSlot, index: usize) -> f64 {
    half_area([0, 1, 2].map(|axis| {
        let [lower, upper] = decode(slot, index, axis);
        upper.1 - lower.1
    }))
}

fn decoded_union_area(slot: &InnerSlot) -> f64 {
    half_area([0, 1, 2].map(|axis| {
        (0..SLOT_GROUP as usize)
            .filter(|&index| is_present(slot, index))
            .map(|index| decode(slot, index, axis)[1].1)
            .fold(0.0, f64::max)
    }))
}
