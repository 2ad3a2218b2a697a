// AOVs: what the camera's ray meets first, and what the path cost. Only what is asked for is summed; where nothing is, nothing
// of this is left.
#ifndef AOV_GLSL
#define AOV_GLSL
#include "counters.glsl"
#include "surface.glsl"

AovSums aovs;  // of the lane's block

void begin_aovs() { aovs = AovSums(vec3(0.0), 0u, vec3(0.0), 0.0, vec3(0.0), 0u); }

// What the surface scatters by: nothing if it is a black back. An unlit surface shows its colour.
vec3 surface_albedo(Surface surface) {
    bool is_unlit = HAS_BSDF(BSDF_UNLIT) && surface.bsdf.kind == BSDF_UNLIT;
    return surface.black && !is_unlit ? vec3(0.0) : surface.bsdf.color;
}

// The camera's ray has met the surface.
void add_surface_aovs(RenderConstants constants, Surface surface) {
    aovs.hits += 1u;
    if (HAS_AOV(AOV_ALBEDO)) aovs.albedo += surface_albedo(surface);
    if (HAS_AOV(AOV_NORMAL)) aovs.normal += surface.frame.normal;
    vec3 position = surface.point.position;
    if (HAS_AOV(AOV_DEPTH)) aovs.depth += dot(position - constants.camera_origin, constants.camera_forward);
    if (HAS_AOV(AOV_POSITION)) aovs.position += position;
}

#endif
