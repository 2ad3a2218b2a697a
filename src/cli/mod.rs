//! The command line: one file a subcommand. Everything for people goes to standard error; standard output is for
//! `--json` alone.

mod bench;
mod bench_compare;
mod bench_compare_report;
mod bench_report;
mod bench_suite;
mod compare;
mod devices;
mod estimator_args;
mod given_flags;
mod info;
mod interrupt;
mod merge;
mod not_built;
mod parse;
mod progress;
mod render;
mod render_args;
mod render_report;
mod shader_test;
mod shaders;
mod statistics_report;
mod tone_args;
mod watch;

use std::io::{self, Write};

use anyhow::Context;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use tracing_subscriber::filter::LevelFilter;

/// Exit codes, for `--help`; [`sunfleck::Error::exit_code`] decides them.
const EXIT_CODES: &str = "\
Exit codes:
  0    done
  2    usage: an unknown name, an impossible value, something that is not built yet
  3    the scene or another input is bad, or an output cannot be written
  4    no usable device, or the device lacks what was demanded
  5    the device was lost or is out of memory
  6    the result is not trustworthy (--strict), or a shader test's expectations are not met
  130  interrupted, after the partial image was written";

/// Sunfleck: a headless, physically based path tracer on Vulkan, with and without ray-tracing hardware.
#[derive(Debug, Parser)]
#[command(name = "sunfleck", version, about, after_help = EXIT_CODES, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Render(Box<render_args::RenderArgs>),
    Devices(devices::DevicesArgs),
    Info(info::InfoArgs),
    Compare(compare::CompareArgs),
    Merge(merge::MergeArgs),
    Bench(Box<bench::BenchArgs>),
    Watch(Box<watch::WatchArgs>),
    Shaders(shaders::ShadersArgs),
    ShaderTest(shader_test::ShaderTestArgs),
    /// Renders for `watch`, which speaks to it over standard input and output.
    #[command(hide = true)]
    WatchWorker(Box<watch::WorkerArgs>),
    /// Compiles for `watch`, likewise.
    #[command(hide = true)]
    WatchCompiler,
}

impl Cli {
    /// How many paths the command will trace, where its flags say so.
    pub(crate) fn paths(&self) -> Option<u64> {
        match &self.command {
            Command::Render(args) => args.paths(),
            _ => None,
        }
    }
}

/// Parses the process's arguments; a usage error or `--help` ends the process.
pub(crate) fn parse() -> Cli {
    let matches = not_built::mark_in_help(Cli::command()).get_matches();
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

/// Does what the command line asks for.
pub(crate) fn run(cli: Cli) -> anyhow::Result<()> {
    init_tracing();
    not_built::refuse(&cli.command)?;
    match cli.command {
        Command::Render(args) => render::run(args.resolve()?),
        Command::Devices(args) => devices::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Bench(args) => bench::run(*args),
        Command::Watch(args) => watch::run(&args),
        Command::Shaders(args) => Ok(shaders::run(&args)?),
        Command::ShaderTest(args) => shader_test::run(args),
        Command::WatchWorker(args) => watch::run_worker(&args),
        Command::WatchCompiler => Ok(sunfleck::watch::compiler::run()?),
    }
}

/// The exit code of an error: what the library says where it is one of its own, else 1 (a bug or a broken pipe).
pub(crate) fn exit_code(error: &anyhow::Error) -> u8 {
    error.chain().find_map(|e| e.downcast_ref::<sunfleck::Error>()).map_or(1, sunfleck::Error::exit_code)
}

/// Warnings and diagnostics go to standard error; `RUST_LOG=debug` shows more.
fn init_tracing() {
    let level = std::env::var("RUST_LOG").ok().and_then(|level| level.parse().ok()).unwrap_or(LevelFilter::WARN);
    tracing_subscriber::fmt().with_max_level(level).with_writer(io::stderr).without_time().init();
}

/// Prints one JSON object on standard output.
fn print_json(value: &serde_json::Value) -> anyhow::Result<()> {
    let mut stdout = io::stdout().lock();
    match writeln!(stdout, "{value:#}").and_then(|()| stdout.flush()) {
        // A reader that has seen enough (`| head`) is no error.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to standard output"),
    }
}

/// Prints warnings for people, one line each.
fn print_warnings<'a>(warnings: impl IntoIterator<Item = &'a String>) {
    for warning in warnings {
        eprintln!("warning: {warning}");
    }
}
