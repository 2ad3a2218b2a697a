// The sampler: a pure function of (pixel, sample index, bounce, named dimension, seed). Dimension numbers never move,
// whatever a scene uses or a kernel drops.
#ifndef RNG_GLSL
#define RNG_GLSL
#include "features.glsl"
#include "sobol.glsl"

// Groups of four dimensions. Camera groups stand at bounce 0; the others at the number of the scattering event.
const uint DIMENSIONS_FILM = 0u;     // x, y in the pixel; lens u, v
const uint DIMENSIONS_TIME = 1u;     // time; filter; two in reserve
const uint DIMENSIONS_SCATTER = 2u;  // lobe; direction u, v; roulette
const uint DIMENSIONS_LIGHT = 3u;    // which light and position u; digits below that; position v; which strategy (mixture)
const uint DIMENSIONS_ENVIRONMENT = 4u;  // row; column; position u, v under the texel's tent
const uint DIMENSIONS_ALPHA = 5u;    // decisions about alpha: key of the path's ray; key of the shadow ray
const uint DIMENSIONS_EMISSION = 6u;  // emission rays: x, y in the pixel; lens u, v
const uint DIMENSIONS_EMISSION_ALPHA = 7u;  // decisions about alpha along them: key; two in reserve
const uint DIMENSION_GROUPS = 8u;

struct SampleKey {
    uint pixel;  // x | y << 16
    uint index;
    uint seed;
};

void pcg_mix(inout uvec4 v) {
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
}

// The four-dimensional PCG hash of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", with a third round: after
// their two, keys that differ in the upper half of one word alone (the y of a pixel) still make the lower half of the
// result repeat itself (tests/gpu/sampler.rs).
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    pcg_mix(v);
    v ^= v >> 16u;
    pcg_mix(v);
    v ^= v >> 16u;
    pcg_mix(v);
    return v;
}

// Four 32-bit values of a group of dimensions at a bounce, all independent.
uvec4 hashed_bits(SampleKey key, uint bounce, uint group) {
    return pcg4d(uvec4(key.pixel, key.index, bounce * DIMENSION_GROUPS + group, key.seed));
}

// The same as two Sobol' pairs, each in an order of its own (padding: PBR, 4th ed., §8.6.3). What belongs together is a
// pair: of scattering the two in the middle, of lights the first and the third, and what is left. A sample of `parts` has
// that many points of the sequence.
uvec4 sobol_bits(SampleKey key, uint parts, uint part, uint bounce, uint group) {
    uint x = key.pixel & 0xffffu;
    uint y = key.pixel >> 16u;
    uint replicate = 0u;
    if (SAMPLER == SAMPLER_SOBOL_REPLICATES) {
        // Those of src/film/replicates.rs: each a point set of its own.
        uint block = key.index / SOBOL_BLOCK;
        replicate = 1u + block % SOBOL_REPLICATES;
        key.index = block / SOBOL_REPLICATES * SOBOL_BLOCK + key.index % SOBOL_BLOCK;
    }
    key.index = key.index * parts + part;
    uint tile = x >> SOBOL_TILE | y >> SOBOL_TILE << 16u;
    uint z = morton(x & ((1u << SOBOL_TILE) - 1u), y & ((1u << SOBOL_TILE) - 1u));
    uvec4 a = pcg4d(uvec4(tile, replicate, bounce * DIMENSION_GROUPS + group, key.seed));
    uvec4 b = pcg4d(a);
    uvec2 first = sobol_pair(key.index, z, a);
    uvec2 second = sobol_pair(key.index, z, b);
    if (group == DIMENSIONS_SCATTER) return uvec4(second.x, first, second.y);
    if (group == DIMENSIONS_LIGHT) return uvec4(first.x, second.x, first.y, second.y);
    return uvec4(first, second);
}

// Four 32-bit values of a group of dimensions at a bounce.
uvec4 sample_bits(SampleKey key, uint bounce, uint group) {
    return SAMPLER == SAMPLER_INDEPENDENT ? hashed_bits(key, bounce, group) : sobol_bits(key, 1u, 0u, bounce, group);
}

// The same for one of several rays of a sample that do the same, at bounce 0. Up to 2^32 / parts samples no two are alike.
uvec4 sample_part_bits(SampleKey key, uint parts, uint part, uint group) {
    if (SAMPLER != SAMPLER_INDEPENDENT) return sobol_bits(key, parts, part, 0u, group);
    key.index = key.index * parts + part;
    return hashed_bits(key, 0u, group);
}

// [0, 1), in steps of 2^-24.
float to_unit(uint bits) { return float(bits >> 8u) * 5.9604644775390625e-8; }
vec4 to_unit(uvec4 bits) { return vec4(bits >> 8u) * 5.9604644775390625e-8; }

#endif
