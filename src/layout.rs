//! Every struct and constant that a shader reads or writes. The other half is `shaders/include/layout.glsl`;
//! `tests/gpu/layout.rs` holds the two together.
//!
//! Scene data lies in a few arrays of 16-byte texels, which the shader reads through one accessor (`load4(array, index)`,
//! see `shaders/include/arrays.glsl`) as texel buffer, storage buffer or device address. A struct here is a whole number
//! of texels.

use bytemuck::{Pod, Zeroable};

/// "No index": no texture, no light, no hit.
pub const NONE: u32 = u32::MAX;

/// One 16-byte element of a scene array.
pub type Texel = [u32; 4];

/// The scene arrays, in binding order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum SceneArray {
    /// BVH slots: [`InnerSlot`], [`LeafSlot`], [`InstanceSlot`].
    Slots = 0,
    /// [`Triangle`] records or their kinds, then [`Vertex`] records.
    Attributes = 1,
    /// Small tables: materials, texture headers, lights, the light CDF, instances.
    Tables = 2,
    /// Texels of all images, packed words.
    Texels = 3,
    /// Environment radiance, its marginal and its conditional CDFs.
    Environment = 4,
}

/// Number of [`SceneArray`]s.
pub const SCENE_ARRAYS: usize = 5;
/// An array larger than a device's limit is split into at most this many chunks.
pub const MAX_CHUNKS: usize = 4;

/// `kind` of an inner slot. Read as a float it is NaN, which the last word of a [`LeafSlot`] never is.
pub const SLOT_INNER: u32 = 0xffffffff;
/// `kind` of an instance.
pub const SLOT_INSTANCE: u32 = 0xfffffffe;
/// The least last word of a slot that is no leaf: the bits of −∞, above those of every finite float.
pub const SLOT_NO_LEAF: u32 = 0xff800000;
/// Slots stand in groups of this many: the children of one inner slot.
pub const SLOT_GROUP: u32 = 4;

/// An inner node of the four-wide BVH, with its children's boxes quantised to 8 bits on a grid of its own.
/// Box k spans, on each axis, `origin + lower.k · 2^(e−127)` to `origin + upper.k · 2^(e−127)`, with child k's 8 bits at
/// bit 8k. An absent child has lower 255 and upper 0, and its slot is all zero.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct InnerSlot {
    /// Origin of the grid.
    pub origin: [f32; 3],
    /// Biased exponents of the grid's steps: x at bit 0, y at bit 8, z at bit 16.
    pub exponents: u32,
    /// Lower bounds, one word an axis.
    pub lower: [u32; 3],
    /// Upper bounds, one word an axis.
    pub upper: [u32; 3],
    /// The children are slots `4·child_group` to `4·child_group + 3`.
    pub child_group: u32,
    /// [`SLOT_INNER`].
    pub kind: u32,
}

/// One triangle, or two that share an edge and turn the same way: (0, 1, 2) and (0, 2, 3), vertices as they are (so that
/// neighbours test a shared edge alike). Where there is one, vertex 3 is vertex 0. Its triangles have the numbers
/// twice its slot and one more.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LeafSlot {
    /// Vertices, finite, counter-clockwise seen from the front.
    pub vertices: [[f32; 3]; 4],
}

/// A placed mesh: traversal goes on at the instance's root with the ray in object space.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct InstanceSlot {
    /// Unused, zero.
    pub unused: [u32; 9],
    /// Index of the [`InstanceRecord`].
    pub instance: u32,
    /// Unused, zero.
    pub unused_too: u32,
    /// [`SLOT_INSTANCE`].
    pub kind: u32,
}

/// Texels a slot takes.
pub const SLOT_TEXELS: u32 = 3;

/// Bit of a triangle's `kind`: its index is that of a light, of which it is the triangle, and whose record has the material;
/// in an instanced mesh, relative to the instance's first light.
pub const TRIANGLE_LIGHT: u32 = 1 << 31;
/// Bit of `kind`: the material's alpha decides whether a ray meets it.
pub const TRIANGLE_ALPHA: u32 = 1 << 30;
/// Bit of `kind`: the vertices carry colours.
pub const TRIANGLE_COLORS: u32 = 1 << 29;
/// Bit of `kind`: the vertices carry tangents.
pub const TRIANGLE_TANGENTS: u32 = 1 << 28;
/// Bit of `kind`: the vertices carry texture coordinates.
pub const TRIANGLE_TEXCOORDS: u32 = 1 << 27;
/// Bit of `kind`: the vertices carry normals.
pub const TRIANGLE_NORMALS: u32 = 1 << 26;
/// Bits of `kind` that say what the vertices carry.
pub const TRIANGLE_ATTRIBUTES: u32 = 0x3c000000;
/// Bits of `kind` that hold the index of the material or light.
pub const TRIANGLE_INDEX_MASK: u32 = (1 << 26) - 1;

/// What shading needs of a triangle beyond its positions, by its number. Where the kernel reads no attributes of vertices
/// ([`RenderConstants::vertex_texels`] is 0), the `kind`s alone are stored, four a texel.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// Indices of [`Vertex`] records.
    pub vertices: [u32; 3],
    /// `TRIANGLE_*` bits and index.
    pub kind: u32,
}

/// Shading attributes of a vertex, in the space of its mesh (world for baked meshes). A scene stores of each vertex
/// [`RenderConstants::vertex_texels`] texels: the first; the second where it has texture coordinates or tangents; the third
/// where it has tangents; and as the last the colour where it has colours.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Vertex {
    /// Unit shading normal.
    pub normal: [f32; 3],
    /// Texture coordinate u of set 0.
    pub u: f32,
    /// Texture coordinate v of set 0.
    pub v: f32,
    /// Texture coordinate u of set 1.
    pub u_1: f32,
    /// Texture coordinate v of set 1.
    pub v_1: f32,
    /// Unused, zero.
    pub unused: f32,
    /// Unit tangent, or zero.
    pub tangent: [f32; 3],
    /// The bitangent is this sign, 1 or −1, times normal × tangent.
    pub bitangent_sign: f32,
    /// Linear colour and alpha, in [0, 1].
    pub color: [f32; 4],
}

/// [`Material`] `kind`: Lambertian.
pub const BSDF_LAMBERTIAN: u32 = 0;
/// [`Material`] `kind`: mirror.
pub const BSDF_MIRROR: u32 = 1;
/// [`Material`] `kind`: refract.
pub const BSDF_REFRACT: u32 = 2;
/// [`Material`] `kind`: glass.
pub const BSDF_GLASS: u32 = 3;
/// [`Material`] `kind`: metallic-roughness.
pub const BSDF_METALLIC_ROUGHNESS: u32 = 4;
/// [`Material`] `kind`: unlit.
pub const BSDF_UNLIT: u32 = 5;
/// Bits of `kind_flags` that hold the BSDF.
pub const MATERIAL_KIND_MASK: u32 = 0xff;
/// `kind_flags`: emits from both sides.
pub const MATERIAL_DOUBLE_SIDED: u32 = 1 << 8;
/// `kind_flags`: the back neither scatters nor emits.
pub const MATERIAL_BLACK_BACK: u32 = 1 << 9;
/// `kind_flags`: glass with Schlick's Fresnel term.
pub const MATERIAL_SCHLICK: u32 = 1 << 10;

/// `kind_flags`: KHR_materials_volume: transmission refracts into what the surface encloses.
pub const MATERIAL_VOLUME: u32 = 1 << 11;
/// `kind_flags`: alpha says whether the surface is there.
pub const MATERIAL_ALPHA_MASK: u32 = 1 << 12;
/// `kind_flags`: alpha is the probability that the surface is there.
pub const MATERIAL_ALPHA_BLEND: u32 = 1 << 13;

/// A material's parameters; see `scene::Material`. Textures are indices of [`TextureHeader`]s or [`NONE`]. A shader reads
/// the texels of what its scene needs alone.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Material {
    /// Linear colour.
    pub base_color: [f32; 3],
    /// One of `BSDF_*` and `MATERIAL_*` flags.
    pub kind_flags: u32,
    /// Radiance.
    pub emission: [f32; 3],
    /// Perceptual roughness.
    pub roughness: f32,
    /// Metalness.
    pub metallic: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Share of the diffuse base that transmits.
    pub transmission: f32,
    /// Factor on the base colour's alpha.
    pub alpha: f32,
    /// Base colour and alpha.
    pub base_color_texture: u32,
    /// Roughness in G, metalness in B.
    pub metallic_roughness_texture: u32,
    /// Emission.
    pub emission_texture: u32,
    /// Tangent-space normals.
    pub normal_texture: u32,
    /// Colour of the dielectric's reflectance at normal incidence.
    pub specular_color: [f32; 3],
    /// Strength of the dielectric's reflection.
    pub specular: f32,
    /// Absorption coefficient of the volume in 1/m.
    pub absorption: [f32; 3],
    /// With [`MATERIAL_ALPHA_MASK`]: the surface is there where alpha is at least this.
    pub alpha_cutoff: f32,
    /// Strength of the anisotropy.
    pub anisotropy: f32,
    /// Angle of the anisotropy from the tangent, in turns.
    pub anisotropy_turns: f32,
    /// Scales the x and y of normals from the texture.
    pub normal_scale: f32,
    /// Unused, zero.
    pub unused: u32,
    /// Transmission in R.
    pub transmission_texture: u32,
    /// Strength of the specular reflection in A.
    pub specular_texture: u32,
    /// Colour of the specular reflection.
    pub specular_color_texture: u32,
    /// Anisotropy: direction in R and G, strength in B.
    pub anisotropy_texture: u32,
}

/// Nodes of the albedo table of GGX along each of its coordinates. A texel holds a node and the one after it.
pub const GGX_ALBEDO_SIZE: u32 = 48;

/// Nodes of the albedo table of rough dielectrics along its coordinates, for each side. It stands before that of GGX. A texel
/// holds a node and the three next to it along the first two coordinates, 16 bits a number.
pub const DIELECTRIC_ALBEDO_SIZE: [u32; 3] = [40, 20, 40];

/// Nodes of the table of anisotropic albedos along each of its coordinates: direction (polar angle), azimuth, ratio of the
/// two roughnesses, larger roughness.
pub const GGX_ANISOTROPIC_SIZES: [u32; 4] = [24, 12, 12, 20];

/// Texels a material takes.
pub const MATERIAL_TEXELS: u32 = 8;

/// `sampling`: texels are sRGB-encoded (alpha never is).
pub const TEXTURE_SRGB: u32 = 1;
/// `sampling`: 16 bits a channel (two words a texel, R | G << 16 first) instead of 8 (R | G << 8 | B << 16 | A << 24).
pub const TEXTURE_16_BIT: u32 = 2;
/// `sampling`: nearest texel instead of bilinear.
pub const TEXTURE_NEAREST: u32 = 4;
/// `sampling`: looked up by the second set of texture coordinates.
pub const TEXTURE_SET_1: u32 = 8;
/// `sampling`: shift of the wrap mode along u; 0 repeat, 1 mirrored repeat, 2 clamp to edge.
pub const TEXTURE_WRAP_U_SHIFT: u32 = 4;
/// `sampling`: shift of the wrap mode along v.
pub const TEXTURE_WRAP_V_SHIFT: u32 = 6;
/// `sampling`: the transform is not the identity.
pub const TEXTURE_TRANSFORMED: u32 = 1 << 8;
/// `sampling`: lookups by a ray cone use the mip chain.
pub const TEXTURE_MIPS: u32 = 1 << 9;

/// Where a texture's texels are, by which coordinates and how they are read.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct TextureHeader {
    /// First word in [`SceneArray::Texels`].
    pub first_word: u32,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `TEXTURE_*` bits.
    pub sampling: u32,
    /// u′ of the lookup is the dot product with (u, v, 1).
    pub u_row: [f32; 3],
    /// With [`TEXTURE_MIPS`]: word in [`SceneArray::Texels`] of the list of the first words of the levels 1, 2, … to the
    /// one of a single texel. Level l has max(1, ⌊size/2ˡ⌋) texels along each side, of 16 bits a channel, linear.
    pub mips: u32,
    /// v′ of the lookup is the dot product with (u, v, 1).
    pub v_row: [f32; 3],
    /// Unused, zero.
    pub unused: u32,
}

/// Texels a texture header takes.
pub const TEXTURE_TEXELS: u32 = 3;

/// [`Light`] `kind`: emissive triangle.
pub const LIGHT_TRIANGLE: u32 = 0;
/// [`Light`] `kind`: point.
pub const LIGHT_POINT: u32 = 1;
/// [`Light`] `kind`: spot.
pub const LIGHT_SPOT: u32 = 2;
/// [`Light`] `kind`: directional.
pub const LIGHT_DIRECTIONAL: u32 = 3;
/// [`Light`] `kind`: the environment.
pub const LIGHT_ENVIRONMENT: u32 = 4;

/// A light that can be sampled. Lights are picked by the CDF at `light_cdf_word`; with a light BVH its bins are the lights
/// without a place, which come last, then the tree. The first texel is all that a triangle needs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Light {
    /// One of `LIGHT_*`.
    pub kind: u32,
    /// Number of the triangle ([`LIGHT_TRIANGLE`]), see [`LeafSlot`].
    pub slot: u32,
    /// Instance of the triangle or [`NONE`].
    pub instance: u32,
    /// Material of the triangle.
    pub material: u32,
    /// Position (point, spot).
    pub position: [f32; 3],
    /// Spot: falloff = clamp(cos θ · scale + offset, 0, 1)².
    pub cone_scale: f32,
    /// Radiant intensity or, for a directional light, irradiance.
    pub intensity: [f32; 3],
    /// See `cone_scale`.
    pub cone_offset: f32,
    /// Direction the light travels (spot, directional), unit.
    pub direction: [f32; 3],
    /// The way to its leaf in the light BVH: two bits a node, the root's lowest.
    pub trail: u32,
}

/// Texels a light takes.
pub const LIGHT_TEXELS: u32 = 4;

/// A node of the light BVH: its four children, structure by structure.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LightNode {
    /// Centres of spheres around the lights (rebased world space).
    pub x: [f32; 4],
    /// See `x`.
    pub y: [f32; 4],
    /// See `x`.
    pub z: [f32; 4],
    /// Their radii, > 0.
    pub radius: [f32; 4],
    /// The upper half of the f32 of the largest intensity to any direction, relative to all lights'; below it the sines of
    /// half the angles by which normals lie off the axis (8 bits, of 255) and by which light lies off a normal (7 bits, of
    /// 127), and a bit that is set if light also goes the other way. All rounded up.
    pub cones: [u32; 4],
    /// Axis of the normals: x and y on the octahedron |x| + |y| + |z| = 1 in 16 bits each, of 32767, x the lower.
    pub axes: [u32; 4],
    /// Number of the child's node, or [`LIGHT_BVH_LEAF`] and its light.
    pub children: [u32; 4],
    /// How many lights the child has; 0 if there is no child.
    pub lights: [u32; 4],
}

/// Texels a node of the light BVH takes.
pub const LIGHT_BVH_TEXELS: u32 = 8;
/// [`LightNode::children`]: it is a light.
pub const LIGHT_BVH_LEAF: u32 = 1 << 31;

/// A placed mesh.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct InstanceRecord {
    /// Rows of the 3×4 matrix from object to (rebased) world space.
    pub object_to_world: [[f32; 4]; 3],
    /// Rows of its inverse.
    pub world_to_object: [[f32; 4]; 3],
    /// Slot of the mesh's root.
    pub root_slot: u32,
    /// First of the instance's lights.
    pub first_light: u32,
    /// 1 if the transform mirrors, so that the winding's front is the other side.
    pub mirrored: u32,
    /// Unused, zero.
    pub unused: u32,
}

/// Texels an instance takes.
pub const INSTANCE_TEXELS: u32 = 7;

/// A CDF of n bins is n+1 words, from 0 to this total; bin i has probability (cdf\[i+1\] − cdf\[i\]) / total.
pub const CDF_TOTAL: u32 = 1 << 31;

/// Projection: pinhole or thin lens.
pub const PROJECTION_PERSPECTIVE: u32 = 0;
/// Projection: orthographic.
pub const PROJECTION_ORTHOGRAPHIC: u32 = 1;

/// Constants of one render (uniform buffer, std140: only 16-byte rows).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct RenderConstants {
    /// Camera position in rebased world space.
    pub camera_origin: [f32; 3],
    /// Thin lens radius, 0 for a pinhole.
    pub lens_radius: f32,
    /// Half the film's width on the plane at distance 1 (orthographic: in world units), along the camera's right.
    pub camera_right: [f32; 3],
    /// Distance of the plane in focus.
    pub focus_distance: f32,
    /// Half the film's height, along the camera's up.
    pub camera_up: [f32; 3],
    /// One of `PROJECTION_*`.
    pub projection: u32,
    /// Unit viewing direction.
    pub camera_forward: [f32; 3],
    /// Texels of a [`Vertex`].
    pub vertex_texels: u32,
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Seed of the sampler.
    pub seed: u32,
    /// Largest number of scattering events.
    pub max_bounces: u32,
    /// First sample index of the range rendered.
    pub first_sample: u32,
    /// One past its last sample index.
    pub end_sample: u32,
    /// First texel of the vertices in [`SceneArray::Attributes`].
    pub vertices: u32,
    /// Slot at which traversal starts.
    pub root_slot: u32,
    /// First texel of the materials in [`SceneArray::Tables`].
    pub materials: u32,
    /// First texel of the texture headers.
    pub textures: u32,
    /// First texel of the lights.
    pub lights: u32,
    /// First texel of the instances.
    pub instances: u32,
    /// First word of the light CDF in [`SceneArray::Tables`].
    pub light_cdf_word: u32,
    /// Number of lights.
    pub light_count: u32,
    /// Index of the environment among the lights, or [`NONE`] if it is not sampled.
    pub environment_light: u32,
    /// Environment image width.
    pub environment_width: u32,
    /// Environment image height.
    pub environment_height: u32,
    /// First word of its marginal CDF (over rows) in [`SceneArray::Environment`].
    pub environment_marginal_word: u32,
    /// First word of its conditional CDFs; row r starts at `+ r · (width + 1)`.
    pub environment_conditional_word: u32,
    /// First texel of the albedo table of GGX in [`SceneArray::Tables`], if a BSDF needs it.
    pub ggx_albedo: u32,
    /// Constant radiance, or the factor on the image.
    pub environment_radiance: [f32; 3],
    /// Cosine of the environment's rotation about +Y.
    pub environment_cos: f32,
    /// Centre of the scene's bounds.
    pub scene_center: [f32; 3],
    /// Sine of the environment's rotation about +Y.
    pub environment_sin: f32,
    /// First texel of the light BVH in [`SceneArray::Tables`], if lights are chosen by one.
    pub light_bvh: u32,
    /// Its share of the [`CDF_TOTAL`] counts, 0 without one.
    pub light_bvh_counts: u32,
    /// Lights in it: those with a place, which come first.
    pub near_lights: u32,
    /// Most that a path may bring at once after two scattering events or more, largest component; 0 without a bound.
    pub clamp_indirect: f32,
    /// 0, which no compiler knows.
    pub zero: f32,
    /// Unused, zero.
    pub unused: [u32; 3],
}

/// What a slice renders: the atoms `0..atoms`, atom i being block `first_block` + a / pixels of pixel a mod pixels with
/// a = `first_atom` + i. Lanes `0..lanes` take them from a [`SliceQueue`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct SliceConstants {
    /// First atom, counted within `first_block`.
    pub first_atom: u32,
    /// Number of lanes.
    pub lanes: u32,
    /// Aligned block of 16 sample indices that `first_atom` belongs to.
    pub first_block: u32,
    /// A lane saves its state after this many rays of an atom and goes on in the next dispatch.
    pub ray_budget: u32,
    /// 1 if the lanes go on from their saved state.
    pub resume: u32,
    /// Number of atoms.
    pub atoms: u32,
    /// 1 if the only lane writes what it prints behind its result (shaders/include/debug.glsl).
    pub prints: u32,
    /// Unused, zero.
    pub unused: u32,
}

/// The atoms of a slice, of which a lane takes the next when it has finished one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct SliceQueue {
    /// Times that an atom was asked for; beyond `atoms` there was none.
    pub taken: u32,
    /// Atoms that are complete.
    pub done: u32,
}

/// Most values that a lane prints.
pub const DEBUG_RECORDS: u32 = 64;

/// Samples of an aligned block.
pub const BLOCK_SAMPLES: u32 = 16;

/// The result of one atom: the sums over the samples of one pixel and block.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BlockResult {
    /// Sum of radiance; the exact sum is `sum + compensation`.
    pub sum: [f32; 3],
    /// Sum of squared sample luminance.
    pub luminance_squared: f32,
    /// Low part of the compensated sum.
    pub compensation: [f32; 3],
    /// Rays traced.
    pub rays: u32,
    /// Bit i: sample i of the block was not finite.
    pub non_finite: u32,
    /// Bit i: a path of sample i was cut off by the safety cap on bounces.
    pub capped: u32,
    /// Paths that were ended in this block (samples).
    pub samples: u32,
    /// Unused, zero.
    pub unused: u32,
}

/// Bits of the AOVs that a kernel sums, by number (`AOVS` of shaders/include/features.glsl).
///
/// Base colour.
pub const AOV_ALBEDO: u32 = 0;
/// Shading normal.
pub const AOV_NORMAL: u32 = 1;
/// Depth along the camera's axis.
pub const AOV_DEPTH: u32 = 2;
/// Position.
pub const AOV_POSITION: u32 = 3;
/// Share of the camera's rays that meet a surface.
pub const AOV_COVERAGE: u32 = 4;
/// What searches visit.
pub const AOV_COST: u32 = 5;

/// The AOVs of one atom: sums over its samples of what the camera's rays meet. What is not asked for is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AovSums {
    /// Base colours.
    pub albedo: [f32; 3],
    /// Camera rays that met a surface.
    pub hits: u32,
    /// Shading normals, world space, on the side that is seen.
    pub normal: [f32; 3],
    /// Distances along the camera's viewing direction.
    pub depth: f32,
    /// Positions in rebased world space.
    pub position: [f32; 3],
    /// Nodes and triangles visited by all rays of the samples; stops at the largest number.
    pub visits: u32,
}

/// Counters of one atom, for statistics. Triples are by kind of ray: camera, scattered, shadow. Each stops at the largest
/// number.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RayCounters {
    /// Rays traced.
    pub rays: [u32; 3],
    /// Steps of searches that the lane took part in.
    pub search_steps: u32,
    /// Nodes visited.
    pub nodes: [u32; 3],
    /// Steps that its subgroup ran, where this lane was the one to count them.
    pub search_vectors: u32,
    /// Triangles tested.
    pub triangles: [u32; 3],
    /// Times that its subgroup shaded surfaces, where this lane was the one to count them.
    pub shading_vectors: u32,
    /// Lanes of a subgroup.
    pub vector_width: u32,
    /// Surfaces shaded.
    pub shadings: u32,
    /// Unused, zero.
    pub unused: [u32; 2],
}

/// Bytes of a lane's saved state (`LaneState` in shaders/include/lane.glsl), which only shaders look into.
pub const LANE_STATE_BYTES: usize = 304;
