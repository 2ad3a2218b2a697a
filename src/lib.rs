//! Sunfleck: a headless, physically based path tracer on Vulkan compute.
//!
//! Data goes one way, and each module is a room that knows only what is in front of it:
//!
//! | module | what it knows |
//! |---|---|
//! | [`scene`] | what a scene is, as plain data; [`scene::load`] reads glTF, OBJ and environment maps into it |
//! | [`prepare`] | a scene as arrays of 16-byte texels: BVH, materials, textures, lights, environment and their CDFs |
//! | [`layout`] | every struct that a shader reads or writes; the other half is `shaders/include/layout.glsl` |
//! | [`gpu`] | Vulkan behind small RAII types; the only module with `unsafe`, and it knows nothing of scenes |
//! | [`render`] | what is asked for, the kernel for it, slices on a device, and the result |
//! | [`film`] | sums of samples in f64; EXR and PNG, merging, error metrics; knows neither the GPU nor scenes |
//! | [`mod@bench`] | run time against error: repeated renders, their errors to a reference, slopes, verdicts, plots |
//! | [`shader_test`] | a single shader function against what is expected of it |
//! | [`watch`] | the shader loop: a worker process that renders, files that change, the page that shows it |
//! | [`atomic_file`] | writing a file whole or not at all |
//! | [`error`] | what can end a run, and the exit code each kind has |
//!
//! From a scene to an image, as `sunfleck render cornell -o cornell.exr` does it:
//!
//! ```no_run
//! use std::ops::ControlFlow;
//! use std::path::Path;
//!
//! use sunfleck::film::exr::ExrImage;
//! use sunfleck::film::metadata::Metadata;
//! use sunfleck::render::{Settings, render};
//! use sunfleck::scene::load;
//!
//! # fn main() -> sunfleck::Result<()> {
//! let mut scene = load::resolve("cornell")?;
//! scene.frame_if_no_camera();
//! scene.light_if_dark();
//! let result = render(&scene, &Settings { spp: 64, ..Settings::default() }, &mut |_| ControlFlow::Continue(()))?;
//! ExrImage::from_film(&result.film, Metadata::default()).write(Path::new("cornell.exr"))?;
//! # Ok(())
//! # }
//! ```

pub mod atomic_file;
pub mod bench;
pub mod error;
pub mod film;
pub mod gpu;
pub mod layout;
mod memo;
mod named_enum;
pub mod prepare;
mod random;
pub mod render;
pub mod scene;
pub mod shader_test;
pub mod watch;

pub use error::{Error, Result};
