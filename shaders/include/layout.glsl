// Every struct and constant shared with the host. The other half is src/layout/, where each field is documented;
// tests/gpu/layout.rs holds the two together.
#ifndef LAYOUT_GLSL
#define LAYOUT_GLSL
#include "debug.glsl"

const uint NONE = 0xffffffffu;

const uint SLOT_INNER = 0xffffffffu;
const uint SLOT_INSTANCE = 0xfffffffeu;
const uint SLOT_NO_LEAF = 0xff800000u;
const uint SLOT_GROUP = 4u;
const uint SLOT_TEXELS = 3u;

const uint TRIANGLE_LIGHT = 0x80000000u;
const uint TRIANGLE_ALPHA = 0x40000000u;
const uint TRIANGLE_COLORS = 0x20000000u;
const uint TRIANGLE_TANGENTS = 0x10000000u;
const uint TRIANGLE_TEXCOORDS = 0x8000000u;
const uint TRIANGLE_NORMALS = 0x4000000u;
const uint TRIANGLE_ATTRIBUTES = 0x3c000000u;
const uint TRIANGLE_INDEX_MASK = 0x03ffffffu;

const uint BSDF_LAMBERTIAN = 0u;
const uint BSDF_MIRROR = 1u;
const uint BSDF_REFRACT = 2u;
const uint BSDF_GLASS = 3u;
const uint BSDF_METALLIC_ROUGHNESS = 4u;
const uint BSDF_UNLIT = 5u;
const uint MATERIAL_KIND_MASK = 0xffu;
const uint MATERIAL_DOUBLE_SIDED = 0x100u;
const uint MATERIAL_BLACK_BACK = 0x200u;
const uint MATERIAL_SCHLICK = 0x400u;
const uint MATERIAL_VOLUME = 0x800u;
const uint MATERIAL_ALPHA_MASK = 0x1000u;
const uint MATERIAL_ALPHA_BLEND = 0x2000u;
const uint MATERIAL_TEXELS = 8u;

const uint GGX_ALBEDO_SIZE = 48u;
const uvec3 DIELECTRIC_ALBEDO_SIZE = uvec3(40u, 20u, 40u);
const uvec4 GGX_ANISOTROPIC_SIZES = uvec4(24u, 12u, 12u, 20u);

const uint TEXTURE_SRGB = 1u;
const uint TEXTURE_16_BIT = 2u;
const uint TEXTURE_NEAREST = 4u;
const uint TEXTURE_SET_1 = 8u;
const uint TEXTURE_WRAP_U_SHIFT = 4u;
const uint TEXTURE_WRAP_V_SHIFT = 6u;
const uint TEXTURE_TRANSFORMED = 0x100u;
const uint TEXTURE_MIPS = 0x200u;
const uint TEXTURE_TEXELS = 3u;

const uint LIGHT_TRIANGLE = 0u;
const uint LIGHT_POINT = 1u;
const uint LIGHT_SPOT = 2u;
const uint LIGHT_DIRECTIONAL = 3u;
const uint LIGHT_ENVIRONMENT = 4u;
const uint LIGHT_TEXELS = 4u;
const uint LIGHT_BVH_TEXELS = 8u;
const uint LIGHT_BVH_LEAF = 0x80000000u;

const uint INSTANCE_TEXELS = 7u;
const uint CDF_TOTAL = 0x80000000u;

const uint PROJECTION_PERSPECTIVE = 0u;
const uint PROJECTION_ORTHOGRAPHIC = 1u;

const uint BLOCK_SAMPLES = 16u;
const uint DEBUG_RECORDS = 64u;

const uint AOV_ALBEDO = 0u;
const uint AOV_NORMAL = 1u;
const uint AOV_DEPTH = 2u;
const uint AOV_POSITION = 3u;
const uint AOV_COVERAGE = 4u;
const uint AOV_COST = 5u;

struct RenderConstants {
    vec3 camera_origin;
    float lens_radius;
    vec3 camera_right;
    float focus_distance;
    vec3 camera_up;
    uint projection;
    vec3 camera_forward;
    uint vertex_texels;
    uint width;
    uint height;
    uint seed;
    uint max_bounces;
    uint light_bvh;
    uint light_bvh_counts;
    uint vertices;
    uint root_slot;
    uint materials;
    uint textures;
    uint lights;
    uint instances;
    uint light_cdf_word;
    uint light_count;
    uint environment_light;
    uint environment_width;
    uint environment_height;
    uint environment_marginal_word;
    uint environment_conditional_word;
    uint ggx_albedo;
    vec3 environment_radiance;
    float environment_cos;
    vec3 scene_center;
    float environment_sin;
    uint near_lights;
    float clamp_indirect;
    float zero;
    uint environment_rgbe;
    uint rest_root_slot;
    uint emission_rays;
    uint unused_0;
    uint unused_1;
};

struct SliceConstants {
    uint lanes;
    uint atoms;
    uint most_samples;
    uint ray_budget;
    uint resume;
    uint prints;
};

struct Atom {
    uint pixel;
    uint first_sample;
    uint end_sample;
};

struct SliceQueue {
    uint taken;
    uint done;
};

struct BlockResult {
    float sum_r;
    float sum_g;
    float sum_b;
    float luminance_squared;
    float compensation_r;
    float compensation_g;
    float compensation_b;
    uint rays_and_samples;      // samples in the low 5 bits
    uint non_finite_and_capped; // 16 bits each, non_finite in the low ones
};

struct AovSums {
    vec3 albedo;
    uint hits;
    vec3 normal;
    float depth;
    vec3 position;
    uint visits;
};

struct RayCounters {
    uvec3 rays;
    uint search_steps;
    uvec3 nodes;
    uint search_vectors;
    uvec3 triangles;
    uint shading_vectors;
    uint vector_width;
    uint shadings;
    uint unused_0;
    uint unused_1;
};

// Scene-array records, decoded from texels by records.glsl.
struct Material {
    vec3 base_color;
    uint kind_flags;
    vec3 emission;
    float roughness;
    float metallic;
    float ior;
    float transmission;
    float alpha;
    uint base_color_texture;
    uint metallic_roughness_texture;
    uint emission_texture;
    uint normal_texture;
    vec3 specular_color;
    float specular;
    vec3 absorption;
    float alpha_cutoff;
    float anisotropy;
    float anisotropy_turns;
    float normal_scale;
    uint unused;
    uint transmission_texture;
    uint specular_texture;
    uint specular_color_texture;
    uint anisotropy_texture;
};

struct TextureHeader {
    uint first_word;
    uint width;
    uint height;
    uint sampling;
    vec3 u_row;
    uint mips;
    vec3 v_row;
};

struct Light {
    uint kind;
    uint slot;
    uint instance;
    uint material;
    vec3 position;
    float cone_scale;
    vec3 intensity;
    float cone_offset;
    vec3 direction;
};

#endif
