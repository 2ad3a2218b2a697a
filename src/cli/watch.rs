//! `sunfleck watch`: the shader dev loop. Not built yet; its arguments are taken as they come.

use clap::Args;

/// Render again whenever a shader changes, with a live page in the browser.
#[derive(Args, Debug)]
pub(crate) struct WatchArgs {
    /// A scene, and flags.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}
