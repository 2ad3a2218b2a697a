//! Suites of `sunfleck bench`: a JSON file that lists scenes with flags.

use std::ffi::OsString;
use std::fmt::{Display, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Command, FromArgMatches};
use serde::Deserialize;
use serde_json::json;
use sunfleck::Error;
use sunfleck::bench::plot;

use super::bench::{BenchArgs, Report, bench, write_text};
use super::bench_report::{bias, efficiency, seconds};
use super::given_flags::GivenFlags;
use super::{interrupt, not_built, print_json};

/// A suite's file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Suite {
    /// What it is for, in a sentence.
    about: String,
    benches: Vec<Entry>,
}

/// One bench of a suite.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Names its files.
    name: String,
    /// A built-in scene, or a path from the suite's folder.
    scene: String,
    /// Flags of `sunfleck bench`.
    #[serde(default)]
    flags: Vec<String>,
}

/// The suite's file, if the argument names one: `*.json`, or a name in benches/suites below the current folder.
pub(super) fn find(argument: &str) -> Option<PathBuf> {
    if Path::new(argument).extension().is_some_and(|extension| extension == "json") {
        return Some(argument.into());
    }
    let named = Path::new("benches/suites").join(format!("{argument}.json"));
    (!argument.contains(['/', '\\']) && named.is_file()).then_some(named)
}

/// Flags that name something of one scene: beside a suite they are refused.
const OF_ONE_SCENE: &[&str] = &["camera", "reference", "plot", "compare"];
/// Flags that concern the whole run: in a suite's file they are refused.
const OF_THE_RUN: &[&str] = &["output", "json", "quiet", "strict", "plot", "compare"];

/// Runs every bench of the suite. What the command line gives holds for all and overrides what the suite says.
pub(super) fn run(path: &Path, args: &BenchArgs) -> anyhow::Result<()> {
    if let Some(flag) = args.given.first_of(OF_ONE_SCENE) {
        let message = format!("{flag} is for one scene, and {} is a suite of them", path.display());
        return Err(Error::Usage(message).into());
    }
    let suite = read(path)?;
    let benches: Result<Vec<_>, _> = suite.benches.iter().map(|entry| entry.arguments(path, args)).collect();
    let (mut reports, mut interrupted) = (Vec::new(), false);
    for (entry, arguments) in suite.benches.iter().zip(benches?) {
        match bench(&arguments, &entry.name) {
            Ok(report) => {
                interrupted = report.measurement.interrupted;
                reports.push((entry, report));
            }
            Err(error) if matches!(error.downcast_ref(), Some(Error::Interrupted)) => interrupted = true,
            Err(error) => return Err(error),
        }
        // Also where the signal came between two benches.
        interrupted |= interrupt::requested() && reports.len() < suite.benches.len();
        if interrupted {
            break;
        }
    }
    if let Some(folder) = &args.output {
        write_text(&folder.join("README.md"), &index(path, &suite, &reports))?;
    }
    if args.json {
        let values: Vec<_> = reports.iter().map(|(_, report)| &report.value).collect();
        print_json(&json!({ "suite": path.display().to_string(), "interrupted": interrupted, "benches": values }))?;
    }
    if interrupted {
        return Err(Error::Interrupted.into());
    }
    reports.iter().try_for_each(|(_, report)| report.verdict(args.strict)).map_err(anyhow::Error::from)
}

fn read(path: &Path) -> sunfleck::Result<Suite> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read this suite", e))?;
    let suite: Suite = serde_json::from_str(&text).map_err(|e| Error::input(path, format!("is no suite: {e}")))?;
    for (n, entry) in suite.benches.iter().enumerate() {
        if entry.name.is_empty() || entry.name.contains(['/', '\\']) {
            return Err(Error::input(path, format!("'{}' cannot name files", entry.name)));
        }
        if suite.benches[..n].iter().any(|other| other.name == entry.name) {
            return Err(Error::input(path, format!("has two benches named '{}'", entry.name)));
        }
    }
    Ok(suite)
}

impl Entry {
    /// What the suite says, under what stands on the command line.
    fn arguments(&self, suite: &Path, args: &BenchArgs) -> sunfleck::Result<BenchArgs> {
        let own = parse(std::iter::once(OsString::from(&self.scene)).chain(self.flags.iter().map(OsString::from)))
            .map_err(|e| self.error(suite, e))?;
        if let Some(flag) = own.given.first_of(OF_THE_RUN) {
            return Err(self.error(suite, format!("{flag} is for the command line, not for a bench of a suite")));
        }
        let words = own.given.words_under(&args.given, &command());
        let words = words.into_iter().chain(args.given.words_under(&GivenFlags::default(), &command()));
        let mut parsed = parse(std::iter::once(OsString::from(&self.scene)).chain(words))
            .map_err(|e| Error::Usage(format!("bench '{}': {e}", self.name)))?;
        not_built::refuse_for_bench(&parsed)?;
        if Path::new(&self.scene).extension().is_some() {
            let folder = suite.parent().unwrap_or(Path::new(""));
            parsed.scene = folder.join(&self.scene).display().to_string();
        }
        Ok(parsed)
    }

    fn error(&self, suite: &Path, message: impl Display) -> Error {
        Error::input(suite, format!("bench '{}': {message}", self.name))
    }
}

fn command() -> Command {
    BenchArgs::augment_args(Command::new("bench").no_binary_name(true))
}

fn parse(words: impl Iterator<Item = OsString>) -> Result<BenchArgs, clap::Error> {
    command().try_get_matches_from(words).and_then(|matches| BenchArgs::from_arg_matches(&matches))
}

/// The results as a page: a table, then the plots.
fn index(path: &Path, suite: &Suite, reports: &[(&Entry, Report)]) -> String {
    let mut page = format!("# Run time against error: {}\n\n{}\n", path.display(), suite.about);
    if let Some((_, Report { measurement: m, .. })) = reports.first() {
        let processor = m.processor.as_deref().unwrap_or("unknown processor");
        let _ = writeln!(page, "\n{}; {}; {processor}.\n", m.device, m.driver);
    }
    if reports.len() < suite.benches.len() {
        let _ = writeln!(page, "Interrupted: {} of {} benches.\n", reports.len(), suite.benches.len());
    }
    page.push_str("| scene | spp | time | MSE | relMSE | FLIP | 1/(MSE · s) | slope of MSE over spp | bias |\n");
    page.push_str("|---|---|---|---|---|---|---|---|---|\n");
    for (entry, Report { measurement: m, .. }) in reports {
        let Some(point) = m.points.last() else { continue };
        let flip = point.flip.map_or("–".to_owned(), |flip| format!("{:.4}", flip.mean));
        let slope = m.mse_over_spp.map_or("none fits".to_owned(), |law| {
            format!("{:.3} ({:.3} to {:.3})", law.slope.estimate, law.slope.low, law.slope.high)
        });
        let _ = writeln!(
            page,
            "| [{name}]({name}.json) | {} | {} | {:.3e} | {:.3e} | {flip} | {} | {slope} | {} |",
            point.spp_label(),
            seconds(&point.seconds),
            point.mse.mean,
            point.rel_mse.mean,
            efficiency(point),
            bias(m.bias.as_ref()),
            name = entry.name,
        );
    }
    for (entry, _) in reports.iter().filter(|(_, report)| plot::can_draw(&report.measurement)) {
        let _ = writeln!(page, "\n![{name}]({name}.svg)", name = entry.name);
    }
    page
}
