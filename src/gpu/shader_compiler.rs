//! GLSL to SPIR-V by glslang (shaderc): the one compiler that build.rs, `--shaders` and the shader loop use.
//!
//! build.rs includes this file by path, so it depends on nothing else of the crate.

use std::collections::BTreeMap;
use std::fmt;

/// A shader that does not compile: the compiler's message, which names file and line.
#[derive(Debug)]
pub struct CompileError {
    /// File that was compiled.
    pub file: String,
    /// The compiler's messages, each with the source line that it names.
    pub message: String,
}

impl fmt::Display for CompileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "shader {} does not compile: {}", self.file, self.message.trim_end())
    }
}

impl std::error::Error for CompileError {}

/// Shader sources by their path below the shader folder, with forward slashes.
pub type Sources = BTreeMap<String, String>;

/// Compiles the compute shader `file` of `sources` with the given macro definitions.
///
/// The code is left as it is written: spirv-opt inlines every function before anything is specialised, and turns early
/// returns into switches that cost a software driver masks (docs/benchmarks). Dead code is dropped by
/// `gpu::specialize`, the rest is the driver's work.
///
/// # Errors
/// [`CompileError`] with the compiler's message.
pub fn compile(sources: &Sources, file: &str, defines: &[(&str, String)]) -> Result<Vec<u32>, CompileError> {
    let error = |message: String| CompileError { file: file.to_owned(), message };
    let source = sources.get(file).ok_or_else(|| error("there is no such file".to_owned()))?;
    let compiler = shaderc::Compiler::new().map_err(|e| error(e.to_string()))?;
    let mut options = shaderc::CompileOptions::new().map_err(|e| error(e.to_string()))?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    options.set_optimization_level(shaderc::OptimizationLevel::Zero);
    for (name, value) in defines {
        options.add_macro_definition(name, Some(value));
    }
    options.set_include_callback(|requested, _, from, _| {
        let name = resolve_include(from, requested);
        match sources.get(&name) {
            Some(content) => Ok(shaderc::ResolvedInclude { resolved_name: name, content: content.clone() }),
            None => Err(format!("'{requested}', included from {from}, does not exist")),
        }
    });
    let artifact = compiler
        .compile_into_spirv(source, shaderc::ShaderKind::Compute, file, "main", Some(&options))
        .map_err(|e| error(with_source_lines(sources, &e.to_string())))?;
    Ok(artifact.as_binary().to_vec())
}

/// The file that `requested` means in an `#include` of the file `from`.
pub fn resolve_include(from: &str, requested: &str) -> String {
    join(from.rsplit_once('/').map_or("", |(folder, _)| folder), requested)
}

/// The compiler's messages; below each that names a file and a line stands that line.
fn with_source_lines(sources: &Sources, message: &str) -> String {
    let source_line = |line: &str| {
        let mut parts = line.splitn(3, ':');
        let text = sources.get(parts.next()?)?;
        let number: usize = parts.next()?.parse().ok()?;
        text.lines().nth(number.checked_sub(1)?).map(|source| format!("{number:>6} | {source}"))
    };
    let lines = message.trim_end().lines().flat_map(|line| [Some(line.to_owned()), source_line(line)]);
    lines.flatten().collect::<Vec<_>>().join("\n")
}

/// Resolves `..` in `folder/relative`.
fn join(folder: &str, relative: &str) -> String {
    let mut parts: Vec<&str> = folder.split('/').filter(|p| !p.is_empty()).collect();
    for part in relative.split('/') {
        match part {
            "." | "" => {}
            ".." => {
                parts.pop();
            }
            _ => parts.push(part),
        }
    }
    parts.join("/")
}

/// Reads every shader source below `folder`, and the expectations (`.toml`) beside kernels for tests.
///
/// # Errors
/// When the folder or a file in it cannot be read.
pub fn read_sources(folder: &std::path::Path) -> std::io::Result<Sources> {
    let mut sources = Sources::new();
    read_folder(folder, "", &mut sources)?;
    Ok(sources)
}

fn read_folder(folder: &std::path::Path, prefix: &str, sources: &mut Sources) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = format!("{prefix}{name}");
        if entry.file_type()?.is_dir() {
            read_folder(&entry.path(), &format!("{path}/"), sources)?;
        } else if [".comp", ".glsl", ".toml"].iter().any(|ending| name.ends_with(ending)) {
            sources.insert(path, std::fs::read_to_string(entry.path())?);
        }
    }
    Ok(())
}
