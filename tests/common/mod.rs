//! What the integration tests share.
#![allow(
    dead_code,
    unreachable_pub,
    unused_imports,
    reason = "every test binary compiles this module and uses a part of it"
)]

pub mod assets;
pub mod brute_force;
pub mod bsdf;
pub mod builder;
pub mod dielectric_albedo;
pub mod ggx_albedo;
pub mod gpu;
pub mod half_vector_bins;
pub mod irradiance;
pub mod kernel;
pub mod microfacets;
pub mod mitsuba_bsdfs;
pub mod mutation;
pub mod random;
pub mod reference;
pub mod scenes;
pub mod spirv;
pub mod statistics;
pub mod trace;
