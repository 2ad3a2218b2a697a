#version 460
// The environment's functions. A lane draws a direction from its texel of 32-bit numbers and writes (direction, density),
// (radiance, density of that direction by environment_pdf) and the radiance of that direction by environment_radiance.
// With EVALUATE its texel is a direction; (radiance, density) is written.
#include "../include/test_kernel.glsl"
#include "../include/environment.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
#ifdef EVALUATE
    vec3 direction = uintBitsToFloat(inputs[lane].xyz);
    outputs[lane] = floatBitsToUint(vec4(environment_radiance(constants, direction), environment_pdf(constants, direction)));
#else
    EnvironmentSample s = environment_sample(constants, inputs[lane]);
    outputs[3u * lane] = floatBitsToUint(vec4(s.direction, s.pdf));
    outputs[3u * lane + 1u] = floatBitsToUint(vec4(s.radiance, environment_pdf(constants, s.direction)));
    outputs[3u * lane + 2u] = floatBitsToUint(vec4(environment_radiance(constants, s.direction), 0.0));
#endif
}
