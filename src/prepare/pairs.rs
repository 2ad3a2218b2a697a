//! Which triangles share a leaf: two that share an edge and turn the same way. A ray visits one leaf for both, which half of
//! the memory holds.

use crate::layout::LeafSlot;
use crate::prepare::bounds::Bounds;

/// No triangle.
const NONE: u32 = u32::MAX;

/// One triangle, or two with a common edge: indices of them, and the corner of each that its vertices begin with. Turned so,
/// the first is (0, 1, 2) and the second (0, 2, 3) of four vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    pub(super) first: (u32, usize),
    pub(super) second: Option<(u32, usize)>,
}

impl Pair {
    /// The same triangles, begun so that the vertices of their diagonal, the leaf's first and third, say whether they have
    /// alpha: the first has then the larger words, x before y before z. Of both ways to begin a pair, and of the three to begin
    /// a triangle, one is so; only a triangle without area has two vertices in one place.
    pub(super) fn begun(self, triangles: &[[u32; 3]], positions: &[[f32; 3]], alpha: bool) -> Self {
        let words = |vertex: u32| positions[vertex as usize].map(f32::to_bits);
        let fits = |(triangle, corner): (u32, usize)| {
            let [a, _, c] = turned(triangles[triangle as usize], corner);
            (words(a) > words(c)) == alpha
        };
        let (first, corner) = self.first;
        match self.second {
            Some(_) if fits(self.first) => self,
            Some((second, from)) => Self { first: (second, (from + 1) % 3), second: Some((first, (corner + 2) % 3)) },
            None => {
                let corner = (0..3).find(|&corner| fits((first, corner))).unwrap_or(corner);
                Self { first: (first, corner), second: None }
            }
        }
    }
}

/// Three indices in the same cyclic order, the one at `corner` first.
pub(super) fn turned<T: Copy>(triangle: [T; 3], corner: usize) -> [T; 3] {
    [triangle[corner], triangle[(corner + 1) % 3], triangle[(corner + 2) % 3]]
}

/// Pairs the triangles of an indexed mesh, each with the free neighbour beside which it lies closest, in index order. Every
/// triangle is in one pair.
pub(super) fn pairs(triangles: &[[u32; 3]], positions: &[[f32; 3]]) -> Vec<Pair> {
    let neighbours = neighbours(triangles, positions.len());
    let bounds = |triangle: u32| Bounds::around(triangles[triangle as usize].map(|v| positions[v as usize]));
    let mut taken = vec![false; triangles.len()];
    let mut pairs = Vec::with_capacity(triangles.len() / 2 + 1);
    for first in 0..triangles.len() as u32 {
        if taken[first as usize] {
            continue;
        }
        let own = bounds(first);
        // Two leaves cost what their areas are; a leaf for both, at most as much.
        let free = |edge: usize| {
            let (other, other_edge) = neighbours[first as usize][edge].filter(|(other, _)| !taken[*other as usize])?;
            let other_bounds = bounds(other);
            let area = own.union(other_bounds).half_area();
            (area <= own.half_area() + other_bounds.half_area()).then_some((area, edge, other, other_edge))
        };
        let best = (0..3).filter_map(free).min_by(|a, b| a.0.total_cmp(&b.0));
        taken[first as usize] = true;
        pairs.push(match best {
            None => Pair { first: (first, 0), second: None },
            Some((_, edge, other, other_edge)) => {
                taken[other as usize] = true;
                // The common edge leads from the first's vertex 2 to 0, and from the second's 0 to 2.
                Pair { first: (first, (edge + 1) % 3), second: Some((other, other_edge)) }
            }
        });
    }
    pairs
}

/// Of each edge (from corner k to the next), the one triangle that has it the other way round, and which of its edges that
/// is; `None` at borders, and where more than two triangles meet.
fn neighbours(triangles: &[[u32; 3]], vertices: usize) -> Vec<[Option<(u32, usize)>; 3]> {
    let low = |triangle: &[u32; 3], edge: usize| triangle[edge].min(triangle[(edge + 1) % 3]) as usize;
    // Edges by their lower vertex, as a counting sort makes them.
    let mut starts = vec![0u32; vertices + 1];
    for triangle in triangles {
        (0..3).for_each(|edge| starts[low(triangle, edge) + 1] += 1);
    }
    for vertex in 0..vertices {
        starts[vertex + 1] += starts[vertex];
    }
    let mut edges = vec![(NONE, NONE); 3 * triangles.len()];
    let mut next = starts.clone();
    for (triangle, index) in triangles.iter().zip(0u32..) {
        for edge in 0..3 {
            let place = &mut next[low(triangle, edge)];
            let high = triangle[edge].max(triangle[(edge + 1) % 3]);
            edges[*place as usize] = (high, 3 * index + edge as u32);
            *place += 1;
        }
    }
    let mut neighbours = vec![[None; 3]; triangles.len()];
    for vertex in 0..vertices {
        let around = &mut edges[starts[vertex] as usize..starts[vertex + 1] as usize];
        around.sort_unstable();
        for same in around.chunk_by(|a, b| a.0 == b.0) {
            let &[(_, a), (_, b)] = same else { continue };
            let (at, bt) = ((a / 3) as usize, (b / 3) as usize);
            let (ae, be) = ((a % 3) as usize, (b % 3) as usize);
            let opposite = triangles[at][ae] == triangles[bt][(be + 1) % 3] && triangles[at][ae] != triangles[bt][be];
            if opposite && at != bt {
                neighbours[at][ae] = Some((bt as u32, be));
                neighbours[bt][be] = Some((at as u32, ae));
            }
        }
    }
    neighbours
}

/// The leaf of one triangle, or of two: (0, 1, 2) and (0, 2, 3).
pub(super) fn leaf_slot(first: [[f32; 3]; 3], second: Option<[[f32; 3]; 3]>) -> LeafSlot {
    let [a, b, c] = first;
    LeafSlot { vertices: [a, b, c, second.map_or(a, |second| second[2])] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of n quads, each of two triangles, a triangle that turns the other way, and one that nothing touches.
    fn mesh(n: u32) -> (Vec<[u32; 3]>, Vec<[f32; 3]>) {
        let mut positions: Vec<[f32; 3]> = (0..2 * (n + 1)).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
        let mut triangles: Vec<[u32; 3]> = (0..n).map(|i| [2 * i, 2 * i + 2, 2 * i + 3]).collect();
        triangles.extend((0..n).map(|i| [2 * i + 3, 2 * i + 1, 2 * i]));
        positions.extend([[0.0, 2.0, 0.0], [9.0, 9.0, 9.0], [9.0, 8.0, 9.0], [8.0, 9.0, 9.0]]);
        let extra = 2 * (n + 1);
        triangles.extend([[1, 3, extra + 3], [extra + 1, extra + 2, extra + 3]]);
        (triangles, positions)
    }

    #[test]
    fn pairs_share_an_edge_and_turn_alike() {
        let (triangles, positions) = mesh(10);
        let pairs = pairs(&triangles, &positions);
        let mut seen = vec![0; triangles.len()];
        for pair in &pairs {
            seen[pair.first.0 as usize] += 1;
            let Some((second, corner)) = pair.second else { continue };
            seen[second as usize] += 1;
            let [a, _, c] = turned(triangles[pair.first.0 as usize], pair.first.1);
            let [a2, c2, _] = turned(triangles[second as usize], corner);
            assert_eq!((a, c), (a2, c2), "{pair:?}");
        }
        assert!(seen.iter().all(|count| *count == 1), "{seen:?}");
        // The halves of a quad have one box: they are nearer to each other than to those of the next.
        assert_eq!(pairs.iter().filter(|pair| pair.second.is_some()).count(), 10);
    }

    #[test]
    fn edges_of_three_triangles_and_twins_are_left_alone() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
        let fan = [[0, 1, 2], [1, 0, 3], [1, 0, 4]];
        assert!(pairs(&fan, &positions).iter().all(|pair| pair.second.is_none()));
        let same = [[0, 1, 2], [0, 1, 3]];
        assert!(pairs(&same, &positions).iter().all(|pair| pair.second.is_none()), "they turn apart");
        assert_eq!(pairs(&[], &[]), []);
    }
}
