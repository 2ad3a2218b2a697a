// Alpha: whether a ray meets a surface that is only partly there. Traversal asks at each candidate hit, in whatever order
// it finds them, so the answer is a pure function of the ray and the triangle. It is not a bounce.
#ifndef ALPHA_GLSL
#define ALPHA_GLSL
#include "attributes.glsl"
#include "rng.glsl"

// What all decisions along a ray are drawn from. A path's ray and the shadow ray from its end have the same bounce and may
// cross the same triangle: their decisions are multiplied with each other, so they must be independent, and each has
// numbers of its own.
uvec2 alpha_key(SampleKey key, uint bounce, bool shadow) {
    if (!HAS_ALPHA) return uvec2(0u);
    // These are keys of hashes, which gain nothing by being stratified.
    uvec4 bits = hashed_bits(key, bounce, DIMENSIONS_ALPHA);
    return shadow ? bits.zw : bits.xy;
}

// The share of the light at a point that meets its surface; the rest passes straight through.
float surface_opacity(RenderConstants constants, Material material, Vertices vertices) {
    uint mode = material.kind_flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND);
    if (mode == 0u) return 1.0;
    float alpha = base_color(constants, material, vertices).a;
    return mode == MATERIAL_ALPHA_MASK ? (alpha >= material.alpha_cutoff ? 1.0 : 0.0) : alpha;
}

// Whether the ray of `key` meets the triangle, with the probability of its opacity.
bool alpha_hits(RenderConstants constants, uvec2 key, uint triangle, uint instance, vec2 barycentric) {
    uint material = triangle_look(constants, load_triangle_kind(constants, triangle), instance).material;
    Vertices vertices = interpolate_vertices(constants, triangle, instance, barycentric);
    float opacity = surface_opacity(constants, load_material(constants, material), vertices);
    return to_unit(pcg4d(uvec4(key, triangle, instance)).x) < opacity;
}

#endif
