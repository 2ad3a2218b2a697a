//! Deliberate bugs that only numbers under stress show, each with the test that notices it.

use crate::common::mutation::{Mutation, assert_caught};
use crate::common::scenes::short_form;

/// Rays leave a surface by a fixed distance: too far in a small scene, not far enough in a large one.
#[test]
fn fixed_epsilon() {
    let mutation = Mutation {
        file: "include/geometry.glsl",
        original: "side * dot(abs(point.geometric_normal), point.error)",
        mutant: "side * 1e-4",
    };
    if !short_form() {
        assert_caught(&mutation, "geometry::furnace_holds_at_every_scale");
    }
}
