// The smooth BSDFs: mirror, refract, glass. All their lobes are deltas.

vec3 reflect_local(vec3 wo) { return vec3(-wo.x, wo.y, -wo.z); }

// Snell's law; `cosine` is the transmitted one.
vec3 refract_local(vec3 wo, float cosine, float eta) { return vec3(-wo.x / eta, -cosine, -wo.z / eta); }

BsdfSample mirror_scatter(BsdfParameters p, vec3 wo) {
    return BsdfSample(reflect_local(wo), p.color, 0.0, SCATTERED_DELTA);
}

BsdfSample transmitted_sample(BsdfParameters p, vec3 wo, float cosine) {
    return BsdfSample(refract_local(wo, cosine, p.eta), p.color / (p.eta * p.eta), 0.0,
                      SCATTERED_DELTA | SCATTERED_THROUGH);
}

BsdfSample refract_scatter(BsdfParameters p, vec3 wo) {
    float cosine = transmitted_cosine(wo.y, p.eta);
    if (cosine < 0.0) return mirror_scatter(p, wo);
    return transmitted_sample(p, wo, cosine);
}

// Reflects with the Fresnel probability, which cancels in the weight.
BsdfSample glass_scatter(BsdfParameters p, vec3 wo, float u) {
    float cosine = transmitted_cosine(wo.y, p.eta);
    float reflectance = p.schlick ? fresnel_schlick_dielectric(wo.y, cosine, p.eta)
                                  : fresnel_dielectric(wo.y, cosine, p.eta);
    if (u < reflectance) return mirror_scatter(p, wo);
    return transmitted_sample(p, wo, cosine);
}
