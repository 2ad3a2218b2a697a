//! Compiles the shaders and embeds them: every variant of the path-tracing kernel as SPIR-V, and all sources, so that an
//! installed binary can compile them anew.

#[path = "src/gpu/shader_compiler.rs"]
#[allow(dead_code, unreachable_pub, reason = "the library uses more of it")]
mod shader_compiler;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=shaders");
    println!("cargo::rerun-if-changed=src/gpu/shader_compiler.rs");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let sources = shader_compiler::read_sources(Path::new("shaders")).expect("shaders/ is readable");
    let mut code = String::from("/// Shader sources by path.\npub const SOURCES: &[(&str, &str)] = &[\n");
    let root = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    for name in sources.keys() {
        writeln!(code, "    ({name:?}, include_str!({:?})),", format!("{root}/shaders/{name}")).expect("string");
    }
    code.push_str("];\n/// The path-tracing kernel by trace back end and array form.\npub const PATH_TRACE: [[&[u8]; 3]; 2] = [\n");
    for backend in 0..2 {
        code.push_str("    [");
        for form in 0..3 {
            let defines = [("TRACE_BACKEND", backend.to_string()), ("ARRAY_FORM", form.to_string())];
            let spirv = match shader_compiler::compile(&sources, "path_trace.comp", &defines) {
                Ok(spirv) => spirv,
                Err(error) => {
                    println!("cargo::error={}", error.to_string().replace('\n', " | "));
                    return;
                }
            };
            let file = out.join(format!("path_trace_{backend}{form}.spv"));
            let bytes: Vec<u8> = spirv.iter().flat_map(|w| w.to_le_bytes()).collect();
            std::fs::write(&file, bytes).expect("OUT_DIR is writable");
            write!(code, "include_bytes!({file:?}), ").expect("string");
        }
        code.push_str("],\n");
    }
    code.push_str("];\n");
    std::fs::write(out.join("embedded_shaders.rs"), code).expect("OUT_DIR is writable");
}
