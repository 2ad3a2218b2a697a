#version 460
// The metallic-roughness model as the path tracer calls it, thin walls and solid boundaries too, for the expectations in
// bsdf_metallic_roughness.toml. tests/gpu/bsdf_chi_square.rs goes further, by bsdf.comp.
#include "../include/test_bsdf.glsl"

// By their places in `parameters` of the expectations; `wo` completes them.
BsdfParameters parameters(uint configuration, vec3 wo) {
    BsdfParameters p;
    p.kind = BSDF_METALLIC_ROUGHNESS;
    p.color = vec3(parameter(configuration, 0));
    p.metallic = parameter(configuration, 1);
    float roughness = parameter(configuration, 2);
    p.alpha = resolvable_alpha(vec2(roughness * roughness));
    p.ior = parameter(configuration, 3);
    p.transmission = parameter(configuration, 4);
    p.solid = parameter(configuration, 5) != 0.0;
    p.eta = p.solid ? p.ior : 1.0;
    p.specular = 1.0;
    p.specular_color = vec3(1.0);
    p.schlick = false;
    bsdf_prepare(constants, p, wo);
    return p;
}

BsdfSample test_scatter(uint configuration, vec3 wo, vec3 u) {
    return bsdf_scatter(parameters(configuration, wo), wo, u);
}

vec4 test_evaluate(uint configuration, vec3 wo, vec3 wi) {
    BsdfParameters p = parameters(configuration, wo);
    return vec4(bsdf_evaluate(p, wo, wi), bsdf_pdf(p, wo, wi));
}
