//! Mutation tests: a deliberate bug in the shaders, and the test that has to notice it.
//!
//! The test binary runs one of its own tests again, in a process of its own, with a folder of shader sources in which one
//! piece of text is replaced (`SUNFLECK_TEST_SHADERS`, which tests/common/gpu.rs reads). That test must fail by an
//! assertion; a mutation that it does not notice, or that does not compile, fails the mutation test.

use std::path::Path;
use std::process::Command;

use super::gpu;

/// Environment variable that names the folder of shader sources of a mutated run.
pub const SHADERS_VARIABLE: &str = "SUNFLECK_TEST_SHADERS";

/// One deliberate bug.
pub struct Mutation {
    /// File below shaders/.
    pub file: &'static str,
    /// Text of it that occurs once.
    pub original: &'static str,
    /// What stands there instead.
    pub mutant: &'static str,
}

/// Asserts that the test `test` of this binary (its full name) passes judgement on the mutated shaders: it fails.
pub fn assert_caught(mutation: &Mutation, test: &str) {
    let folder = tempfile::tempdir().expect("a scratch folder");
    write_mutated(folder.path(), mutation);
    let output = run(test, folder.path());
    assert!(output.contains("running 1 test"), "there is no test {test}:\n{output}");
    for broken in ["does not compile", "there is no such file"] {
        assert!(!output.contains(broken), "the mutant is no shader:\n{output}");
    }
    let caught = output.contains("test result: FAILED. 0 passed; 1 failed");
    assert!(caught, "{test} did not notice `{}` in {}:\n{output}", mutation.mutant, mutation.file);
    // For whoever wants to see by which figures (--nocapture).
    let verdict = output.lines().skip_while(|line| !line.contains("panicked at")).take(3).collect::<Vec<_>>();
    println!("{}", verdict.join("\n"));
}

/// Asserts that `test` passes with the unchanged sources read from a folder: what catches a mutant is the mutation.
pub fn assert_passes_unchanged(test: &str) {
    let folder = tempfile::tempdir().expect("a scratch folder");
    write_sources(folder.path(), |_, text| text.to_owned());
    let output = run(test, folder.path());
    assert!(output.contains("test result: ok. 1 passed; 0 failed"), "{test}:\n{output}");
}

fn write_mutated(folder: &Path, mutation: &Mutation) {
    let source = gpu::sources().get(mutation.file).unwrap_or_else(|| panic!("there is no shaders/{}", mutation.file));
    let found = source.matches(mutation.original).count();
    assert_eq!(found, 1, "`{}` occurs {found} times in shaders/{}", mutation.original, mutation.file);
    write_sources(folder, |name, text| {
        if name == mutation.file { text.replace(mutation.original, mutation.mutant) } else { text.to_owned() }
    });
}

/// Writes the shader sources under test to a folder, each edited by (name, text).
pub fn write_sources(folder: &Path, edit: impl Fn(&str, &str) -> String) {
    for (name, text) in gpu::sources() {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("the scratch folder is writable");
        std::fs::write(path, edit(name, text)).expect("the scratch folder is writable");
    }
}

/// Everything that the run of one test prints.
fn run(test: &str, shaders: &Path) -> String {
    let program = std::env::current_exe().expect("this program");
    let mut command = Command::new(program);
    command.args([test, "--exact", "--nocapture"]).env(SHADERS_VARIABLE, shaders);
    let output = command.output().expect("this program runs");
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}
