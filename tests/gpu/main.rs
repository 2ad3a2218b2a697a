//! Tests that need a Vulkan device. They run on every driver (`make test-drivers`).

#[path = "../common/mod.rs"]
mod common;

mod adaptive;
mod agreement;
mod alpha;
mod anisotropy;
mod aovs;
mod attributes;
mod baked;
mod beside;
mod bitterli;
mod bsdf_chi_square;
mod bsdf_delta;
mod bsdf_dielectric;
mod clamp_indirect;
mod cornell;
mod debug_shaders;
mod determinism;
#[cfg(target_os = "linux")]
mod dispatches;
mod emission_rays;
mod environment_chi_square;
mod error_estimate;
mod furnace;
mod layout;
mod light_bvh;
mod light_sampling;
mod mip;
mod mitsuba_bsdfs;
mod mitsuba_images;
mod mutations;
mod panes;
mod plates;
mod reciprocity;
mod sampler;
mod shader_math;
mod shader_test;
mod shaders_valid;
mod shading_normals;
mod sobol;
mod sobol_images;
mod specialized_kernels;
mod statistics;
mod texture;
mod trace;
mod volume;
mod watertight;
