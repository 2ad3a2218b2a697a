// Camera rays. The film's box filter of one pixel is sampled by jittering inside the pixel.
#ifndef CAMERA_GLSL
#define CAMERA_GLSL
#include "features.glsl"
#include "layout.glsl"
#include "math.glsl"

struct CameraRay {
    vec3 origin;
    vec3 direction;
};

bool is_orthographic(RenderConstants constants) {
    return HAS_ORTHOGRAPHIC && (!FOR_ANY_SCENE || constants.projection == PROJECTION_ORTHOGRAPHIC);
}

// `pixel` counts from the top left; `u` is the position in the pixel (xy) and on the lens (zw), all in [0, 1).
CameraRay camera_ray(RenderConstants constants, uvec2 pixel, vec4 u) {
    vec2 film = (vec2(pixel) + u.xy) / vec2(constants.width, constants.height) * 2.0 - 1.0;
    vec3 offset = constants.camera_right * film.x - constants.camera_up * film.y;
    if (is_orthographic(constants)) return CameraRay(constants.camera_origin + offset, constants.camera_forward);
    vec3 direction = constants.camera_forward + offset;
    if (!HAS_LENS || (FOR_ANY_SCENE && constants.lens_radius == 0.0))
        return CameraRay(constants.camera_origin, normalize(direction));
    // Thin lens: the ray through the pinhole meets the plane in focus where the ray from the lens point must (PBR §5.2.3).
    vec2 disk = sqrt(u.z) * cos_sin_turns(u.w) * constants.lens_radius;
    vec3 lens = normalize(constants.camera_right) * disk.x + normalize(constants.camera_up) * disk.y;
    return CameraRay(constants.camera_origin + lens, normalize(direction * constants.focus_distance - lens));
}

#endif
