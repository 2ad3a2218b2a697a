#version 460
// math.glsl at one number a lane: x -> cos and sin of x turns; x, y -> the angle of (x, y) in turns; the floats next to y.
#include "../include/test_kernel.glsl"
#include "../include/math.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    vec4 x = uintBitsToFloat(inputs[lane]);
    vec2 cs = cos_sin_turns(x.x);
    outputs[2u * lane] = floatBitsToUint(vec4(cs, turns(x.z, x.y), atan_unit(x.w)));
    vec2 next = vec2(next_float_up(x.y), next_float_down(x.y));
    outputs[2u * lane + 1u] = uvec4(floatBitsToUint(next), 0u, 0u);
}
