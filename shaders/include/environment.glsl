// The environment: latitude/longitude, north pole (0, 1, 0), u = atan2(z, x)/2π, top row north. The image is interpolated
// bilinearly (wrapping in u, clamped in v): a sum of texels, each times a tent two texels wide. So a texel is picked, then
// a point under its tent; the density is the probabilities of the texels, interpolated as the radiance is.
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

bool environment_is_sampled_by_texels() {
    return HAS_IMAGE_ENVIRONMENT && ENVIRONMENT_SAMPLING == ENVIRONMENT_SAMPLING_IMPORTANCE;
}

vec2 environment_uv(vec3 w) {
    float sine = sqrt(w.x * w.x + w.z * w.z);
    // The polar angle is at most half a turn.
    return vec2(turns(w.z, w.x), 2.0 * turns(sine, w.y));
}

// A texel: radiance, and the probability of its being picked times width·height/2π² (src/prepare/environment.rs).
vec4 environment_texel(RenderConstants constants, int x, int y) {
    int width = int(constants.environment_width);
    x = x < 0 ? x + width : (x >= width ? x - width : x);
    y = clamp(y, 0, int(constants.environment_height) - 1);
    return uintBitsToFloat(LOAD4(ENVIRONMENT, uint(y * width + x)));
}

bool environment_is_rgbe(RenderConstants constants) {
    return HAS_RGBE_ENVIRONMENT && (!FOR_ANY_SCENE || constants.environment_rgbe != 0u);
}

// Radiance as src/prepare/environment_quads.rs stores it. The scale is a normal float.
vec3 rgbe_radiance(uint word) {
    return vec3(word & 255u, (word >> 8u) & 255u, (word >> 16u) & 255u) * uintBitsToFloat(((word >> 24u) - 9u) << 23u);
}

// The texels (x, y), (x + 1, y), (x, y + 1) and (x + 1, y + 1) from `corner` on. Of quads, one element holds all four, and
// another their probabilities.
mat4 environment_texels(RenderConstants constants, ivec2 corner) {
    if (!environment_is_rgbe(constants))
        return mat4(environment_texel(constants, corner.x, corner.y), environment_texel(constants, corner.x + 1, corner.y),
                    environment_texel(constants, corner.x, corner.y + 1),
                    environment_texel(constants, corner.x + 1, corner.y + 1));
    int width = int(constants.environment_width);
    int height = int(constants.environment_height);
    int x = corner.x < 0 ? corner.x + width : corner.x;
    uint quad = uint(clamp(corner.y + 1, 0, height) * width + x);
    uvec4 words = LOAD4(ENVIRONMENT, quad);
    vec4 p = vec4(0.0);
    if (environment_is_sampled_by_texels()) p = uintBitsToFloat(LOAD4(ENVIRONMENT, quad + uint(width * (height + 1))));
    return mat4(vec4(rgbe_radiance(words.x), p.x), vec4(rgbe_radiance(words.y), p.y), vec4(rgbe_radiance(words.z), p.z),
                vec4(rgbe_radiance(words.w), p.w));
}

// The four texels from `corner` on, weighted by those of its column and row (`low`) and of the next ones (`high`). All
// terms are positive, so the sum is good to 6 roundings also where a texel of 10⁹ fades out: radiance and density are
// as exact as each other.
vec4 environment_interpolate(RenderConstants constants, ivec2 corner, vec2 low, vec2 high) {
    mat4 texels = environment_texels(constants, corner);
    vec4 top = texels[0] * low.x + texels[1] * high.x;
    vec4 bottom = texels[2] * low.x + texels[3] * high.x;
    return (top * low.y + bottom * high.y) * vec4(constants.environment_radiance, 1.0);
}

vec4 environment_lookup(RenderConstants constants, vec2 uv) {
    vec2 p = uv * vec2(constants.environment_width, constants.environment_height) - 0.5;
    vec2 corner = floor(p);
    vec2 f = p - corner;
    return environment_interpolate(constants, texel_of_corner(corner), 1.0 - f, f);
}

// Radiance that arrives from direction `w`, and the density with which environment_sample draws it.
vec4 environment_radiance_and_pdf(RenderConstants constants, vec3 w) {
    if (!HAS_IMAGE_ENVIRONMENT)
        return vec4(HAS_CONSTANT_ENVIRONMENT ? constants.environment_radiance : vec3(0.0), 0.25 * INV_PI);
    vec3 local = environment_from_world(constants, w);
    vec4 image = environment_lookup(constants, environment_uv(local));
    if (!environment_is_sampled_by_texels()) return vec4(image.rgb, 0.25 * INV_PI);
    float sine = sqrt(local.x * local.x + local.z * local.z);
    return vec4(image.rgb, image.w > 0.0 ? image.w / sine : 0.0);
}
vec3 environment_radiance(RenderConstants constants, vec3 w) { return environment_radiance_and_pdf(constants, w).rgb; }
float environment_pdf(RenderConstants constants, vec3 w) { return environment_radiance_and_pdf(constants, w).w; }

uint environment_row_word(RenderConstants constants, uint row) {
    return constants.environment_conditional_word + row * cdf_guided_words(constants.environment_width);
}

// A point under a texel's tent, along one axis.
struct TentPoint {
    float own;  // the texel's weight there, in (0, 1]; 1 − own is its neighbour's and the distance from its centre
    bool next;  // towards the next texel, not the one before
};

// Distributed as the tent. What the pick leaves of its number, with the bits of `dither` below its point, is uniform in
// (0, count); the tent's area on the nearer side of it is own²/2 of the whole. From either end it is exact.
TentPoint tent_point(CdfSample bin, uint dither) {
    float below = (float(dither >> 9u) + 0.5) * 1.1920928955078125e-7;
    float before = float(bin.offset) + below;
    float after = float(bin.count - 1u - bin.offset) + (1.0 - below);
    float area = min(before, after) / float(bin.count);
    // At the centre rounding may leave more than a half.
    return TentPoint(sqrt(2.0 * min(area, 0.5)), before > after);
}

// `bits`: row, column, position under the texel's tent (u, v).
EnvironmentSample environment_sample(RenderConstants constants, uvec4 bits) {
    if (!environment_is_sampled_by_texels()) {
        float cosine = 1.0 - 2.0 * to_unit(bits.x);
        vec2 horizontal = cos_sin_turns(to_unit(bits.y)) * sqrt(max(0.0, 1.0 - cosine * cosine));
        vec3 w = vec3(horizontal.x, cosine, horizontal.y);
        return EnvironmentSample(w, environment_radiance(constants, w), 0.25 * INV_PI);
    }
    CdfSample row = cdf_sample_guided_ENVIRONMENT(constants.environment_marginal_word, constants.environment_height, bits.x);
    CdfSample column = cdf_sample_guided_ENVIRONMENT(
        environment_row_word(constants, row.index), constants.environment_width, bits.y);
    TentPoint across = tent_point(column, bits.z);
    TentPoint down = tent_point(row, bits.w);
    vec2 own = vec2(across.own, down.own);
    bvec2 next = bvec2(across.next, down.next);
    // By the weights the point was drawn with: where it rounds to is too coarse for them at the foot of the tent.
    ivec2 corner = ivec2(column.index, row.index) - ivec2(not(next));
    vec4 image = environment_interpolate(constants, corner, mix(1.0 - own, own, next), mix(own, 1.0 - own, next));
    vec2 size = vec2(constants.environment_width, constants.environment_height);
    vec2 p = vec2(column.index, row.index) + 0.5 + mix(own - 1.0, 1.0 - own, next);
    p.x = p.x < 0.0 ? p.x + size.x : (p.x >= size.x ? p.x - size.x : p.x);
    // Clamping repeats the edge row, which is a tent folded at the pole.
    p.y = min(abs(p.y), 2.0 * size.y - p.y);
    // At the poles themselves sin θ is 0 and the density infinite.
    float v = clamp(p.y / size.y, UNIT_ROUNDOFF, 1.0 - UNIT_ROUNDOFF);
    vec2 polar = cos_sin_turns(0.5 * v);
    vec2 azimuth = cos_sin_turns(p.x / size.x);
    vec3 w = vec3(azimuth.x * polar.y, polar.x, azimuth.y * polar.y);
    return EnvironmentSample(environment_to_world(constants, w), image.rgb, image.w / polar.y);
}

#endif
