//! Sunfleck: a headless, physically based path tracer on Vulkan compute.

pub mod scene;
