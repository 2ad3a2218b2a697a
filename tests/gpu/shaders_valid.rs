//! Every kernel compiles, and its SPIR-V is valid by `spirv-val` (Debian: spirv-tools; `make deps` installs it).

use crate::common::gpu;
use crate::common::spirv::{assert_valid, bytes, validate, validator_is_there};
use sunfleck::gpu::{embedded, shader_compiler};

fn compile(file: &str, backend: u32, form: u32) -> Vec<u8> {
    let defines = [("TRACE_BACKEND", backend.to_string()), ("ARRAY_FORM", form.to_string())];
    let spirv = shader_compiler::compile(gpu::sources(), file, &defines);
    bytes(&spirv.unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn every_variant_of_the_path_tracer_is_valid() {
    if !validator_is_there() {
        return;
    }
    for (backend, forms) in embedded::PATH_TRACE.iter().enumerate() {
        for (form, spirv) in forms.iter().enumerate() {
            assert_valid(&format!("path_trace, back end {backend}, array form {form}"), spirv);
        }
    }
}

#[test]
fn every_other_kernel_is_valid() {
    if !validator_is_there() {
        return;
    }
    let files: Vec<&String> = gpu::sources().keys().filter(|file| file.ends_with(".comp")).collect();
    assert!(files.len() > 5, "the kernels are found: {files:?}");
    for file in files.into_iter().filter(|file| *file != "path_trace.comp") {
        // Both back ends and all forms at least once, without compiling every kernel six times.
        for (backend, form) in [(0, 0), (0, 1), (1, 2)] {
            assert_valid(&format!("{file}, back end {backend}, array form {form}"), &compile(file, backend, form));
        }
    }
}

/// The validator is asked in earnest: a module with a word missing is refused.
#[test]
fn a_broken_module_is_refused() {
    if !validator_is_there() {
        return;
    }
    let spirv = embedded::PATH_TRACE[0][0];
    assert!(validate(&spirv[..spirv.len() - 4]).expect("spirv-val runs").is_some());
}
