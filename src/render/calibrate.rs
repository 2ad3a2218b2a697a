//! Measures which variant of the kernel is fastest on a device: every trace back end, and every form in which the shader can
//! read the scene's arrays.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use super::scene_buffers::{WHOLE, binds_storage};
use super::{
    BindingOverride, PathTracer, SamplerKind, Settings, TraceChoice, choose_array_form, choose_trace, prepare_scene,
};
use crate::gpu::{
    ArrayForm, CalibratedVariant, Calibration, DeviceInfo, DeviceRequirements, Gpu, Instance, TraceBackend,
};
use crate::scene::{Scene, builtin};
use crate::{Error, Result};

/// What is traced: a box of 36 triangles, and one with a mesh of 9,800.
const SCENES: [&str; 2] = ["cornell", "bumpy"];
/// How long each of [`RUNS`] lasts; the best counts, since what else the machine does only ever slows one down.
const RUN_TIME: Duration = Duration::from_millis(300);
const RUNS: u32 = 4;

/// Measures the device. `progress` is told what is about to be measured.
///
/// # Errors
/// When the device cannot be opened or is lost.
pub fn calibrate(
    instance: &Arc<Instance>,
    info: &DeviceInfo,
    progress: &mut dyn FnMut(TraceBackend, ArrayForm, &str),
) -> Result<Calibration> {
    let settings = Settings {
        width: 128,
        height: 128,
        max_bounces: Some(7),
        sampler: SamplerKind::Independent,
        // With the scene in the kernel there is nothing to read and nothing to traverse.
        bake: false,
        ..Settings::default()
    };
    let scenes: Vec<Scene> = SCENES.iter().filter_map(|name| builtin::builtin(name)).collect();
    let mut variants = Vec::new();
    for (trace, array_form) in candidates(info) {
        variants.push(CalibratedVariant {
            trace,
            array_form,
            paths_per_second: Vec::new(),
            compile_seconds: Vec::new(),
        });
    }
    for scene in &scenes {
        let camera = &scene.cameras[0];
        let prepared = prepare_scene(scene, camera, &settings)?;
        let mut tracers = Vec::new();
        for variant in &mut variants {
            progress(variant.trace, variant.array_form, &scene.name);
            let requirements = DeviceRequirements { ray_query: variant.trace == TraceBackend::RayQuery };
            let gpu = Gpu::new(instance.clone(), info.clone(), requirements)?;
            let form = BindingOverride { array_form: Some((variant.array_form, WHOLE)), ..BindingOverride::default() };
            let tracer = PathTracer::new(&gpu, variant.trace, &prepared, camera, &settings, form)?;
            variant.paths_per_second.push(0.0);
            variant.compile_seconds.push(tracer.compile_seconds);
            tracers.push(tracer);
        }
        // In turns, so that what else the machine does falls on all.
        for seed in 0..RUNS {
            for (tracer, variant) in tracers.iter_mut().zip(&mut variants) {
                let run = tracer.run(seed, 0..u32::MAX, Some(RUN_TIME), &mut |_| ControlFlow::Continue(()))?;
                let rates = &mut variant.paths_per_second;
                let best = rates.last_mut().expect("the tracer's rate was begun above");
                *best = best.max(run.paths as f64 / run.seconds);
            }
        }
    }
    if variants.is_empty() {
        return Err(Error::Usage(format!("device '{}' can hold no scene", info.name)));
    }
    Ok(Calibration::new(scenes.into_iter().map(|scene| scene.name).collect(), variants))
}

/// Texels of the longest array of [`SCENES`], with room to spare: no device binds fewer to a texel buffer (Vulkan 1.3,
/// table "Required Limits").
const LONGEST: usize = 1 << 16;

/// What the rules would take; then the BVH with every form that holds the scenes unsplit, and ray queries, which hardly read
/// arrays, with one.
fn candidates(info: &DeviceInfo) -> Vec<(TraceBackend, ArrayForm)> {
    let limits = &info.limits;
    let mut unmeasured = info.clone();
    unmeasured.calibration = None;
    let Some((form, WHOLE)) = choose_array_form(&unmeasured, &[LONGEST]).ok() else { return Vec::new() };
    let (trace, _) = choose_trace(&unmeasured, TraceChoice::Auto);
    let forms = [
        (ArrayForm::TexelBuffer, limits.texel_buffer_elements >= LONGEST as u64),
        (ArrayForm::StorageBuffer, limits.storage_buffer_range >= 16 * LONGEST as u64 && binds_storage(info)),
        (ArrayForm::DeviceAddress, info.buffer_device_address),
    ];
    let bvh = forms.into_iter().filter(|&(_, fits)| fits).map(|(form, _)| (TraceBackend::Bvh, form));
    let query = info.ray_query.then_some((TraceBackend::RayQuery, form));
    let others = bvh.chain(query).filter(|&other| other != (trace, form));
    std::iter::once((trace, form)).chain(others).collect()
}
