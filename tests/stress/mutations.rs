//! Deliberate bugs in what the stress suite relies on, each with the test that notices it (tests/common/mutation.rs).

use crate::common::mutation::{Mutation, assert_caught};
use crate::common::scenes::short_form;

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
