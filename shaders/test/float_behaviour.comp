#version 460
// What the shaders rely on of a driver's float arithmetic (docs/accuracy/float-behaviour.md), at three numbers a lane:
// x, y, z as bits -> ten texels of results, as bits. tests/stress/float_behaviour.rs names them.
#include "../include/test_kernel.glsl"
#include "../include/math.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 bits = inputs[lane];
    float x = uintBitsToFloat(bits.x);
    float y = uintBitsToFloat(bits.y);
    float z = uintBitsToFloat(bits.z);
    uint o = 10u * lane;
    outputs[o] = floatBitsToUint(vec4(x + y, x - y, x * y, x / y));
    precise float separate = x * y + z;
    float free = x * y + z;
    precise float difference = x * y - z * y;
    outputs[o + 1u] = floatBitsToUint(vec4(separate, free, difference, 0.0));
    outputs[o + 2u] = floatBitsToUint(vec4(sqrt(x), inversesqrt(x), min(x, y), max(x, y)));
    outputs[o + 3u] = uvec4((x < y ? 1u : 0u) | (x <= y ? 2u : 0u) | (x > y ? 4u : 0u) | (x >= y ? 8u : 0u) |
                                (x == y ? 16u : 0u) | (x != y ? 32u : 0u),
                            floatBitsToInt(x) < floatBitsToInt(y) ? 1u : 0u, is_finite(x) ? 1u : 0u, 0u);
    // Conversions: of the words as integers, and of the numbers where they fit.
    outputs[o + 4u] = uvec4(floatBitsToUint(float(bits.x >> 8u)), floatBitsToUint(float(bits.x & 255u)),
                            floatBitsToUint(float(int(bits.x) >> 8)), 0u);
    bool fits = abs(x) < 2147483520.0;
    float fitting = fits ? x : 0.0;
    outputs[o + 5u] = uvec4(uint(int(fitting)), uint(abs(fitting)), floatBitsToUint(floor(fitting)), 0u);
    outputs[o + 6u] = floatBitsToUint(vec4(abs(x), -x, clamp(x, 0.0, 1.0), x + 0.0));
    // Bits that only pass through must stay, denormal or not.
    outputs[o + 7u] = floatBitsToUint(vec4(x, y, (bits.w & 1u) != 0u ? x : y, 0.0));
    vec3 v = vec3(x, y, z);
    outputs[o + 8u] = floatBitsToUint(vec4(dot(v, v), max_component(v), 0.0, 0.0));
    outputs[o + 9u] = floatBitsToUint(vec4(1.0 / x, x * x, next_float_up(x), next_float_down(x)));
}
