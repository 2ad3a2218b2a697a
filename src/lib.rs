//! Sunfleck: a headless, physically based path tracer on Vulkan compute.

pub mod gpu;
pub mod layout;
pub mod scene;
