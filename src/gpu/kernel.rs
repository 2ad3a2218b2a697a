//! Compute kernels: a pipeline with its bindings, and sets of resources for them.

use std::sync::Arc;

use ash::vk;

use super::specialize::{declared_bindings, specialize};
use super::{AccelerationStructures, Buffer, Gpu, GpuError, GpuResult};

/// How the shader traces rays (macro TRACE_BACKEND).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u32)]
pub enum TraceBackend {
    /// Our own BVH.
    Bvh = 0,
    /// Hardware ray queries.
    RayQuery = 1,
}

impl std::fmt::Display for TraceBackend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Bvh => "bvh",
            Self::RayQuery => "ray-query",
        })
    }
}

/// How the shader reads the scene arrays (macro ARRAY_FORM).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u32)]
pub enum ArrayForm {
    /// rgba32ui texel buffers: the cheapest divergent load on software devices.
    TexelBuffer = 0,
    /// Storage buffers.
    StorageBuffer = 1,
    /// Buffer device addresses: no limit but memory.
    DeviceAddress = 2,
}

impl std::fmt::Display for ArrayForm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::TexelBuffer => "texel-buffer",
            Self::StorageBuffer => "storage-buffer",
            Self::DeviceAddress => "device-address",
        })
    }
}

/// What a binding holds.
#[derive(Clone, Copy)]
pub enum BindingResource<'a> {
    /// One uniform buffer.
    Uniform(&'a Buffer),
    /// One storage buffer.
    Storage(&'a Buffer),
    /// An array of storage buffers.
    StorageArray(&'a [&'a Buffer]),
    /// An array of texel buffers.
    TexelArray(&'a [&'a Buffer]),
    /// The top-level acceleration structure.
    AccelerationStructure(&'a AccelerationStructures),
}

impl BindingResource<'_> {
    fn descriptor_type(&self) -> vk::DescriptorType {
        match self {
            Self::Uniform(_) => vk::DescriptorType::UNIFORM_BUFFER,
            Self::Storage(_) | Self::StorageArray(_) => vk::DescriptorType::STORAGE_BUFFER,
            Self::TexelArray(_) => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
            Self::AccelerationStructure(_) => vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
        }
    }

    fn count(&self) -> u32 {
        match self {
            Self::StorageArray(buffers) | Self::TexelArray(buffers) => u32::try_from(buffers.len()).unwrap_or(u32::MAX),
            _ => 1,
        }
    }
}

/// What a kernel is made from.
pub struct KernelDescription<'a> {
    /// Name for messages.
    pub name: &'a str,
    /// The shader.
    pub spirv: &'a [u32],
    /// Lanes of a workgroup (specialisation constant 0).
    pub workgroup_size: u32,
    /// Further specialisation constants: id and value.
    pub constants: &'a [(u32, u32)],
    /// Leave all specialisation to the driver, as where [`specialize`] cannot do it.
    pub driver_specializes: bool,
    /// Bytes of push constants.
    pub push_constant_bytes: u32,
    /// For each set of resources, what is bound at which number: all sets have the same numbers and types. What the
    /// shader, as specialised, does not declare is not bound.
    pub sets: &'a [&'a [(u32, BindingResource<'a>)]],
}

/// A pipeline with its sets of resources.
pub struct Kernel {
    /// Name for messages.
    pub name: String,
    /// Lanes of a workgroup.
    pub workgroup_size: u32,
    pub(super) pipeline: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) sets: Vec<vk::DescriptorSet>,
    /// What the shader, as specialised, declares; `None` is everything.
    declared: Option<Vec<u32>>,
    set_layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    gpu: Arc<Gpu>,
}

impl Kernel {
    /// Compiles the kernel and fills its sets.
    ///
    /// # Errors
    /// When the driver refuses the shader or memory runs out.
    pub fn new(gpu: &Arc<Gpu>, description: &KernelDescription<'_>) -> GpuResult<Self> {
        // Owned from the start, so that an error on the way frees what was made (null handles are ignored by Vulkan).
        let mut kernel = Self {
            name: description.name.to_owned(),
            workgroup_size: description.workgroup_size,
            pipeline: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            sets: Vec::new(),
            declared: None,
            set_layout: vk::DescriptorSetLayout::null(),
            pool: vk::DescriptorPool::null(),
            gpu: gpu.clone(),
        };
        let mut constants = vec![(0, description.workgroup_size)];
        constants.extend_from_slice(description.constants);
        let specialized = if description.driver_specializes { None } else { specialize(description.spirv, &constants) };
        let spirv = specialized.as_deref().unwrap_or(description.spirv);
        kernel.declared = declared_bindings(spirv);
        let sets = kernel.declared_of(description.sets);
        kernel.create_layouts(description, &sets[0])?;
        kernel.create_pipeline(spirv, &constants)?;
        kernel.create_sets(&sets)?;
        Ok(kernel)
    }

    /// Binds other resources of the same types, as many sets as there were; none of them may be in use. After an error it is as it was.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn rebind(&mut self, sets: &[&[(u32, BindingResource<'_>)]]) -> GpuResult<()> {
        self.create_sets(&self.declared_of(sets))
    }

    fn declared_of<'a>(&self, sets: &[&[(u32, BindingResource<'a>)]]) -> Vec<Vec<(u32, BindingResource<'a>)>> {
        let is_bound = |number: u32| self.declared.as_ref().is_none_or(|declared| declared.contains(&number));
        sets.iter().map(|set| set.iter().filter(|(number, _)| is_bound(*number)).copied().collect()).collect()
    }

    fn create_layouts(
        &mut self,
        description: &KernelDescription<'_>,
        set: &[(u32, BindingResource<'_>)],
    ) -> GpuResult<()> {
        let device = &self.gpu.device;
        let bindings: Vec<_> = set
            .iter()
            .map(|(binding, resource)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(*binding)
                    .descriptor_type(resource.descriptor_type())
                    .descriptor_count(resource.count())
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive and the pointers outlive the calls.
        unsafe {
            self.set_layout = device
                .create_descriptor_set_layout(&info, None)
                .map_err(GpuError::call("vkCreateDescriptorSetLayout", &self.name))?;
            let range = [vk::PushConstantRange::default()
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
                .size(description.push_constant_bytes)];
            let layouts = [self.set_layout];
            let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
            if description.push_constant_bytes > 0 {
                info = info.push_constant_ranges(&range);
            }
            self.layout = device
                .create_pipeline_layout(&info, None)
                .map_err(GpuError::call("vkCreatePipelineLayout", &self.name))?;
        }
        Ok(())
    }

    fn create_pipeline(&mut self, spirv: &[u32], constants: &[(u32, u32)]) -> GpuResult<()> {
        let device = &self.gpu.device;
        let entries: Vec<_> = constants
            .iter()
            .zip(0u32..)
            .map(|((id, _), i)| vk::SpecializationMapEntry::default().constant_id(*id).offset(4 * i).size(4))
            .collect();
        let values: Vec<u32> = constants.iter().map(|(_, value)| *value).collect();
        let specialization =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
        let module_info = vk::ShaderModuleCreateInfo::default().code(spirv);
        // SAFETY: the SPIR-V is from our compiler; all pointers outlive the calls; the module may go once the pipeline
        // is made.
        unsafe {
            let module = device
                .create_shader_module(&module_info, None)
                .map_err(GpuError::call("vkCreateShaderModule", &self.name))?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main")
                .specialization_info(&specialization);
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout)];
            let pipelines = device.create_compute_pipelines(self.gpu.pipeline_cache.raw(), &info, None);
            device.destroy_shader_module(module, None);
            self.pipeline =
                pipelines.map_err(|(_, result)| GpuError::call("vkCreateComputePipelines", &self.name)(result))?[0];
        }
        self.gpu.pipeline_cache.store(device);
        Ok(())
    }

    fn create_sets(&mut self, sets: &[Vec<(u32, BindingResource<'_>)>]) -> GpuResult<()> {
        let device = &self.gpu.device;
        let set_count = u32::try_from(sets.len()).unwrap_or(u32::MAX);
        let sizes: Vec<_> = sets[0]
            .iter()
            .map(|(_, r)| {
                vk::DescriptorPoolSize::default().ty(r.descriptor_type()).descriptor_count(r.count() * set_count)
            })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(set_count).pool_sizes(&sizes);
        // SAFETY: the device is alive; the pool is sized for exactly these sets; those of the old one, if any, are in no
        // submitted work.
        unsafe {
            let pool = device
                .create_descriptor_pool(&info, None)
                .map_err(GpuError::call("vkCreateDescriptorPool", &self.name))?;
            let layouts = vec![self.set_layout; sets.len()];
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
            match device.allocate_descriptor_sets(&info) {
                Ok(sets) => self.sets = sets,
                Err(error) => {
                    device.destroy_descriptor_pool(pool, None);
                    return Err(GpuError::call("vkAllocateDescriptorSets", &self.name)(error));
                }
            }
            device.destroy_descriptor_pool(std::mem::replace(&mut self.pool, pool), None);
        }
        for (set, resources) in self.sets.iter().zip(sets) {
            for (binding, resource) in resources {
                self.write_binding(*set, *binding, *resource);
            }
        }
        Ok(())
    }

    fn write_binding(&self, set: vk::DescriptorSet, binding: u32, resource: BindingResource<'_>) {
        let mut structures = vk::WriteDescriptorSetAccelerationStructureKHR::default();
        let structure_handles;
        let mut buffers = Vec::new();
        let mut views = Vec::new();
        let whole = |b: &Buffer| vk::DescriptorBufferInfo::default().buffer(b.raw).range(vk::WHOLE_SIZE);
        match resource {
            BindingResource::Uniform(b) | BindingResource::Storage(b) => buffers.push(whole(b)),
            BindingResource::StorageArray(all) => buffers.extend(all.iter().map(|b| whole(b))),
            BindingResource::TexelArray(all) => views.extend(all.iter().map(|b| b.texel_view())),
            BindingResource::AccelerationStructure(_) => {}
        }
        let mut write = vk::WriteDescriptorSet::default()
            .dst_set(set)
            .dst_binding(binding)
            .descriptor_type(resource.descriptor_type())
            .buffer_info(&buffers)
            .texel_buffer_view(&views);
        write.descriptor_count = resource.count();
        if let BindingResource::AccelerationStructure(a) = resource {
            structure_handles = [a.top_level()];
            structures = structures.acceleration_structures(&structure_handles);
            write = write.push_next(&mut structures);
        }
        // SAFETY: the set belongs to this kernel and is in no submitted work; resources outlive the kernel's use.
        unsafe { self.gpu.device.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for Kernel {
    fn drop(&mut self) {
        // SAFETY: submissions wait before they go, so no work uses the pipeline; null handles are allowed.
        unsafe {
            self.gpu.device.destroy_pipeline(self.pipeline, None);
            self.gpu.device.destroy_pipeline_layout(self.layout, None);
            self.gpu.device.destroy_descriptor_pool(self.pool, None);
            self.gpu.device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
