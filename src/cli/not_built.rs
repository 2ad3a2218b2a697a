//! What the contract of the command line names and this version does not have yet. Building something means deleting
//! its line here.

use sunfleck::render::{DeviceChoice, PixelFilter, SamplerKind};

use super::Command;
use super::render_args::RenderArgs;

/// A flag or command by its name, and whether a command line uses it.
type Entry = (&'static str, fn(&Command) -> bool);

const NOT_BUILT: &[Entry] = &[
    ("bench", |c| matches!(c, Command::Bench(_))),
    ("watch", |c| matches!(c, Command::Watch(_))),
    ("--target-error", |c| render(c, |r| r.target_error.is_some())),
    ("--estimate", |c| render(c, |r| r.estimate)),
    ("--aov", |c| render(c, |r| !r.aov.is_empty())),
    ("--denoise", |c| render(c, |r| r.denoise)),
    ("--checkpoint", |c| render(c, |r| r.checkpoint.is_some())),
    ("--resume", |c| render(c, |r| r.resume)),
    ("--sampler sobol", |c| render(c, |r| r.sampler == SamplerKind::Sobol)),
    ("--filter tent", |c| render(c, |r| r.filter == PixelFilter::Tent)),
    ("--filter gaussian", |c| render(c, |r| r.filter == PixelFilter::Gaussian)),
    ("--filter blackman-harris", |c| render(c, |r| r.filter == PixelFilter::BlackmanHarris)),
    ("--device all", |c| render(c, |r| r.device == DeviceChoice::All)),
];

fn render(command: &Command, uses: fn(&RenderArgs) -> bool) -> bool {
    matches!(command, Command::Render(args) if uses(args))
}

/// A usage error that names what is asked for and not built; never is it ignored.
pub(crate) fn refuse(command: &Command) -> sunfleck::Result<()> {
    let asked: Vec<_> = NOT_BUILT.iter().filter(|(_, uses)| uses(command)).map(|(name, _)| *name).collect();
    if asked.is_empty() {
        return Ok(());
    }
    let verb = if asked.len() == 1 { "is" } else { "are" };
    Err(sunfleck::Error::Usage(format!(
        "{} {verb} not built yet in sunfleck {}",
        asked.join(", "),
        env!("CARGO_PKG_VERSION")
    )))
}
