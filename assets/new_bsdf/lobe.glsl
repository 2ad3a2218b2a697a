// NAME: a lobe that is brightest at grazing angles, where fibres stand against the light. It is there to be changed.
//
//   f = color/π · (1 − s·cos θo·cos θi)        s: strength in [0, 1]; 0 is Lambertian
//
// The same with wo and wi exchanged. It reflects color·(1 − ⅔·s·cos θo) of the light, never more than it gets.
//
// +Y is the normal, on the side of wo (wo.y > 0). Directions point away from the surface, so cos θ = w.y. The three functions
// must be of one model: test/bsdf_NAME.toml says how that is checked, `sunfleck shader-test test/bsdf_NAME.comp` does.
// BsdfParameters, BsdfSample and the flags are those of bsdf.glsl.
#ifndef BSDF_NAME_GLSL
#define BSDF_NAME_GLSL

// What of the material it goes by: glTF's roughness, squared.
float NAME_strength(BsdfParameters p) { return p.alpha.x; }

// f(wo, wi), without the cosine, in 1/sr. Zero below the surface: the lobe only reflects.
vec3 NAME_evaluate(BsdfParameters p, vec3 wo, vec3 wi) {
    if (wi.y <= 0.0) return vec3(0.0);
    return p.color * (INV_PI * (1.0 - NAME_strength(p) * wo.y * wi.y));
}

// The density with which NAME_scatter draws wi, per solid angle: by the cosine.
float NAME_pdf(BsdfParameters p, vec3 wo, vec3 wi) { return max(wi.y, 0.0) * INV_PI; }

// Draws a direction from `u`: which lobe (there is one), direction u and v. The weight is f·cos θi/pdf. A lobe that goes
// through the surface sets SCATTERED_THROUGH, a mirror SCATTERED_DELTA (with pdf 0); ABSORBED is no direction at all.
BsdfSample NAME_scatter(BsdfParameters p, vec3 wo, vec3 u) {
    vec3 wi = sample_cosine_hemisphere(u.yz);
    float pdf = NAME_pdf(p, wo, wi);
    return BsdfSample(wi, NAME_evaluate(p, wo, wi) * (wi.y / pdf), pdf, 0u);
}

#endif
