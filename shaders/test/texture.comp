#version 460
// sample_texture at one coordinate a lane: (u, v, index of the texture), (u and v of set 1) -> RGBA.
#include "../include/test_kernel.glsl"
#include "../include/texture.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[2u * lane];
    uvec4 b = inputs[2u * lane + 1u];
    outputs[lane] = floatBitsToUint(sample_texture(constants, a.z, uintBitsToFloat(uvec4(a.xy, b.xy))));
}
