//! What is expected of a function: numbers in, numbers out.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Value;

use super::expectations::{Axis, FileError, Header, Test, at};

/// Most lanes of a check.
const MOST_LANES: u32 = 1 << 20;

/// A number that a lane reads or writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Number {
    /// Its name.
    pub name: String,
    /// A 32-bit integer, not a float.
    pub integer: bool,
}

/// The numbers of a kernel, and its checks.
#[derive(Clone, Debug)]
pub struct FunctionExpectations {
    /// What a lane reads, four to a texel.
    pub inputs: Vec<Number>,
    /// What it writes, four to a texel.
    pub outputs: Vec<Number>,
    /// The checks.
    pub tests: Vec<FunctionTest>,
}

/// A check.
#[derive(Clone, Debug)]
pub struct FunctionTest {
    /// What it is called, besides the kind of check; may be empty.
    pub name: String,
    /// What is checked.
    pub check: FunctionCheck,
}

/// Kinds of checks.
#[derive(Clone, Debug)]
pub enum FunctionCheck {
    /// Given inputs have given outputs.
    Values(Values),
    /// Over a grid of inputs, outputs are finite and within limits.
    Range(Range),
    /// Outputs at random inputs have a mean: an integral, by a t-test.
    Mean(Mean),
    /// Outputs at random inputs are uniform in [0, 1), by a χ² test.
    Uniform(Uniform),
}

/// `check = "values"`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Values {
    /// Inputs, then outputs; `"any"` for an output that does not matter.
    pub rows: Vec<Vec<Value>>,
    /// Largest absolute error.
    #[serde(default)]
    pub absolute: f64,
    /// Largest error relative to what is expected; both are added.
    #[serde(default)]
    pub relative: f64,
}

/// `check = "range"`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Values of each input.
    pub over: BTreeMap<String, Axis>,
    /// Least and greatest value of an output; the others must be finite.
    #[serde(default)]
    pub within: BTreeMap<String, [f64; 2]>,
}

/// `check = "mean"`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mean {
    /// How each input is drawn.
    pub draw: BTreeMap<String, Draw>,
    /// Means of outputs.
    pub expect: BTreeMap<String, f64>,
    /// Lanes.
    #[serde(default = "default_samples")]
    pub samples: u32,
}

/// `check = "uniform"`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uniform {
    /// How each input is drawn.
    pub draw: BTreeMap<String, Draw>,
    /// Which outputs.
    pub outputs: Vec<String>,
    /// Bins of [0, 1).
    #[serde(default = "default_bins")]
    pub bins: u32,
    /// Lanes.
    #[serde(default = "default_samples")]
    pub samples: u32,
}

fn default_samples() -> u32 {
    1 << 16
}

fn default_bins() -> u32 {
    64
}

/// How an input is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "expected a number or [low, high]")]
pub enum Draw {
    /// Always this.
    Fixed(f64),
    /// Uniform from the first up to the second.
    Uniform([f64; 2]),
}

impl FunctionExpectations {
    pub(super) fn new(header: &Header, tests: Vec<(usize, Test)>) -> Result<Self, FileError> {
        let whole = |message: &str| at(0, message);
        if !header.grid.is_empty() || header.samples.is_some() {
            return Err(whole("grid and samples at the top are for BSDFs; give them to the [[test]]"));
        }
        let inputs = numbers(header.inputs.as_deref().unwrap_or_default()).map_err(|m| at(0, m))?;
        let outputs = numbers(header.outputs.as_deref().unwrap_or_default()).map_err(|m| at(0, m))?;
        if inputs.is_empty() || outputs.is_empty() {
            return Err(whole("inputs and outputs need a name each at least"));
        }
        let mut kernel = Self { inputs, outputs, tests: Vec::new() };
        for (line, test) in tests {
            let test = kernel.test(test).map_err(|message| at(line, message))?;
            kernel.tests.push(test);
        }
        Ok(kernel)
    }

    fn test(&self, test: Test) -> Result<FunctionTest, String> {
        let name = test.name.clone();
        let check = match test.check.as_str() {
            "values" => FunctionCheck::Values(test.read()?),
            "range" => FunctionCheck::Range(test.read()?),
            "mean" => FunctionCheck::Mean(test.read()?),
            "uniform" => FunctionCheck::Uniform(test.read()?),
            other => return Err(format!("check = \"{other}\": of a function there are values, range, mean, uniform")),
        };
        match &check {
            FunctionCheck::Values(values) => self.check_rows(values)?,
            FunctionCheck::Range(range) => {
                all_are_given(&self.inputs, range.over.keys())?;
                are_known(&self.outputs, range.within.keys())?;
            }
            FunctionCheck::Mean(mean) => {
                all_are_given(&self.inputs, mean.draw.keys())?;
                are_known(&self.outputs, mean.expect.keys())?;
                check_samples(mean.samples)?;
                if mean.expect.is_empty() {
                    return Err("expect names no output".to_owned());
                }
            }
            FunctionCheck::Uniform(uniform) => {
                all_are_given(&self.inputs, uniform.draw.keys())?;
                are_known(&self.outputs, uniform.outputs.iter())?;
                check_samples(uniform.samples)?;
                if uniform.outputs.is_empty() {
                    return Err("outputs names none".to_owned());
                }
                if !(2..=uniform.samples / 16).contains(&uniform.bins) {
                    return Err(format!("bins = {}: expected at least 2, and 16 samples in each", uniform.bins));
                }
            }
        }
        Ok(FunctionTest { name, check })
    }

    fn check_rows(&self, values: &Values) -> Result<(), String> {
        let length = self.inputs.len() + self.outputs.len();
        if values.rows.is_empty() {
            return Err("rows is empty".to_owned());
        }
        for (number, row) in values.rows.iter().enumerate() {
            if row.len() != length {
                let (inputs, outputs) = (self.inputs.len(), self.outputs.len());
                let found = row.len();
                return Err(format!(
                    "row {}: expected {length} numbers ({inputs} in, {outputs} out), found {found}",
                    number + 1
                ));
            }
            for (index, value) in row.iter().enumerate() {
                let any = index >= self.inputs.len() && value.as_str() == Some("any");
                if !any && number_of(value).is_none() {
                    return Err(format!("row {}: {value} is no number (nor \"any\", of an output)", number + 1));
                }
            }
        }
        Ok(())
    }
}

/// A TOML number.
pub(super) fn number_of(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

/// `name`, or `name: uint`.
fn numbers(texts: &[String]) -> Result<Vec<Number>, String> {
    let mut all: Vec<Number> = Vec::new();
    for text in texts {
        let (name, kind) = text.split_once(':').unwrap_or((text, "float"));
        let (name, kind) = (name.trim().to_owned(), kind.trim());
        if name.is_empty() || all.iter().any(|other| other.name == name) {
            return Err(format!("\"{text}\": expected a name of its own"));
        }
        let integer = match kind {
            "float" => false,
            "uint" => true,
            _ => return Err(format!("\"{text}\": expected \"name\" or \"name: uint\"")),
        };
        all.push(Number { name, integer });
    }
    Ok(all)
}

fn are_known<'a>(numbers: &[Number], names: impl Iterator<Item = &'a String>) -> Result<(), String> {
    let unknown = |name: &&String| !numbers.iter().any(|number| number.name == **name);
    let mut names = names;
    match names.find(unknown) {
        None => Ok(()),
        Some(name) => {
            let known: Vec<_> = numbers.iter().map(|number| number.name.as_str()).collect();
            Err(format!("there is no \"{name}\"; there are {}", known.join(", ")))
        }
    }
}

fn all_are_given<'a>(numbers: &[Number], names: impl Iterator<Item = &'a String> + Clone) -> Result<(), String> {
    are_known(numbers, names.clone())?;
    match numbers.iter().find(|number| !names.clone().any(|name| *name == number.name)) {
        None => Ok(()),
        Some(missing) => Err(format!("nothing is said of the input {}", missing.name)),
    }
}

fn check_samples(samples: u32) -> Result<(), String> {
    if (256..=MOST_LANES).contains(&samples) {
        return Ok(());
    }
    Err(format!("samples = {samples}: expected 256 to {MOST_LANES}"))
}
