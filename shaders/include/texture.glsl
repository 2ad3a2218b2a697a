// Textures: texels lie packed in one array and are wrapped, fetched and filtered here, since not every device can index
// images dynamically. Coordinates and filters follow glTF 2.0 (v = 0 is the top row, texel centres at (i + 0.5) / size).
#ifndef TEXTURE_GLSL
#define TEXTURE_GLSL
#include "features.glsl"
#include "records.glsl"

// sRGB to linear for x in [0, 1] (IEC 61966-2-1). The power is evaluated as x² · x^0.4 with x^0.4 = exp2(0.4 · log2 x),
// whose error on [0.09, 1] is some 2^-20 with the errors that Vulkan allows for exp2 and log2.
float srgb_to_linear(float x) {
    float base = (x + 0.055) * (1.0 / 1.055);
    return x <= 0.04045 ? x * (1.0 / 12.92) : base * base * exp2(0.4 * log2(base));
}

// `i` is at most one texel outside of [0, 2·size] (mirrored) or [0, size] (else), as texel_coordinate leaves it: so one period
// more or less is enough, and there is no division, which software devices do lane by lane.
int wrap_texel(int i, int size, uint mode) {
    if (mode == 2u) return clamp(i, 0, size - 1);
    int period = mode == 1u ? 2 * size : size;
    i += i < 0 ? period : 0;
    i -= i >= period ? period : 0;
    return i < size ? i : period - 1 - i;
}

// A texel as it is stored, from 0 to 1. What has 16 bits lies in two words of one element of the array, since images begin at
// whole elements. Lookups of one slice are of both widths, so that a branch would cost both sides on lavapipe.
vec4 stored_texel(TextureHeader header, uint index) {
    bool wide = (header.sampling & TEXTURE_16_BIT) != 0u;
    uint word = header.first_word + (index << uint(wide));
    uvec4 four = LOAD4(TEXELS, word >> 2u);
    uint one = four[word & 3u];
    uint next = four[(word & 3u) | 1u];
    uvec4 bits = wide ? uvec4(one & 0xffffu, one >> 16u, next & 0xffffu, next >> 16u)
                      : uvec4(one & 255u, (one >> 8u) & 255u, (one >> 16u) & 255u, one >> 24u);
    return vec4(bits) * (wide ? 1.0 / 65535.0 : 1.0 / 255.0);
}

vec4 fetch_texel(TextureHeader header, ivec2 texel) {
    uint x = uint(wrap_texel(texel.x, int(header.width), (header.sampling >> TEXTURE_WRAP_U_SHIFT) & 3u));
    uint y = uint(wrap_texel(texel.y, int(header.height), (header.sampling >> TEXTURE_WRAP_V_SHIFT) & 3u));
    vec4 value = stored_texel(header, y * header.width + x);
    if ((header.sampling & TEXTURE_SRGB) != 0u)
        value.rgb = vec3(srgb_to_linear(value.r), srgb_to_linear(value.g), srgb_to_linear(value.b));
    return value;
}

// The coordinate in texels, reduced so that no huge or non-finite coordinate reaches the integer conversion.
float texel_coordinate(float x, uint size, uint mode) {
    if (!is_finite(x)) return 0.0;
    if (mode == 2u) x = clamp(x, 0.0, 1.0);
    else if (mode == 1u) x -= 2.0 * floor(x * 0.5);
    else x -= floor(x);
    return x * float(size);
}

// What a lookup stands for: the gradients over the surface, in any common frame, of the coordinates u and v of set 0, then
// of set 1, each times the width of the ray cone. Zero where the lookup must be exact.
const mat4x3 NO_FOOTPRINT = mat4x3(0.0);

// The level of the mip chain whose texels are still no wider than the footprint in any direction: by the smaller singular value
// of the map to texels, so that what is stretched is not blurred along its long side. It is |a × b| over the larger one, with
// the gradients a and b of the two texel coordinates, which does not cancel. NaN, as of coordinates without area, is level 0.
uint mip_level(TextureHeader header, mat4x3 footprint) {
    bool second = (header.sampling & TEXTURE_SET_1) != 0u;
    vec3 du = second ? footprint[2] : footprint[0];
    vec3 dv = second ? footprint[3] : footprint[1];
    vec3 a = (header.u_row.x * du + header.u_row.y * dv) * float(header.width);
    vec3 b = (header.v_row.x * du + header.v_row.y * dv) * float(header.height);
    float aa = dot(a, a);
    float bb = dot(b, b);
    float larger = sqrt(0.5 * (aa + bb + length(vec2(aa - bb, 2.0 * dot(a, b)))));
    float texels = length(cross(a, b)) / larger;
    if (!(texels >= 2.0)) return 0u;
    // The logarithm is the exponent.
    uint level = (floatBitsToUint(texels) >> 23u) - 127u;
    return min(level, uint(findMSB(max(header.width, header.height))));
}

// The header of a level ≥ 1: its texels are linear and have 16 bits (src/prepare/mip.rs).
TextureHeader mip_header(TextureHeader header, uint level) {
    header.first_word = LOAD1(TEXELS, header.mips + level - 1u);
    header.width = max(header.width >> level, 1u);
    header.height = max(header.height >> level, 1u);
    header.sampling = (header.sampling & ~TEXTURE_SRGB) | TEXTURE_16_BIT;
    return header;
}

// `texcoords`: the two sets; the texture's header says which of them is looked up, and how it is transformed.
vec4 sample_texture(RenderConstants constants, uint index, vec4 texcoords, mat4x3 footprint) {
    TextureHeader header = load_texture_header(constants, index);
    if (HAS_MIP && (header.sampling & TEXTURE_MIPS) != 0u) {
        uint level = mip_level(header, footprint);
        if (level > 0u) header = mip_header(header, level);
    }
    vec2 uv = (header.sampling & TEXTURE_SET_1) != 0u ? texcoords.zw : texcoords.xy;
    if ((header.sampling & TEXTURE_TRANSFORMED) != 0u)
        uv = vec2(dot(header.u_row, vec3(uv, 1.0)), dot(header.v_row, vec3(uv, 1.0)));
    float x = texel_coordinate(uv.x, header.width, (header.sampling >> TEXTURE_WRAP_U_SHIFT) & 3u);
    float y = texel_coordinate(uv.y, header.height, (header.sampling >> TEXTURE_WRAP_V_SHIFT) & 3u);
    if ((header.sampling & TEXTURE_NEAREST) != 0u) return fetch_texel(header, ivec2(small_whole(floor(vec2(x, y)))));
    vec2 corner = floor(vec2(x, y) - 0.5);
    vec2 f = vec2(x, y) - 0.5 - corner;
    ivec2 t = texel_of_corner(corner);
    vec4 top = mix(fetch_texel(header, t), fetch_texel(header, t + ivec2(1, 0)), f.x);
    vec4 bottom = mix(fetch_texel(header, t + ivec2(0, 1)), fetch_texel(header, t + ivec2(1, 1)), f.x);
    return mix(top, bottom, f.y);
}

// An exact lookup.
vec4 sample_texture(RenderConstants constants, uint index, vec4 texcoords) {
    return sample_texture(constants, index, texcoords, NO_FOOTPRINT);
}

// Emitted radiance of a material at texture coordinates.
vec3 material_emission(RenderConstants constants, Material material, vec4 texcoords) {
    vec3 emission = material.emission;
    if (HAS_TEXTURES && material.emission_texture != NONE)
        emission *= sample_texture(constants, material.emission_texture, texcoords).rgb;
    return emission;
}

#endif
