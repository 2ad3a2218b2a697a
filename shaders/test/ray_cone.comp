#version 460
// Ray cones: (direction of a camera ray), (cosine of incidence, of refraction, relative index, pdf)
// -> (camera's width, its spread, width and spread that a unit cone has after a boundary), (spread after a lobe).
#include "../include/test_kernel.glsl"
#include "../include/ray_cone.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    vec3 direction = uintBitsToFloat(inputs[2u * lane].xyz);
    vec4 event = uintBitsToFloat(inputs[2u * lane + 1u]);
    RayCone camera = camera_cone(constants, direction);
    RayCone through = delta_cone(RayCone(1.0, 1.0), false, true, event.z, event.x, event.y);
    outputs[2u * lane] = floatBitsToUint(vec4(camera.width, camera.spread, through.width, through.spread));
    outputs[2u * lane + 1u] = floatBitsToUint(vec4(lobe_cone(event.w).spread, 0.0, 0.0, 0.0));
}
