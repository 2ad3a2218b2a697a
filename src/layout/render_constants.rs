//! What is the same for a whole render: camera, film, and where the records stand in the scene arrays.

use bytemuck::{Pod, Zeroable};

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
    /// Texels of a [`Vertex`](super::Vertex).
    pub vertex_texels: u32,
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Seed of the sampler.
    pub seed: u32,
    /// Largest number of scattering events.
    pub max_bounces: u32,
    /// First texel of the light BVH in [`SceneArray::Tables`](super::SceneArray::Tables), if lights are chosen by one.
    pub light_bvh: u32,
    /// Its share of the [`CDF_TOTAL`](super::CDF_TOTAL) counts, 0 without one.
    pub light_bvh_counts: u32,
    /// First texel of the vertices in [`SceneArray::Attributes`](super::SceneArray::Attributes).
    pub vertices: u32,
    /// Slot at which traversal starts.
    pub root_slot: u32,
    /// First texel of the materials in [`SceneArray::Tables`](super::SceneArray::Tables).
    pub materials: u32,
    /// First texel of the texture headers.
    pub textures: u32,
    /// First texel of the lights.
    pub lights: u32,
    /// First texel of the instances.
    pub instances: u32,
    /// First word of the light CDF in [`SceneArray::Tables`](super::SceneArray::Tables).
    pub light_cdf_word: u32,
    /// Number of lights.
    pub light_count: u32,
    /// Index of the environment among the lights, or [`NONE`](super::NONE) if it is not sampled.
    pub environment_light: u32,
    /// Environment image width.
    pub environment_width: u32,
    /// Environment image height.
    pub environment_height: u32,
    /// First word of its marginal CDF (over rows) in [`SceneArray::Environment`](super::SceneArray::Environment).
    pub environment_marginal_word: u32,
    /// First word of its conditional CDFs; row r starts at `+ r · (width + 1)`.
    pub environment_conditional_word: u32,
    /// First texel of the albedo table of GGX in [`SceneArray::Tables`](super::SceneArray::Tables), if a BSDF needs it.
    pub ggx_albedo: u32,
    /// Constant radiance, or the factor on the image.
    pub environment_radiance: [f32; 3],
    /// Cosine of the environment's rotation about +Y.
    pub environment_cos: f32,
    /// Centre of the scene's bounds.
    pub scene_center: [f32; 3],
    /// Sine of the environment's rotation about +Y.
    pub environment_sin: f32,
    /// Lights in the light BVH: those with a place, which come first.
    pub near_lights: u32,
    /// Most that a path may bring at once after two scattering events or more, largest component; 0 without a bound.
    pub clamp_indirect: f32,
    /// 0, which no compiler knows.
    pub zero: f32,
    /// 1 if the environment's texels are in RGBE, as quads (src/prepare/environment.rs).
    pub environment_rgbe: u32,
    /// Slot at which traversal starts when the large faces are compiled in (src/prepare/large_faces.rs).
    pub rest_root_slot: u32,
    /// Emission rays of a sample, in the pixels that are picked for them (src/render/emission_pixels.rs).
    pub emission_rays: u32,
    /// Unused, zero.
    pub unused_0: u32,
    /// Unused, zero.
    pub unused_1: u32,
}
