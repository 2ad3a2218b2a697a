//! The materials in use as the shader reads them, and the textures they need.

use super::PrepareError;
use super::alpha::Presence;
use super::emission::EmissionMap;
use super::features::Features;
use super::textures::{ColorSpace, Lookup, TextureTable};
use crate::layout::{
    BSDF_GLASS, BSDF_LAMBERTIAN, BSDF_METALLIC_ROUGHNESS, BSDF_MIRROR, BSDF_REFRACT, BSDF_UNLIT, MATERIAL_ALPHA_BLEND,
    MATERIAL_ALPHA_MASK, MATERIAL_BLACK_BACK, MATERIAL_DOUBLE_SIDED, MATERIAL_KIND_MASK, MATERIAL_SCHLICK,
    MATERIAL_VOLUME, Material, NONE, TEXTURE_MIPS, TEXTURE_SET_1, TRIANGLE_INDEX_MASK,
};
use crate::scene::{self, Bsdf, Fresnel, Scene, TextureBinding, Volume};

/// Below this α a lobe is a delta, as in shaders/include/ggx.glsl. Were it less here, light samples would only fail to pass some
/// walls that they could.
const SMALLEST_ALPHA: f32 = 1.0 / 4096.0;

/// The material table, with what later stages ask of a material.
#[derive(Debug, Default)]
pub(super) struct MaterialTable {
    /// Records by the index that leaf slots hold.
    pub records: Vec<Material>,
    /// By index of the scene's material.
    uses: Vec<Option<MaterialUse>>,
    /// Traversal decides where some surface is there.
    pub has_alpha: bool,
    /// By index of the record: the emission texture, if the surface emits by one.
    emission_maps: Vec<Option<EmissionMap>>,
}

/// What geometry must know of its material.
#[derive(Clone, Copy, Debug)]
pub(super) struct MaterialUse {
    /// Index of the record; none of a surface that is nowhere there.
    pub record: u32,
    /// Nothing of the surface is there.
    pub absent: bool,
    /// Traversal decides where it is there.
    pub alpha: bool,
    /// Which sets of texture coordinates are looked up.
    pub texcoord_sets: [bool; 2],
    /// Tangents matter.
    pub tangents: bool,
    /// Shading normals matter.
    pub shaded: bool,
    /// It emits somewhere, and its triangles are lights.
    pub emissive: bool,
}

impl MaterialUse {
    /// That of a surface that is nowhere there.
    const ABSENT: Self = Self {
        record: u32::MAX,
        absent: true,
        alpha: false,
        texcoord_sets: [false; 2],
        tangents: false,
        shaded: false,
        emissive: false,
    };
}

impl MaterialTable {
    /// Collects the materials that instanced meshes refer to, in order of first use.
    ///
    /// # Errors
    /// If there are more materials or texels than the layout can index.
    pub(super) fn new(scene: &Scene, textures: &mut TextureTable<'_>) -> Result<Self, PrepareError> {
        let mut table = Self { uses: vec![None; scene.materials.len()], ..Self::default() };
        let mut seen = vec![false; scene.meshes.len()];
        for instance in &scene.instances {
            if std::mem::replace(&mut seen[instance.mesh], true) {
                continue;
            }
            for primitive in scene.meshes[instance.mesh].primitives.iter().filter(|p| !p.triangles.is_empty()) {
                if table.uses[primitive.material].is_none() {
                    let used = table.add(scene, primitive.material, textures)?;
                    table.uses[primitive.material] = Some(used);
                    table.has_alpha |= used.alpha;
                }
            }
        }
        Ok(table)
    }

    /// What a material of the scene that is in use became.
    pub(super) fn used(&self, material: usize) -> MaterialUse {
        self.uses[material].expect("every placed primitive's material was collected")
    }

    /// The emission texture of a record.
    pub(super) fn emission_map(&self, record: u32) -> Option<&EmissionMap> {
        self.emission_maps[record as usize].as_ref()
    }

    /// Whether any surface has the lobes of GGX.
    pub(super) fn need_ggx(&self) -> bool {
        self.records.iter().any(|record| record.kind_flags & MATERIAL_KIND_MASK == BSDF_METALLIC_ROUGHNESS)
    }

    /// Whether any surface is the boundary of a volume by GGX.
    pub(super) fn need_dielectrics(&self) -> bool {
        self.records.iter().any(|record| {
            record.kind_flags & MATERIAL_KIND_MASK == BSDF_METALLIC_ROUGHNESS
                && record.kind_flags & MATERIAL_VOLUME != 0
        })
    }

    /// A bound on the share of a surface that is there, > 0, whatever its texture says. It weighs lights against each other.
    pub(super) fn largest_opacity(&self, record: u32) -> f64 {
        let record = &self.records[record as usize];
        if record.kind_flags & MATERIAL_ALPHA_BLEND != 0 { record.alpha.into() } else { 1.0 }
    }

    /// Adds what the materials need.
    pub(super) fn add_features(&self, textures: &TextureTable<'_>, features: &mut Features) {
        features.mip = textures.headers.iter().any(|header| header.sampling & TEXTURE_MIPS != 0);
        features.alpha = self.has_alpha;
        for record in &self.records {
            features.bsdfs |= 1 << (record.kind_flags & MATERIAL_KIND_MASK);
            features.textures |= textures_of(record).iter().any(|&texture| texture != NONE);
            features.emission_textures |= record.emission_texture != NONE;
            features.emission |= record.emission != [0.0; 3];
            features.normal_maps |= record.normal_texture != NONE;
            let solid = record.kind_flags & MATERIAL_VOLUME != 0;
            features.volume |= solid;
            features.transmission |= record.transmission > 0.0 && !solid;
            features.panes |= record.transmission > 0.0 && !solid && record.roughness.powi(2) < SMALLEST_ALPHA;
            features.specular |= has_specular(record);
            features.anisotropy |= record.anisotropy > 0.0;
            features.black_back |= record.kind_flags & MATERIAL_BLACK_BACK != 0;
            features.schlick |= record.kind_flags & MATERIAL_SCHLICK != 0;
        }
    }

    fn add(
        &mut self,
        scene: &Scene,
        index: usize,
        textures: &mut TextureTable<'_>,
    ) -> Result<MaterialUse, PrepareError> {
        let material = &scene.materials[index];
        let presence = Presence::of(scene, index);
        if presence == Presence::Absent {
            return Ok(MaterialUse::ABSENT);
        }
        let record_index = self.records.len() as u32;
        if record_index > TRIANGLE_INDEX_MASK {
            return Err(PrepareError::TooManyMaterials);
        }
        let mut bind = |binding: Option<TextureBinding>, needed: bool, space: ColorSpace, lookup: Lookup| match binding
        {
            Some(binding) if needed => textures.add(scene, binding, space, lookup),
            _ => Ok(NONE),
        };
        let alpha = presence != Presence::Opaque;
        // The colour of what is not there is anything: it must not be mixed into that of what is.
        let color_lookup = if alpha { Lookup::Exact } else { Lookup::Filtered };
        let shaded = material.bsdf != Bsdf::Unlit;
        let rough = material.bsdf == Bsdf::MetallicRoughness;
        // KHR_materials_unlit: emission is ignored.
        let may_emit = material.is_emissive() && material.bsdf != Bsdf::Unlit;
        let map = match material.emission_texture {
            Some(binding) if may_emit => Some(EmissionMap::new(scene, binding, material.emission)),
            _ => None,
        };
        let emissive = may_emit && !map.as_ref().is_some_and(EmissionMap::is_black);
        let anisotropy = if rough { material.anisotropy } else { 0.0 };
        let transmission = if rough { material.transmission } else { 0.0 };
        let record = Material {
            base_color: material.base_color,
            kind_flags: kind_flags(material, presence),
            emission: if emissive { material.emission } else { [0.0; 3] },
            roughness: material.roughness,
            metallic: material.metallic,
            ior: material.ior,
            transmission,
            alpha: material.alpha,
            base_color_texture: bind(
                material.base_color_texture,
                alpha || material.base_color != [0.0; 3],
                ColorSpace::Srgb,
                color_lookup,
            )?,
            metallic_roughness_texture: bind(
                material.metallic_roughness_texture,
                rough,
                ColorSpace::Linear,
                Lookup::Filtered,
            )?,
            emission_texture: bind(material.emission_texture, emissive, ColorSpace::Srgb, Lookup::Exact)?,
            normal_texture: bind(
                material.normal_texture,
                shaded && material.normal_scale != 0.0,
                ColorSpace::Linear,
                Lookup::Exact,
            )?,
            specular_color: material.specular_color,
            specular: material.specular,
            absorption: material.volume.map_or([0.0; 3], absorption),
            alpha_cutoff: if let Presence::Mask { cutoff } = presence { cutoff } else { 0.0 },
            anisotropy,
            anisotropy_turns: material.anisotropy_rotation_radians / std::f32::consts::TAU,
            normal_scale: material.normal_scale,
            unused: 0,
            transmission_texture: bind(
                material.transmission_texture,
                transmission > 0.0,
                ColorSpace::Linear,
                Lookup::Filtered,
            )?,
            specular_texture: bind(
                material.specular_texture,
                rough && material.specular > 0.0,
                ColorSpace::Linear,
                Lookup::Filtered,
            )?,
            specular_color_texture: bind(material.specular_color_texture, rough, ColorSpace::Srgb, Lookup::Filtered)?,
            anisotropy_texture: bind(material.anisotropy_texture, anisotropy > 0.0, ColorSpace::Linear, Lookup::Exact)?,
        };
        let mut texcoord_sets = [false; 2];
        for texture in textures_of(&record).into_iter().filter(|&texture| texture != NONE) {
            let second = textures.headers[texture as usize].sampling & TEXTURE_SET_1 != 0;
            texcoord_sets[usize::from(second)] = true;
        }
        let tangents = record.normal_texture != NONE || anisotropy > 0.0;
        self.records.push(record);
        self.emission_maps.push(map.filter(|_| emissive));
        Ok(MaterialUse { record: record_index, absent: false, alpha, texcoord_sets, tangents, shaded, emissive })
    }
}

/// Absorption coefficient in 1/m (KHR_materials_volume): −ln(color)/distance. A channel of 0 lets nothing pass: the largest
/// number does so too, over every distance above 10⁻³⁶ m.
fn absorption(volume: Volume) -> [f32; 3] {
    let distance = f64::from(volume.attenuation_distance);
    volume.attenuation_color.map(|c| (-f64::from(c).ln() / distance).min(f64::from(f32::MAX)) as f32)
}

/// Whether the reflection of a dielectric is not the plain one of its index of refraction.
fn has_specular(record: &Material) -> bool {
    let textured = record.specular_texture != NONE || record.specular_color_texture != NONE;
    record.kind_flags & MATERIAL_KIND_MASK == BSDF_METALLIC_ROUGHNESS
        && record.metallic < 1.0
        && (textured || record.specular != 1.0 || record.specular_color != [1.0; 3])
}

/// Indices of all its textures, or [`NONE`].
fn textures_of(record: &Material) -> [u32; 8] {
    [
        record.base_color_texture,
        record.metallic_roughness_texture,
        record.emission_texture,
        record.normal_texture,
        record.transmission_texture,
        record.specular_texture,
        record.specular_color_texture,
        record.anisotropy_texture,
    ]
}

fn kind_flags(material: &scene::Material, presence: Presence) -> u32 {
    let mut bits = match material.bsdf {
        Bsdf::Lambertian => BSDF_LAMBERTIAN,
        Bsdf::Mirror => BSDF_MIRROR,
        Bsdf::Refract => BSDF_REFRACT,
        Bsdf::Glass => BSDF_GLASS,
        Bsdf::MetallicRoughness => BSDF_METALLIC_ROUGHNESS,
        Bsdf::Unlit => BSDF_UNLIT,
    };
    if material.black_back {
        // A black back emits nothing, whatever else is said.
        bits |= MATERIAL_BLACK_BACK;
    } else if material.double_sided {
        bits |= MATERIAL_DOUBLE_SIDED;
    }
    if material.bsdf == Bsdf::Glass && material.fresnel == Fresnel::Schlick {
        bits |= MATERIAL_SCHLICK;
    }
    if material.volume.is_some() {
        bits |= MATERIAL_VOLUME;
    }
    match presence {
        Presence::Mask { .. } => bits | MATERIAL_ALPHA_MASK,
        Presence::Blend => bits | MATERIAL_ALPHA_BLEND,
        Presence::Opaque | Presence::Absent => bits,
    }
}
