//! Numerical stability under stress: `cargo test --test stress` is the short form, `make stress` the full one.

#[path = "../common/mod.rs"]
mod common;

mod accumulation;
mod light;
mod material;
mod mutations;
mod real_input;
