//! Binary BVH by binned surface-area heuristic (Wald, "On fast construction of SAH-based bounding volume hierarchies",
//! RT 2007), one primitive a leaf.
//!
//! A subtree of n leaves takes exactly 2n−1 consecutive nodes, so that the two halves of a node are built in parallel
//! into disjoint slices, without locks and without an allocation a node.

use glam::{Vec4, Vec4Swizzles};

use crate::prepare::bounds::Bounds;

/// A primitive to build over: its box, and its index in a lane that no arithmetic looks at.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    min: Vec4,
    max: Vec4,
}

/// Bit for bit: the index would not compare as a number.
impl PartialEq for Primitive {
    fn eq(&self, other: &Self) -> bool {
        let bits = |primitive: &Self| [primitive.min, primitive.max].map(|v| v.to_array().map(f32::to_bits));
        bits(self) == bits(other)
    }
}

impl Primitive {
    /// A primitive by its number and its finite, non-empty box.
    pub fn new(index: u32, bounds: &Bounds) -> Self {
        Self { min: bounds.min.extend(f32::from_bits(index)), max: bounds.max.extend(0.0) }
    }

    /// Its box.
    pub fn bounds(&self) -> Bounds {
        Bounds { min: self.min.xyz(), max: self.max.xyz() }
    }

    /// Its number.
    pub fn index(&self) -> u32 {
        self.min.w.to_bits()
    }

    /// Halved before the sum, which could overflow otherwise.
    fn centroid(&self) -> Vec4 {
        self.min * 0.5 + self.max * 0.5
    }
}

/// A node of the binary tree. The left child is the next node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Node {
    /// Smallest corner.
    pub min: [f32; 3],
    /// Distance to the right child; of a leaf, the primitive.
    pub right_or_primitive: u32,
    /// Largest corner.
    pub max: [f32; 3],
    /// Leaves below, 1 for a leaf.
    pub leaves: u32,
}

impl Node {
    /// Whether it is a leaf.
    pub(super) fn is_leaf(&self) -> bool {
        self.leaves == 1
    }

    /// Its box.
    pub(super) fn bounds(&self) -> Bounds {
        Bounds { min: self.min.into(), max: self.max.into() }
    }

    /// Half the surface area.
    pub(super) fn half_area(&self) -> f32 {
        self.relative_half_area(1.0)
    }

    /// Half the surface area, lengths multiplied by `scale`.
    pub(super) fn relative_half_area(&self, scale: f32) -> f32 {
        let bounds = self.bounds();
        half_area(((bounds.max - bounds.min) * scale).extend(0.0))
    }
}

/// No path from the root to a leaf is longer: past the point where only balanced halves keep to it, nodes are halved
/// instead of split by cost. Stacks and recursion rely on it.
pub const MAX_DEPTH: u32 = 64;

/// Subtrees smaller than this are built by one thread: its work outweighs a task switch by far.
const PARALLEL_PRIMITIVES: usize = 4096;

/// Builds the nodes over primitives, which it reorders. The root is node 0; no primitives, no nodes.
pub(super) fn build(primitives: &mut [Primitive]) -> Vec<Node> {
    if primitives.is_empty() {
        return Vec::new();
    }
    let mut nodes = vec![Node::default(); 2 * primitives.len() - 1];
    let extent = Extent::of(primitives);
    build_subtree(primitives, &mut nodes, extent, 0);
    nodes
}

/// Box of the primitives and box of their centroids.
#[derive(Clone, Copy)]
struct Extent {
    min: Vec4,
    max: Vec4,
    centroid_min: Vec4,
    centroid_max: Vec4,
}

impl Extent {
    const EMPTY: Self = Self {
        min: Vec4::INFINITY,
        max: Vec4::NEG_INFINITY,
        centroid_min: Vec4::INFINITY,
        centroid_max: Vec4::NEG_INFINITY,
    };

    fn of(primitives: &[Primitive]) -> Self {
        let mut extent = Self::EMPTY;
        for primitive in primitives {
            extent.add(primitive);
        }
        extent
    }

    #[inline]
    fn add(&mut self, primitive: &Primitive) {
        let centroid = primitive.centroid();
        self.min = self.min.min(primitive.min);
        self.max = self.max.max(primitive.max);
        self.centroid_min = self.centroid_min.min(centroid);
        self.centroid_max = self.centroid_max.max(centroid);
    }
}

#[inline]
fn half_area(size: Vec4) -> f32 {
    size.x * size.y + size.y * size.z + size.z * size.x
}

fn ceil_log2(n: usize) -> u32 {
    n.next_power_of_two().trailing_zeros()
}

/// Recursion is bounded by [`MAX_DEPTH`].
fn build_subtree(primitives: &mut [Primitive], nodes: &mut [Node], extent: Extent, depth: u32) {
    let count = primitives.len();
    debug_assert_eq!(nodes.len(), 2 * count - 1);
    let (node, below) = nodes.split_first_mut().expect("a subtree has nodes");
    node.min = extent.min.xyz().into();
    node.max = extent.max.xyz().into();
    node.leaves = count as u32;
    if count == 1 {
        node.right_or_primitive = primitives[0].index();
        return;
    }
    // Invariant: depth + ⌈log₂ count⌉ ≤ MAX_DEPTH. A split by cost may spend a level without making the larger half
    // smaller than count − 1, so it needs one level to spare; halving keeps the sum.
    let may_split_by_cost = depth + ceil_log2(count) < MAX_DEPTH;
    let (middle, left_extent, right_extent) = if !may_split_by_cost {
        halve(primitives, &extent)
    } else {
        match count {
            2 => halves(primitives, 1),
            3 => split_three(primitives),
            4..16 => split_by_cost::<8>(primitives, &extent),
            16..256 => split_by_cost::<16>(primitives, &extent),
            _ => split_by_cost::<32>(primitives, &extent),
        }
    };
    let left_nodes = 2 * middle - 1;
    node.right_or_primitive = 1 + left_nodes as u32;
    let (left, right) = primitives.split_at_mut(middle);
    let (nodes_left, nodes_right) = below.split_at_mut(left_nodes);
    if count >= PARALLEL_PRIMITIVES {
        rayon::join(
            || build_subtree(left, nodes_left, left_extent, depth + 1),
            || build_subtree(right, nodes_right, right_extent, depth + 1),
        );
    } else {
        build_subtree(left, nodes_left, left_extent, depth + 1);
        build_subtree(right, nodes_right, right_extent, depth + 1);
    }
}

/// Maps centroids to bins. Both ends of an axis with distinct centroids fall into the first and the last bin, whatever
/// the rounding: 0·∞ is NaN, which a cast makes 0, and a cast saturates.
#[derive(Clone, Copy)]
struct Binning {
    origin: Vec4,
    scale: Vec4,
    last: u32,
}

impl Binning {
    fn new(extent: &Extent, bins: usize) -> Self {
        let size = extent.centroid_max - extent.centroid_min;
        Self { origin: extent.centroid_min, scale: Vec4::splat(bins as f32) / size, last: bins as u32 - 1 }
    }

    #[inline]
    fn bins(&self, primitive: &Primitive) -> [usize; 3] {
        let position = (primitive.centroid() - self.origin) * self.scale;
        [position.x, position.y, position.z].map(|x| (x as u32).min(self.last) as usize)
    }

    /// The same on one axis.
    #[inline]
    fn bin(&self, primitive: &Primitive, axis: usize) -> usize {
        self.bins(primitive)[axis]
    }
}

struct Split {
    binning: Binning,
    axis: usize,
    /// Bins below this go left.
    bin: usize,
}

#[derive(Clone, Copy)]
struct Bin {
    min: Vec4,
    max: Vec4,
    count: u32,
}

impl Bin {
    const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY, count: 0 };

    #[inline]
    fn add(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.count += other.count;
    }
}

/// Splits between `BINS` bins where it costs least, or in halves if all centroids are the same point.
fn split_by_cost<const BINS: usize>(primitives: &mut [Primitive], extent: &Extent) -> (usize, Extent, Extent) {
    let binning = Binning::new(extent, BINS);
    let mut table = [[Bin::EMPTY; BINS]; 3];
    for primitive in primitives.iter() {
        let indices = binning.bins(primitive);
        for (axis, &index) in indices.iter().enumerate() {
            table[axis][index].add(&Bin { min: primitive.min, max: primitive.max, count: 1 });
        }
    }
    // Costs are compared within the node only: sizes relative to it neither overflow nor vanish.
    let size = extent.max - extent.min;
    let relative = 1.0 / size.x.max(size.y).max(size.z).max(f32::MIN_POSITIVE);
    let mut best: Option<(f32, Split)> = None;
    for (axis, bins) in table.iter().enumerate() {
        if extent.centroid_min[axis] >= extent.centroid_max[axis] {
            continue;
        }
        let (cost, bin) = sweep(bins, relative);
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, Split { binning, axis, bin }));
        }
    }
    match best {
        Some((_, split)) => partition(primitives, &split),
        None => halve(primitives, extent),
    }
}

/// Least cost Σ area · count over the splits of an axis whose first and last bins are occupied, and its right part's
/// first bin.
fn sweep<const BINS: usize>(bins: &[Bin; BINS], relative: f32) -> (f32, usize) {
    let cost = |bin: &Bin| half_area((bin.max - bin.min) * relative) * bin.count as f32;
    let mut right_costs = [0.0; BINS];
    let mut right = Bin::EMPTY;
    for (index, bin) in bins.iter().enumerate().skip(1).rev() {
        right.add(bin);
        right_costs[index] = cost(&right);
    }
    let mut best = (f32::INFINITY, 1);
    let mut left = Bin::EMPTY;
    for index in 1..BINS {
        left.add(&bins[index - 1]);
        let total = cost(&left) + right_costs[index];
        if total < best.0 {
            best = (total, index);
        }
    }
    best
}

/// The exact best of the three ways to split three: the pair of least area stays together.
fn split_three(primitives: &mut [Primitive]) -> (usize, Extent, Extent) {
    let pair_area = |a: &Primitive, b: &Primitive| half_area(a.max.max(b.max) - a.min.min(b.min));
    let single_area = |a: &Primitive| half_area(a.max - a.min);
    let cost = |single: usize| {
        let (a, b) = (&primitives[(single + 1) % 3], &primitives[(single + 2) % 3]);
        2.0 * pair_area(a, b) + single_area(&primitives[single])
    };
    let costs = [cost(0), cost(1), cost(2)];
    let single = (1..3).fold(0, |best, k| if costs[k] < costs[best] { k } else { best });
    primitives.swap(single, 0);
    halves(primitives, 1)
}

/// Moves the primitives of the left bins to the front; returns how many, and both extents.
fn partition(primitives: &mut [Primitive], split: &Split) -> (usize, Extent, Extent) {
    let (mut left, mut right) = (Extent::EMPTY, Extent::EMPTY);
    let (mut front, mut back) = (0, primitives.len());
    while front < back {
        let primitive = primitives[front];
        if split.binning.bin(&primitive, split.axis) < split.bin {
            left.add(&primitive);
            front += 1;
        } else {
            right.add(&primitive);
            back -= 1;
            primitives.swap(front, back);
        }
    }
    (front, left, right)
}

/// Halves by the order of centroids along the longest axis: the balanced split when cost does not decide.
fn halve(primitives: &mut [Primitive], extent: &Extent) -> (usize, Extent, Extent) {
    let middle = primitives.len() / 2;
    let size = extent.centroid_max - extent.centroid_min;
    if size.xyz().max_element() > 0.0 {
        let axis = size.xyz().max_position();
        primitives.select_nth_unstable_by(middle, |a, b| a.centroid()[axis].total_cmp(&b.centroid()[axis]));
    }
    halves(primitives, middle)
}

/// The first `middle` and the rest.
fn halves(primitives: &[Primitive], middle: usize) -> (usize, Extent, Extent) {
    let (left, right) = primitives.split_at(middle);
    (middle, Extent::of(left), Extent::of(right))
}
