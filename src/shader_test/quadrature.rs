//! Integrals over cells of directions, refined where the integrand is uneven.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Nodes along a side of a cell.
const ORDER: usize = 6;
/// A cell is cut in four this many times at most: then it is 2⁻¹² of a bin along each side.
const DEEPEST: u32 = 12;
/// Nodes of a bin, in all its cells together, at most on average: what is still uneven then is said in the error.
const MOST_NODES_A_BIN: usize = 1 << 14;

/// A piece of a hemisphere: `radius` and `turns` are ranges of Lambert's azimuthal equal-area coordinates about the normal,
/// r = √(1 − |cos θ|) in [0, 1] and the azimuth in [0, 1). They are smooth at the pole, and the horizon is an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Below the surface.
    pub below: bool,
    /// From and to.
    pub radius: [f64; 2],
    /// From and to, in turns of the azimuth, from +X towards +Z.
    pub turns: [f64; 2],
}

impl Cell {
    /// A hemisphere.
    pub fn hemisphere(below: bool) -> Self {
        Self { below, radius: [0.0, 1.0], turns: [0.0, 1.0] }
    }

    /// The direction in the middle.
    pub fn center(&self) -> DVec3 {
        let middle = |range: [f64; 2]| 0.5 * (range[0] + range[1]);
        direction(self.below, middle(self.radius), middle(self.turns))
    }

    /// The parts below and above `at`, along the radius or the azimuth.
    pub fn cut(&self, along_radius: bool, at: f64) -> [Self; 2] {
        let halves = |range: [f64; 2]| [[range[0], at], [at, range[1]]];
        if along_radius {
            halves(self.radius).map(|radius| Self { radius, ..*self })
        } else {
            halves(self.turns).map(|turns| Self { turns, ..*self })
        }
    }

    fn quarters(&self) -> [Self; 4] {
        let middle = |range: [f64; 2]| 0.5 * (range[0] + range[1]);
        let [inner, outer] = self.cut(true, middle(self.radius));
        let [a, b] = inner.cut(false, middle(self.turns));
        let [c, d] = outer.cut(false, middle(self.turns));
        [a, b, c, d]
    }
}

/// The direction at a radius and an azimuth of [`Cell`], and back: (below, radius, turns).
fn direction(below: bool, radius: f64, turns: f64) -> DVec3 {
    let sine = radius * (2.0 - radius * radius).sqrt();
    let (sin, cos) = (turns * TAU).sin_cos();
    let cosine = 1.0 - radius * radius;
    DVec3::new(sine * cos, if below { -cosine } else { cosine }, sine * sin)
}

/// Where a direction lies: (below, radius, turns) of [`Cell`]. The radius is taken from x and z, since near the pole a
/// rounded y says little.
pub fn coordinates(w: DVec3) -> (bool, f64, f64) {
    let radius = ((w.x * w.x + w.z * w.z) / (1.0 + w.y.abs())).sqrt();
    (w.y < 0.0, radius.min(1.0), (w.z.atan2(w.x) / TAU).rem_euclid(1.0))
}

/// An integral over a bin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integral<const N: usize> {
    /// Its value.
    pub value: [f64; N],
    /// By how much the last two refinements differ, summed over the bin's cells: the error is less for what is smooth.
    pub error: [f64; N],
}

struct Pending<const N: usize> {
    bin: usize,
    depth: u32,
    cell: Cell,
    coarse: [f64; N],
}

/// Integrates `N` functions of direction over each of `bins` bins, per solid angle. `cells` are what the bins are made of,
/// each with the index of its bin. `evaluate` gets (bin, direction), in the order of `cells`, and returns the values there; a
/// cell is cut in four until that changes its integrals by less than `tolerance`.
///
/// # Errors
/// Those of `evaluate`.
pub fn integrate<const N: usize, E>(
    bins: usize,
    cells: &[(usize, Cell)],
    tolerance: f64,
    mut evaluate: impl FnMut(&[(usize, DVec3)]) -> Result<Vec<[f64; N]>, E>,
) -> Result<Vec<Integral<N>>, E> {
    let rule = gauss_legendre(ORDER);
    let mut results = vec![Integral { value: [0.0; N], error: [0.0; N] }; bins];
    let coarse = integrate_cells(cells, &rule, &mut evaluate)?;
    let pending = |(&(bin, cell), coarse): (&(usize, Cell), _)| Pending { bin, depth: 0, cell, coarse };
    let mut waiting: Vec<Pending<N>> = cells.iter().zip(coarse).map(pending).collect();
    let mut nodes_left = MOST_NODES_A_BIN * bins;
    while !waiting.is_empty() {
        let quarters: Vec<(usize, Cell)> =
            waiting.iter().flat_map(|p| p.cell.quarters().map(|cell| (p.bin, cell))).collect();
        nodes_left = nodes_left.saturating_sub(quarters.len() * ORDER * ORDER);
        let fine = integrate_cells(&quarters, &rule, &mut evaluate)?;
        let mut next = Vec::new();
        for (i, parent) in waiting.iter().enumerate() {
            let parts = &fine[4 * i..4 * i + 4];
            let sum: [f64; N] = std::array::from_fn(|k| parts.iter().map(|part| part[k]).sum());
            let change: [f64; N] = std::array::from_fn(|k| (sum[k] - parent.coarse[k]).abs());
            // Written so that NaN, which no refinement mends, ends it.
            let uneven = change.iter().any(|c| *c > tolerance);
            if uneven && parent.depth < DEEPEST && nodes_left > 0 {
                let quarter = |k: usize| Pending {
                    bin: parent.bin,
                    depth: parent.depth + 1,
                    cell: quarters[4 * i + k].1,
                    coarse: parts[k],
                };
                next.extend((0..4).map(quarter));
            } else {
                let result = &mut results[parent.bin];
                for k in 0..N {
                    result.value[k] += sum[k];
                    result.error[k] += change[k];
                }
            }
        }
        waiting = next;
    }
    Ok(results)
}

/// The tensor Gauss-Legendre rule on each cell.
fn integrate_cells<const N: usize, E>(
    cells: &[(usize, Cell)],
    rule: &[(f64, f64)],
    evaluate: &mut impl FnMut(&[(usize, DVec3)]) -> Result<Vec<[f64; N]>, E>,
) -> Result<Vec<[f64; N]>, E> {
    let (mut at, mut weights) = (Vec::new(), Vec::new());
    for (bin, cell) in cells {
        let [r0, r1] = cell.radius;
        let [t0, t1] = cell.turns;
        for (x, radial) in rule {
            let radius = r0 + (r1 - r0) * x;
            for (y, angular) in rule {
                at.push((*bin, direction(cell.below, radius, t0 + (t1 - t0) * y)));
                // dω = d(cos θ) dφ = 2r dr dφ.
                weights.push(2.0 * radius * (r1 - r0) * radial * TAU * (t1 - t0) * angular);
            }
        }
    }
    let values = evaluate(&at)?;
    let nodes = rule.len() * rule.len();
    let sum = |(values, weights): (&[[f64; N]], &[f64])| {
        std::array::from_fn(|k| values.iter().zip(weights).map(|(value, weight)| value[k] * weight).sum())
    };
    Ok(values.chunks_exact(nodes).zip(weights.chunks_exact(nodes)).map(sum).collect())
}

/// Nodes and weights on [0, 1], by Newton's steps on the Legendre polynomial.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 0.0;
        for _ in 0..50 {
            let (mut p0, mut p1) = (1.0, x);
            for k in 2..=n {
                let k = k as f64;
                (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
            }
            slope = n as f64 * (x * p1 - p0) / (x * x - 1.0);
            let step = p1 / slope;
            x -= step;
            if step.abs() < 1e-16 {
                break;
            }
        }
        (0.5 + 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over<const N: usize>(bins: &[Cell], f: impl Fn(DVec3) -> [f64; N]) -> Vec<Integral<N>> {
        let evaluate = |at: &[(usize, DVec3)]| Ok::<_, ()>(at.iter().map(|(_, w)| f(*w)).collect());
        integrate(bins.len(), &bins.iter().copied().enumerate().collect::<Vec<_>>(), 1e-9, evaluate).unwrap()
    }

    #[test]
    fn known_integrals_over_the_hemispheres() {
        let hemispheres = [Cell::hemisphere(false), Cell::hemisphere(true)];
        let integrals = over(&hemispheres, |w| [1.0, w.y, w.x * w.x, if w.y > 0.0 { w.x } else { w.z }]);
        for (integral, sign) in integrals.iter().zip([1.0, -1.0]) {
            let expected = [TAU, sign * PI, TAU / 3.0, 0.0];
            let close = integral.value.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-8);
            assert!(close, "{integral:?}, expected {expected:?}");
        }
    }

    #[test]
    fn directions_and_coordinates_are_inverse_down_to_the_pole() {
        for (below, radius, turns) in [(false, 1e-5, 0.3), (true, 0.7, 0.99), (false, 1.0, 0.0)] {
            // As a shader would give it.
            let w = direction(below, radius, turns).as_vec3().as_dvec3();
            let (side, r, t) = coordinates(w);
            assert!(side == below || radius == 1.0, "{w}");
            assert!((r / radius - 1.0).abs() < 1e-6 && (t - turns).abs() < 1e-6, "{radius} {turns}: {r} {t}");
        }
    }
}
