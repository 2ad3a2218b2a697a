//! What a render is asked to do, as plain data with defaults.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use crate::film::aov::Aov;
use crate::named_enum::named_enum;
use crate::prepare::{BvhQuality, EnvironmentSampling, LightChoice};
use crate::scene::Scene;
use crate::{Error, Result};

/// Settings of a render.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Width of the image in pixels, ≥ 1.
    pub width: u32,
    /// Height of the image in pixels, ≥ 1.
    pub height: u32,
    /// Samples per pixel, ≥ 1; `u32::MAX` if only `time` or `target_error` ends the run.
    pub spp: u32,
    /// Wall time for rendering, after which the run ends.
    pub time: Option<Duration>,
    /// Relative error at which the run ends ([`crate::film::replicates::ErrorEstimate::error`]).
    pub target_error: Option<f64>,
    /// Estimate the error from replicates; a `target_error` implies it.
    pub estimate: bool,
    /// Only these sample indices, instead of `0..spp`.
    pub sample_range: Option<Range<u32>>,
    /// Samples of a pilot, at least 4, after which noisy pixels have more samples than others (`adaptive.rs`).
    pub adaptive: Option<u32>,
    /// Seed of the sampler.
    pub seed: u32,
    /// Scattering events a path may have: 0 shows emitters alone, 1 adds direct light. `None` is unlimited.
    pub max_bounces: Option<u32>,
    /// Which part of the light is added up.
    pub integrator: Integrator,
    /// Where the random numbers come from.
    pub sampler: SamplerKind,
    /// How light is looked for.
    pub light_sampling: LightSampling,
    /// How a light is picked at a vertex; a scene of few lights is not given a tree.
    pub light_choice: LightChoice,
    /// Most that a path may bring at once after two scattering events or more (largest component), > 0. It takes light
    /// away from the image: a bias.
    pub clamp_indirect: Option<f32>,
    /// Rays of a sample that ask for emission alone, in pixels where the camera may see a lamp; 0 is none, `None` as many as
    /// cost little (`emission_pixels.rs`).
    pub emission_rays: Option<u32>,
    /// How [`LightSampling::Mis`] weighs its two samples.
    pub mis_heuristic: MisHeuristic,
    /// How directions to an image environment are chosen; `None` leaves it to [`Settings::environment_sampling`].
    pub env_sampling: Option<EnvironmentSampling>,
    /// The pixel filter.
    pub filter: PixelFilter,
    /// What is kept besides radiance, each once.
    pub aovs: Vec<Aov>,
    /// Count rays, what their searches visit, and how full vectors are.
    pub statistics: bool,
    /// Look textures up in mip chains by ray cones, not in the files' texels alone.
    pub mip: bool,
    /// How good the trees of our own BVH are.
    pub bvh_quality: BvhQuality,
    /// Compile small scenes into the kernel on software devices.
    pub bake: bool,
    /// Which implementation traces rays.
    pub trace: TraceChoice,
    /// Which device renders.
    pub device: DeviceChoice,
    /// A folder whose shader sources replace the embedded ones.
    pub shaders_dir: Option<PathBuf>,
    /// The kernel's SPIR-V, compiled already for the trace back end and the array form that will be chosen; it goes before
    /// `shaders_dir`. The shader loop sets it.
    pub kernel_spirv: Option<Arc<[u32]>>,
    /// A camera of the scene by name or index; `None` is the first.
    pub camera: Option<String>,
    /// Refuse to succeed with a result that is not trustworthy.
    pub strict: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            spp: 128,
            time: None,
            target_error: None,
            estimate: false,
            sample_range: None,
            adaptive: None,
            seed: 0,
            max_bounces: None,
            integrator: Integrator::default(),
            sampler: SamplerKind::default(),
            light_sampling: LightSampling::default(),
            light_choice: LightChoice::default(),
            clamp_indirect: None,
            emission_rays: None,
            mis_heuristic: MisHeuristic::default(),
            env_sampling: None,
            filter: PixelFilter::default(),
            aovs: Vec::new(),
            statistics: false,
            mip: true,
            bvh_quality: BvhQuality::default(),
            bake: true,
            trace: TraceChoice::default(),
            device: DeviceChoice::default(),
            shaders_dir: None,
            kernel_spirv: None,
            camera: None,
            strict: false,
        }
    }
}

impl Settings {
    /// The sample indices to render.
    pub fn samples(&self) -> Range<u32> {
        self.sample_range.clone().unwrap_or(0..self.spp)
    }

    /// How directions to an image environment are chosen: what is set, or else what suits the light sampling. MIS
    /// compensation leaves to BSDF samples what is not brighter than the mean, and [`LightSampling::Nee`] has none.
    pub fn environment_sampling(&self) -> EnvironmentSampling {
        self.env_sampling.unwrap_or(match self.light_sampling {
            LightSampling::Nee => EnvironmentSampling::Importance,
            LightSampling::Mis | LightSampling::Mixture | LightSampling::Bsdf => EnvironmentSampling::Compensated,
        })
    }
}

named_enum! {
    /// Which part of the light is added up. Emission + direct + indirect = path, to 1 ulp at the same seed.
    Integrator, "integrator" {
        /// All light.
        #[default]
        Path = "path",
        /// Exactly one scattering event.
        Direct = "direct",
        /// Two scattering events or more.
        Indirect = "indirect",
        /// None: emitters and the environment as the camera sees them.
        Emission = "emission",
    }
}

named_enum! {
    /// How light is looked for. Lights that only one strategy can see are seen in every mode that has it.
    LightSampling, "light sampling" {
        /// A light sample and a BSDF sample at each vertex, weighted by multiple importance sampling.
        #[default]
        Mis = "mis",
        /// One sample at each vertex, of the light or of the BSDF, divided by the averaged density.
        Mixture = "mixture",
        /// Light samples only (next event estimation).
        Nee = "nee",
        /// BSDF samples only.
        Bsdf = "bsdf",
    }
}

named_enum! {
    /// How multiple importance sampling weighs (Veach 1997, section 9.2).
    MisHeuristic, "MIS heuristic" {
        /// p / Σ p.
        Balance = "balance",
        /// p² / Σ p².
        #[default]
        Power = "power",
    }
}

named_enum! {
    /// Where the random numbers come from.
    SamplerKind, "sampler" {
        /// Independent uniform numbers, hashed from pixel, sample and dimension.
        Independent = "independent",
        /// Owen-scrambled Sobol' points, in which neighbouring pixels complete each other.
        #[default]
        Sobol = "sobol",
    }
}

named_enum! {
    /// The pixel filter, sampled by importance.
    PixelFilter, "filter" {
        /// One pixel, evenly.
        #[default]
        Box = "box",
        /// Two pixels wide, a triangle.
        Tent = "tent",
        /// Truncated Gaussian.
        Gaussian = "gaussian",
        /// Blackman-Harris window.
        BlackmanHarris = "blackman-harris",
    }
}

named_enum! {
    /// Which implementation traces rays.
    TraceChoice, "trace back end" {
        /// Ray queries where the device has them.
        #[default]
        Auto = "auto",
        /// `VK_KHR_ray_query`.
        RayQuery = "ray-query",
        /// The shader's own BVH.
        Bvh = "bvh",
    }
}

/// Which device renders.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The best: discrete, integrated, virtual, then CPU.
    #[default]
    Auto,
    /// All of them together.
    All,
    /// By its number in `sunfleck devices`.
    Index(usize),
    /// By a part of its name, upper or lower case.
    Name(String),
}

impl FromStr for DeviceChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        Ok(match text {
            "auto" => Self::Auto,
            "all" => Self::All,
            _ => text.parse().map_or_else(|_| Self::Name(text.to_owned()), Self::Index),
        })
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::All => f.write_str("all"),
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => f.write_str(name),
        }
    }
}

/// The index of the camera that `choice` names: a name, else an index, else (without a choice) the first.
///
/// # Errors
/// [`Error::Usage`] that lists the scene's cameras.
pub fn choose_camera(scene: &Scene, choice: Option<&str>) -> Result<usize> {
    let Some(wanted) = choice else { return Ok(0) };
    let by_name = scene.cameras.iter().position(|camera| camera.name == wanted);
    let by_index = wanted.parse().ok().filter(|&index: &usize| index < scene.cameras.len());
    by_name.or(by_index).ok_or_else(|| {
        let list: Vec<_> = scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} '{}'", c.name)).collect();
        Error::Usage(format!("--camera: no camera '{wanted}' in {}; there are: {}", scene.name, list.join(", ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for integrator in Integrator::ALL {
            assert_eq!(integrator.to_string().parse(), Ok(*integrator));
        }
        let error = "rtx".parse::<TraceChoice>().unwrap_err();
        assert_eq!(error, "unknown trace back end 'rtx'; there are auto, ray-query, bvh");
        assert_eq!("2".parse(), Ok(DeviceChoice::Index(2)));
        assert_eq!("H200".parse(), Ok(DeviceChoice::Name("H200".to_owned())));
    }
}
