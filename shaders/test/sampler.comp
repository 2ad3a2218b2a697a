#version 460
// rng.glsl at one key a lane: (pixel, sample index, seed, bounce), (group, 0, 0, 0) -> the group's bits, and as numbers
// in [0, 1). KEY_FAULT is there for a test to break the sampler with.
#include "../include/test_kernel.glsl"
#include "../include/rng.glsl"

#ifndef KEY_FAULT
#define KEY_FAULT(key)
#endif

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[2u * lane];
    SampleKey key = SampleKey(a.x, a.y, a.z);
    KEY_FAULT(key);
    uvec4 bits = sample_bits(key, a.w, inputs[2u * lane + 1u].x);
    outputs[2u * lane] = bits;
    outputs[2u * lane + 1u] = floatBitsToUint(to_unit(bits));
}
