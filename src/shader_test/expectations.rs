//! The file beside a kernel of `shaders/test/` that says what is expected of it, in TOML. docs/shader-tests.md describes it.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::{Spanned, Table, Value};

use super::bsdf_expectations::BsdfExpectations;
use super::function_expectations::FunctionExpectations;

/// Level of a check where the file says none: so often a right shader fails it by chance.
const SIGNIFICANCE: f64 = 0.01;

/// What is expected of a kernel.
#[derive(Clone, Debug)]
pub struct Expectations {
    /// What is tested, in a line; may be empty.
    pub about: String,
    /// The kernel's file, beside this one; that with the same stem if it is not said.
    pub kernel: Option<String>,
    /// The level of each statistical check, all its configurations together.
    pub significance: f64,
    /// What the kernel is, and its checks.
    pub kind: Kind,
}

/// What a kernel is.
#[derive(Clone, Debug)]
pub enum Kind {
    /// Numbers in, numbers out.
    Function(FunctionExpectations),
    /// The functions of a BSDF, by `shaders/include/test_bsdf.glsl`.
    Bsdf(BsdfExpectations),
}

/// What is wrong with a file, and in which line (0: in no line alone).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    /// Line, from 1.
    pub line: usize,
    /// What is wrong and what to do.
    pub message: String,
}

impl std::fmt::Display for FileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.line > 0 { write!(f, "line {}: {}", self.line, self.message) } else { f.write_str(&self.message) }
    }
}

/// The keys at the top.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    #[serde(default)]
    about: String,
    kernel: Option<String>,
    significance: Option<f64>,
    pub(super) samples: Option<u32>,
    pub(super) inputs: Option<Vec<String>>,
    pub(super) outputs: Option<Vec<String>>,
    pub(super) parameters: Option<Vec<String>>,
    #[serde(default)]
    pub(super) grid: BTreeMap<String, Axis>,
    #[serde(default)]
    test: Vec<Spanned<Table>>,
}

/// A `[[test]]` without the keys that all have.
pub(super) struct Test {
    pub(super) check: String,
    pub(super) name: String,
    rest: Table,
}

impl Expectations {
    /// Reads a file's text.
    ///
    /// # Errors
    /// What is wrong, with the line.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let line = |offset: usize| text[..offset.min(text.len())].matches('\n').count() + 1;
        let mut header: Header = toml::from_str(text).map_err(|error| FileError {
            line: error.span().map_or(0, |span| line(span.start)),
            message: error.message().to_owned(),
        })?;
        let whole = |message: String| FileError { line: 0, message };
        let significance = header.significance.unwrap_or(SIGNIFICANCE);
        if !(significance > 0.0 && significance <= 0.5) {
            return Err(whole(format!("significance = {significance}: expected a probability above 0 and up to 0.5")));
        }
        let tests = std::mem::take(&mut header.test);
        if tests.is_empty() {
            return Err(whole("there is no [[test]] in it".to_owned()));
        }
        let tests = tests.into_iter().map(|table| (line(table.span().start), table.into_inner()));
        let tests = tests.map(|(line, table)| Ok((line, Test::new(table).map_err(|m| at(line, m))?)));
        let tests = tests.collect::<Result<Vec<_>, FileError>>()?;
        let kind = match (&header.inputs, &header.parameters) {
            (Some(_), None) => Kind::Function(FunctionExpectations::new(&header, tests)?),
            (None, Some(_)) => Kind::Bsdf(BsdfExpectations::new(&header, tests)?),
            _ => {
                let message = "expected either inputs and outputs (numbers in, numbers out) or parameters (of a BSDF)";
                return Err(whole(message.to_owned()));
            }
        };
        Ok(Self { about: header.about, kernel: header.kernel, significance, kind })
    }
}

/// A message about what begins in a line.
pub(super) fn at(line: usize, message: impl Into<String>) -> FileError {
    FileError { line, message: message.into() }
}

impl Test {
    fn new(mut table: Table) -> Result<Self, String> {
        let mut text = |key: &str| match table.remove(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(other) => Err(format!("{key} = {other}: expected a text")),
        };
        let check = text("check")?.ok_or("a [[test]] needs check = \"…\"")?;
        let name = text("name")?.unwrap_or_default();
        Ok(Self { check, name, rest: table })
    }

    /// The keys of this kind of check.
    pub(super) fn read<T: DeserializeOwned>(self) -> Result<T, String> {
        let check = self.check;
        self.rest.try_into().map_err(|error: toml::de::Error| format!("check \"{check}\": {}", error.message()))
    }
}

/// The values that a number takes in turn.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "expected a number, a list of numbers, or { from, to, steps }")]
pub enum Axis {
    /// One.
    Value(f64),
    /// These.
    List(Vec<f64>),
    /// Evenly spaced, both ends included.
    Range {
        /// First.
        from: f64,
        /// Last.
        to: f64,
        /// How many, two at least.
        steps: u32,
    },
}

impl Axis {
    /// The values.
    pub(super) fn values(&self) -> Vec<f64> {
        match self {
            Self::Value(value) => vec![*value],
            Self::List(values) => values.clone(),
            Self::Range { from, to, steps } => {
                let step = |i: u32| from + (to - from) * f64::from(i) / f64::from(steps.saturating_sub(1).max(1));
                (0..*steps).map(step).collect()
            }
        }
    }
}

/// Every combination of the axes' values, the last axis running fastest.
///
/// # Errors
/// An axis without values, or more than `most` combinations.
pub(super) fn combinations(axes: &[(&str, Vec<f64>)], most: usize) -> Result<Vec<Vec<f64>>, String> {
    let mut all = vec![Vec::new()];
    for (name, values) in axes {
        if values.is_empty() {
            return Err(format!("{name} has no values"));
        }
        if all.len() * values.len() > most {
            return Err(format!("more than {most} combinations; give the axes fewer values"));
        }
        let longer = |one: &Vec<f64>| values.iter().map(|v| [one.as_slice(), &[*v]].concat()).collect::<Vec<_>>();
        all = all.iter().flat_map(longer).collect();
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> FileError {
        Expectations::parse(text).unwrap_err()
    }

    #[test]
    fn errors_have_a_line_and_say_what_is_expected() {
        let function = "inputs = ['x']\noutputs = ['y']\n";
        for (text, line, words) in [
            ("inputs = ['x'\n", 1, "array"),
            ("inputs = ['x']\noutput = ['y']\n", 2, "unknown field `output`"),
            (function, 0, "no [[test]]"),
            ("[[test]]\ncheck = 'chi2'", 0, "either inputs"),
            (&format!("{function}\n[[test]]\ncheck = 'valuez'\n"), 4, "there are values, range, mean, uniform"),
            (&format!("{function}[[test]]\ncheck = 'values'\nrow = []"), 3, "unknown field `row`"),
            (&format!("{function}[[test]]\ncheck = 'values'\nrows = [[1]]"), 3, "expected 2 numbers"),
            (&format!("{function}significance = 2\n[[test]]\ncheck = 'values'\nrows = []"), 0, "probability"),
            ("parameters = ['a']\n[[test]]\ncheck = 'chi2'", 0, "grid"),
            ("parameters = ['a']\ngrid = { a = 1, b = 2 }\n[[test]]\ncheck = 'chi2'", 0, "b is no parameter"),
            ("parameters = ['a']\ngrid = { a = 1 }\n[[test]]\ncheck = 'furnace'", 3, "at_most or equals"),
        ] {
            let error = error(text);
            assert!(error.line == line && error.message.contains(words), "{text}: {error:?}");
        }
    }

    #[test]
    fn axes_are_values_lists_and_ranges() {
        let range = Axis::Range { from: 0.0, to: 1.0, steps: 3 };
        let axes =
            [("a", Axis::Value(2.0).values()), ("b", range.values()), ("c", Axis::List(vec![5.0, 6.0]).values())];
        let all = combinations(&axes, 6).unwrap();
        assert_eq!(all.len(), 6);
        assert_eq!((&all[0], &all[3]), (&vec![2.0, 0.0, 5.0], &vec![2.0, 0.5, 6.0]));
        assert!(combinations(&axes, 5).unwrap_err().contains("more than 5"));
        assert!(combinations(&[("a", Vec::new())], 5).unwrap_err().contains("a has no values"));
    }
}
