//! `sunfleck devices`: every Vulkan device that could render.

use clap::Args;

/// List every Vulkan device: driver, memory, ray query or not, and the limits that matter.
#[derive(Args, Debug)]
pub(crate) struct DevicesArgs {
    /// Print one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Lists the devices.
pub(crate) fn run(args: &DevicesArgs) -> anyhow::Result<()> {
    let _ = args.json;
    Err(sunfleck::Error::Usage("devices is not built yet".to_owned()).into())
}
