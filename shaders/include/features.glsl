// What a scene and its settings need: specialisation constants, so that the rest leaves no code behind. The host's side
// is src/gpu/kernel.rs. The defaults switch everything on.
#ifndef FEATURES_GLSL
#define FEATURES_GLSL
#include "layout.glsl"

layout(constant_id = 2) const uint BSDFS = 0x3fu;
layout(constant_id = 3) const uint LIGHTS = 0x1fu;
layout(constant_id = 4) const uint FEATURES = 0xffffffffu;
layout(constant_id = 5) const uint INTEGRATOR = 7u;
layout(constant_id = 6) const uint LIGHT_SAMPLING = 0u;
layout(constant_id = 7) const uint MIS_HEURISTIC = 1u;
layout(constant_id = 8) const uint ENVIRONMENT_SAMPLING = 0u;
layout(constant_id = 9) const uint STACK_SIZE = 64u;
layout(constant_id = 10) const uint SAMPLER = 0u;
layout(constant_id = 11) const uint LIGHT_CHOICE = 1u;
layout(constant_id = 12) const uint BAKED = 0u;
layout(constant_id = 13) const uint AOVS = 0x3fu;
layout(constant_id = 14) const uint STATISTICS = 1u;

const bool HAS_TEXTURES = (FEATURES & 1u) != 0u;
const bool HAS_INSTANCES = (FEATURES & 2u) != 0u;
const bool HAS_NORMALS = (FEATURES & 4u) != 0u;
const bool HAS_CONSTANT_ENVIRONMENT = (FEATURES & 8u) != 0u;
const bool HAS_IMAGE_ENVIRONMENT = (FEATURES & 16u) != 0u;
const bool HAS_LENS = (FEATURES & 32u) != 0u;
const bool HAS_ORTHOGRAPHIC = (FEATURES & 64u) != 0u;
const bool HAS_BLACK_BACKS = (FEATURES & 128u) != 0u;
const bool HAS_NORMAL_MAPS = (FEATURES & 256u) != 0u;
const bool HAS_VERTEX_COLORS = (FEATURES & 512u) != 0u;
const bool HAS_ALPHA = (FEATURES & 1024u) != 0u;
const bool HAS_ANISOTROPY = (FEATURES & 2048u) != 0u;
const bool HAS_SPECULAR = (FEATURES & 4096u) != 0u;
const bool HAS_TRANSMISSION = (FEATURES & 8192u) != 0u;
const bool HAS_VOLUME = (FEATURES & 16384u) != 0u;
const bool HAS_MIP = (FEATURES & 32768u) != 0u;
const bool HAS_NEAR_LAMPS = (FEATURES & 65536u) != 0u;
const bool CLAMPS_INDIRECT = (FEATURES & 131072u) != 0u;
const bool HAS_PANES = (FEATURES & 262144u) != 0u;
// A kernel with everything switched on, for any scene. A kernel that is built for a scene must not ask: a branch on nothing
// but uniforms that takes much code away makes lavapipe copy and optimise the whole kernel anew at every dispatch.
const bool FOR_ANY_SCENE = (FEATURES & 524288u) != 0u;
const bool HAS_RGBE_ENVIRONMENT = (FEATURES & 1048576u) != 0u;
const bool HAS_EMISSION_RAYS = (FEATURES & 2097152u) != 0u;

// Whether triangles have records with vertices, or only their kinds.
const bool HAS_ATTRIBUTES = HAS_NORMALS || HAS_TEXTURES || HAS_NORMAL_MAPS || HAS_ANISOTROPY || HAS_VERTEX_COLORS;

// What is compiled in as literals (src/gpu/specialize/bake.rs).
const bool BAKES_GEOMETRY = (BAKED & 1u) != 0u;
const bool BAKES_MATERIALS = (BAKED & 2u) != 0u;
const bool BAKES_LIGHTS = (BAKED & 4u) != 0u;
// Of the geometry the largest faces alone (src/prepare/large_faces.rs).
const bool BAKES_LARGE_FACES = (BAKED & 8u) != 0u;

#define HAS_BSDF(kind) ((BSDFS & (1u << (kind))) != 0u)
#define HAS_LIGHT(kind) ((LIGHTS & (1u << (kind))) != 0u)
#define HAS_AOV(kind) ((AOVS & (1u << (kind))) != 0u)

// What a run keeps besides radiance.
const bool HAS_AOVS = AOVS != 0u;
const bool HAS_STATISTICS = STATISTICS != 0u;
const bool HAS_COST = (AOVS & (1u << AOV_COST)) != 0u;
// Of names, not of expressions: those glslang would make no constant.
const bool COUNTS_VISITS = HAS_STATISTICS || HAS_COST;
const bool HAS_EXTRAS = HAS_STATISTICS || HAS_AOVS;

// Which scattering counts the image adds up.
const bool ADDS_EMISSION = (INTEGRATOR & 1u) != 0u;
const bool ADDS_DIRECT = (INTEGRATOR & 2u) != 0u;
const bool ADDS_INDIRECT = (INTEGRATOR & 4u) != 0u;

const uint LIGHT_SAMPLING_MIS = 0u;
const uint LIGHT_SAMPLING_MIXTURE = 1u;
const uint LIGHT_SAMPLING_NEE = 2u;
const uint LIGHT_SAMPLING_BSDF = 3u;

const uint SAMPLER_INDEPENDENT = 0u;
const uint SAMPLER_SOBOL = 1u;
const uint SAMPLER_SOBOL_REPLICATES = 2u;

const uint LIGHT_CHOICE_TABLE = 0u;
const uint LIGHT_CHOICE_BVH = 1u;
const bool HAS_LIGHT_BVH = LIGHT_CHOICE == LIGHT_CHOICE_BVH;

const uint MIS_BALANCE = 0u;
const uint MIS_POWER = 1u;

const uint ENVIRONMENT_SAMPLING_IMPORTANCE = 0u;
const uint ENVIRONMENT_SAMPLING_UNIFORM = 1u;

#endif
