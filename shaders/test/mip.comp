#version 460
// sample_texture by a footprint: (u, v, index of the texture), gradient of u, gradient of v -> RGBA, (level).
#include "../include/test_kernel.glsl"
#include "../include/texture.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[3u * lane];
    mat4x3 footprint = mat4x3(0.0);
    footprint[0] = uintBitsToFloat(inputs[3u * lane + 1u].xyz);
    footprint[1] = uintBitsToFloat(inputs[3u * lane + 2u].xyz);
    vec4 texcoords = vec4(uintBitsToFloat(a.xy), 0.0, 0.0);
    outputs[2u * lane] = floatBitsToUint(sample_texture(constants, a.z, texcoords, footprint));
    outputs[2u * lane + 1u] = uvec4(mip_level(load_texture_header(constants, a.z), footprint), 0u, 0u, 0u);
}
