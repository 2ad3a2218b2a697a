//! Tests of single shader functions, for `sunfleck shader-test`: a kernel of `shaders/test/` gets numbers and gives numbers,
//! and a file beside it says what is expected of them. docs/shader-tests.md describes the files.
//!
//! | module | what it knows |
//! |---|---|
//! | [`targets`] | which files are meant, and the shader sources that go with them |
//! | [`expectations`] | the file: its keys, and what is wrong with it |
//! | `device` | an open device, with a scene bound that does not matter |
//! | `function_checks` | numbers in, numbers out: `values`, `range`, `mean`, `uniform` |
//! | `bsdf_statistics`, `bsdf_points` | a BSDF: `integral`, `chi2`, `furnace`; `weights`, `reciprocity`, `finite` |
//! | `measure`, `bins`, [`quadrature`] | samples of a lobe of unknown shape, bins that fit it, integrals over them |
//! | [`template`] | the files of `sunfleck shaders new bsdf` |

pub mod bins;
mod bsdf_expectations;
mod bsdf_kernel;
mod bsdf_points;
mod bsdf_statistics;
pub mod chi_square;
mod configuration;
mod device;
pub mod expectations;
mod function_checks;
mod function_expectations;
mod measure;
pub mod quadrature;
mod report;
pub mod targets;
pub mod template;

pub use bsdf_expectations::{Albedo, BsdfCheck, BsdfExpectations, BsdfTest, Term};
pub use configuration::{Configuration, Grid};
pub use device::TestDevice;
pub use function_expectations::{
    Draw, FunctionCheck, FunctionExpectations, FunctionTest, Mean, Number, Range, Uniform, Values,
};
pub use report::{CheckReport, FileReport};

use std::path::Path;

use crate::{Error, Result};
use bsdf_kernel::BsdfKernel;
use expectations::Kind;
use function_checks::Function;
use measure::Measurement;
use targets::Target;

/// Makes all checks of a file on a device. Another `seed` draws other samples.
///
/// # Errors
/// A kernel that does not compile ([`Error::Input`]), and errors of the device. What is not as expected is no error, but
/// part of the report.
pub fn run(device: &TestDevice, target: &Target, seed: u32) -> Result<FileReport> {
    let kernel_name = target.kernel.rsplit('/').next().unwrap_or_default();
    let told = Path::new(&target.file).with_file_name(kernel_name);
    let kernel = device.kernel(&target.sources, &target.kernel, &told)?;
    let significance = target.expectations.significance;
    let checks = match &target.expectations.kind {
        Kind::Function(expectations) => {
            let mut function = Function { kernel, expectations, significance, seed };
            expectations.tests.iter().map(|test| function.check(test)).collect::<Result<Vec<_>>>()?
        }
        Kind::Bsdf(expectations) => check_bsdf(BsdfKernel::new(kernel), expectations, significance, seed)?,
    };
    Ok(FileReport {
        file: target.file.clone(),
        kernel: target.kernel.clone(),
        about: target.expectations.about.clone(),
        passed: checks.iter().all(|check| check.passed),
        checks,
    })
}

fn check_bsdf(
    mut kernel: BsdfKernel,
    expectations: &BsdfExpectations,
    significance: f64,
    seed: u32,
) -> Result<Vec<CheckReport>> {
    // Checks of the same grid share what was measured.
    let mut measured: Vec<(&Grid, Vec<Configuration>, Vec<Measurement>)> = Vec::new();
    let mut reports = Vec::new();
    for test in &expectations.tests {
        let name = &test.name;
        let configurations = test.grid.configurations().map_err(Error::Usage)?;
        match &test.check {
            BsdfCheck::Weights { relative } => {
                reports.push(bsdf_points::weights(&mut kernel, name, &configurations, *relative, seed)?);
                continue;
            }
            BsdfCheck::Reciprocity { relative } => {
                reports.push(bsdf_points::reciprocity(&mut kernel, name, &configurations, *relative, seed)?);
                continue;
            }
            BsdfCheck::Finite { largest_weight } => {
                reports.push(bsdf_points::finite(&mut kernel, name, &configurations, *largest_weight, seed)?);
                continue;
            }
            BsdfCheck::Integral { .. } | BsdfCheck::ChiSquare | BsdfCheck::Furnace { .. } => {}
        }
        let known = measured.iter().position(|(grid, ..)| **grid == test.grid);
        let index = match known {
            Some(index) => index,
            None => {
                let new = measure::measure(&mut kernel, &configurations, expectations.samples, seed)?;
                measured.push((&test.grid, configurations, new));
                measured.len() - 1
            }
        };
        let (grid, configurations, measurements) = &measured[index];
        let all: Vec<_> = configurations.iter().zip(measurements).collect();
        reports.push(match &test.check {
            BsdfCheck::Integral { tolerance } => bsdf_statistics::integral(name, &all, *tolerance, significance),
            BsdfCheck::Furnace { albedo, tolerance } => {
                bsdf_statistics::furnace(name, grid, &all, albedo, *tolerance, significance)
            }
            _ => bsdf_statistics::chi_square(name, &all, significance),
        });
    }
    Ok(reports)
}
