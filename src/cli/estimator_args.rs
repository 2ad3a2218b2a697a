//! Which estimator runs, under which sky and on which device: the flags that `render` and `bench` share.

use std::path::PathBuf;

use clap::Args;
use sunfleck::render::{
    BvhQuality, DeviceChoice, EnvironmentSampling, Integrator, LightChoice, LightSampling, MisHeuristic, SamplerKind,
    Settings, TraceChoice,
};
use sunfleck::{Error, Result};

use super::parse;

/// Light transport, environment and device.
#[derive(Args, Clone, Debug)]
pub(crate) struct EstimatorArgs {
    /// Seed of the sampler: another seed, independent noise.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Light transport")]
    pub(super) seed: u32,
    /// Scattering events a path may have: 0 shows emitters alone, 1 adds direct light [default: unlimited].
    #[arg(long, value_name = "N", help_heading = "Light transport")]
    max_bounces: Option<u32>,
    /// Which part of the light to add up; emission + direct + indirect = path.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<Integrator>(Integrator::NAMES), help_heading = "Light transport")]
    integrator: Integrator,
    /// Where the random numbers come from: Owen-scrambled Sobol' points, with far less noise a sample, most so at powers
    /// of two of samples; or independent numbers.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<SamplerKind>(SamplerKind::NAMES), help_heading = "Light transport")]
    pub(super) sampler: SamplerKind,
    /// How light is looked for: mis takes two samples, mixture one of the averaged pdf, nee and bsdf one strategy.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<LightSampling>(LightSampling::NAMES), help_heading = "Light transport")]
    light_sampling: LightSampling,
    /// How a light is picked: by a tree over power, distance and orientation, by power alone, or all alike. A tree takes
    /// three lights that have a place; with fewer, bvh is power.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<LightChoice>(LightChoice::NAMES), help_heading = "Light transport")]
    light_choice: LightChoice,
    /// How --light-sampling mis weighs its samples.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<MisHeuristic>(MisHeuristic::NAMES), help_heading = "Light transport")]
    mis: MisHeuristic,
    /// Cut light that arrives after two or more scattering events down to X (largest component): fewer fireflies, but the
    /// image is too dark wherever it acts. Reports and images say so.
    #[arg(long, value_name = "X", value_parser = parse::positive_f32, help_heading = "Light transport")]
    clamp_indirect: Option<f32>,
    /// Camera rays that ask for emission alone, N for each sample of the pixels in which a lamp may be seen: smoother edges of
    /// lamps for little time; 0 is none [default: a power of two up to 8, by how few these pixels are].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256), help_heading = "Light transport")]
    emission_rays: Option<u32>,
    /// Adaptive sampling: a pilot of N samples per pixel, which are no part of the image, finds where it is noisy; there each
    /// sample becomes up to 32, and at most 1.25 in an average pixel. --spp, --samples and --target-error count those of the
    /// other pixels. Unbiased, and the same for every part of a run; not in watch [N: 8].
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "8", value_parser = clap::value_parser!(u32).range(4..=4096), help_heading = "Light transport")]
    adaptive: Option<u32>,
    /// Look up every texture in the file's own texels; without it, those of colours and roughness in mip chains, by ray
    /// cones that are a quarter of a pixel wide and widen at each scattering event.
    #[arg(long, help_heading = "Light transport")]
    no_mip: bool,
    /// Compile nothing of the scene into the kernel; without it, on CPU devices, small scenes and small tables of materials
    /// and lights are.
    #[arg(long, help_heading = "Device")]
    no_bake: bool,

    /// Image of the environment (.hdr or .exr, latitude/longitude), in place of the scene's.
    #[arg(long, value_name = "FILE", help_heading = "Environment")]
    env: Option<PathBuf>,
    /// Factor on the environment's radiance.
    #[arg(long, value_name = "X", default_value = "1", value_parser = parse::not_negative, help_heading = "Environment")]
    env_strength: f32,
    /// Rotation of the environment about +Y in degrees, counter-clockwise seen from above.
    #[arg(long, value_name = "DEG", default_value = "0", allow_hyphen_values = true, value_parser = parse::finite, help_heading = "Environment")]
    env_rotation: f64,
    /// How directions to the environment are chosen: by what is brighter than its mean, the rest being left to BSDF samples; by
    /// brightness; or evenly [default: compensated, or importance with --light-sampling nee].
    #[arg(long, value_name = "NAME", value_parser = parse::named::<EnvironmentSampling>(EnvironmentSampling::NAMES), help_heading = "Environment")]
    env_sampling: Option<EnvironmentSampling>,

    /// Device to render on: a number or a part of a name (see `sunfleck devices`), all, or auto.
    #[arg(long, value_name = "NAME|INDEX|all|auto", default_value_t, help_heading = "Device")]
    pub(super) device: DeviceChoice,
    /// How rays are traced: by hardware ray queries, by the shader's own BVH, or whichever the device has.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<TraceChoice>(TraceChoice::NAMES), help_heading = "Device")]
    trace: TraceChoice,
    /// How long the BVH may take to build, for how fast rays go through it: fast for a look at a large scene, high for long
    /// renders. Hardware ray queries have trees of their own.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<BvhQuality>(BvhQuality::NAMES), help_heading = "Device")]
    bvh_quality: BvhQuality,
    /// Folder of shader sources to use in place of the built-in ones.
    #[arg(long, value_name = "DIR", help_heading = "Device")]
    shaders: Option<PathBuf>,
}

/// What the `--env` flags say.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EnvironmentArgs {
    /// Image in place of the scene's environment.
    pub(crate) file: Option<PathBuf>,
    /// Factor on the radiance of whichever environment there is.
    pub(crate) strength: f32,
    /// Rotation about +Y in degrees, added to the environment's own.
    pub(crate) rotation_degrees: f64,
}

impl EstimatorArgs {
    /// The same as arguments of `sunfleck render`, each as `--name=value`, without the seed and without what is at its
    /// default: a build that lacks a newer flag can still be called.
    pub(crate) fn render_flags(&self) -> Vec<String> {
        let mut flags = Vec::new();
        let mut add = |name: &str, value: String| flags.push(format!("--{name}={value}"));
        if let Some(bounces) = self.max_bounces {
            add("max-bounces", bounces.to_string());
        }
        if let Some(most) = self.clamp_indirect {
            add("clamp-indirect", most.to_string());
        }
        if let Some(rays) = self.emission_rays {
            add("emission-rays", rays.to_string());
        }
        if let Some(samples) = self.adaptive {
            add("adaptive", samples.to_string());
        }
        if let Some(sampling) = self.env_sampling {
            add("env-sampling", sampling.to_string());
        }
        let default = Settings::default();
        let named = [
            ("integrator", self.integrator.name(), default.integrator.name()),
            ("sampler", self.sampler.name(), default.sampler.name()),
            ("light-sampling", self.light_sampling.name(), default.light_sampling.name()),
            ("light-choice", self.light_choice.name(), default.light_choice.name()),
            ("mis", self.mis.name(), default.mis_heuristic.name()),
            ("trace", self.trace.name(), default.trace.name()),
            ("bvh-quality", self.bvh_quality.name(), default.bvh_quality.name()),
        ];
        for (name, value, default) in named {
            if value != default {
                add(name, value.to_owned());
            }
        }
        for (name, path) in [("env", &self.env), ("shaders", &self.shaders)] {
            if let Some(path) = path {
                add(name, path.display().to_string());
            }
        }
        if self.env_strength != 1.0 {
            add("env-strength", self.env_strength.to_string());
        }
        if self.env_rotation != 0.0 {
            add("env-rotation", self.env_rotation.to_string());
        }
        if self.device != DeviceChoice::Auto {
            add("device", self.device.to_string());
        }
        if self.no_mip {
            flags.push(String::from("--no-mip"));
        }
        if self.no_bake {
            flags.push(String::from("--no-bake"));
        }
        flags
    }

    /// Puts into the settings what these flags say.
    ///
    /// # Errors
    /// `--shaders` is not a folder.
    pub(crate) fn apply(self, settings: &mut Settings) -> Result<EnvironmentArgs> {
        if let Some(folder) = self.shaders.as_deref().filter(|folder| !folder.is_dir()) {
            return Err(Error::Usage(format!("--shaders: '{}' is not a folder", folder.display())));
        }
        settings.seed = self.seed;
        settings.max_bounces = self.max_bounces;
        settings.integrator = self.integrator;
        settings.sampler = self.sampler;
        settings.light_sampling = self.light_sampling;
        settings.light_choice = self.light_choice;
        settings.mis_heuristic = self.mis;
        settings.env_sampling = self.env_sampling;
        settings.mip = !self.no_mip;
        settings.bake = !self.no_bake;
        settings.clamp_indirect = self.clamp_indirect;
        settings.emission_rays = self.emission_rays;
        settings.adaptive = self.adaptive;
        settings.trace = self.trace;
        settings.bvh_quality = self.bvh_quality;
        settings.device = self.device;
        settings.shaders_dir = self.shaders;
        Ok(EnvironmentArgs { file: self.env, strength: self.env_strength, rotation_degrees: self.env_rotation })
    }
}
