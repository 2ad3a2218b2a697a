// What a path is inside of: volumes (KHR_materials_volume) may lie in volumes, so it is a stack of materials. The last one
// entered has precedence; the volumes need not be left in the order in which they were entered.
#ifndef MEDIA_GLSL
#define MEDIA_GLSL
#include "features.glsl"
#include "math.glsl"
#include "records.glsl"

// Indices of materials, the innermost first; NONE is the outside. Of more than four volumes around one point, the
// outermost are forgotten: what is outside the fourth counts as empty.
struct Media { uvec4 stack; };
const Media OUTSIDE = Media(uvec4(NONE));

Media entered(Media media, uint material) { return Media(uvec4(material, media.stack.xyz)); }

bool is_inside(Media media, uint material) { return any(equal(media.stack, uvec4(material))); }

// Without the innermost volume of that material.
Media left(Media media, uint material) {
    uvec4 s = media.stack;
    if (s.x == material) return Media(uvec4(s.yzw, NONE));
    if (s.y == material) return Media(uvec4(s.x, s.zw, NONE));
    if (s.z == material) return Media(uvec4(s.xy, s.w, NONE));
    if (s.w == material) return Media(uvec4(s.xyz, NONE));
    return media;
}

float medium_ior(RenderConstants constants, Media media) {
    return media.stack.x == NONE ? 1.0 : load_material(constants, media.stack.x).ior;
}

// By the Beer–Lambert law. An infinite distance lets through what is not absorbed at all.
vec3 transmittance(RenderConstants constants, Media media, float distance) {
    if (media.stack.x == NONE) return vec3(1.0);
    vec3 absorption = load_material(constants, media.stack.x).absorption;
    vec3 depth = mix(absorption * distance, vec3(0.0), equal(absorption, vec3(0.0)));
    return vec3(exp_minus(depth.x), exp_minus(depth.y), exp_minus(depth.z));
}

#endif
