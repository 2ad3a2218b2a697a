//! The compiler process: GLSL to SPIR-V. It is a process of its own because glslang crashes on some wrong shaders, and its
//! tables stay warm in it.

use std::io::{self, BufWriter};

use serde::{Deserialize, Serialize};

use super::diagnostic::{Diagnostic, diagnose};
use super::wire::{read_message, write_message};
use crate::Result;
use crate::gpu::shader_compiler::{Sources, compile};

/// What is to be compiled.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CompileOrder {
    /// Comes back with the answer.
    pub number: u32,
    /// The kernel's file.
    pub file: String,
    /// Macros and their values.
    pub defines: Vec<(String, String)>,
    /// All shader files.
    pub sources: Sources,
}

/// What came of it; the SPIR-V follows if there are no errors.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CompileAnswer {
    /// That of the order.
    pub number: u32,
    /// Milliseconds.
    pub milliseconds: f64,
    /// What the compiler says.
    pub errors: Vec<Diagnostic>,
}

/// Compiles what standard input orders, until it ends.
///
/// # Errors
/// None: a parent that is gone ends it.
pub fn run() -> Result<()> {
    // Makes the tables of built-in functions before the first save.
    let warm_up = Sources::from([("empty.comp".to_owned(), "#version 460\nvoid main() {}\n".to_owned())]);
    let _ = compile(&warm_up, "empty.comp", &[]);
    let (mut stdin, mut out) = (io::stdin().lock(), BufWriter::new(io::stdout().lock()));
    while let Ok((order, _)) = read_message::<CompileOrder>(&mut stdin) {
        let start = std::time::Instant::now();
        let defines: Vec<_> = order.defines.iter().map(|(name, value)| (name.as_str(), value.clone())).collect();
        let result = compile(&order.sources, &order.file, &defines);
        let milliseconds = 1e3 * start.elapsed().as_secs_f64();
        let (errors, spirv) = match result {
            Ok(spirv) => (Vec::new(), spirv.iter().flat_map(|word| word.to_le_bytes()).collect()),
            Err(error) => (diagnose(&error, &order.sources), Vec::new()),
        };
        if write_message(&mut out, &CompileAnswer { number: order.number, milliseconds, errors }, &spirv).is_err() {
            break;
        }
    }
    Ok(())
}
