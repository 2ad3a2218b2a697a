//! `sunfleck render`: its flags, and the job that they describe once the errors that need no scene are out of the way.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use sunfleck::atomic_file::check_writable;
use sunfleck::film::aov::Aov;
use sunfleck::film::aov_picture::picture_path;
use sunfleck::film::output::ImageFormat;
use sunfleck::film::tonemap::ToneMap;
use sunfleck::render::{PixelFilter, Settings};
use sunfleck::watch::messages::Pose;
use sunfleck::{Error, Result};

use super::estimator_args::{EnvironmentArgs, EstimatorArgs};
use super::parse;
use super::tone_args::ToneArgs;

const EXAMPLES: &str = "\
Examples:
  sunfleck render                                   the Cornell box, to cornell.exr and cornell.png
  sunfleck render scene.gltf -o a.exr -o a.png --spp 512
  sunfleck render scene.glb --target-error 0.02 --time 10m     as good as 2 %, within ten minutes
  sunfleck render scene.glb --time 30s --resolution 1920x1080 --json
  sunfleck render scene.obj --env sky.hdr --env-rotation 90 --exposure -1
  sunfleck render scene.gltf --samples 0..64 -o part0.exr     one part of a farm's work
  sunfleck render scene.gltf -o a.exr --aov albedo,normal     what a denoiser wants besides
  sunfleck render --device 1 --trace bvh --seed 7";

/// Render a scene to EXR and PNG images.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct RenderArgs {
    /// A .gltf, .glb or .obj file, or the name of a built-in scene.
    #[arg(default_value = "cornell")]
    scene: String,
    /// Output image: .exr is linear 32-bit float radiance, .png tone-mapped sRGB. May be given several times
    /// [default: SCENE.exr and SCENE.png in the current folder].
    #[arg(short, long = "output", value_name = "FILE")]
    outputs: Vec<PathBuf>,

    /// Width and height of the image in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse::resolution, help_heading = "Image")]
    resolution: (u32, u32),
    /// Camera of the scene, by name or index [default: the first].
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Image")]
    camera: Option<String>,
    /// Put that camera elsewhere: where it is, what it looks at, what is up in the image (else 0,1,0); world space, metres.
    #[arg(long, value_name = "EYE:TARGET[:UP]", allow_hyphen_values = true, value_parser = parse::look_at, help_heading = "Image")]
    look_at: Option<Pose>,
    #[command(flatten)]
    tone: ToneArgs,
    /// Pixel filter.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<PixelFilter>(PixelFilter::NAMES), help_heading = "Image")]
    pub(super) filter: PixelFilter,
    /// More layers, as in albedo,normal,depth: means over the samples of what the camera's rays meet first (cost: of what all
    /// rays of a sample visit). A .exr has them as layers, beside a .png stands a picture of each, NAME.albedo.png.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = parse::named::<Aov>(Aov::NAMES), help_heading = "Image")]
    aov: Vec<Aov>,
    /// Denoise the image.
    #[arg(long, help_heading = "Image")]
    pub(super) denoise: bool,

    /// Samples per pixel [default: 128, or without limit if --time or --target-error is given].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "samples", help_heading = "How long")]
    spp: Option<u32>,
    /// Stop rendering after this time, as in 500ms, 30s, 2m, 1h.
    #[arg(long, value_name = "TIME", value_parser = parse::duration, help_heading = "How long")]
    time: Option<Duration>,
    /// Stop when the estimated relative error is this small, as in 0.02 for 2 %; see --estimate. First looked at after 64
    /// samples per pixel, and without limit if neither --spp nor --time is given.
    #[arg(long, value_name = "ERROR", value_parser = parse::positive, help_heading = "How long")]
    target_error: Option<f64>,
    /// Render the sample indices from A up to but without B only; `sunfleck merge` joins such parts to one run.
    #[arg(long, value_name = "A..B", value_parser = parse::sample_range, help_heading = "How long")]
    samples: Option<Range<u32>>,
    /// Save the state of the run to this file now and then.
    #[arg(long, value_name = "FILE", help_heading = "How long")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Go on from the checkpoint.
    #[arg(long, help_heading = "How long")]
    pub(super) resume: bool,

    #[command(flatten)]
    pub(super) estimator: EstimatorArgs,

    /// Estimate the error of the image from replicates, with an interval for it; needs 32 samples per pixel or more.
    #[arg(long, help_heading = "Reports")]
    estimate: bool,
    /// Count rays by kind, the nodes and triangles that each visits, how full the device's vectors are, and the time of
    /// slices: a table, and an object in --json. Slows the render down a little.
    #[arg(long, help_heading = "Reports")]
    stats: bool,
    /// Show the image and its AOVs in the viewer tev that listens there, while they are rendered [port: 14158].
    #[arg(long, value_name = "HOST[:PORT]", help_heading = "Reports")]
    tev: Option<String>,
    /// Print one JSON object about the run on standard output.
    #[arg(long, help_heading = "Reports")]
    json: bool,
    /// No progress and no summary; errors and warnings remain.
    #[arg(long, short, help_heading = "Reports")]
    quiet: bool,
    /// Exit with 6 if a result is not trustworthy, such as after a NaN sample.
    #[arg(long, help_heading = "Reports")]
    strict: bool,
}

/// Images to write and their formats.
type Outputs = Vec<(PathBuf, ImageFormat)>;

/// A render with everything about it that is not the scene's.
#[derive(Clone, Debug)]
pub(crate) struct RenderJob {
    /// A file or the name of a built-in scene.
    pub(crate) scene: String,
    /// Images to write, each with a known format and checked to be writable.
    pub(crate) outputs: Vec<(PathBuf, ImageFormat)>,
    /// Pictures of AOVs to write beside the .png outputs, checked likewise.
    pub(crate) aov_pictures: Vec<(PathBuf, Aov)>,
    /// What the library needs to know.
    pub(crate) settings: Settings,
    /// Where the camera is put.
    pub(crate) look_at: Option<Pose>,
    /// Changes to the scene's environment.
    pub(crate) environment: EnvironmentArgs,
    /// Exposure steps of PNG outputs.
    pub(crate) exposure_ev: f32,
    /// Tone curve of PNG outputs.
    pub(crate) tone_map: ToneMap,
    /// Address of a viewer that shows the image.
    pub(crate) tev: Option<String>,
    /// Print a JSON object on standard output.
    pub(crate) json: bool,
    /// Say nothing but warnings.
    pub(crate) quiet: bool,
}

impl RenderArgs {
    /// How many paths the run will trace; `None` if a time or an error ends it.
    pub(crate) fn paths(&self) -> Option<u64> {
        let samples = match &self.samples {
            Some(range) => range.end - range.start,
            None if self.time.is_some() || self.target_error.is_some() => return None,
            None => self.spp.unwrap_or(Settings::default().spp),
        };
        let (width, height) = self.resolution;
        Some((u64::from(width) * u64::from(height)).saturating_mul(samples.into()))
    }

    /// The job, after every check that needs neither the scene nor a device.
    pub(crate) fn resolve(self) -> Result<RenderJob> {
        let aovs: Vec<Aov> = Aov::ALL.iter().copied().filter(|aov| self.aov.contains(aov)).collect();
        let (outputs, aov_pictures) = self.checked_outputs(&aovs)?;
        let (width, height) = self.resolution;
        let without_limit =
            if self.time.is_some() || self.target_error.is_some() { u32::MAX } else { Settings::default().spp };
        let mut settings = Settings {
            width,
            height,
            spp: self.spp.unwrap_or(without_limit),
            time: self.time,
            target_error: self.target_error,
            estimate: self.estimate,
            sample_range: self.samples,
            filter: self.filter,
            aovs,
            statistics: self.stats,
            camera: self.camera,
            strict: self.strict,
            ..Settings::default()
        };
        let environment = self.estimator.apply(&mut settings)?;
        Ok(RenderJob {
            scene: self.scene,
            outputs,
            aov_pictures,
            settings,
            environment,
            exposure_ev: self.tone.exposure,
            tone_map: self.tone.tonemap,
            look_at: self.look_at,
            tev: self.tev,
            json: self.json,
            quiet: self.quiet,
        })
    }

    /// The outputs with their formats, and the pictures of AOVs: usage errors first, then what the file system says.
    fn checked_outputs(&self, aovs: &[Aov]) -> Result<(Outputs, Vec<(PathBuf, Aov)>)> {
        let named = if self.outputs.is_empty() { default_outputs(&self.scene) } else { self.outputs.clone() };
        let mut outputs = Outputs::new();
        for path in named {
            let format = ImageFormat::of(&path)?;
            if outputs.iter().any(|(other, _)| *other == path) {
                return Err(Error::Usage(format!("output '{}' is given twice", path.display())));
            }
            outputs.push((path, format));
        }
        let pictures: Vec<_> = outputs
            .iter()
            .filter(|(_, format)| *format == ImageFormat::Png)
            .flat_map(|(path, _)| aovs.iter().map(|&aov| (picture_path(path, aov), aov)))
            .collect();
        if let Some((path, aov)) = pictures.iter().find(|(path, _)| outputs.iter().any(|(other, _)| other == path)) {
            return Err(Error::Usage(format!(
                "output '{}' is also the picture of --aov {aov}; give one of them another name",
                path.display()
            )));
        }
        for path in outputs.iter().map(|(path, _)| path).chain(pictures.iter().map(|(path, _)| path)) {
            check_writable(path)?;
        }
        Ok((outputs, pictures))
    }
}

/// `SCENE.exr` and `SCENE.png` in the current folder.
fn default_outputs(scene: &str) -> Vec<PathBuf> {
    let name = Path::new(scene).file_stem().map_or("image".into(), |stem| stem.to_string_lossy());
    ["exr", "png"].map(|extension| PathBuf::from(format!("{name}.{extension}"))).to_vec()
}
