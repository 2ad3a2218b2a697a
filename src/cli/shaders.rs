//! `sunfleck shaders`: the shader sources that are inside the program, to start from, and a check of one's own.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use sunfleck::gpu::embedded::SOURCES;
use sunfleck::gpu::shader_compiler::{compile, read_sources};
use sunfleck::shader_test::template::new_bsdf;
use sunfleck::{Error, Result};

/// Write the built-in shader sources to a folder, check a folder of them, or begin a new lobe in it.
#[derive(Args, Debug)]
pub(crate) struct ShadersArgs {
    #[command(subcommand)]
    command: ShadersCommand,
}

#[derive(Subcommand, Debug)]
enum ShadersCommand {
    /// Write the built-in sources to a folder: a start for `render --shaders DIR`.
    Export {
        /// The folder; it is made if it is not there.
        folder: PathBuf,
        /// Overwrite files that are there.
        #[arg(long)]
        force: bool,
    },
    /// Compile the path tracer of a folder for every way to trace and to read the scene, and every test kernel, without a
    /// device.
    Check {
        /// The folder, as for `render --shaders`.
        folder: PathBuf,
    },
    /// Write the start of something new to a folder of them.
    New {
        #[command(subcommand)]
        what: NewCommand,
    },
}

#[derive(Subcommand, Debug)]
enum NewCommand {
    /// A lobe that works, to be changed: include/bsdf_NAME.glsl, its test kernel and what is expected of it.
    Bsdf {
        /// Its name: lower-case letters, digits and underscores.
        name: String,
        /// The folder, as `sunfleck shaders export` writes it.
        #[arg(long, value_name = "DIR", default_value = ".")]
        dir: PathBuf,
    },
}

/// Does what the subcommand says.
pub(crate) fn run(args: &ShadersArgs) -> Result<()> {
    match &args.command {
        ShadersCommand::Export { folder, force } => export(folder, *force),
        ShadersCommand::Check { folder } => check(folder),
        ShadersCommand::New { what: NewCommand::Bsdf { name, dir } } => begin_bsdf(name, dir),
    }
}

fn export(folder: &Path, force: bool) -> Result<()> {
    let there: Vec<_> = SOURCES.iter().map(|(name, _)| folder.join(name)).filter(|path| path.exists()).collect();
    if let (Some(first), false) = (there.first(), force) {
        let more = there.len() - 1;
        let others = if more == 0 { String::new() } else { format!(" and {more} more files are") };
        let verb = if more == 0 { " is" } else { "" };
        return Err(Error::Usage(format!("{}{others}{verb} there already; --force overwrites", first.display())));
    }
    for (name, text) in SOURCES {
        write(folder, name, text)?;
    }
    let shown = folder.display();
    eprintln!("wrote {} files to {shown}; try: sunfleck render --shaders {shown}", SOURCES.len());
    Ok(())
}

fn write(folder: &Path, name: &str, text: &str) -> Result<PathBuf> {
    let path = folder.join(name);
    let parent = path.parent().unwrap_or(folder);
    fs::create_dir_all(parent).map_err(|error| Error::io(parent, "make the folder", error))?;
    fs::write(&path, text).map_err(|error| Error::io(&path, "write", error))?;
    Ok(path)
}

fn begin_bsdf(name: &str, folder: &Path) -> Result<()> {
    if !folder.join("include/test_bsdf.glsl").is_file() {
        let message = "is no folder of shader sources (there is no include/test_bsdf.glsl in it); \
                       `sunfleck shaders export DIR` makes one, --dir DIR names it";
        return Err(Error::input(folder, message));
    }
    let sources = read_sources(folder).map_err(|error| Error::io(folder, "read the shader folder", error))?;
    let files = new_bsdf(name, &sources).map_err(Error::Usage)?;
    if let Some(there) = files.iter().map(|(file, _)| folder.join(file)).find(|path| path.exists()) {
        return Err(Error::Usage(format!("{} is there already; choose another name", there.display())));
    }
    for (file, text) in &files {
        eprintln!("wrote {}", write(folder, file, text)?.display());
    }
    let shown = folder.display();
    let kernel = folder.join(format!("test/bsdf_{name}.comp"));
    eprintln!(
        "\
next:
  test it       sunfleck shader-test {kernel}
  change it     include/bsdf_{name}.glsl, and what is expected of it: test/bsdf_{name}.toml
  wire it in    in include/bsdf.glsl add, after the other lobes,
                    #include \"bsdf_{name}.glsl\"
                and in bsdf_scatter, bsdf_evaluate and bsdf_pdf return {name}_… in place of lambertian_…
                for BSDF_LAMBERTIAN: Lambertian surfaces then have it
  see it        sunfleck watch --shaders {shown}",
        kernel = kernel.display()
    );
    Ok(())
}

fn check(folder: &Path) -> Result<()> {
    let sources = read_sources(folder).map_err(|error| Error::io(folder, "read the shader folder", error))?;
    let kernels: Vec<&String> = sources.keys().filter(|name| name.ends_with(".comp")).collect();
    if kernels.is_empty() {
        return Err(Error::input(folder, "there is no .comp file in it"));
    }
    let (mut failed, mut messages) = (Vec::new(), BTreeSet::new());
    for kernel in &kernels {
        // The path tracer alone is built in every variant; the first that does not compile speaks for the others.
        let tried = if *kernel == "path_trace.comp" { variants() } else { variants()[..1].to_vec() };
        let broken = tried.iter().find_map(|defines| compile(&sources, kernel, defines).err());
        if let Some(error) = broken {
            // An include that is broken is so for every kernel.
            if messages.insert(error.message.clone()) {
                eprintln!("{}", error.message.trim_end());
            }
            failed.push(kernel.as_str());
        }
    }
    if failed.is_empty() {
        eprintln!("{}: {} kernels compile", folder.display(), kernels.len());
        return Ok(());
    }
    Err(Error::input(folder, format!("does not compile: {}", failed.join(", "))))
}

/// Each way to trace and each form of the scene's arrays, as the path tracer is built.
fn variants() -> Vec<Vec<(&'static str, String)>> {
    let forms = |trace: u32| {
        (0..3).map(move |form: u32| vec![("TRACE_BACKEND", trace.to_string()), ("ARRAY_FORM", form.to_string())])
    };
    (0..2).flat_map(forms).collect()
}
