//! `sunfleck merge`: sample ranges to one image.

use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::Args;
use sunfleck::atomic_file::check_writable;
use sunfleck::film::exr::{ExrImage, read_exr};
use sunfleck::film::merge::merge;
use sunfleck::film::output::ImageFormat;
use sunfleck::film::png::{tone_map_srgb8, write_png};
use sunfleck::{Error, Result};

use super::print_warnings;
use super::tone_args::ToneArgs;

const EXAMPLES: &str = "\
Example:
  sunfleck render scene.gltf --samples 0..64 -o a.exr
  sunfleck render scene.gltf --samples 64..128 -o b.exr
  sunfleck merge a.exr b.exr -o image.exr              equals --spp 128 in one run, to 1 ulp
  sunfleck merge image.exr -o image.png --exposure 1   a picture of an image that is there already";

/// Merge images of disjoint samples to the image of all of them, weighted by their sample counts.
///
/// Merge all parts in one command: merging merged images rounds once more.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct MergeArgs {
    /// Images that `sunfleck render` wrote, of the same view.
    #[arg(required = true, value_name = "PART.exr")]
    parts: Vec<PathBuf>,
    /// The image to write: .exr or .png.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    tone: ToneArgs,
}

/// A picture holds radiance alone; what else the parts have is not dropped in silence.
fn note_layers(image: &ExrImage) {
    let layers: BTreeSet<&str> = image.channels.iter().filter_map(|c| Some(c.name.rsplit_once('.')?.0)).collect();
    if !layers.is_empty() {
        let list: Vec<_> = layers.into_iter().collect();
        eprintln!("note: layers that are not in a .png: {}; merge to an .exr to keep them", list.join(", "));
    }
}

/// Merges the parts.
pub(crate) fn run(args: &MergeArgs) -> anyhow::Result<()> {
    let format = ImageFormat::of(&args.output)?;
    check_writable(&args.output)?;
    let parts = args.parts.iter().map(|path| Ok((path.clone(), read_exr(path)?))).collect::<Result<Vec<_>>>()?;
    let merged = merge(parts)?;
    print_warnings(&merged.warnings);
    let image = merged.image;
    match format {
        ImageFormat::Exr => image.write(&args.output)?,
        ImageFormat::Png => {
            note_layers(&image);
            let radiance = image.rgb().ok_or_else(|| Error::input(&args.output, "the merged image has no colours"))?;
            let (pixels, _) = tone_map_srgb8(&radiance, args.tone.exposure, args.tone.tonemap);
            write_png(&args.output, image.width, image.height, &pixels)?;
        }
    }
    let spp = image.metadata.samples_per_pixel.unwrap_or_default();
    eprintln!("merged {} images to {}: {spp} samples per pixel", args.parts.len(), args.output.display());
    Ok(())
}
