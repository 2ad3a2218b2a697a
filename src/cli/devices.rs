//! `sunfleck devices`: every Vulkan device that could render.

use std::sync::Arc;

use anyhow::Context;
use clap::Args;
use serde_json::json;
use sunfleck::gpu::{self, DeviceInfo, DeviceSelection, Instance, driver_environment, forget_calibration};
use sunfleck::render::{TraceChoice, calibrate, choose_trace};

use super::print_json;

/// List every Vulkan device: driver, memory, ray query or not, and the limits that matter.
#[derive(Args, Debug)]
pub(crate) struct DevicesArgs {
    /// Print one JSON object on standard output.
    #[arg(long)]
    json: bool,
    /// Measure on each device how fast it traces rays with every back end and every form of arrays, and take the fastest from
    /// then on (half a minute a device). What was measured is kept in the cache folder, for this driver and this version.
    #[arg(long, conflicts_with = "forget")]
    calibrate: bool,
    /// Forget what --calibrate measured.
    #[arg(long)]
    forget: bool,
}

/// Lists the devices.
pub(crate) fn run(args: &DevicesArgs) -> anyhow::Result<()> {
    let instance = Instance::new().map_err(sunfleck::Error::from)?;
    let mut devices = gpu::devices(&instance).map_err(sunfleck::Error::from)?;
    for device in devices.iter_mut().filter(|device| device.unusable.is_none()) {
        if args.calibrate {
            measure(&instance, device)?;
        }
        if args.forget && forget_calibration(device).context("cannot forget the calibration")? {
            device.calibration = None;
            eprintln!("{}: forgotten", device.name);
        }
    }
    let default = gpu::select(&devices, &DeviceSelection::Auto).ok().map(|(device, _)| device.index);
    if args.json {
        let list: Vec<_> = devices.iter().map(|d| describe_json(d, default)).collect();
        return print_json(&json!({ "devices": list, "driver_environment": environment_json() }));
    }
    for device in &devices {
        describe(device, default);
    }
    if let Some(environment) = driver_environment() {
        println!("environment for lavapipe: {environment}");
    }
    Ok(())
}

/// Measures the device and keeps what was measured.
fn measure(instance: &Arc<Instance>, device: &mut DeviceInfo) -> anyhow::Result<()> {
    eprintln!("{}: {}", device.index, device.name);
    let calibration = calibrate(instance, device, &mut |trace, form, scene| {
        eprintln!("   measuring {trace}, {form}, on {scene}");
    })?;
    let path = calibration.store(device).context("cannot keep the calibration")?;
    eprintln!("   kept in {}", path.display());
    device.calibration = Some(calibration);
    Ok(())
}

/// What was set for lavapipe, by variable, and why.
pub(super) fn environment_json() -> serde_json::Value {
    driver_environment().map_or(serde_json::Value::Null, |environment| {
        let set: serde_json::Map<_, _> =
            environment.set.iter().map(|(name, value)| ((*name).into(), json!(value.to_string_lossy()))).collect();
        json!({ "set": set, "reason": environment.reason })
    })
}

fn describe(d: &DeviceInfo, default: Option<usize>) {
    let (trace, why) = choose_trace(d, TraceChoice::Auto);
    let (major, minor, patch) = d.api_version;
    let mark = if default == Some(d.index) { " (taken by default)" } else { "" };
    println!("{}: {}{mark}", d.index, d.name);
    println!("   kind            {}", d.kind);
    println!("   driver          {}", d.driver);
    println!("   Vulkan          {major}.{minor}.{patch}");
    println!("   memory          {:.1} GiB", d.memory_bytes as f64 / f64::from(1 << 30));
    println!("   ray query       {}", if d.ray_query { "yes" } else { "no" });
    println!("   --trace auto    {trace}: {why}");
    let l = &d.limits;
    println!("   storage buffer  {} MiB", l.storage_buffer_range >> 20);
    println!("   texel buffer    {} texels", l.texel_buffer_elements);
    println!("   allocation      {} MiB", l.allocation_size >> 20);
    println!("   workgroup       {} lanes, subgroups of {}", l.workgroup_invocations, l.subgroup_size);
    if let Some(calibration) = &d.calibration {
        println!("   calibrated      million paths/s on {}", calibration.scenes.join(", "));
        for v in &calibration.variants {
            let rates: Vec<_> = v.paths_per_second.iter().map(|rate| format!("{:8.3}", rate / 1e6)).collect();
            let best = if Some(v) == calibration.best() { " (taken)" } else { "" };
            println!("      {:9} {:14} {}{best}", v.trace.to_string(), v.array_form.to_string(), rates.join(" "));
        }
    }
    if let Some(why) = &d.unusable {
        println!("   unusable        {why}");
    }
}

fn describe_json(d: &DeviceInfo, default: Option<usize>) -> serde_json::Value {
    let (trace, why) = choose_trace(d, TraceChoice::Auto);
    let (major, minor, patch) = d.api_version;
    json!({
        "index": d.index,
        "name": d.name,
        "kind": d.kind.to_string(),
        "driver": d.driver,
        "api_version": format!("{major}.{minor}.{patch}"),
        "memory_bytes": d.memory_bytes,
        "ray_query": d.ray_query,
        "buffer_device_address": d.buffer_device_address,
        "trace_auto": trace.to_string(),
        "trace_auto_reason": why,
        "calibration": d.calibration,
        "default": default == Some(d.index),
        "unusable": d.unusable,
        "limits": {
            "storage_buffer_range": d.limits.storage_buffer_range,
            "texel_buffer_elements": d.limits.texel_buffer_elements,
            "allocation_size": d.limits.allocation_size,
            "workgroup_invocations": d.limits.workgroup_invocations,
            "subgroup_size": d.limits.subgroup_size,
        },
    })
}
