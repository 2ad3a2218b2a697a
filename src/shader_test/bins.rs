//! Bins of directions for a χ² test of a lobe of unknown shape: cut by samples of the lobe itself, so that all are about
//! equally probable however narrow it is.

use glam::DVec3;

use super::quadrature::{Cell, coordinates};

/// A bin is not cut further than into this many of the samples that it is cut by.
const SMALLEST_BIN: usize = 64;
/// Where samples are few, the hemisphere is cut in the middle, this many times.
const LEAST_CUTS: u32 = 4;
/// The most, which makes 256 bins of a hemisphere.
const MOST_CUTS: u32 = 8;

/// Fewer samples close together are nothing to go by.
const FEWEST: usize = 6;
/// A piece is cut in two this many times, at most.
const MOST_HALVINGS: u32 = 48;

/// A binary tree over both hemispheres; its leaves are the bins.
pub struct Bins {
    nodes: Vec<Node>,
    /// The bins.
    pub cells: Vec<Cell>,
    /// What each bin is made of, for a quadrature: pieces that get smaller towards where the samples are dense.
    pub pieces: Vec<(usize, Cell)>,
}

enum Node {
    Leaf(usize),
    Cut { along_radius: bool, at: f64, children: [usize; 2] },
}

impl Bins {
    /// Bins by `samples` of the lobe. For the test itself others must be drawn.
    pub fn new(samples: &[DVec3]) -> Self {
        let mut points: [Vec<[f64; 2]>; 2] = Default::default();
        for sample in samples {
            let (below, radius, turns) = coordinates(*sample);
            points[usize::from(below)].push([radius, turns]);
        }
        let mut bins = Self { nodes: Vec::new(), cells: Vec::new(), pieces: Vec::new() };
        // The first two nodes are the hemispheres.
        bins.nodes.extend([Node::Leaf(0), Node::Leaf(0)]);
        let [mut above, mut below] = points;
        bins.build(0, Cell::hemisphere(false), &mut above, 0);
        bins.build(1, Cell::hemisphere(true), &mut below, 0);
        bins
    }

    fn build(&mut self, node: usize, cell: Cell, points: &mut [[f64; 2]], cuts: u32) {
        let few = points.len() < 2 * SMALLEST_BIN;
        if cuts >= if few { LEAST_CUTS } else { MOST_CUTS } {
            return self.leaf(node, cell, points);
        }
        let along_radius = cuts % 2 == 1;
        let range = if along_radius { cell.radius } else { cell.turns };
        let middle = if few { None } else { median(points, usize::from(!along_radius)) };
        let inside = middle.filter(|at| range[0] < *at && *at < range[1]);
        let at = inside.unwrap_or(0.5 * (range[0] + range[1]));
        let axis = usize::from(!along_radius);
        points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        let (low, high) = points.split_at_mut(points.partition_point(|point| point[axis] < at));
        let first = self.nodes.len();
        self.nodes.extend([Node::Leaf(0), Node::Leaf(0)]);
        self.nodes[node] = Node::Cut { along_radius, at, children: [first, first + 1] };
        let [one, other] = cell.cut(along_radius, at);
        self.build(first, one, low, cuts + 1);
        self.build(first + 1, other, high, cuts + 1);
    }

    fn leaf(&mut self, node: usize, cell: Cell, points: &mut [[f64; 2]]) {
        self.nodes[node] = Node::Leaf(self.cells.len());
        self.cut_where_dense(cell, points, 0);
        self.cells.push(cell);
    }

    /// A narrow lobe in a wide bin lies between the nodes of a quadrature, which then knows nothing of it. Halving the cell
    /// wherever samples are close together makes pieces whose size is in proportion to their distance from the lobe.
    fn cut_where_dense(&mut self, cell: Cell, points: &mut [[f64; 2]], halvings: u32) {
        let [radius, turns] = [crowding(points, 0, cell.radius), crowding(points, 1, cell.turns)];
        if radius.max(turns) <= 1.0 || halvings >= MOST_HALVINGS {
            self.pieces.push((self.cells.len(), cell));
            return;
        }
        let along_radius = radius > turns;
        let (axis, range) = if along_radius { (0, cell.radius) } else { (1, cell.turns) };
        let middle = 0.5 * (range[0] + range[1]);
        points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        let (low, high) = points.split_at_mut(points.partition_point(|point| point[axis] < middle));
        let [one, other] = cell.cut(along_radius, middle);
        self.cut_where_dense(one, low, halvings + 1);
        self.cut_where_dense(other, high, halvings + 1);
    }

    /// The bin that a direction falls in.
    pub fn find(&self, direction: DVec3) -> usize {
        let (below, radius, turns) = coordinates(direction);
        let mut node = usize::from(below);
        loop {
            match &self.nodes[node] {
                Node::Leaf(bin) => return *bin,
                Node::Cut { along_radius, at, children } => {
                    let coordinate = if *along_radius { radius } else { turns };
                    node = children[usize::from(coordinate >= *at)];
                }
            }
        }
    }
}

/// How crowded the most crowded stretch of the range is: its samples over those of an even density, or 1 if that may be
/// chance. Of λ expected samples in a stretch, λ + 4.5·√λ + 3 are found in some hundred stretches in one cell of a thousand.
fn crowding(points: &[[f64; 2]], axis: usize, range: [f64; 2]) -> f64 {
    let mut along: Vec<f64> = points.iter().map(|point| point[axis]).collect();
    along.sort_by(f64::total_cmp);
    let density = along.len() as f64 / (range[1] - range[0]);
    let sizes = std::iter::successors(Some(FEWEST), |size| Some(2 * size)).take_while(|size| *size <= along.len());
    let crowded = |size: usize| {
        let shortest = along.windows(size).map(|w| w[size - 1] - w[0]).fold(f64::INFINITY, f64::min);
        let expected = shortest * density;
        if expected + 4.5 * expected.sqrt() + 3.0 < size as f64 { size as f64 / expected.max(1e-9) } else { 1.0 }
    };
    sizes.map(crowded).fold(1.0, f64::max)
}

/// Half of the points are below it along the axis.
fn median(points: &mut [[f64; 2]], axis: usize) -> Option<f64> {
    let middle = points.len() / 2;
    let (_, median, _) = points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    Some(median[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shader_test::quadrature::integrate;

    /// Points of a plane lattice, made directions of a cosine lobe.
    fn directions(n: u32) -> Vec<DVec3> {
        let point = |i: u32| {
            let (u, v) = ((f64::from(i) + 0.5) / f64::from(n), (f64::from(i) * 0.618_033_988_75).fract());
            let (sin, cos) = (v * std::f64::consts::TAU).sin_cos();
            DVec3::new(u.sqrt() * cos, (1.0 - u).sqrt(), u.sqrt() * sin)
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn bins_are_equally_probable_and_cover_both_hemispheres() {
        let bins = Bins::new(&directions(1 << 14));
        assert_eq!(bins.cells.len(), 256 + 16, "above; below, where no sample is");
        let mut counts = vec![0; bins.cells.len()];
        for w in directions(1 << 16) {
            counts[bins.find(w)] += 1;
        }
        for (cell, count) in bins.cells.iter().zip(counts) {
            assert!(if cell.below { count == 0 } else { (150..400).contains(&count) }, "{cell:?}: {count}");
        }
        let area: f64 =
            bins.cells.iter().map(|c| (c.radius[1].powi(2) - c.radius[0].powi(2)) * (c.turns[1] - c.turns[0])).sum();
        assert!((area - 2.0).abs() < 1e-12, "{area}");
    }

    /// Half of the samples are in a lobe of a thousandth of a radian, the others are by the cosine: over the pieces, both are
    /// integrated in full.
    #[test]
    fn a_narrow_lobe_over_a_broad_one_is_integrated_in_full() {
        const CONCENTRATION: f64 = 1e6;
        let (axis, side, up) = (DVec3::new(0.6, 0.8, 0.0), DVec3::Z, DVec3::new(-0.8, 0.6, 0.0));
        let narrow = |i: u32| {
            let (u, v) = ((f64::from(i) + 0.5) / f64::from(1 << 16), (f64::from(i) * 0.618_033_988_75).fract());
            let radius = (-2.0 * (1.0 - u).ln() / CONCENTRATION).sqrt();
            let (sin, cos) = (v * std::f64::consts::TAU).sin_cos();
            (axis + (side * cos + up * sin) * radius).normalize()
        };
        let samples: Vec<DVec3> =
            directions(1 << 16).into_iter().zip(0..).map(|(w, i)| if i % 2 == 0 { narrow(i) } else { w }).collect();
        let bins = Bins::new(&samples);
        // von Mises and Fisher's density and the cosine's.
        let density = |w: DVec3| {
            let lobe =
                (-0.5 * CONCENTRATION * (w - axis).length_squared()).exp() * CONCENTRATION / std::f64::consts::TAU;
            [0.5 * lobe, 0.5 * w.y.max(0.0) * std::f64::consts::FRAC_1_PI]
        };
        let evaluate = |at: &[(usize, DVec3)]| Ok::<_, ()>(at.iter().map(|(_, w)| density(*w)).collect());
        let integrals = integrate(bins.cells.len(), &bins.pieces, 1e-6, evaluate).unwrap();
        for k in 0..2 {
            let sum: f64 = integrals.iter().map(|integral| integral.value[k]).sum();
            // Ten of the samples.
            assert!((sum - 0.5).abs() < 10.0 / f64::from(1 << 16), "part {k}: {sum}");
        }
    }

    #[test]
    fn pieces_are_small_where_a_few_samples_are_close_together() {
        // One sample in fifty is in a spot of 10⁻⁴ radians.
        let spot = |i: u32| DVec3::new(0.6 + 1e-4 * f64::from(i % 7) / 7.0, 0.8, 1e-4 * f64::from(i % 11) / 11.0);
        let samples: Vec<DVec3> =
            directions(1 << 14).into_iter().zip(0..).map(|(w, i)| if i % 50 == 0 { spot(i) } else { w }).collect();
        let bins = Bins::new(&samples);
        let radius = (1.0_f64 - 0.8).sqrt();
        let at_spot = bins.pieces.iter().filter(|(_, c)| c.radius[0] <= radius && radius < c.radius[1] + 1e-6);
        let smallest = at_spot.map(|(_, c)| c.radius[1] - c.radius[0]).fold(1.0, f64::min);
        assert!(smallest < 1e-3, "{smallest}");
        let whole = |bin: usize, cell: &Cell| {
            let area = |c: &Cell| (c.radius[1] - c.radius[0]) * (c.turns[1] - c.turns[0]);
            let parts: f64 = bins.pieces.iter().filter(|(owner, _)| *owner == bin).map(|(_, c)| area(c)).sum();
            (parts / area(cell) - 1.0).abs() < 1e-9
        };
        assert!(bins.cells.iter().enumerate().all(|(bin, cell)| whole(bin, cell)));
    }

    #[test]
    fn a_direction_is_in_its_bin_and_samples_that_are_all_alike_end_the_cuts() {
        let same = vec![DVec3::new(0.6, 0.8, 0.0); 1 << 12];
        for samples in [directions(1 << 10), same, Vec::new()] {
            let bins = Bins::new(&samples);
            assert!(bins.cells.len() <= 512);
            for w in directions(500).into_iter().flat_map(|w| [w, -w]) {
                let cell = &bins.cells[bins.find(w)];
                let (below, radius, turns) = coordinates(w);
                let within = |x: f64, range: [f64; 2]| range[0] <= x && x <= range[1];
                assert!(
                    cell.below == below && within(radius, cell.radius) && within(turns, cell.turns),
                    "{cell:?} {w}"
                );
            }
        }
    }
}
