//! The compiler's message as file, line, column and the line itself.

use serde::{Deserialize, Serialize};

use crate::gpu::shader_compiler::{CompileError, ErrorAtLine, Sources};
use crate::watch::includes::{reached_from, trail};

/// One message of the compiler.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Diagnostic {
    /// File below the shader folder.
    pub file: String,
    /// Line, from 1; 0 if the compiler names none.
    pub line: u32,
    /// Column, from 1, of what the compiler names in that line, else of its first character; 0 without a line.
    pub column: u32,
    /// What is wrong.
    pub message: String,
    /// The line.
    pub source: String,
    /// The files through which this one is included, up to the kernel.
    pub included_from: Vec<String>,
}

impl std::fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.line == 0 {
            write!(f, "{}: {}", self.file, self.message)?;
        } else {
            write!(f, "{}:{}:{}: {}", self.file, self.line, self.column, self.message)?;
            // Tabs keep their width above the caret.
            let indent: String = self.source.chars().take(self.column.max(1) as usize - 1).collect();
            let indent: String = indent.chars().map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
            write!(f, "\n    {}\n    {indent}^", self.source)?;
        }
        for file in &self.included_from {
            write!(f, "\n    included from {file}")?;
        }
        Ok(())
    }
}

/// The errors of a failed compilation; one at least.
pub fn diagnose(error: &CompileError, sources: &Sources) -> Vec<Diagnostic> {
    let reached = reached_from(sources, &error.file);
    let at_line = |found: &ErrorAtLine| Diagnostic {
        file: found.file.clone(),
        line: found.line,
        column: column_of(&found.message, &found.source),
        message: found.message.clone(),
        source: found.source.clone(),
        included_from: trail(&reached, &found.file),
    };
    if !error.errors.is_empty() {
        return error.errors.iter().map(at_line).collect();
    }
    vec![Diagnostic {
        file: error.file.clone(),
        line: 0,
        column: 0,
        message: error.message.trim().to_owned(),
        source: String::new(),
        included_from: Vec::new(),
    }]
}

/// glslang names no column, but quotes what it stumbled over.
pub(super) fn column_of(message: &str, source: &str) -> u32 {
    let quoted = message.split('\'').nth(1).filter(|word| !word.is_empty());
    let byte = quoted.and_then(|word| find_word(source, word));
    let byte = byte.unwrap_or_else(|| source.len() - source.trim_start().len());
    u32::try_from(source[..byte].chars().count() + 1).unwrap_or(u32::MAX)
}

/// Where `word` stands in `line`, not as a part of a longer name.
fn find_word(line: &str, word: &str) -> Option<usize> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let whole = |&(at, _): &(usize, &str)| {
        let before = line[..at].chars().next_back().is_some_and(is_name);
        let after = line[at + word.len()..].chars().next().is_some_and(is_name);
        !(before && word.starts_with(is_name) || after && word.ends_with(is_name))
    };
    line.match_indices(word).find(whole).map(|(at, _)| at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::shader_compiler::compile;

    fn sources(leaf: &str) -> Sources {
        let main = "#version 460\n#include \"include/leaf.glsl\"\nlayout(local_size_x = 1) in;\nvoid main() { f(); }\n";
        [("k.comp", main), ("include/leaf.glsl", leaf)].map(|(n, t)| (n.to_owned(), t.to_owned())).into()
    }

    #[test]
    fn a_message_in_an_include_has_its_file_line_column_and_text() {
        let sources = sources("// fine\nvoid f() {\n    float fooo = 1.0 + foo;\n}\n");
        let found = diagnose(&compile(&sources, "k.comp", &[]).unwrap_err(), &sources);
        let first = &found[0];
        assert_eq!((first.file.as_str(), first.line, first.column), ("include/leaf.glsl", 3, 24), "{found:?}");
        assert_eq!(first.source, "    float fooo = 1.0 + foo;");
        assert_eq!(first.included_from, ["k.comp"]);
        assert!(first.message.contains("undeclared"), "{first}");
        assert!(first.to_string().contains("\n                           ^"), "{first}");
    }

    #[test]
    fn an_include_that_is_missing_is_named_where_it_is_asked_for() {
        let sources = sources("#include \"none.glsl\"\nvoid f() {}\n");
        let found = diagnose(&compile(&sources, "k.comp", &[]).unwrap_err(), &sources);
        assert_eq!((found[0].file.as_str(), found[0].line), ("include/leaf.glsl", 1), "{found:?}");
        assert!(found[0].message.contains("none.glsl"));
    }

    #[test]
    fn a_kernel_that_is_gone_is_said_without_a_line() {
        let found = diagnose(&compile(&Sources::new(), "k.comp", &[]).unwrap_err(), &Sources::new());
        assert_eq!((found[0].line, found.len()), (0, 1));
    }
}
