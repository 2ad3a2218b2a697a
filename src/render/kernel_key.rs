//! The kernel key: everything that decides which code runs. One key, one kernel.

use std::fmt;

use super::bake::Baked;
use super::{EnvironmentSampling, Integrator, LightSampling, MisHeuristic, RunPlan, SamplerKind, Settings};
use crate::film::aov::Aov;
use crate::gpu::{ArrayForm, TraceBackend};
use crate::layout::{AOV_ALBEDO, AOV_COST, AOV_COVERAGE, AOV_DEPTH, AOV_NORMAL, AOV_POSITION};
use crate::prepare::{EnvironmentKind, Features, LightChoice, Prepared};
use crate::scene::{Camera, Projection};

/// Version of the BVH's node layout; part of the key.
const NODE_LAYOUT: &str = "bvh4-q8-pairs";

/// What a path-tracing kernel is built with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct KernelKey {
    /// Trace back end.
    pub trace: TraceBackend,
    /// How scene arrays are read.
    pub array_form: ArrayForm,
    /// log2 of the texels of a chunk; 31 if nothing is split.
    pub chunk_shift: u32,
    /// Entries of the traversal stack that may lie in memory.
    pub stack_size: u32,
    /// What the scene needs.
    pub features: Features,
    /// A thin lens.
    pub lens: bool,
    /// An orthographic camera.
    pub orthographic: bool,
    /// What is added up.
    pub integrator: Integrator,
    /// Bright indirect light is cut off.
    pub clamp_indirect: bool,
    /// How light is looked for.
    pub light_sampling: LightSampling,
    /// How two samples are weighed.
    pub mis_heuristic: MisHeuristic,
    /// Where the random numbers come from.
    pub sampler: SamplerKind,
    /// Its points are those of independent replicates, by which the error is estimated.
    pub replicates: bool,
    /// What is compiled in.
    pub baked: Baked,
    /// How environment directions are drawn.
    pub env_sampling: EnvironmentSampling,
    /// Bit `1 << AOV_*` for each AOV that is summed.
    pub aovs: u32,
    /// Rays and their searches are counted.
    pub statistics: bool,
    /// Some pixels have rays for emission alone. As what is compiled in, it is decided where the kernel is built.
    pub emission_rays: bool,
}

fn aov_bit(aov: Aov) -> u32 {
    1 << match aov {
        Aov::Albedo => AOV_ALBEDO,
        Aov::Normal => AOV_NORMAL,
        Aov::Depth => AOV_DEPTH,
        Aov::Position => AOV_POSITION,
        Aov::Coverage => AOV_COVERAGE,
        Aov::Cost => AOV_COST,
    }
}

impl KernelKey {
    /// The key for a prepared scene seen by a camera.
    pub fn new(
        prepared: &Prepared,
        camera: &Camera,
        settings: &Settings,
        trace: TraceBackend,
        (array_form, chunk_shift): (ArrayForm, u32),
    ) -> Self {
        Self {
            trace,
            array_form,
            chunk_shift,
            // An entry an inner slot of the path, and one more to leave the instance.
            stack_size: prepared.statistics.depth + 2,
            features: prepared.features,
            lens: camera.lens_radius > 0.0,
            orthographic: matches!(camera.projection, Projection::Orthographic { .. }),
            integrator: settings.integrator,
            clamp_indirect: settings.clamp_indirect.is_some(),
            light_sampling: settings.light_sampling,
            mis_heuristic: settings.mis_heuristic,
            sampler: settings.sampler,
            replicates: settings.sampler == SamplerKind::Sobol && RunPlan::new(settings).estimates_error(),
            baked: Baked::default(),
            env_sampling: settings.environment_sampling(),
            aovs: settings.aovs.iter().fold(0, |bits, &aov| bits | aov_bit(aov)),
            statistics: settings.statistics,
            emission_rays: false,
        }
    }

    /// The AOVs that are summed.
    pub fn aovs(&self) -> Vec<Aov> {
        Aov::ALL.iter().copied().filter(|&aov| self.aovs & aov_bit(aov) != 0).collect()
    }

    /// Names of what the kernel has: the scene's features, then what the settings ask for besides.
    pub fn kept(&self) -> Vec<String> {
        let features = self.features.kept().into_iter().map(str::to_owned);
        let aovs = self.aovs().into_iter().map(|aov| format!("aov-{aov}"));
        let rays = self.emission_rays.then(|| String::from("emission-rays"));
        features.chain(rays).chain(aovs).chain(self.statistics.then(|| String::from("statistics"))).collect()
    }

    /// The specialisation constants of shaders/include/features.glsl.
    pub fn specialization(&self) -> Vec<(u32, u32)> {
        let f = &self.features;
        let flags = [
            f.textures,
            f.instances,
            f.normals,
            f.environment == EnvironmentKind::Constant,
            f.environment == EnvironmentKind::Image,
            self.lens,
            self.orthographic,
            f.black_back,
            f.normal_maps,
            f.vertex_colors,
            f.alpha,
            f.anisotropy,
            f.specular,
            f.transmission,
            f.volume,
            f.mip,
            f.near_lamps,
            self.clamp_indirect,
            f.panes,
            // FOR_ANY_SCENE: it is for this one.
            false,
            f.environment_rgbe,
            self.emission_rays,
        ];
        let features = flags.iter().zip(0..).fold(0, |bits, (&on, i)| bits | u32::from(on) << i);
        let integrator = match self.integrator {
            Integrator::Path => 7,
            Integrator::Emission => 1,
            Integrator::Direct => 2,
            Integrator::Indirect => 4,
        };
        vec![
            (1, self.chunk_shift),
            (2, f.bsdfs),
            (3, f.lights),
            (4, features),
            (5, integrator),
            (6, self.light_sampling as u32),
            (7, self.mis_heuristic as u32),
            (8, u32::from(self.env_sampling == EnvironmentSampling::Uniform)),
            (9, self.stack_size),
            (10, self.sampler as u32 + u32::from(self.replicates)),
            (11, u32::from(f.light_choice == LightChoice::Bvh)),
            (12, self.baked.parts),
            (13, self.aovs),
            (14, self.statistics.into()),
        ]
    }
}

impl fmt::Display for KernelKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} {} {NODE_LAYOUT} chunk:{} stack:{}",
            self.trace, self.array_form, self.chunk_shift, self.stack_size
        )?;
        write!(f, " {} {} {} {}", self.integrator, self.light_sampling, self.mis_heuristic, self.env_sampling)?;
        write!(f, " lights:{}", self.features.light_choice)?;
        write!(f, " [{}]", self.kept().join(" "))?;
        if self.sampler != SamplerKind::Independent {
            write!(f, " {}{}", self.sampler, if self.replicates { ":replicates" } else { "" })?;
        }
        if self.clamp_indirect {
            f.write_str(" clamp-indirect")?;
        }
        if self.lens {
            f.write_str(" lens")?;
        }
        if self.baked.parts != 0 {
            write!(f, " baked:{:016x}", self.baked.hash)?;
        }
        if self.orthographic {
            f.write_str(" orthographic")?;
        }
        Ok(())
    }
}
