#version 460
// fresnel.glsl at one (cosine, eta) a lane: the transmitted cosine, the exact reflectance, Schlick's.
#include "../include/test_kernel.glsl"
#include "../include/math.glsl"
#include "../include/fresnel.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    vec2 x = uintBitsToFloat(inputs[lane].xy);
    float transmitted = transmitted_cosine(x.x, x.y);
    outputs[lane] = floatBitsToUint(vec4(transmitted, fresnel_dielectric(x.x, transmitted, x.y),
                                         fresnel_schlick_dielectric(x.x, transmitted, x.y), 0.0));
}
