//! What the contract of the command line names and this version does not have yet. Building something means deleting
//! its line here.

use sunfleck::render::{DeviceChoice, PixelFilter};

use super::Command;
use super::bench::BenchArgs;
use super::estimator_args::EstimatorArgs;
use super::render_args::RenderArgs;

/// A flag or command by its name, and whether a command line uses it.
type Entry = (&'static str, fn(&Command) -> bool);

const NOT_BUILT: &[Entry] = &[
    ("--denoise", |c| render(c, |r| r.denoise)),
    ("--checkpoint", |c| render(c, |r| r.checkpoint.is_some())),
    ("--resume", |c| render(c, |r| r.resume)),
    ("--filter tent", |c| render(c, |r| r.filter == PixelFilter::Tent)),
    ("--filter gaussian", |c| render(c, |r| r.filter == PixelFilter::Gaussian)),
    ("--filter blackman-harris", |c| render(c, |r| r.filter == PixelFilter::BlackmanHarris)),
    ("--device all", |c| estimator(c, |e| e.device == DeviceChoice::All)),
];

fn render(command: &Command, uses: fn(&RenderArgs) -> bool) -> bool {
    matches!(command, Command::Render(args) if uses(args))
}

fn estimator(command: &Command, uses: fn(&EstimatorArgs) -> bool) -> bool {
    match command {
        Command::Render(args) => uses(&args.estimator),
        Command::Bench(args) => uses(&args.estimator),
        Command::Watch(args) => uses(&args.job.estimator),
        _ => false,
    }
}

/// A usage error that names what is asked for and not built; never is it ignored.
pub(crate) fn refuse(command: &Command) -> sunfleck::Result<()> {
    let asked: Vec<_> = NOT_BUILT.iter().filter(|(_, uses)| uses(command)).map(|(name, _)| *name).collect();
    if asked.is_empty() {
        return Ok(());
    }
    let verb = if asked.len() == 1 { "is" } else { "are" };
    let version = env!("CARGO_PKG_VERSION");
    Err(sunfleck::Error::Usage(format!("{} {verb} not built yet in sunfleck {version}", asked.join(", "))))
}

/// The same for a bench of a suite.
pub(crate) fn refuse_for_bench(args: &BenchArgs) -> sunfleck::Result<()> {
    refuse(&Command::Bench(Box::new(args.clone())))
}

/// Says so in `--help` too, so that nobody has to try.
pub(crate) fn mark_in_help(command: clap::Command) -> clap::Command {
    NOT_BUILT.iter().fold(command, |command, (name, _)| match name.strip_prefix("--") {
        None => command.mut_subcommand(*name, |sub| {
            let about = format!("{} [not built yet]", sub.get_about().cloned().unwrap_or_default());
            sub.about(about)
        }),
        Some(flag) => command.mut_subcommand("render", |sub| {
            let (flag, value) = flag.split_once(' ').unwrap_or((flag, ""));
            // Flags whose names clap does not know cannot be marked; a test would show them missing in the help.
            sub.mut_args(|arg| {
                if arg.get_long() != Some(flag) {
                    return arg;
                }
                let space = if value.is_empty() { "" } else { " " };
                let help = format!("{} [{value}{space}not built yet]", arg.get_help().cloned().unwrap_or_default());
                arg.help(help)
            })
        }),
    })
}
