// What a kernel of shaders/test/ that tests a BSDF includes first. It then defines the two functions declared here;
// `sunfleck shader-test` calls them by the `main` below, with the parameters that the expectations beside the kernel name
// (docs/shader-tests.md).
//
// The first input texel is (configurations, samples a configuration, seed, texels a configuration); then each configuration:
// wo, and its parameters. With samples, a lane scatters. Without, the texels that follow are a lane's wi and configuration,
// and the third word of the first says whether f is wanted with both directions exchanged too.
#include "test_kernel.glsl"
#include "bsdf.glsl"
#include "rng.glsl"

// A sample of the lobe, as bsdf_scatter of bsdf.glsl gives it. `u`: lobe, direction u, direction v, in [0, 1).
BsdfSample test_scatter(uint configuration, vec3 wo, vec3 u);

// f without the cosine, and in the last component the density of wi: bsdf_evaluate and bsdf_pdf. wo.y > 0; wi may be below.
vec4 test_evaluate(uint configuration, vec3 wo, vec3 wi);

// A parameter's value, by its place in `parameters` of the expectations.
float parameter(uint configuration, uint index) {
    uvec4 texel = inputs[2u + configuration * inputs[0].w + index / 4u];
    return uintBitsToFloat(texel[index % 4u]);
}

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uint samples = inputs[0].y;
    if (samples > 0u) {
        uint configuration = lane / samples;
        vec3 wo = uintBitsToFloat(inputs[1u + configuration * inputs[0].w].xyz);
        SampleKey key = SampleKey(configuration, lane % samples, inputs[0].z);
        vec4 u = to_unit(hashed_bits(key, 0u, DIMENSIONS_SCATTER));
        BsdfSample s = test_scatter(configuration, wo, u.xyz);
        outputs[2u * lane] = uvec4(floatBitsToUint(s.wi), s.flags);
        outputs[2u * lane + 1u] = floatBitsToUint(vec4(s.weight, s.pdf));
        return;
    }
    uvec4 node = inputs[1u + inputs[0].x * inputs[0].w + lane];
    vec3 wi = uintBitsToFloat(node.xyz);
    vec3 wo = uintBitsToFloat(inputs[1u + node.w * inputs[0].w].xyz);
    outputs[2u * lane] = floatBitsToUint(test_evaluate(node.w, wo, wi));
    vec4 reverse = vec4(0.0);
    if (inputs[0].z != 0u && wi.y > 0.0) reverse = test_evaluate(node.w, wi, wo);
    outputs[2u * lane + 1u] = floatBitsToUint(reverse);
}
