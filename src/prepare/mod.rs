//! From a [`Scene`] to the arrays that the shader reads: placed triangles in BVH slots, packed materials and textures,
//! lights and the distributions by which they are picked, and what of the kernel the scene needs.

mod acceleration;
mod alpha;
mod attributes;
pub mod bounds;
pub mod bvh;
mod camera;
pub mod cdf;
mod coincident;
mod emission;
pub mod environment;
mod environment_quads;
mod features;
mod geometry;
mod ggx;
mod instances;
mod kept;
mod large_faces;
pub mod light_bvh;
pub mod light_cone;
mod lights;
mod materials;
mod mip;
mod near_lamps;
mod pack;
mod pairs;
mod textures;
mod vertices;

use std::ops::Range;
use std::time::Instant;

use glam::DVec3;

pub use bvh::BvhQuality;
pub use camera::camera_constants;
pub use environment::EnvironmentKind;
pub use features::Features;
pub use kept::{Kept, Reuse};
pub use lights::{spot_falloff, spot_solid_angle};
pub use textures::srgb_to_linear;

use self::materials::MaterialTable;
use self::pack::{pack, pack_words};
use self::textures::TextureTable;
use crate::layout::{
    InstanceRecord, LeafSlot, NONE, RenderConstants, SCENE_ARRAYS, SceneArray, TRIANGLE_INDEX_MASK, TRIANGLE_LIGHT,
    Texel, Triangle,
};
use crate::named_enum::named_enum;
use crate::scene::Scene;

/// Coordinates beyond this many metres from the camera are refused: the square of a distance must stay in f32, and so
/// must the area of the whole.
pub const COORDINATE_LIMIT: f64 = (1u64 << 60) as f64;

/// How to prepare.
#[derive(Clone, Debug)]
pub struct PrepareOptions {
    /// World position of the camera that will see the scene.
    pub camera: DVec3,
    /// How an environment image is sampled.
    pub environment_sampling: EnvironmentSampling,
    /// The environment is among the lights that are picked; otherwise only rays that leave the scene find it.
    pub sample_environment: bool,
    /// Makes mip chains, by which textures are looked up as finely as the path that asks needs it.
    pub mip: bool,
    /// How a light is picked.
    pub light_choice: LightChoice,
    /// How good the trees are.
    pub bvh_quality: BvhQuality,
    /// Bakes every instance into the world: more memory, one level of traversal.
    pub bake_instances: bool,
}

impl Default for PrepareOptions {
    fn default() -> Self {
        Self {
            camera: DVec3::ZERO,
            environment_sampling: EnvironmentSampling::default(),
            sample_environment: true,
            mip: true,
            light_choice: LightChoice::default(),
            bvh_quality: BvhQuality::default(),
            bake_instances: false,
        }
    }
}

named_enum! {
    /// How directions to an image environment are chosen.
    EnvironmentSampling, "environment sampling" {
        /// In proportion to what is above its mean luminance, and to a sixteenth of the rest, which BSDF samples find: MIS
        /// compensation (Karlík et al. 2019, "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance
        /// Sampling").
        #[default]
        Compensated = "compensated",
        /// In proportion to its luminance.
        Importance = "importance",
        /// Evenly over the sphere.
        Uniform = "uniform",
    }
}

named_enum! {
    /// How a light is picked at a vertex.
    LightChoice, "light choice" {
        /// By a tree over the lights that have a place: power, distance and orientation count.
        #[default]
        Bvh = "bvh",
        /// By power, wherever the vertex is.
        Power = "power",
        /// All alike.
        Uniform = "uniform",
    }
}

/// Why a scene cannot be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// A coordinate does not fit.
    #[error("`{name}` reaches further than {limit:e} m from the camera; scale the scene down or move it nearer")]
    TooFar {
        /// Node, mesh or light.
        name: String,
        /// [`COORDINATE_LIMIT`].
        limit: f64,
    },
    /// The BVH has no numbers left.
    #[error("too many triangles: the BVH can number {} slots", 4u64 << bvh::GROUP_BITS)]
    TooManySlots,
    /// Vertex records have no numbers left.
    #[error("too many vertices with normals or texture coordinates: at most 2³¹ can be addressed")]
    TooManyVertices,
    /// Materials have no numbers left.
    #[error("too many materials: a triangle can refer to 2²⁶")]
    TooManyMaterials,
    /// Lights have no numbers left.
    #[error("too many emissive triangles: at most 2²⁶ in a mesh, and 2²⁹ lights in all, can be addressed")]
    TooManyLights,
    /// The texel array has no numbers left.
    #[error("the textures are larger than 16 GiB together; scale them down")]
    TooManyTexels,
    /// The environment array has no numbers left.
    #[error("the environment image of {width}×{height} texels is too large; scale it down")]
    EnvironmentTooLarge {
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
    },
}

/// A scene as the device reads it.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// World position of the rebased space's zero.
    pub origin: DVec3,
    /// Contents of the scene arrays by [`SceneArray`], one texel at least.
    pub arrays: [Vec<Texel>; SCENE_ARRAYS],
    /// The scene's part of the constants; film, camera (see [`camera_constants`]) and sampler are zero.
    pub constants: RenderConstants,
    /// What the kernel must do.
    pub features: Features,
    /// The traced meshes: first the baked world, then those that instances share.
    pub meshes: Vec<PreparedMesh>,
    /// Placements of the shared meshes.
    pub instances: Vec<PreparedInstance>,
    /// Figures for people.
    pub statistics: Statistics,
}

/// A mesh with a tree of its own.
#[derive(Clone, Debug)]
pub struct PreparedMesh {
    /// Name from the file, or `world`.
    pub name: String,
    /// Slot of its root.
    pub root_slot: u32,
    /// Slot of the root above all but the large leaves, which stand before the others; the root if there are none.
    pub rest_root_slot: u32,
    /// Leaves so large that they stand in a tree apart: see `large_faces`.
    pub large_leaves: u32,
    /// All of its slots, inner ones, empty ones and the world's instances among them; see [`Prepared::triangle_slots`].
    pub slots: Range<u32>,
    /// Number of triangles.
    pub triangles: u32,
    /// Inner slots on the longest path.
    pub depth: u32,
    /// Number of inner slots.
    pub inner_slots: u32,
    /// Slots that a random ray through its box is expected to visit, not counting what is inside instances.
    pub sah_cost: f64,
}

/// A placed mesh.
#[derive(Clone, Copy, Debug)]
pub struct PreparedInstance {
    /// As the shader reads it.
    pub record: InstanceRecord,
    /// Index into [`Prepared::meshes`].
    pub mesh: usize,
    /// Index into `Scene::instances`.
    pub source: usize,
}

/// Figures about a prepared scene.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// Triangles stored.
    pub triangles: u64,
    /// Triangles that rays can meet: shared ones count once an instance.
    pub placed_triangles: u64,
    /// Instances.
    pub instances: u64,
    /// Inner nodes of all trees.
    pub inner_slots: u64,
    /// Inner nodes on the longest path, through an instance into its mesh.
    pub depth: u32,
    /// Slots that a random ray through the scene's box is expected to visit.
    pub sah_cost: f64,
    /// Lights.
    pub lights: u64,
    /// Nodes of the light BVH.
    pub light_nodes: u64,
    /// Bytes of each array.
    pub array_bytes: [u64; SCENE_ARRAYS],
    /// Seconds for placing triangles and building the trees.
    pub bvh_seconds: f64,
    /// Seconds in all.
    pub seconds: f64,
}

/// Prepares a valid scene.
///
/// # Errors
/// If something in it is larger or further away than the layout can express.
pub fn prepare(scene: &Scene, options: &PrepareOptions) -> Result<Prepared, PrepareError> {
    prepare_again(scene, options, &Kept::default())
}

/// The same with what was kept of other calls: bit for bit what [`prepare`] makes.
///
/// # Errors
/// Those of [`prepare`].
pub fn prepare_again(scene: &Scene, options: &PrepareOptions, kept: &Kept) -> Result<Prepared, PrepareError> {
    let start = Instant::now();
    let mut textures = TextureTable::new(options.mip, kept);
    let materials = MaterialTable::new(scene, &mut textures)?;
    let bvh_start = Instant::now();
    let mut geometry = geometry::gather(scene, options, &materials)?;
    let camera = options.camera - geometry.origin;
    let mut acceleration = acceleration::build(&mut geometry, camera, options.bvh_quality, kept)?;
    let bvh_seconds = bvh_start.elapsed().as_secs_f64();
    let sampling = if options.sample_environment { options.environment_sampling } else { EnvironmentSampling::Uniform };
    let environment = kept.environment(&scene.environment, sampling)?;
    let lights = lights::gather(scene, &geometry, &mut acceleration, &materials, &environment, options)?;
    let mut features = pack::features(&geometry, &acceleration, &materials, &textures, &environment, &lights);
    features.near_lamps = lights.kinds() & (1 << crate::layout::LIGHT_TRIANGLE) != 0 && near_lamps::any(scene);
    let mut statistics = pack::statistics(&acceleration, &lights);
    let instances = pack::prepared_instances(&acceleration);
    let meshes = std::mem::take(&mut acceleration.meshes);
    let origin = geometry.origin;
    let (arrays, mut constants) =
        pack::pack_arrays(geometry, acceleration, &materials, textures, environment, &lights, &features);
    (constants.root_slot, constants.rest_root_slot) =
        meshes.first().map_or((0, 0), |world| (world.root_slot, world.rest_root_slot));
    statistics.array_bytes = [0, 1, 2, 3, 4].map(|i: usize| (arrays[i].len() * size_of::<Texel>()) as u64);
    statistics.bvh_seconds = bvh_seconds;
    statistics.seconds = start.elapsed().as_secs_f64();
    Ok(Prepared { origin, arrays, constants, features, meshes, instances, statistics })
}

/// Luminance of linear Rec.709 RGB.
fn luminance([r, g, b]: [f32; 3]) -> f64 {
    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
}

impl Prepared {
    /// Numbers of a mesh's triangles (see [`LeafSlot`]), ascending.
    pub fn triangle_slots<'a>(&'a self, mesh: &PreparedMesh) -> impl Iterator<Item = u32> + use<'a> {
        self.triangles_in(mesh.slots.clone())
    }

    /// Numbers of the triangles in a mesh's large leaves, ascending.
    pub fn large_triangle_slots<'a>(&'a self, mesh: &PreparedMesh) -> impl Iterator<Item = u32> + use<'a> {
        let leaves = mesh.slots.clone().filter(|&slot| bvh::triangles_in(&self.slot(slot)) > 0);
        self.triangles_in(leaves.take(mesh.large_leaves as usize))
    }

    fn triangles_in(&self, slots: impl Iterator<Item = u32>) -> impl Iterator<Item = u32> {
        slots.flat_map(|slot| (0..bvh::triangles_in(&self.slot(slot))).map(move |k| 2 * slot + k))
    }

    fn slot(&self, slot: u32) -> bvh::Slot {
        let texels = &self.arrays[SceneArray::Slots as usize][3 * slot as usize..][..3];
        [texels[0], texels[1], texels[2]]
    }

    /// A triangle by its number, as the shader reads it.
    pub fn triangle(&self, number: u32) -> PreparedTriangle {
        let [a, b, c, d] = bytemuck::cast::<bvh::Slot, LeafSlot>(self.slot(number / 2)).vertices;
        let attributes = &self.arrays[SceneArray::Attributes as usize];
        let record = if self.constants.vertex_texels > 0 {
            bytemuck::cast(attributes[number as usize])
        } else {
            Triangle { vertices: [NONE; 3], kind: attributes.as_flattened()[number as usize] }
        };
        let index = record.kind & TRIANGLE_INDEX_MASK;
        let light = if record.kind & TRIANGLE_LIGHT != 0 { Some(index) } else { None };
        PreparedTriangle { vertices: if number.is_multiple_of(2) { [a, b, c] } else { [a, c, d] }, record, light }
    }
}

/// A triangle with what stands in its record.
#[derive(Clone, Copy, Debug)]
pub struct PreparedTriangle {
    /// Its vertices in the space of its mesh.
    pub vertices: [[f32; 3]; 3],
    /// Its record; without vertices where none are stored.
    pub record: Triangle,
    /// Its light, in an instanced mesh relative to the instance's first; then the material is in the light's record.
    pub light: Option<u32>,
}
