#version 460
// The BSDF functions. The first input texel is (configurations, samples a configuration, seed, 0); then four texels a
// configuration (see `load`). With EVALUATE, one texel a lane follows: wi and its configuration; else a lane scatters.
// ALPHA_FAULT changes the roughness that is sampled but not the one of the pdf, for a test to fail with.
#include "../include/test_kernel.glsl"
#include "../include/bsdf.glsl"
#include "../include/rng.glsl"

#ifndef ALPHA_FAULT
#define ALPHA_FAULT 1.0
#endif
#ifndef PDF_FAULT
#define PDF_FAULT 1.0
#endif

BsdfParameters load(uint configuration, out vec3 wo) {
    uint base = 1u + 4u * configuration;
    vec4 b = uintBitsToFloat(inputs[base + 1u]);
    vec4 c = uintBitsToFloat(inputs[base + 2u]);
    BsdfParameters p;
    p.color = uintBitsToFloat(inputs[base].xyz);
    p.kind = inputs[base].w & MATERIAL_KIND_MASK;
    p.solid = (inputs[base].w & MATERIAL_VOLUME) != 0u;
    p.schlick = (inputs[base].w & MATERIAL_SCHLICK) != 0u;
    p.metallic = b.x;
    p.alpha = vec2(b.y, c.y);
    p.ior = b.z;
    p.eta = b.w;
    p.transmission = c.x;
    p.specular = c.z;
    p.specular_color = vec3(c.w);
    wo = uintBitsToFloat(inputs[base + 3u].xyz);
    return p;
}

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    vec3 wo;
#ifdef EVALUATE
    uvec4 node = inputs[1u + 4u * inputs[0].x + lane];
    vec3 wi = uintBitsToFloat(node.xyz);
    BsdfParameters p = load(node.w, wo);
    bsdf_prepare(constants, p, wo);
    outputs[2u * lane] = floatBitsToUint(vec4(bsdf_evaluate(p, wo, wi), bsdf_pdf(p, wo, wi) * PDF_FAULT));
    bsdf_prepare(constants, p, wi);
    outputs[2u * lane + 1u] = floatBitsToUint(vec4(bsdf_evaluate(p, wi, wo), bsdf_pdf(p, wi, wo) * PDF_FAULT));
#else
    BsdfParameters p = load(lane / inputs[0].y, wo);
    p.alpha *= ALPHA_FAULT;
    bsdf_prepare(constants, p, wo);
    vec4 u = to_unit(sample_bits(SampleKey(lane, lane % inputs[0].y, inputs[0].z), 0u, DIMENSIONS_SCATTER));
    BsdfSample s = bsdf_scatter(p, wo, u.xyz);
    outputs[2u * lane] = uvec4(floatBitsToUint(s.wi), s.flags);
    outputs[2u * lane + 1u] = floatBitsToUint(vec4(s.weight, s.pdf));
#endif
}
