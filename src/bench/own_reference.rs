//! The reference that a bench renders itself: another estimator of the same image, with other seeds.
//!
//! As much of it differs as costs little: the light sampling, the trace back end, and shaders that are replaced are not
//! replaced here. What stays common (BSDFs, cameras, textures) is tested against Mitsuba instead.

use super::mean_image::ImageAccumulator;
use super::plan::Budget;
use super::reference::Reference;
use super::work::Work;
use crate::Result;
use crate::gpu::{DeviceKind, TraceBackend};
use crate::layout::{LIGHT_ENVIRONMENT, LIGHT_TRIANGLE};
use crate::render::{LightSampling, OpenDevice, Settings, TraceChoice, open_device, path_tracer_on};
use crate::scene::Scene;

/// Independent parts of the reference: enough for a variance of every pixel.
pub const REFERENCE_PARTS: u32 = 8;

/// The settings of the estimator that checks another one on a device with or without ray queries: the same integral, by
/// other samples, by the built-in shaders. `trace` is what the other one traces rays with.
pub fn other_estimator(settings: &Settings, trace: TraceBackend, kind: DeviceKind, ray_query: bool) -> Settings {
    let light_sampling = match settings.light_sampling {
        LightSampling::Mis => LightSampling::Mixture,
        LightSampling::Mixture | LightSampling::Nee | LightSampling::Bsdf => LightSampling::Mis,
    };
    let trace = match trace {
        TraceBackend::RayQuery => TraceChoice::Bvh,
        // On a software driver they would make the reference many times slower than the images.
        TraceBackend::Bvh if ray_query && kind != DeviceKind::Cpu => TraceChoice::RayQuery,
        TraceBackend::Bvh => TraceChoice::Bvh,
    };
    Settings { light_sampling, trace, shaders_dir: None, ..settings.clone() }
}

/// Renders the reference in [`REFERENCE_PARTS`] parts of the seeds from `first_seed` on, which together may take `budget`.
pub(super) fn render(
    open: &OpenDevice,
    scene: &Scene,
    settings: &Settings,
    budget: Budget,
    first_seed: u32,
    work: &mut Work,
) -> Result<Reference> {
    let info = &open.gpu.info;
    let other = other_estimator(settings, open.trace, info.kind, info.ray_query);
    // A device is opened with ray queries only where it traces by them.
    let same = other.trace == TraceChoice::Bvh && open.trace == TraceBackend::Bvh;
    let other_device = if same { None } else { Some(open_device(&other)?) };
    let (mut tracer, ..) = path_tracer_on(other_device.as_ref().unwrap_or(open), scene, &other)?;
    let mut image = ImageAccumulator::new((settings.width, settings.height));
    let (mut seconds, mut spp) = (0.0, 0.0);
    for seed in (0..REFERENCE_PARTS).map(|n| first_seed.wrapping_add(n)) {
        let run = work.render(&mut tracer, seed, None, budget.part(REFERENCE_PARTS))?;
        let part_spp = run.film.mean_samples_per_pixel();
        image.add(&run.film.radiance(), part_spp);
        seconds += run.seconds;
        spp += part_spp;
    }
    let mut description = format!("own run with --light-sampling {}", other.light_sampling);
    if other_device.is_some() {
        description += &format!(", --trace {}", other.trace);
    }
    if settings.shaders_dir.is_some() {
        description += ", the built-in shaders";
    }
    let last_seed = first_seed.wrapping_add(REFERENCE_PARTS - 1);
    description += &format!(", {spp:.0} samples per pixel of seeds {first_seed} to {last_seed}");
    if tracer.key().features.lights & (1 << LIGHT_TRIANGLE | 1 << LIGHT_ENVIRONMENT) == 0 {
        description += " (no light here has an area: every light sampling is the same estimator)";
    }
    Ok(Reference::from_images(image.finish(), description, spp, seconds))
}
