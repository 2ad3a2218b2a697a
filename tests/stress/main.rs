//! Numerical stability under stress (`make stress`; docs/accuracy/stability.md). Plain `cargo test --test stress` is the
//! short form, SUNFLECK_STRESS=full the whole.

#[path = "../common/mod.rs"]
mod common;

mod accumulation;
mod float_behaviour;
mod geometry;
mod light;
mod material;
mod mutations;
mod ray;
mod real_input;
