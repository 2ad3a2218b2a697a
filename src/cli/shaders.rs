//! `sunfleck shaders`: the sources that are embedded in the binary.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use sunfleck::film::output::write_atomically;
use sunfleck::gpu::embedded::SOURCES;
use sunfleck::{Error, Result};

/// Shader sources.
#[derive(Args, Clone, Debug)]
pub(crate) struct ShadersArgs {
    #[command(subcommand)]
    command: ShadersCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum ShadersCommand {
    Export(ExportArgs),
}

/// Write the embedded shader sources to a folder, for --shaders and watch.
#[derive(Args, Clone, Debug)]
struct ExportArgs {
    /// The folder; it is made if there is none.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Overwrite files that are there.
    #[arg(long)]
    force: bool,
}

/// Does what is asked for.
pub(crate) fn run(args: &ShadersArgs) -> anyhow::Result<()> {
    let ShadersCommand::Export(args) = &args.command;
    Ok(export(args)?)
}

fn export(args: &ExportArgs) -> Result<()> {
    // Before anything is written: all or nothing.
    let taken: Vec<_> = SOURCES.iter().filter(|(name, _)| args.folder.join(name).exists()).collect();
    if let (false, Some((name, _))) = (args.force, taken.first()) {
        let message = format!("{} of {} files are there already; --force overwrites them", taken.len(), SOURCES.len());
        return Err(Error::input(&args.folder.join(name), message));
    }
    for (name, text) in SOURCES {
        let path = args.folder.join(name);
        let folder = path.parent().unwrap_or(&args.folder);
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, "make the folder", e))?;
        write_atomically(&path, |file| file.write_all(text.as_bytes()))?;
    }
    eprintln!("{} files in {}", SOURCES.len(), args.folder.display());
    eprintln!("next: sunfleck watch --shaders {}", args.folder.display());
    Ok(())
}
