//! Sunfleck: a headless, physically based path tracer on Vulkan compute.

pub mod layout;
pub mod prepare;
pub mod scene;
