// Alpha: whether a ray meets a surface that is only partly there. Traversal asks at each candidate hit, in whatever order
// it finds them, so the answer is a pure function of the ray and the triangle. It is not a bounce.
#ifndef ALPHA_GLSL
#define ALPHA_GLSL
#include "features.glsl"
#include "records.glsl"
#include "rng.glsl"
#include "texture.glsl"

// What all decisions along a ray are drawn from. A path's ray and the shadow ray from its end have the same bounce and may
// cross the same triangle: their decisions are multiplied with each other, so they must be independent, and each has
// numbers of its own.
uvec2 alpha_key(SampleKey key, uint bounce, bool shadow) {
    if (!HAS_ALPHA) return uvec2(0u);
    uvec4 bits = sample_bits(key, bounce, DIMENSIONS_ALPHA);
    return shadow ? bits.zw : bits.xy;
}

vec2 alpha_texcoord(RenderConstants constants, uint triangle, vec2 barycentric) {
    uvec4 record = LOAD4(ATTRIBUTES, triangle);
    if ((record.w & TRIANGLE_TEXCOORDS) == 0u) return vec2(0.0);
    uvec3 first = constants.vertices + record.xyz * VERTEX_TEXELS;
    vec3 weights = vec3(1.0 - barycentric.x - barycentric.y, barycentric);
    vec3 u = uintBitsToFloat(uvec3(LOAD4(ATTRIBUTES, first.x).w, LOAD4(ATTRIBUTES, first.y).w,
                                   LOAD4(ATTRIBUTES, first.z).w));
    vec3 v = uintBitsToFloat(uvec3(LOAD4(ATTRIBUTES, first.x + 1u).x, LOAD4(ATTRIBUTES, first.y + 1u).x,
                                   LOAD4(ATTRIBUTES, first.z + 1u).x));
    return vec2(dot(u, weights), dot(v, weights));
}

// Alpha of a material at a point of one of its triangles.
float surface_alpha(RenderConstants constants, Material material, uint triangle, vec2 barycentric) {
    float alpha = material.alpha;
    if (HAS_TEXTURES && material.base_color_texture != NONE)
        alpha *= sample_texture(constants, material.base_color_texture,
                                alpha_texcoord(constants, triangle, barycentric)).a;
    return alpha;
}

// The share of the light at a point of a triangle that meets its surface; the rest passes straight through.
float surface_opacity(RenderConstants constants, Material material, uint triangle, vec2 barycentric) {
    uint mode = material.kind_flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND);
    if (mode == 0u) return 1.0;
    float alpha = surface_alpha(constants, material, triangle, barycentric);
    return mode == MATERIAL_ALPHA_MASK ? (alpha >= material.alpha_cutoff ? 1.0 : 0.0) : alpha;
}

// Whether the ray of `key` meets the triangle, with the probability of its opacity.
bool alpha_hits(RenderConstants constants, uvec2 key, uint material, uint triangle, uint instance, vec2 barycentric) {
    float opacity = surface_opacity(constants, load_material(constants, material), triangle, barycentric);
    return to_unit(pcg4d(uvec4(key, triangle, instance)).x) < opacity;
}

#endif
