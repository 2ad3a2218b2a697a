// BSDFs behind three functions. `wo` and `wi` are in the shading frame (+Y is the normal on the side of wo, so wo.y > 0)
// and point away from the surface. Continuous and discrete probability are never mixed: bsdf_evaluate and bsdf_pdf know
// the continuous lobes alone, and a sample says by its flags which kind it is.
//
//   bsdf_prepare:  completes the parameters for a wo; the others must be called with that wo.
//   bsdf_scatter:  draws wi; weight = f·|cos θi| / pdf for a continuous lobe, f·|cos θi| / probability for a delta lobe;
//                  the probability of choosing the lobe is in both. A zero weight means absorption.
//   bsdf_evaluate: f(wo, wi), without the cosine, in 1/sr.
//   bsdf_pdf:      density of bsdf_scatter's continuous part, per solid angle, lobe choice included.
//
// Radiance is carried: transmission from the side of index ratio eta has the factor 1/eta² (PBR, 4th ed., §9.5.2).
#ifndef BSDF_GLSL
#define BSDF_GLSL
#include "features.glsl"
#include "layout.glsl"
#include "math.glsl"
#include "ggx.glsl"

const uint SCATTERED_DELTA = 1u;
const uint SCATTERED_THROUGH = 2u;

struct BsdfParameters {
    uint kind;
    vec3 color;
    float metallic;
    vec2 alpha;   // GGX along x and z; 0 where the specular lobe is a delta
    float ior;    // of the inside relative to the outside
    float eta;    // index of refraction of the far side relative to wo's side
    float transmission;
    float specular;
    vec3 specular_color;
    bool schlick;
    bool solid;   // the boundary of a volume, not a thin wall
    // Set by bsdf_prepare.
    GgxAlbedo albedo;
    float dielectric_albedo;
};

struct BsdfSample {
    vec3 wi;
    vec3 weight;
    float pdf;  // of a continuous lobe; 0 for a delta lobe
    uint flags;
};
const BsdfSample ABSORBED = BsdfSample(vec3(0.0, 1.0, 0.0), vec3(0.0), 0.0, 0u);

bool ggx_is_delta(BsdfParameters p) { return p.alpha.x == 0.0; }

vec3 mirrored(vec3 w) { return vec3(w.x, -w.y, w.z); }

#include "fresnel.glsl"
#include "bsdf_lambertian.glsl"
#include "bsdf_specular.glsl"
#include "bsdf_dielectric.glsl"
#include "bsdf_metallic_roughness.glsl"

void bsdf_prepare(RenderConstants constants, inout BsdfParameters p, vec3 wo) {
    p.albedo = GgxAlbedo(1.0, 0.0);
    p.dielectric_albedo = 1.0;
    if (HAS_BSDF(BSDF_METALLIC_ROUGHNESS) && p.kind == BSDF_METALLIC_ROUGHNESS)
        metallic_roughness_prepare(constants, p, wo);
}

// `u`: lobe, direction u, direction v.
BsdfSample bsdf_scatter(BsdfParameters p, vec3 wo, vec3 u) {
    if (HAS_BSDF(BSDF_LAMBERTIAN) && p.kind == BSDF_LAMBERTIAN) return lambertian_scatter(p, wo, u);
    if (HAS_BSDF(BSDF_MIRROR) && p.kind == BSDF_MIRROR) return mirror_scatter(p, wo);
    if (HAS_BSDF(BSDF_REFRACT) && p.kind == BSDF_REFRACT) return refract_scatter(p, wo);
    if (HAS_BSDF(BSDF_GLASS) && p.kind == BSDF_GLASS) return glass_scatter(p, wo, u.x);
    if (HAS_BSDF(BSDF_METALLIC_ROUGHNESS) && p.kind == BSDF_METALLIC_ROUGHNESS)
        return metallic_roughness_scatter(p, wo, u);
    return ABSORBED;
}

vec3 bsdf_evaluate(BsdfParameters p, vec3 wo, vec3 wi) {
    if (HAS_BSDF(BSDF_LAMBERTIAN) && p.kind == BSDF_LAMBERTIAN) return lambertian_evaluate(p, wo, wi);
    if (HAS_BSDF(BSDF_METALLIC_ROUGHNESS) && p.kind == BSDF_METALLIC_ROUGHNESS)
        return metallic_roughness_evaluate(p, wo, wi);
    return vec3(0.0);
}

float bsdf_pdf(BsdfParameters p, vec3 wo, vec3 wi) {
    if (HAS_BSDF(BSDF_LAMBERTIAN) && p.kind == BSDF_LAMBERTIAN) return lambertian_pdf(p, wo, wi);
    if (HAS_BSDF(BSDF_METALLIC_ROUGHNESS) && p.kind == BSDF_METALLIC_ROUGHNESS)
        return metallic_roughness_pdf(p, wo, wi);
    return 0.0;
}

// Whether light that comes from the other side can be scattered by a continuous lobe.
bool bsdf_transmits(BsdfParameters p) {
    if (p.kind != BSDF_METALLIC_ROUGHNESS || p.transmission == 0.0) return false;
    if (HAS_VOLUME && p.solid) return !dielectric_is_delta(p);
    return HAS_TRANSMISSION && !ggx_is_delta(p);
}

// Whether light sampling can reach anything: is there a continuous lobe?
bool bsdf_has_continuous_lobe(BsdfParameters p) {
    return p.kind == BSDF_LAMBERTIAN ||
           (HAS_BSDF(BSDF_METALLIC_ROUGHNESS) && p.kind == BSDF_METALLIC_ROUGHNESS &&
            metallic_roughness_has_continuous_lobe(p));
}

#endif
