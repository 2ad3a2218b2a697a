//! The shader loop of `sunfleck watch`: a saved file becomes a new picture, or the compiler's message at its line.
//!
//! Three processes. The **server** ([`session`]) watches files and shows the page. The **compiler** ([`compiler`]) turns GLSL
//! into SPIR-V; a shader that crashes it takes only it along. The **worker** ([`worker`]) has the device and renders; a kernel
//! that hangs or kills the device takes only the worker along, which is replaced and goes on with the last good kernel. They
//! speak by [`wire`] over standard input and output.

pub mod compiler;
pub mod debug_calls;
pub mod diagnostic;
mod estimator;
pub mod guard;
pub mod hub;
pub mod includes;
pub mod messages;
mod options;
mod report;
pub mod scene_files;
pub mod server;
pub mod session;
mod supervisor;
mod tracked;
pub mod wire;
pub mod worker;
