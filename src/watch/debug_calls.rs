//! The calls of DEBUG_PIXEL and DEBUG_PRINT in shaders (shaders/include/debug.glsl): found, and given the numbers by which
//! what they print is told apart.

use serde::Serialize;

use super::includes::reached_from;
use crate::gpu::shader_compiler::Sources;

/// Where the macros are defined.
const DEFINED_IN: &str = "include/debug.glsl";

/// A line that prints.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PrintPlace {
    /// File below the shader folder.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// What it prints, as it is written.
    pub text: String,
}

/// The calls in a kernel and its includes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DebugCalls {
    /// A value is shown as the picture.
    pub has_pixel: bool,
    /// The lines that print; their numbers count from 1.
    pub prints: Vec<PrintPlace>,
}

/// The sources with `DEBUG_PRINT_AT(NUMBER, VALUE)` for each `DEBUG_PRINT(VALUE)` in what `kernel` is made of, and the calls.
/// Every line stays where it is.
pub fn number_calls(sources: &Sources, kernel: &str) -> (Sources, DebugCalls) {
    let mut calls = DebugCalls::default();
    let mut numbered = sources.clone();
    for file in reached_from(sources, kernel).keys().filter(|file| *file != DEFINED_IN) {
        let Some(text) = sources.get(file) else { continue };
        if !text.contains("DEBUG_P") {
            continue;
        }
        calls.has_pixel |= positions(text, "DEBUG_PIXEL").next().is_some();
        let mut rest = 0;
        let mut out = String::new();
        for (at, argument) in positions(text, "DEBUG_PRINT") {
            let line = text[..at].matches('\n').count() + 1;
            let written = text[argument..].get(..argument_length(&text[argument..])).unwrap_or_default();
            let words: Vec<_> = written.split_whitespace().collect();
            calls.prints.push(PrintPlace { file: file.clone(), line, text: words.join(" ") });
            out += &format!("{}DEBUG_PRINT_AT({}u, ", &text[rest..at], calls.prints.len());
            rest = argument;
        }
        out += &text[rest..];
        numbered.insert(file.clone(), out);
    }
    (numbered, calls)
}

/// Where `name(` stands outside of line comments, and where its argument begins.
fn positions<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = (usize, usize)> + 'a {
    text.match_indices(name).filter_map(move |(at, _)| {
        let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
        let is_name = |c: char| c.is_alphanumeric() || c == '_';
        let after = text[at + name.len()..].trim_start_matches(' ');
        let is_call = after.starts_with('(') && !text[..at].ends_with(is_name) && !text[line..at].contains("//");
        is_call.then(|| (at, text.len() - after.len() + 1))
    })
}

/// Bytes up to the parenthesis that closes.
fn argument_length(text: &str) -> usize {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' if depth == 0 => return at,
            ')' => depth -= 1,
            _ => {}
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_numbered_in_what_the_kernel_includes_and_lines_stay() {
        let sources: Sources = [
            (
                "k.comp",
                "#include \"include/debug.glsl\"\n#include \"include/a.glsl\"\nvoid main() { DEBUG_PRINT (f(1)); }\n",
            ),
            (
                "include/a.glsl",
                "// DEBUG_PIXEL(no);\nDEBUG_PRINT(vec3(a,\n  b)); DEBUG_PRINT(c);\nMY_DEBUG_PRINT(d);\n",
            ),
            ("include/debug.glsl", "#define DEBUG_PRINT(value)\n#define DEBUG_PIXEL(value)\n"),
            ("other.comp", "DEBUG_PIXEL(1.0); DEBUG_PRINT(2.0);\n"),
        ]
        .map(|(name, text)| (name.to_owned(), text.to_owned()))
        .into();
        let (numbered, calls) = number_calls(&sources, "k.comp");
        let found: Vec<_> = calls.prints.iter().map(|p| (p.file.as_str(), p.line, p.text.as_str())).collect();
        let a = "include/a.glsl";
        assert_eq!(found, [(a, 2, "vec3(a, b)"), (a, 3, "c"), ("k.comp", 3, "f(1)")]);
        assert!(!calls.has_pixel);
        let text =
            "// DEBUG_PIXEL(no);\nDEBUG_PRINT_AT(1u, vec3(a,\n  b)); DEBUG_PRINT_AT(2u, c);\nMY_DEBUG_PRINT(d);\n";
        assert_eq!(numbered[a], text);
        assert!(numbered["k.comp"].contains("{ DEBUG_PRINT_AT(3u, f(1)); }"));
        assert_eq!(numbered["include/debug.glsl"], sources["include/debug.glsl"]);
        assert_eq!(numbered["other.comp"], sources["other.comp"]);
        assert!(number_calls(&sources, "other.comp").1.has_pixel);
    }
}
