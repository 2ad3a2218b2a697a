//! `sunfleck bench`: time against error. Not built yet; its arguments are taken as they come.

use clap::Args;

/// Measure time against error to a reference.
#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// A scene or a suite, and flags.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}
