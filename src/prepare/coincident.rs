//! Emissive triangles that are given more than once.
//!
//! Of coincident surfaces a ray meets one. For what only scatters it does not matter which; as lights each would be
//! sampled, with no telling which of them hides the other, and the scene would be too bright.

use std::collections::HashSet;

/// The emissive triangles of a mesh so far.
#[derive(Debug, Default)]
pub(super) struct SeenTriangles(HashSet<Key>);

/// A material and corners in a fixed order, by their bits. Front and back are two surfaces, unless both emit alike.
type Key = (u32, bool, [[u32; 3]; 3]);

impl SeenTriangles {
    /// Whether there was none of this material with these corners before, in whatever order.
    pub(super) fn is_new(&mut self, vertices: [[f32; 3]; 3], material: u32, double_sided: bool) -> bool {
        // The sum makes zero of minus zero.
        let corners = vertices.map(|vertex| vertex.map(|x| (x + 0.0).to_bits()));
        let mut sorted = corners;
        sorted.sort_unstable();
        let first = corners.iter().position(|corner| *corner == sorted[0]).unwrap_or(0);
        let turned = !double_sided && corners[(first + 1) % 3] != sorted[1];
        self.0.insert((material, turned, sorted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_triangle_is_known_again() {
        let [a, b, c] = [[0.0, 0.0, 1.0], [2.0, -1.0, 0.0], [-0.0, 3.0, 0.0]];
        let mut one_sided = SeenTriangles::default();
        assert!(one_sided.is_new([a, b, c], 1, false));
        assert!(!one_sided.is_new([b, c, a], 1, false) && !one_sided.is_new([[-0.0, 0.0, 1.0], b, c], 1, false));
        assert!(one_sided.is_new([b, a, c], 1, false), "the back is another surface");
        assert!(one_sided.is_new([a, b, c], 2, false), "so is another material");
        let mut double_sided = SeenTriangles::default();
        assert!(double_sided.is_new([a, b, c], 1, true) && !double_sided.is_new([c, b, a], 1, true));
    }
}
