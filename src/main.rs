//! The `sunfleck` command: parse, what drivers want to find, run, print the error chain on one line, exit code; nothing
//! else.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = cli::parse();
    sunfleck::gpu::prepare_driver_environment(cli.paths());
    match cli::run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(cli::exit_code(&error))
        }
    }
}
