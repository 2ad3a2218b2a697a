#version 460
// The functions of bsdf_NAME.glsl, for the expectations in bsdf_NAME.toml.
#include "../include/test_bsdf.glsl"
#include "../include/bsdf_NAME.glsl"

// By their places in `parameters` of the expectations.
BsdfParameters parameters(uint configuration) {
    BsdfParameters p;
    p.color = vec3(parameter(configuration, 0), parameter(configuration, 1), parameter(configuration, 2));
    p.alpha = vec2(parameter(configuration, 3));
    return p;
}

BsdfSample test_scatter(uint configuration, vec3 wo, vec3 u) {
    return NAME_scatter(parameters(configuration), wo, u);
}

vec4 test_evaluate(uint configuration, vec3 wo, vec3 wi) {
    BsdfParameters p = parameters(configuration);
    return vec4(NAME_evaluate(p, wo, wi), NAME_pdf(p, wo, wi));
}
