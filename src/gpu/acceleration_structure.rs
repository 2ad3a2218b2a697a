//! Acceleration structures for hardware ray queries: one bottom level a mesh, one top level over the instances.

use std::sync::Arc;

use ash::vk;

use super::{Buffer, Dispatch, Gpu, GpuError, GpuResult, MemoryUse, Submission};

/// A mesh as vertices with one or more index lists. The index of a triangle in its list is what the shader sees.
pub struct MeshGeometry<'a> {
    /// Vertices.
    pub vertices: &'a [[f32; 3]],
    /// The lists; at least one.
    pub parts: &'a [MeshPart],
}

/// Some triangles of a mesh.
pub struct MeshPart {
    /// Three indices a triangle; degenerate triangles are allowed.
    pub indices: Vec<[u32; 3]>,
    /// Rays meet the triangles without asking the shader.
    pub opaque: bool,
}

/// A placed mesh.
pub struct InstanceGeometry {
    /// Index into the meshes.
    pub mesh: usize,
    /// Rows of the object-to-world matrix.
    pub transform: [[f32; 4]; 3],
    /// Number that the shader sees, 24 bits.
    pub custom_index: u32,
}

/// The built structures with their memory.
pub struct AccelerationStructures {
    levels: Vec<(vk::AccelerationStructureKHR, Buffer)>,
    gpu: Arc<Gpu>,
}

fn build_usage() -> vk::BufferUsageFlags {
    vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
}

impl AccelerationStructures {
    /// Builds all levels and waits.
    ///
    /// # Errors
    /// [`GpuError::Lacks`] on a device made without ray queries; out of memory.
    pub fn build(gpu: &Arc<Gpu>, meshes: &[MeshGeometry<'_>], instances: &[InstanceGeometry]) -> GpuResult<Self> {
        let mut built = Self { levels: Vec::new(), gpu: gpu.clone() };
        for mesh in meshes {
            built.build_mesh(mesh)?;
        }
        built.build_top_level(instances)?;
        Ok(built)
    }

    /// The structure that rays are traced against.
    pub fn top_level(&self) -> vk::AccelerationStructureKHR {
        self.levels.last().map_or(vk::AccelerationStructureKHR::null(), |(level, _)| *level)
    }

    /// Bytes of all structures.
    pub fn bytes(&self) -> u64 {
        self.levels.iter().map(|(_, buffer)| buffer.size).sum()
    }

    fn build_mesh(&mut self, mesh: &MeshGeometry<'_>) -> GpuResult<()> {
        let vertices = Buffer::with_data(&self.gpu, "acceleration structure vertices", mesh.vertices, build_usage())?;
        let lists: GpuResult<Vec<Buffer>> = mesh
            .parts
            .iter()
            .map(|part| Buffer::with_data(&self.gpu, "acceleration structure indices", &part.indices, build_usage()))
            .collect();
        let lists = lists?;
        let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: vertices.device_address() })
            .vertex_stride(12)
            .max_vertex(u32::try_from(mesh.vertices.len()).unwrap_or(u32::MAX).saturating_sub(1))
            .index_type(vk::IndexType::UINT32);
        let geometry = |part: &MeshPart, indices: &Buffer| {
            let address = vk::DeviceOrHostAddressConstKHR { device_address: indices.device_address() };
            let triangles = triangles.index_data(address);
            vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                .flags(if part.opaque { vk::GeometryFlagsKHR::OPAQUE } else { vk::GeometryFlagsKHR::empty() })
                .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        };
        let geometries: Vec<_> = mesh.parts.iter().zip(&lists).map(|(part, list)| geometry(part, list)).collect();
        let counts: Vec<u32> =
            mesh.parts.iter().map(|part| u32::try_from(part.indices.len()).unwrap_or(u32::MAX)).collect();
        self.build_level(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, &geometries, &counts)
    }

    fn build_top_level(&mut self, instances: &[InstanceGeometry]) -> GpuResult<()> {
        let addresses: Vec<u64> = self.levels.iter().map(|(level, _)| self.level_address(*level)).collect();
        let records: Vec<[u32; 16]> =
            instances.iter().map(|instance| instance_record(instance, addresses[instance.mesh])).collect();
        let buffer = Buffer::with_data(&self.gpu, "acceleration structure instances", &records, build_usage())?;
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: buffer.device_address() });
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        let count = u32::try_from(records.len()).unwrap_or(u32::MAX);
        self.build_level(vk::AccelerationStructureTypeKHR::TOP_LEVEL, &[geometry], &[count])
    }

    fn level_address(&self, level: vk::AccelerationStructureKHR) -> u64 {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(level);
        // SAFETY: the level was built on this device.
        self.gpu.acceleration.as_ref().map_or(0, |a| unsafe { a.get_acceleration_structure_device_address(&info) })
    }

    fn build_level(
        &mut self,
        level: vk::AccelerationStructureTypeKHR,
        geometries: &[vk::AccelerationStructureGeometryKHR<'_>],
        counts: &[u32],
    ) -> GpuResult<()> {
        let gpu = self.gpu.clone();
        let functions = gpu.acceleration.as_ref().ok_or_else(|| GpuError::Lacks {
            device: gpu.info.name.clone(),
            lacks: "was opened without ray queries".to_owned(),
        })?;
        let mut info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(level)
            .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(geometries);
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        // SAFETY: the geometry is described completely and its buffers live until the wait below.
        unsafe {
            functions.get_acceleration_structure_build_sizes(
                vk::AccelerationStructureBuildTypeKHR::DEVICE,
                &info,
                counts,
                &mut sizes,
            );
        }
        let usage =
            vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
        let storage =
            Buffer::new(&gpu, "acceleration structure", sizes.acceleration_structure_size, usage, MemoryUse::Device)?;
        // Scratch addresses need an alignment of at most 256 on every known device.
        let scratch_usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
        let scratch = Buffer::new(
            &gpu,
            "acceleration structure scratch",
            sizes.build_scratch_size + 256,
            scratch_usage,
            MemoryUse::Device,
        )?;
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .ty(level)
            .buffer(storage.raw)
            .size(sizes.acceleration_structure_size);
        // SAFETY: the storage buffer is as large as asked for.
        let structure = unsafe { functions.create_acceleration_structure(&create, None) }
            .map_err(GpuError::call("vkCreateAccelerationStructureKHR", "the scene"))?;
        self.levels.push((structure, storage));
        info.dst_acceleration_structure = structure;
        info.scratch_data =
            vk::DeviceOrHostAddressKHR { device_address: scratch.device_address().next_multiple_of(256) };
        let ranges: Vec<_> = counts
            .iter()
            .map(|&count| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count))
            .collect();
        let mut submission = Submission::new(&gpu, "building acceleration structures")?;
        submission.submit(&[Dispatch::Record(&|_, commands| {
            // SAFETY: all buffers live until the wait below.
            unsafe { functions.cmd_build_acceleration_structures(commands, &[info], &[&ranges]) };
        })])?;
        submission.wait()
    }
}

/// VkAccelerationStructureInstanceKHR as words: transform, custom index | mask, table offset | flags, reference.
fn instance_record(instance: &InstanceGeometry, address: u64) -> [u32; 16] {
    let mut record = [0; 16];
    for (word, value) in record.iter_mut().zip(instance.transform.iter().flatten()) {
        *word = value.to_bits();
    }
    record[12] = instance.custom_index | 0xff << 24;
    // Both sides are hit: back faces are shaded.
    record[13] = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw() << 24;
    record[14] = (address & 0xffff_ffff) as u32;
    record[15] = (address >> 32) as u32;
    record
}

impl Drop for AccelerationStructures {
    fn drop(&mut self) {
        for (level, _) in &self.levels {
            if let Some(functions) = &self.gpu.acceleration {
                // SAFETY: no submitted work uses the structure any more (submissions wait); its buffer goes after it.
                unsafe { functions.destroy_acceleration_structure(*level, None) };
            }
        }
    }
}
