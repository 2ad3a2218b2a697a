#version 460
// sample_texture at one coordinate a lane: (u, v, index of the texture) -> RGBA.
#include "../include/test_kernel.glsl"
#include "../include/texture.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[lane];
    outputs[lane] = floatBitsToUint(sample_texture(constants, a.z, uintBitsToFloat(a.xy)));
}
