//! The prepared scene on the device: its arrays, in the form and the chunks that the device's limits ask for, and its
//! acceleration structures where rays are traced by hardware.

use std::sync::Arc;

use ash::vk::BufferUsageFlags as Usage;

use crate::gpu::{
    AccelerationStructures, ArrayForm, BindingResource, Buffer, Calibration, DeviceInfo, DeviceKind, Gpu, GpuError,
    GpuResult, InstanceGeometry, MeshGeometry, MeshPart, TraceBackend,
};
use crate::layout::{MAX_CHUNKS, SCENE_ARRAYS, SceneArray, TRIANGLE_ALPHA, Texel};
use crate::prepare::Prepared;

/// Custom index of the baked mesh, as in shaders/include/trace_ray_query.glsl.
const BAKED_INSTANCE: u32 = 0xff_ffff;
/// An array that is not split.
pub(super) const WHOLE: u32 = 31;

/// How arrays of the given sizes (in texels) are bound on a device: the form, and log2 of a chunk's texels.
///
/// What was measured to be fastest on the device ([`crate::gpu::Calibration`]) if it holds them whole. Else software drivers
/// load from texel buffers cheapest; a GPU reads storage buffers. Device addresses have no limit and serve where the
/// others cannot hold the arrays.
///
/// # Errors
/// [`GpuError::Lacks`] if no form can hold them.
pub fn choose_array_form(info: &DeviceInfo, lengths: &[usize]) -> GpuResult<(ArrayForm, u32)> {
    let longest = lengths.iter().copied().max().unwrap_or(0) as u64;
    let shift = |limit: u64| {
        if longest <= limit {
            return Some(WHOLE);
        }
        let shift = limit.checked_ilog2()?;
        (longest <= (MAX_CHUNKS as u64) << shift).then_some(shift)
    };
    let allocation_texels = info.limits.allocation_size / 16;
    let texel = shift(info.limits.texel_buffer_elements.min(allocation_texels));
    let storage = shift((info.limits.storage_buffer_range / 16).min(allocation_texels));
    let storage = storage.filter(|_| binds_storage(info)).map(|s| (ArrayForm::StorageBuffer, s));
    let texel = texel.map(|s| (ArrayForm::TexelBuffer, s));
    let address = info.buffer_device_address.then_some((ArrayForm::DeviceAddress, WHOLE));
    let whole = |choice: Option<(ArrayForm, u32)>| choice.filter(|&(_, s)| s == WHOLE);
    // Unsplit first.
    let order = if info.kind == DeviceKind::Cpu {
        [whole(texel), whole(storage), texel, storage, address]
    } else {
        [whole(storage), address, storage, whole(texel), texel]
    };
    let measured = info.calibration.as_ref().and_then(Calibration::best).map(|best| best.array_form);
    let preferred = [texel, storage, address].into_iter().map(whole).find(|choice| choice.map(|c| c.0) == measured);
    let preferred = preferred.flatten();
    preferred.into_iter().chain(order.into_iter().flatten()).next().ok_or_else(|| GpuError::Lacks {
        device: info.name.clone(),
        lacks: format!("cannot bind an array of {} MiB in {MAX_CHUNKS} parts", longest / 65_536),
    })
}

/// Whether the device binds as many storage buffers as the arrays have chunks, beside those of a slice and the view.
pub(super) fn binds_storage(info: &DeviceInfo) -> bool {
    info.limits.stage_storage_buffers as usize >= SCENE_ARRAYS * MAX_CHUNKS + 7
}

/// The scene's buffers on a device.
pub struct SceneBuffers {
    /// Where they are.
    pub(super) gpu: Arc<Gpu>,
    /// What they are made for.
    pub(super) trace: TraceBackend,
    /// How they are bound: the form, and log2 of a chunk's texels.
    pub(super) form: (ArrayForm, u32),
    /// `MAX_CHUNKS` bindings an array; an absent chunk is an empty buffer.
    chunks: Vec<Vec<Buffer>>,
    empty: Buffer,
    /// Addresses of the arrays (uniform buffer), for [`ArrayForm::DeviceAddress`].
    pub(super) addresses: Option<Buffer>,
    pub(super) acceleration: Option<AccelerationStructures>,
    /// Bytes in all.
    pub(super) bytes: u64,
}

impl SceneBuffers {
    pub(super) fn upload(
        gpu: &Arc<Gpu>,
        prepared: &Prepared,
        trace: TraceBackend,
        (form, chunk_shift): (ArrayForm, u32),
    ) -> GpuResult<Self> {
        let usage = match form {
            ArrayForm::TexelBuffer => Usage::UNIFORM_TEXEL_BUFFER,
            ArrayForm::StorageBuffer => Usage::STORAGE_BUFFER,
            ArrayForm::DeviceAddress => Usage::STORAGE_BUFFER | Usage::SHADER_DEVICE_ADDRESS,
        };
        let empty = Buffer::with_data(gpu, "no chunk", &[[0_u32; 4]], usage)?;
        let mut chunks = Vec::new();
        for (array, name) in prepared.arrays.iter().zip(["slots", "attributes", "tables", "texels", "environment"]) {
            let chunk_texels = if chunk_shift == WHOLE { array.len().max(1) } else { 1 << chunk_shift };
            let buffers: GpuResult<Vec<_>> =
                array.chunks(chunk_texels).map(|chunk| Buffer::with_data(gpu, name, chunk, usage)).collect();
            chunks.push(buffers?);
        }
        let addresses = (form == ArrayForm::DeviceAddress).then(|| upload_addresses(gpu, &chunks)).transpose()?;
        let acceleration = (trace == TraceBackend::RayQuery).then(|| build_acceleration(gpu, prepared)).transpose()?;
        let bytes = chunks.iter().flatten().map(|b| b.size).sum::<u64>()
            + acceleration.as_ref().map_or(0, AccelerationStructures::bytes);
        let (gpu, form) = (Arc::clone(gpu), (form, chunk_shift));
        Ok(Self { gpu, trace, form, chunks, empty, addresses, acceleration, bytes })
    }

    /// The bindings of `scene_arrays`.
    pub(super) fn bindings(&self) -> Vec<&Buffer> {
        self.chunks
            .iter()
            .flat_map(|array| (0..MAX_CHUNKS).map(move |i| array.get(i)))
            .map(|chunk| chunk.unwrap_or(&self.empty))
            .collect()
    }
}

/// What is bound as `scene_arrays` (`array_addresses` for device addresses); `chunks` is [`SceneBuffers::bindings`].
pub(super) fn array_binding<'a>(
    buffers: &'a SceneBuffers,
    form: ArrayForm,
    chunks: &'a [&'a Buffer],
) -> BindingResource<'a> {
    match (form, &buffers.addresses) {
        (ArrayForm::TexelBuffer, _) => BindingResource::TexelArray(chunks),
        (ArrayForm::DeviceAddress, Some(addresses)) => BindingResource::Uniform(addresses),
        _ => BindingResource::StorageArray(chunks),
    }
}

fn upload_addresses(gpu: &Arc<Gpu>, chunks: &[Vec<Buffer>]) -> GpuResult<Buffer> {
    let mut words = vec![[0_u32; 4]; SCENE_ARRAYS * MAX_CHUNKS];
    for (array, buffers) in chunks.iter().enumerate() {
        for (chunk, buffer) in buffers.iter().enumerate() {
            let address = buffer.device_address();
            words[array * MAX_CHUNKS + chunk] = [(address & 0xffff_ffff) as u32, (address >> 32) as u32, 0, 0];
        }
    }
    Buffer::with_data(gpu, "array addresses", &words, Usage::UNIFORM_BUFFER)
}

/// Every mesh over all of its slots, so that primitive i is triangle 2·first + i; those that are not there become degenerate
/// ones. Where some triangles have alpha there is a second list, in which they stand and the opaque ones are degenerate:
/// so only they ask the shader.
fn build_acceleration(gpu: &Arc<Gpu>, prepared: &Prepared) -> GpuResult<AccelerationStructures> {
    let slots = &prepared.arrays[SceneArray::Slots as usize];
    let mut geometry = Vec::new();
    for mesh in &prepared.meshes {
        let texels: &[Texel] = &slots[3 * mesh.slots.start as usize..3 * mesh.slots.end as usize];
        let words: &[u32] = bytemuck::cast_slice(texels);
        let vertices: Vec<[f32; 3]> = words.chunks_exact(3).map(|v| [v[0], v[1], v[2]].map(f32::from_bits)).collect();
        let slot_count = texels.len() / 3;
        let part = |opaque| MeshPart { indices: vec![[0_u32; 3]; 2 * slot_count], opaque };
        let (mut opaque, mut alpha) = (part(true), None);
        let mut is_leaf = vec![false; slot_count];
        for number in prepared.triangle_slots(mesh) {
            let i = number - 2 * mesh.slots.start;
            let has_alpha = prepared.triangle(number).record.kind & TRIANGLE_ALPHA != 0;
            let list = if has_alpha { alpha.get_or_insert_with(|| part(false)) } else { &mut opaque };
            let first = 4 * (i / 2);
            list.indices[i as usize] = [first, first + 1 + i % 2, first + 2 + i % 2];
            is_leaf[(i / 2) as usize] = true;
        }
        let parts: Vec<MeshPart> = [Some(opaque), alpha].into_iter().flatten().collect();
        geometry.push((keep_finite(vertices, &is_leaf), parts));
    }
    let meshes: Vec<_> = geometry.iter().map(|(vertices, parts)| MeshGeometry { vertices, parts }).collect();
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let mut instances = vec![InstanceGeometry { mesh: 0, transform: identity, custom_index: BAKED_INSTANCE }];
    instances.extend(prepared.instances.iter().zip(0..).map(|(instance, custom_index)| InstanceGeometry {
        mesh: instance.mesh,
        transform: instance.record.object_to_world,
        custom_index,
    }));
    AccelerationStructures::build(gpu, &meshes, &instances)
}

/// Words of inner slots read as floats can be NaN; only leaves' vertices matter.
fn keep_finite(mut vertices: Vec<[f32; 3]>, is_leaf: &[bool]) -> Vec<[f32; 3]> {
    for (quad, _) in vertices.chunks_exact_mut(4).zip(is_leaf).filter(|(_, is_leaf)| !**is_leaf) {
        quad.fill([0.0; 3]);
    }
    vertices
}
