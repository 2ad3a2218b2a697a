// The ray cone of a path: how wide what its ray stands for is where it meets a surface, so that textures are looked up in
// the level of their mip chain that fits (Akenine-Möller et al. 2019, "Texture Level of Detail Strategies for Real-Time Ray
// Tracing", Ray Tracing Gems, ch. 20). It is narrower than what it stands for, by shares that keep the blur far below a
// pixel, and never wider than known: what would widen it is left out, what may narrow it is not (docs/estimators.md).
#ifndef RAY_CONE_GLSL
#define RAY_CONE_GLSL
#include "camera.glsl"

struct RayCone {
    float width;   // at the ray's origin, in metres
    float spread;  // what is added in a metre
};

// Of a pixel's width.
const float CONE_PIXEL_SHARE = 0.25;
// Of the side of a square as large as 1/pdf: as many samples of a lobe would fill the lobe without a gap.
const float CONE_LOBE_SHARE = 0.03125;

float cone_width(RayCone cone, float distance) { return cone.width + cone.spread * distance; }

// Off the axis a pixel is narrower, at most by cos².
RayCone camera_cone(RenderConstants constants, vec3 direction) {
    vec2 half_size = vec2(length(constants.camera_right), length(constants.camera_up));
    vec2 pixel = 2.0 * half_size / vec2(constants.width, constants.height);
    float width = CONE_PIXEL_SHARE * min(pixel.x, pixel.y);
    if (is_orthographic(constants)) return RayCone(width, 0.0);
    return RayCone(0.0, width * sqr(dot(direction, constants.camera_forward)));
}

// After a continuous lobe: the direction is one of a bundle of the solid angle 1/pdf, at most that of a hemisphere.
RayCone lobe_cone(float pdf) { return RayCone(0.0, CONE_LOBE_SHARE * inversesqrt(max(pdf, 0.15915494))); }

// After a delta lobe. A flat mirror keeps the cone. A flat boundary of relative index `eta` narrows the angle by 1/eta across
// the plane of incidence and by cos_i/(eta·cos_t) in it, and the width by cos_t/cos_i in it (differentials of Snell's law).
// Curved surfaces may focus: nothing is known of the width.
RayCone delta_cone(RayCone cone, bool curved, bool through, float eta, float cos_i, float cos_t) {
    if (curved) return RayCone(0.0, 0.0);
    if (!through) return cone;
    return RayCone(cone.width * min(1.0, cos_t / cos_i), cone.spread / eta * min(1.0, cos_i / cos_t));
}

#endif
