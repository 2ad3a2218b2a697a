// The environment: latitude/longitude, north pole (0, 1, 0), u = atan2(z, x)/2π, top row north. The image is interpolated
// bilinearly (wrapping in u, clamped in v); a cell is one texel wide around its centre.
#ifndef ENVIRONMENT_GLSL
#define ENVIRONMENT_GLSL
#include "cdf.glsl"
#include "features.glsl"
#include "layout.glsl"
#include "math.glsl"
#include "rng.glsl"

struct EnvironmentSample {
    vec3 direction;
    vec3 radiance;
    float pdf;  // per solid angle
};

vec3 environment_from_world(RenderConstants constants, vec3 w) {
    float c = constants.environment_cos;
    float s = constants.environment_sin;
    return vec3(c * w.x - s * w.z, w.y, s * w.x + c * w.z);
}
vec3 environment_to_world(RenderConstants constants, vec3 w) {
    float c = constants.environment_cos;
    float s = constants.environment_sin;
    return vec3(c * w.x + s * w.z, w.y, -s * w.x + c * w.z);
}

vec2 environment_uv(vec3 w) {
    float sine = sqrt(w.x * w.x + w.z * w.z);
    // The polar angle is at most half a turn.
    return vec2(turns(w.z, w.x), 2.0 * turns(sine, w.y));
}

vec3 environment_texel(RenderConstants constants, int x, int y) {
    int width = int(constants.environment_width);
    x = x < 0 ? x + width : (x >= width ? x - width : x);
    y = clamp(y, 0, int(constants.environment_height) - 1);
    return uintBitsToFloat(LOAD4(ENVIRONMENT, uint(y * width + x)).xyz);
}

vec3 environment_lookup(RenderConstants constants, vec2 uv) {
    vec2 p = uv * vec2(constants.environment_width, constants.environment_height) - 0.5;
    vec2 corner = floor(p);
    vec2 f = p - corner;
    int x = int(corner.x);
    int y = int(corner.y);
    vec3 top = mix(environment_texel(constants, x, y), environment_texel(constants, x + 1, y), f.x);
    vec3 bottom = mix(environment_texel(constants, x, y + 1), environment_texel(constants, x + 1, y + 1), f.x);
    return mix(top, bottom, f.y) * constants.environment_radiance;
}

// Radiance that arrives from direction `w`.
vec3 environment_radiance(RenderConstants constants, vec3 w) {
    if (HAS_IMAGE_ENVIRONMENT)
        return environment_lookup(constants, environment_uv(environment_from_world(constants, w)));
    if (HAS_CONSTANT_ENVIRONMENT) return constants.environment_radiance;
    return vec3(0.0);
}

// Density of a cell of probability p at sin θ: p·w·h / (2π² sin θ).
float environment_cell_pdf(RenderConstants constants, float probability, float sine) {
    return probability * float(constants.environment_width) * float(constants.environment_height) /
           (2.0 * PI * PI * sine);
}

uint environment_row_word(RenderConstants constants, uint row) {
    return constants.environment_conditional_word + row * (constants.environment_width + 1u);
}

bool environment_is_sampled_by_cells() {
    return HAS_IMAGE_ENVIRONMENT && ENVIRONMENT_SAMPLING == ENVIRONMENT_SAMPLING_IMPORTANCE;
}

// `bits`: row, column, position in the cell (u, v).
EnvironmentSample environment_sample(RenderConstants constants, uvec4 bits) {
    if (!environment_is_sampled_by_cells()) {
        float cosine = 1.0 - 2.0 * to_unit(bits.x);
        vec2 horizontal = cos_sin_turns(to_unit(bits.y)) * sqrt(max(0.0, 1.0 - cosine * cosine));
        vec3 w = vec3(horizontal.x, cosine, horizontal.y);
        return EnvironmentSample(w, environment_radiance(constants, w), 0.25 * INV_PI);
    }
    CdfSample row = cdf_sample_ENVIRONMENT(constants.environment_marginal_word, constants.environment_height, bits.x);
    CdfSample column = cdf_sample_ENVIRONMENT(environment_row_word(constants, row.index),
                                              constants.environment_width, bits.y);
    // In the open cell, so that sin θ > 0 at the poles too.
    vec2 inside = (vec2(bits.zw >> 9u) + 0.5) * 1.1920928955078125e-7;
    vec2 uv = (vec2(column.index, row.index) + inside) / vec2(constants.environment_width, constants.environment_height);
    vec2 polar = cos_sin_turns(0.5 * uv.y);
    vec2 azimuth = cos_sin_turns(uv.x);
    vec3 w = vec3(azimuth.x * polar.y, polar.x, azimuth.y * polar.y);
    return EnvironmentSample(environment_to_world(constants, w), environment_lookup(constants, uv),
                             environment_cell_pdf(constants, row.probability * column.probability, polar.y));
}

// Density with which environment_sample draws direction `w`.
float environment_pdf(RenderConstants constants, vec3 w) {
    if (!environment_is_sampled_by_cells()) return 0.25 * INV_PI;
    vec3 local = environment_from_world(constants, w);
    vec2 uv = environment_uv(local);
    uint x = min(uint(uv.x * float(constants.environment_width)), constants.environment_width - 1u);
    uint y = min(uint(uv.y * float(constants.environment_height)), constants.environment_height - 1u);
    float probability = cdf_probability_ENVIRONMENT(constants.environment_marginal_word, y) *
                        cdf_probability_ENVIRONMENT(environment_row_word(constants, y), x);
    float sine = sqrt(local.x * local.x + local.z * local.z);
    return probability > 0.0 ? environment_cell_pdf(constants, probability, sine) : 0.0;
}

#endif
