//! Sunfleck: a headless, physically based path tracer on Vulkan compute.

pub mod error;
pub mod film;
pub mod gpu;
pub mod layout;
pub mod prepare;
pub mod render;
pub mod scene;

pub use error::{Error, Result};
