//! The `sunfleck` command: what drivers want to find, parse, run, print the error chain on one line, exit code; nothing
//! else.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    sunfleck::gpu::prepare_driver_environment();
    match cli::run(cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(cli::exit_code(&error))
        }
    }
}
