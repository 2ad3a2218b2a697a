//! `sunfleck compare`: how much an image differs from a reference.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use sunfleck::atomic_file::check_writable;
use sunfleck::film::exr::{ExrImage, read_exr};
use sunfleck::film::metrics::{Difference, compare, flip, magma};
use sunfleck::film::output::ImageFormat;
use sunfleck::film::png::write_png;
use sunfleck::film::tonemap::ToneMap;
use sunfleck::{Error, Result};

use super::{parse, print_json};

const MEANING: &str = "\
A is the test image and B the reference. In linear radiance, over the pixels that are finite in both:
  MSE              mean over pixels and channels of (a - b)^2
  relMSE           mean over pixels and channels of (a - b)^2 / (b^2 + 0.01^2)
  mean difference  mean over pixels of a - b, for red, green and blue: the bias
FLIP is NVIDIA's LDR-FLIP of both images exposed, clipped and sRGB-encoded, at 67 pixels per degree: 0 is equal, 1 is
black against white.";

/// Compare an image with a reference: MSE, relMSE, mean difference, FLIP.
#[derive(Args, Debug)]
#[command(after_help = MEANING)]
pub(crate) struct CompareArgs {
    /// Image to judge.
    #[arg(value_name = "A.exr")]
    image: PathBuf,
    /// Reference.
    #[arg(value_name = "B.exr")]
    reference: PathBuf,
    /// Write FLIP's error per pixel as a picture: black is 0, yellowish white is 1 (magma).
    #[arg(long, value_name = "OUT.png")]
    heatmap: Option<PathBuf>,
    /// Exposure in steps before FLIP.
    #[arg(long, value_name = "EV", default_value = "0", allow_hyphen_values = true, value_parser = parse::exposure_ev)]
    exposure: f32,
    /// Print one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Compares the two images.
pub(crate) fn run(args: &CompareArgs) -> anyhow::Result<()> {
    if let Some(path) = &args.heatmap {
        if ImageFormat::of(path)? != ImageFormat::Png {
            return Err(Error::Usage(format!("--heatmap: '{}' is not a .png", path.display())).into());
        }
        check_writable(path)?;
    }
    let (a_image, b_image) = (read_exr(&args.image)?, read_exr(&args.reference)?);
    let (a, b) = (radiance(&args.image, &a_image)?, radiance(&args.reference, &b_image)?);
    let size = (a_image.width, a_image.height);
    if size != (b_image.width, b_image.height) {
        let message = format!(
            "is {}x{}, but {} is {}x{}; images to compare have one resolution",
            a_image.width,
            a_image.height,
            args.reference.display(),
            b_image.width,
            b_image.height
        );
        return Err(Error::input(&args.image, message).into());
    }
    let difference = compare(&a, &b);
    let flip = flip(size, &a, &b, args.exposure, ToneMap::Clip);
    if let Some(path) = &args.heatmap {
        let flip = flip.as_ref().ok_or_else(|| Error::input(&args.image, "is too large for FLIP, no heatmap of it"))?;
        write_png(path, size.0, size.1, &magma(size.0, size.1, &flip.error_map))?;
    }
    let flip_mean = flip.map(|f| f.mean);
    print_for_people(args, &difference, flip_mean);
    if args.json {
        let mut object = serde_json::to_value(&difference)?;
        object["flip"] = json!(flip_mean);
        object["image"] = json!(args.image.display().to_string());
        object["reference"] = json!(args.reference.display().to_string());
        object["heatmap"] = json!(args.heatmap.as_ref().map(|path| path.display().to_string()));
        print_json(&object)?;
    }
    Ok(())
}

fn radiance(path: &Path, image: &ExrImage) -> Result<Vec<[f32; 3]>> {
    image.rgb().ok_or_else(|| {
        let names: Vec<_> = image.channels.iter().map(|c| c.name.as_str()).collect();
        Error::input(path, format!("has no channels R, G, B; it has {}", names.join(", ")))
    })
}

fn print_for_people(args: &CompareArgs, difference: &Difference, flip: Option<f64>) {
    for (path, count) in [(&args.image, difference.non_finite_a), (&args.reference, difference.non_finite_b)] {
        if count > 0 {
            eprintln!("warning: {}: {count} pixels are NaN or infinite and are left out", path.display());
        }
    }
    let Difference { mean_difference: [r, g, b], mean_a, mean_b, .. } = difference;
    eprintln!("MSE              {:.6e}", difference.mse);
    eprintln!("relMSE           {:.6e}   ((a - b)^2 / (b^2 + 0.01^2))", difference.rel_mse);
    eprintln!("mean difference  {r:+.6e} {g:+.6e} {b:+.6e}");
    eprintln!("means            {:.6e} {:.6e} {:.6e} (A)", mean_a[0], mean_a[1], mean_a[2]);
    eprintln!("                 {:.6e} {:.6e} {:.6e} (B)", mean_b[0], mean_b[1], mean_b[2]);
    eprintln!("max difference   {:.6e}", difference.max_difference);
    match flip {
        Some(flip) => eprintln!("FLIP             {flip:.6}"),
        None => eprintln!("FLIP             not taken: the image is too large for it"),
    }
}
