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
const COUNTED: &str = "if (!is_finite(lane.radiance)) lane.non_finite |= bit;";
const CATCHES: &str = "real_input::planted_samples_are_counted_and_located";

fn assert_counter_mutant_is_caught(mutant: &'static str) {
    if !short_form() {
        assert_caught(&Mutation { file: "path_trace.comp", original: COUNTED, mutant }, CATCHES);
    }
}

/// A compiler that takes numbers to be finite drops the comparison `x != x`: nothing is counted.
#[test]
fn dropped_comparison_for_non_finite_samples() {
    assert_counter_mutant_is_caught("if (false) lane.non_finite |= bit;");
}

/// A comparison that finds a NaN lets an infinity pass.
#[test]
fn comparison_by_floats_for_non_finite_samples() {
    assert_counter_mutant_is_caught("if (any(notEqual(lane.radiance, lane.radiance))) lane.non_finite |= bit;");
}
