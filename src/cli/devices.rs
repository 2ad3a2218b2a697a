//! `sunfleck devices`: every Vulkan device that could render.

use clap::Args;
use serde_json::json;
use sunfleck::gpu::{self, DeviceInfo, DeviceSelection, Instance, driver_environment};
use sunfleck::render::{TraceChoice, choose_trace};

use super::print_json;

/// List every Vulkan device: driver, memory, ray query or not, and the limits that matter.
#[derive(Args, Debug)]
pub(crate) struct DevicesArgs {
    /// Print one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Lists the devices.
pub(crate) fn run(args: &DevicesArgs) -> anyhow::Result<()> {
    let instance = Instance::new().map_err(sunfleck::Error::from)?;
    let devices = gpu::devices(&instance).map_err(sunfleck::Error::from)?;
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
