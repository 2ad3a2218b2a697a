//! Whether a scene is compiled into the kernel: a rule of scene and device.

use std::hash::{DefaultHasher, Hash, Hasher};

use crate::gpu::specialize::BakedTriangle;
use crate::gpu::{DeviceInfo, DeviceKind, TraceBackend};
use crate::layout::{LeafSlot, SceneArray};
use crate::prepare::Prepared;

/// Most triangles that are compiled in (docs/benchmarks).
pub const MOST_BAKED_TRIANGLES: u64 = 128;

/// What is compiled in, and why, or why not.
#[derive(Clone, Debug, Default)]
pub struct Bake {
    /// All triangles of the scene; none if it is not compiled in.
    pub triangles: Vec<BakedTriangle>,
    /// Why.
    pub reason: String,
}

impl Bake {
    /// Chooses for a scene on a device; `wanted` is false for `--no-bake`.
    pub fn choose(prepared: &Prepared, device: &DeviceInfo, trace: TraceBackend, wanted: bool) -> Self {
        let count = prepared.statistics.triangles;
        let features = &prepared.features;
        let no = |reason: &str| Self { triangles: Vec::new(), reason: reason.to_owned() };
        if !wanted {
            return no("--no-bake");
        }
        if device.kind != DeviceKind::Cpu {
            return no("the device is no CPU");
        }
        if trace != TraceBackend::Bvh {
            return no("rays are traced by the device");
        }
        if features.instances || features.alpha || features.panes {
            return no("the scene has instances, alpha or panes");
        }
        if count == 0 || count > MOST_BAKED_TRIANGLES {
            return no(&format!("{count} triangles are not 1 to {MOST_BAKED_TRIANGLES}"));
        }
        let triangles = triangles(prepared);
        Self { reason: format!("{count} triangles of at most {MOST_BAKED_TRIANGLES}"), triangles }
    }

    /// What is compiled in as a number for the kernel key.
    pub fn key(&self) -> Option<u64> {
        let mut hasher = DefaultHasher::new();
        for triangle in &self.triangles {
            (triangle.slot, triangle.vertices.map(|v| v.map(f32::to_bits))).hash(&mut hasher);
        }
        (!self.triangles.is_empty()).then(|| hasher.finish())
    }
}

/// Every triangle of the scene, in the order of the slots.
pub fn triangles(prepared: &Prepared) -> Vec<BakedTriangle> {
    let slots = &prepared.arrays[SceneArray::Slots as usize];
    let of_mesh = |mesh| prepared.triangle_slots(mesh);
    let all = prepared.meshes.iter().flat_map(of_mesh);
    all.map(|slot| {
        let leaf: LeafSlot =
            bytemuck::cast([slots[3 * slot as usize], slots[3 * slot as usize + 1], slots[3 * slot as usize + 2]]);
        BakedTriangle { slot, vertices: leaf.vertices }
    })
    .collect()
}
