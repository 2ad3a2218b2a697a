#version 460
// light_pick_probability and sample_light for a receiver: (point, light), (normal, slack), (which light, digits below, v, 0),
// (environment) -> (bits of the light's probability, light picked, bits of its probability, bits of its rest), (radiance,
// density).
#include "../include/test_kernel.glsl"
#include "../include/light.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[4u * lane];
    vec4 b = uintBitsToFloat(inputs[4u * lane + 1u]);
    uvec4 bits = inputs[4u * lane + 2u];
    LightReceiver receiver = LightReceiver(uintBitsToFloat(a.xyz), b.w, b.xyz);
    float probability = light_pick_probability(constants, receiver, a.w);
    CdfSample pick = light_pick(constants, receiver, bits.x);
    float rest = pick.index == NONE ? 0.0 : cdf_rest(pick, bits.y);
    LightSample s = sample_light(constants, receiver, bits.xyz, inputs[4u * lane + 3u]);
    outputs[2u * lane] = uvec4(floatBitsToUint(probability), pick.index, floatBitsToUint(pick.probability),
                               floatBitsToUint(rest));
    outputs[2u * lane + 1u] = floatBitsToUint(vec4(s.radiance, s.pdf));
}
