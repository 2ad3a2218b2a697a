//! Child boxes on an 8-bit grid (after Ylitie et al., "Efficient incoherent ray traversal on GPUs through compressed
//! wide BVHs", HPG 2017): in exact arithmetic, the decoded box contains the box it stands for.

use crate::layout::{InnerSlot, SLOT_INNER};
use crate::prepare::bounds::Bounds;

const EXPONENT_BIAS: i32 = 127;
const GRID_STEPS: u32 = 255;

/// An inner slot with up to four children. The absent children have lower 255 and upper 0.
pub fn inner_slot(children: &[Bounds], child_group: u32) -> InnerSlot {
    let bounds = children.iter().fold(Bounds::EMPTY, |union, &child| union.union(child));
    let mut slot =
        InnerSlot { lower: [u32::MAX; 3], upper: [0; 3], child_group, kind: SLOT_INNER, ..InnerSlot::default() };
    for axis in 0..3 {
        let (origin, end) = if children.is_empty() { (0.0, 0.0) } else { (bounds.min[axis], bounds.max[axis]) };
        let exponent = step_exponent(origin, end);
        slot.origin[axis] = origin;
        slot.exponents |= ((exponent + EXPONENT_BIAS) as u32) << (8 * axis);
        let grid = Grid { origin: f64::from(origin), step: power_of_two(exponent), per_step: power_of_two(-exponent) };
        for (index, child) in children.iter().enumerate() {
            let shift = 8 * index;
            slot.lower[axis] &= !(0xff << shift);
            slot.lower[axis] |= grid.below(child.min[axis]) << shift;
            slot.upper[axis] |= grid.above(child.max[axis]) << shift;
        }
    }
    slot
}

/// The exact corners (lower, upper) of child `index` on `axis` as (origin, offset) pairs: the corner is their sum.
pub fn decode(slot: &InnerSlot, index: usize, axis: usize) -> [(f64, f64); 2] {
    let step = power_of_two(((slot.exponents >> (8 * axis)) & 0xff) as i32 - EXPONENT_BIAS);
    [slot.lower, slot.upper].map(|words| {
        let steps = (words[axis] >> (8 * index)) & 0xff;
        (f64::from(slot.origin[axis]), f64::from(steps) * step)
    })
}

/// Whether a child is there at all.
pub fn is_present(slot: &InnerSlot, index: usize) -> bool {
    (0..3).all(|axis| (slot.lower[axis] >> (8 * index)) & 0xff <= (slot.upper[axis] >> (8 * index)) & 0xff)
}

/// Compares the exact sum a + b with c. Rounding is monotonic, so only a rounded sum equal to c leaves a doubt, which the
/// exact rounding error decides (2Sum; Møller 1965, Knuth, TAOCP 2, 4.2.2).
pub(super) fn compare_sum(a: f64, b: f64, c: f64) -> std::cmp::Ordering {
    let sum = a + b;
    let b_part = sum - a;
    let error = (a - (sum - b_part)) + (b - b_part);
    let order = |x: f64, y: f64| x.partial_cmp(&y).expect("finite numbers");
    order(sum, c).then(order(error, 0.0))
}

/// The least exponent e with origin + 255·2^e ≥ end, not below the spacing of f32 at the coordinates nor below the
/// smallest normal number: so a flat box has a step too, one that changes the coordinate it is added to and that no
/// flush of subnormals takes away.
fn step_exponent(origin: f32, end: f32) -> i32 {
    let magnitude = origin.abs().max(end.abs());
    let spacing = (exponent_of(magnitude) - 23).max(1 - EXPONENT_BIAS);
    let size = f64::from(end) - f64::from(origin);
    let mut exponent = spacing;
    if size > 0.0 {
        // 2^⌊log₂(size/255)⌋ or one more; the estimate starts one low and the exact test decides.
        let ratio = size / f64::from(GRID_STEPS);
        exponent = exponent.max(((ratio.to_bits() >> 52) & 0x7ff) as i32 - 1023 - 1);
    }
    while compare_sum(f64::from(origin), f64::from(GRID_STEPS) * power_of_two(exponent), f64::from(end)).is_lt() {
        exponent += 1;
    }
    exponent
}

/// 2^exponent for an exponent of a normal f64.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

fn exponent_of(x: f32) -> i32 {
    ((x.to_bits() >> 23) & 0xff) as i32 - EXPONENT_BIAS
}

struct Grid {
    origin: f64,
    step: f64,
    /// 1/step, exact.
    per_step: f64,
}

impl Grid {
    fn compare(&self, steps: u32, coordinate: f32) -> std::cmp::Ordering {
        compare_sum(self.origin, f64::from(steps) * self.step, f64::from(coordinate))
    }

    /// Whole steps to the coordinate, up to the rounding of the difference.
    fn near(&self, coordinate: f32) -> u32 {
        (((f64::from(coordinate) - self.origin) * self.per_step) as u32).min(GRID_STEPS)
    }

    /// The last grid line not above the coordinate.
    fn below(&self, coordinate: f32) -> u32 {
        let mut steps = self.near(coordinate);
        while steps > 0 && self.compare(steps, coordinate).is_gt() {
            steps -= 1;
        }
        steps
    }

    /// The first grid line not below the coordinate.
    fn above(&self, coordinate: f32) -> u32 {
        let mut steps = self.near(coordinate);
        while steps < GRID_STEPS && self.compare(steps, coordinate).is_lt() {
            steps += 1;
        }
        steps
    }
}
