//! Every kernel compiles, and its SPIR-V is valid by `spirv-val` (Debian: spirv-tools; `make deps` installs it).

use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::common::gpu;
use sunfleck::gpu::{embedded, shader_compiler};

/// `None` if the module is valid, else what the validator says.
fn validate(spirv: &[u8]) -> std::io::Result<Option<String>> {
    let mut child = Command::new("spirv-val")
        .args(["--target-env", "vulkan1.2", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    child.stdin.take().expect("piped").write_all(spirv)?;
    let output = child.wait_with_output()?;
    let message = || String::from_utf8_lossy(&[output.stdout.as_slice(), &output.stderr].concat()).into_owned();
    Ok((!output.status.success()).then(message))
}

/// Whether there is a validator; says so if not.
fn validator_is_there() -> bool {
    let there = Command::new("spirv-val").arg("--version").output().is_ok();
    if !there {
        eprintln!("skipped: spirv-val is not installed (make deps installs it)");
    }
    there
}

fn assert_valid(name: &str, spirv: &[u8]) {
    let message = validate(spirv).expect("spirv-val runs");
    assert!(message.is_none(), "{name}: {}", message.unwrap_or_default());
}

fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn compile(file: &str, backend: u32, form: u32, optimize: bool) -> Vec<u8> {
    let defines = [("TRACE_BACKEND", backend.to_string()), ("ARRAY_FORM", form.to_string())];
    let spirv = shader_compiler::compile(gpu::sources(), file, &defines, optimize);
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
    assert_valid("path_trace, unoptimised", &compile("path_trace.comp", 1, 2, false));
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
            assert_valid(
                &format!("{file}, back end {backend}, array form {form}"),
                &compile(file, backend, form, false),
            );
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
