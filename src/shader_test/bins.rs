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

/// A binary tree over both hemispheres; its leaves are the bins.
pub struct Bins {
    nodes: Vec<Node>,
    /// The bins.
    pub cells: Vec<Cell>,
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
        let mut bins = Self { nodes: Vec::new(), cells: Vec::new() };
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
            return self.leaf(node, cell);
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

    fn leaf(&mut self, node: usize, cell: Cell) {
        self.nodes[node] = Node::Leaf(self.cells.len());
        self.cells.push(cell);
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

/// Half of the points are below it along the axis.
fn median(points: &mut [[f64; 2]], axis: usize) -> Option<f64> {
    let middle = points.len() / 2;
    let (_, median, _) = points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    Some(median[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

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
