//! Polygons to triangles.

use glam::{DVec2, DVec3};

/// Triangles, as corner numbers, that cover a polygon and keep its winding. Triangles and convex quadrilaterals directly;
/// everything else by cutting ears in the plane of Newell's normal.
pub(super) fn triangulate(points: &[[f32; 3]]) -> Vec<[usize; 3]> {
    if points.len() == 3 {
        return vec![[0, 1, 2]];
    }
    let Some(plane) = project(points) else { return fan(points.len()) };
    if is_convex(&plane) { fan(points.len()) } else { cut_ears(&plane) }
}

fn fan(count: usize) -> Vec<[usize; 3]> {
    (1..count.saturating_sub(1)).map(|i| [0, i, i + 1]).collect()
}

/// The polygon in its own plane, counter-clockwise; `None` if it has no area.
fn project(points: &[[f32; 3]]) -> Option<Vec<DVec2>> {
    let points: Vec<DVec3> = points.iter().map(|point| DVec3::from(point.map(f64::from))).collect();
    let origin = points[0];
    let edges = points.iter().zip(points.iter().cycle().skip(1));
    let normal: DVec3 = edges.map(|(&a, &b)| (a - origin).cross(b - origin)).sum();
    let normal = normal.try_normalize()?;
    let (x, y) = normal.any_orthonormal_pair();
    let flipped = x.cross(y).dot(normal) < 0.0;
    let flat = |point: &DVec3| {
        let offset = *point - origin;
        DVec2::new(offset.dot(x), if flipped { -offset.dot(y) } else { offset.dot(y) })
    };
    Some(points.iter().map(flat).collect())
}

/// Twice the signed area of a triangle.
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

fn is_convex(points: &[DVec2]) -> bool {
    let count = points.len();
    let turns_left = (0..count).all(|i| area(points[i], points[(i + 1) % count], points[(i + 2) % count]) >= 0.0);
    // Turning left all the way is not enough for five corners and more: a pentagram does too.
    let fans_out = (1..count - 1).all(|i| area(points[0], points[i], points[i + 1]) >= 0.0);
    turns_left && fans_out
}

/// Cuts off a corner that is convex and holds no other one, until a triangle is left. A polygon that crosses itself may
/// have no such corner; then the rest becomes a fan. O(n²) for most polygons.
fn cut_ears(points: &[DVec2]) -> Vec<[usize; 3]> {
    let mut rest: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    let mut start = 0;
    while rest.len() > 3 {
        let count = rest.len();
        let corner = |i: usize| [rest[(i + count - 1) % count], rest[i % count], rest[(i + 1) % count]];
        let is_ear = |i: &usize| {
            let [a, b, c] = corner(*i).map(|vertex| points[vertex]);
            let inside = |p: DVec2| area(a, b, p) >= 0.0 && area(b, c, p) >= 0.0 && area(c, a, p) >= 0.0;
            let is_corner = |p: DVec2| p == a || p == b || p == c;
            area(a, b, c) > 0.0 && !rest.iter().any(|&other| !is_corner(points[other]) && inside(points[other]))
        };
        let Some(ear) = (start..start + count).find(is_ear).map(|i| i % count) else { break };
        triangles.push(corner(ear));
        rest.remove(ear);
        // Going on from here spreads the cuts and keeps the usual cost low.
        start = ear % rest.len();
    }
    triangles.extend(fan(rest.len()).into_iter().map(|triangle| triangle.map(|i| rest[i])));
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total_area(points: &[[f32; 3]]) -> f64 {
        let vector = |i: usize| DVec3::from(points[i].map(f64::from));
        let twice = |[a, b, c]: [usize; 3]| (vector(b) - vector(a)).cross(vector(c) - vector(a));
        triangulate(points).into_iter().map(|triangle| 0.5 * twice(triangle).length()).sum()
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        // An L of area 3 and a chevron of area 1, the latter as a quadrilateral whose fan from corner 0 would overlap.
        let l = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
        assert!((total_area(&l) - 3.0).abs() < 1e-12);
        let chevron = [[-1.0, 0.0, 5.0], [0.0, 1.0, 5.0], [1.0, 0.0, 5.0], [0.0, 2.0, 5.0]];
        assert!((total_area(&chevron) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn winding_is_kept() {
        let square = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
        for [a, b, c] in triangulate(&square) {
            let [a, b, c] = [a, b, c].map(|i| DVec3::from(square[i].map(f64::from)));
            assert!((b - a).cross(c - a).y > 0.0);
        }
    }

    #[test]
    fn degenerate_polygons_end() {
        assert_eq!(triangulate(&[[1.0; 3]; 5]).len(), 3);
        let crossed = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 3.0, 0.0]];
        assert_eq!(triangulate(&crossed).len(), 3);
    }
}
