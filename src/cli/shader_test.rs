//! `sunfleck shader-test`: single shader functions against what is expected of them.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use sunfleck::Error;
use sunfleck::render::DeviceChoice;
use sunfleck::shader_test::targets::{Target, resolve};
use sunfleck::shader_test::{CheckReport, FileReport, TestDevice, run as test};

use super::print_json;

/// Test single shader functions on a device: a kernel gets numbers and gives numbers, and a file beside it says what is
/// expected of them. So a new lobe can be checked before it is wired in.
#[derive(Args, Debug)]
pub(crate) struct ShaderTestArgs {
    /// Test kernels (.comp, with their expectations beside them as .toml), by path or by name; all there are without one.
    #[arg(value_name = "FILE")]
    files: Vec<String>,
    /// Folder of shader sources to use in place of the built-in ones. A file in such a folder is tested with that folder.
    #[arg(long, value_name = "DIR")]
    shaders: Option<PathBuf>,
    /// Device to test on: a number or a part of a name (see `sunfleck devices`), or auto.
    #[arg(long, value_name = "NAME|INDEX|auto", default_value_t)]
    pub(super) device: DeviceChoice,
    /// Seed of the samples: what fails by chance passes with another.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Print one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Makes the tests.
pub(crate) fn run(args: ShaderTestArgs) -> anyhow::Result<()> {
    if let Some(folder) = args.shaders.as_deref().filter(|folder| !folder.is_dir()) {
        return Err(Error::Usage(format!("--shaders: '{}' is not a folder", folder.display())).into());
    }
    // Before a device is looked for: what is wrong with the files is wrong without one.
    let targets = resolve(&args.files, args.shaders.as_deref())?;
    let device = TestDevice::open(args.device)?;
    let info = device.info();
    eprintln!("device: {}, {}", info.name, info.driver);
    let reports = targets.iter().map(|target| one(&device, target, args.seed)).collect::<sunfleck::Result<Vec<_>>>()?;
    let failed = reports.iter().filter(|report| !report.passed).count();
    if args.json {
        print_json(&json!({
            "device": info.name,
            "driver": info.driver,
            "seed": args.seed,
            "passed": failed == 0,
            "files": reports,
        }))?;
    }
    if failed == 0 {
        eprintln!("{} passed", files(reports.len()));
        return Ok(());
    }
    let checks = reports.iter().flat_map(|report| &report.checks).filter(|check| !check.passed).count();
    let checks = if checks == 1 { "1 check fails".to_owned() } else { format!("{checks} checks fail") };
    Err(Error::Untrustworthy(format!("{checks}, in {failed} of {}", files(reports.len()))).into())
}

fn files(count: usize) -> String {
    if count == 1 { "1 file".to_owned() } else { format!("{count} files") }
}

fn one(device: &TestDevice, target: &Target, seed: u32) -> sunfleck::Result<FileReport> {
    let report = test(device, target, seed)?;
    let about = if report.about.is_empty() { String::new() } else { format!(": {}", report.about) };
    eprintln!("{}{about}", report.file);
    report.checks.iter().for_each(print_check);
    Ok(report)
}

fn print_check(check: &CheckReport) {
    let verdict = if check.passed { "ok  " } else { "FAIL" };
    let name = if check.name.is_empty() { String::new() } else { format!(" ({})", check.name) };
    eprintln!("  {verdict}  {}{name}: {}", check.check, check.summary);
    for failure in &check.failures {
        eprintln!("          {failure}");
    }
    let more = check.failed - check.failures.len();
    if more > 0 {
        eprintln!("          and {more} more");
    }
}
