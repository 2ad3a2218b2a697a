//! What is expected of a BSDF.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::configuration::Grid;
use super::expectations::{Axis, FileError, Header, Test, at};

/// Samples of a configuration where the file says none.
const SAMPLES: u32 = 1 << 16;
/// Most samples of a configuration: a dispatch holds them.
const MOST_SAMPLES: u32 = 1 << 20;

/// The parameters of a BSDF's kernel, and its checks.
#[derive(Clone, Debug)]
pub struct BsdfExpectations {
    /// Names of the numbers that the kernel gets by `parameter(configuration, i)`.
    pub parameters: Vec<String>,
    /// Samples of a configuration.
    pub samples: u32,
    /// The checks.
    pub tests: Vec<BsdfTest>,
}

/// A check.
#[derive(Clone, Debug)]
pub struct BsdfTest {
    /// What it is called, besides the kind of check; may be empty.
    pub name: String,
    /// The parameters and directions that it is made at.
    pub grid: Grid,
    /// What is checked.
    pub check: BsdfCheck,
}

/// Kinds of checks.
#[derive(Clone, Debug)]
pub enum BsdfCheck {
    /// The density integrates to one, less what is absorbed and what goes to delta lobes.
    Integral {
        /// Largest error besides that of sampling.
        tolerance: f64,
    },
    /// Samples follow the density: a χ² test.
    ChiSquare,
    /// The weight of a sample is f·|cos θi|/pdf, and its pdf that of its direction.
    Weights {
        /// Largest relative error.
        relative: f64,
    },
    /// How much light is given back: ∫ f·|cos θi| dωi, and the mean weight.
    Furnace {
        /// What is expected, for red, green and blue.
        albedo: Albedo,
        /// Largest error besides that of sampling.
        tolerance: f64,
    },
    /// f is the same with both directions exchanged.
    Reciprocity {
        /// Largest relative error.
        relative: f64,
    },
    /// Everything is finite, and nothing negative.
    Finite {
        /// Bound on a weight.
        largest_weight: Option<f64>,
    },
}

/// What a furnace gives back.
#[derive(Clone, Debug, PartialEq)]
pub enum Albedo {
    /// No more than this.
    AtMost([Term; 3]),
    /// Just this.
    Equals([Term; 3]),
}

/// A number, or the value of a parameter.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "expected a number or the name of a parameter")]
pub enum Term {
    /// A number.
    Number(f64),
    /// A parameter's name.
    Parameter(String),
}

#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number or the name of a parameter, or a list of three for red, green and blue"
)]
enum Terms {
    One(Term),
    Three([Term; 3]),
}

impl From<Terms> for [Term; 3] {
    fn from(terms: Terms) -> Self {
        match terms {
            Terms::One(term) => [term.clone(), term.clone(), term],
            Terms::Three(terms) => terms,
        }
    }
}

/// The keys of the checks.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plain {
    #[serde(default)]
    over: BTreeMap<String, Axis>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WithTolerance {
    #[serde(default)]
    over: BTreeMap<String, Axis>,
    #[serde(default = "tolerance")]
    tolerance: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WithRelative {
    #[serde(default)]
    over: BTreeMap<String, Axis>,
    #[serde(default = "relative")]
    relative: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Furnace {
    #[serde(default)]
    over: BTreeMap<String, Axis>,
    #[serde(default = "tolerance")]
    tolerance: f64,
    at_most: Option<Terms>,
    equals: Option<Terms>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Finite {
    #[serde(default)]
    over: BTreeMap<String, Axis>,
    largest_weight: Option<f64>,
}

/// The quadrature is good to less.
fn tolerance() -> f64 {
    1e-3
}

/// Some eighty rounded operations of 2⁻²³ each.
fn relative() -> f64 {
    1e-5
}

impl BsdfExpectations {
    pub(super) fn new(header: &Header, tests: Vec<(usize, Test)>) -> Result<Self, FileError> {
        let parameters = header.parameters.clone().unwrap_or_default();
        let samples = header.samples.unwrap_or(SAMPLES);
        if header.outputs.is_some() {
            return Err(at(0, "outputs belong to inputs; a BSDF has parameters alone"));
        }
        if !(1 << 12..=MOST_SAMPLES).contains(&samples) {
            return Err(at(0, format!("samples = {samples}: expected 4096 to {MOST_SAMPLES}")));
        }
        let grid = Grid::new(&parameters, &header.grid).map_err(|message| at(0, message))?;
        let read = |(line, test): (usize, Test)| {
            let name = test.name.clone();
            let (check, over) = check(test, &parameters).map_err(|message| at(line, message))?;
            let grid = grid.with(&over).map_err(|message| at(line, message))?;
            Ok(BsdfTest { name, grid, check })
        };
        let tests = tests.into_iter().map(read).collect::<Result<_, FileError>>()?;
        Ok(Self { parameters, samples, tests })
    }
}

fn check(test: Test, parameters: &[String]) -> Result<(BsdfCheck, BTreeMap<String, Axis>), String> {
    Ok(match test.check.as_str() {
        "integral" => {
            let WithTolerance { over, tolerance } = test.read()?;
            (BsdfCheck::Integral { tolerance }, over)
        }
        "chi2" => (BsdfCheck::ChiSquare, test.read::<Plain>()?.over),
        "weights" => {
            let WithRelative { over, relative } = test.read()?;
            (BsdfCheck::Weights { relative }, over)
        }
        "furnace" => {
            let Furnace { over, tolerance, at_most, equals } = test.read()?;
            let albedo = match (at_most, equals) {
                (Some(terms), None) => Albedo::AtMost(known(terms, parameters)?),
                (None, Some(terms)) => Albedo::Equals(known(terms, parameters)?),
                _ => return Err("a furnace needs either at_most or equals".to_owned()),
            };
            (BsdfCheck::Furnace { albedo, tolerance }, over)
        }
        "reciprocity" => {
            let WithRelative { over, relative } = test.read()?;
            (BsdfCheck::Reciprocity { relative }, over)
        }
        "finite" => {
            let Finite { over, largest_weight } = test.read()?;
            (BsdfCheck::Finite { largest_weight }, over)
        }
        other => {
            return Err(format!(
                "check = \"{other}\": of a BSDF there are integral, chi2, weights, furnace, reciprocity, finite"
            ));
        }
    })
}

fn known(terms: Terms, parameters: &[String]) -> Result<[Term; 3], String> {
    let terms = <[Term; 3]>::from(terms);
    for term in &terms {
        if let Term::Parameter(name) = term
            && !parameters.contains(name)
        {
            return Err(format!("\"{name}\" is no parameter; there are {}", parameters.join(", ")));
        }
    }
    Ok(terms)
}
