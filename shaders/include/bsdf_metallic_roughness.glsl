// glTF 2.0's metallic-roughness model (specification, appendix B.3) with KHR_materials_ior, _specular, _anisotropy and
// _transmission (thin-walled): a GGX lobe with Schlick's Fresnel term over a base that is diffuse or transmits.
//
//   f = F·D·V + (1 − metallic)·color·(1 − E)·((1 − transmission)/π  or  transmission·D·V(mirrored wi)/E₁)
//
// E₁(wo) is the albedo of D·V alone: what one scattering keeps. The factor 1 + F0·(1 − E₁)/E₁, for the dielectric and the
// metal each, gives back what it loses (Turquin 2019, "Practical multiple scattering compensation for microfacet models",
// eq. 16), and the base gets what the dielectric's
// lobe leaves, 1 − E(wo), instead of glTF's 1 − F(wo·h), with which white reflects up to 1.8 at grazing angles. Both
// factors depend on wo alone, so the model is not reciprocal; D·V·F is.

// Schlick's Fresnel term, F0 + (F90 − F0)·(1 − wo·h)⁵, times the factor for multiple scattering.
struct Schlick {
    vec3 f0;
    vec3 f90;
};

vec3 dielectric_f0(BsdfParameters p) {
    float f0 = sqr((p.ior - 1.0) / (p.ior + 1.0));
    return HAS_SPECULAR ? min(f0 * p.specular_color, vec3(1.0)) * p.specular : vec3(f0);
}

vec3 multiple_scattering(BsdfParameters p, vec3 f0) { return 1.0 + f0 * ((1.0 - p.albedo.white) / p.albedo.white); }

// Of the dielectric's and the metal's lobe together, each with its own factor.
Schlick specular_term(BsdfParameters p) {
    vec3 f0 = dielectric_f0(p);
    vec3 of_dielectric = multiple_scattering(p, f0) * (1.0 - p.metallic);
    vec3 of_metal = multiple_scattering(p, p.color) * p.metallic;
    return Schlick(f0 * of_dielectric + p.color * of_metal, (HAS_SPECULAR ? p.specular : 1.0) * of_dielectric + of_metal);
}

bool ggx_is_delta(BsdfParameters p) { return p.alpha.x == 0.0; }

bool metallic_roughness_has_continuous_lobe(BsdfParameters p) {
    return !ggx_is_delta(p) || (p.metallic < 1.0 && p.transmission < 1.0);
}

// What follows from wo alone; done once a hit.
void metallic_roughness_prepare(RenderConstants constants, inout BsdfParameters p, vec3 wo) {
    p.albedo = ggx_is_delta(p) ? GgxAlbedo(1.0, pow5(1.0 - wo.y)) : ggx_albedo(constants.ggx_albedo, wo, p.alpha);
}

// Albedo of a lobe.
vec3 specular_albedo(BsdfParameters p, Schlick term) {
    return term.f0 * (p.albedo.white - p.albedo.schlick) + term.f90 * p.albedo.schlick;
}

// The base's albedo: what is diffuse and what is transmitted, together. A coloured reflection leaves what its strongest
// channel leaves, so that the base is not tinted by its complement (KHR_materials_specular).
vec3 base_albedo(BsdfParameters p) {
    float f0 = max_component(dielectric_f0(p));
    float f90 = HAS_SPECULAR ? p.specular : 1.0;
    float kept = f0 * (p.albedo.white - p.albedo.schlick) + f90 * p.albedo.schlick;
    return p.color * ((1.0 - p.metallic) * (1.0 - kept * multiple_scattering(p, vec3(f0)).x));
}

// Probabilities of the lobes (specular, diffuse, through): their albedos.
vec3 lobe_probabilities(BsdfParameters p) {
    float base = luminance(base_albedo(p));
    float through = HAS_TRANSMISSION ? p.transmission : 0.0;
    vec3 weights = vec3(luminance(specular_albedo(p, specular_term(p))), base * (1.0 - through),
                        base * through);
    float total = weights.x + weights.y + weights.z;
    return total > 0.0 ? weights / total : vec3(0.0);
}

vec3 mirrored(vec3 w) { return vec3(w.x, -w.y, w.z); }

vec3 metallic_roughness_evaluate(BsdfParameters p, vec3 wo, vec3 wi) {
    if (wi.y < 0.0) {
        if (!HAS_TRANSMISSION || ggx_is_delta(p)) return vec3(0.0);
        vec3 up = mirrored(wi);
        float lobe = ggx_distribution(normalize(wo + up), p.alpha) * ggx_visibility(wo, up, p.alpha);
        return base_albedo(p) * (p.transmission * lobe / p.albedo.white);
    }
    if (wi.y == 0.0) return vec3(0.0);
    float opaque = HAS_TRANSMISSION ? 1.0 - p.transmission : 1.0;
    vec3 diffuse = base_albedo(p) * (opaque * INV_PI);
    if (ggx_is_delta(p)) return diffuse;
    vec3 h = normalize(wo + wi);
    Schlick term = specular_term(p);
    vec3 fresnel = term.f0 + (term.f90 - term.f0) * pow5(1.0 - dot(wo, h));
    return diffuse + fresnel * (ggx_distribution(h, p.alpha) * ggx_visibility(wo, wi, p.alpha));
}

float metallic_roughness_pdf(BsdfParameters p, vec3 wo, vec3 wi) {
    vec3 probability = lobe_probabilities(p);
    if (wi.y < 0.0) {
        if (!HAS_TRANSMISSION || ggx_is_delta(p)) return 0.0;
        return probability.z * ggx_reflection_pdf(wo, normalize(wo + mirrored(wi)), p.alpha);
    }
    float diffuse = probability.y * wi.y * INV_PI;
    if (ggx_is_delta(p) || wi.y == 0.0) return diffuse;
    return diffuse + probability.x * ggx_reflection_pdf(wo, normalize(wo + wi), p.alpha);
}

BsdfSample metallic_roughness_scatter(BsdfParameters p, vec3 wo, vec3 u) {
    vec3 probability = lobe_probabilities(p);
    if (u.x >= probability.x && (u.x < probability.x + probability.y || probability.z == 0.0)) {
        if (probability.y == 0.0) return ABSORBED;  // black, or rounding at the end of the last lobe
        vec3 wi = sample_cosine_hemisphere(u.yz);
        float pdf = metallic_roughness_pdf(p, wo, wi);
        return BsdfSample(wi, metallic_roughness_evaluate(p, wo, wi) * (wi.y / pdf), pdf, 0u);
    }
    bool through = u.x >= probability.x;
    if (ggx_is_delta(p)) {
        if (through)
            return BsdfSample(-wo, base_albedo(p) * (p.transmission / probability.z), 0.0,
                              SCATTERED_DELTA | SCATTERED_THROUGH);
        return BsdfSample(reflect_local(wo), specular_albedo(p, specular_term(p)) / probability.x, 0.0, SCATTERED_DELTA);
    }
    vec3 h = sample_visible_normal(wo, p.alpha, ggx_bound(wo, p.alpha), u.yz);
    vec3 wi = h * (2.0 * dot(wo, h)) - wo;
    // Reflected below the surface by normals that the bound did not exclude: no light comes from there.
    if (wi.y <= 0.0) return ABSORBED;
    if (through) wi = mirrored(wi);
    float pdf = metallic_roughness_pdf(p, wo, wi);
    vec3 weight = metallic_roughness_evaluate(p, wo, wi) * (abs(wi.y) / pdf);
    return BsdfSample(wi, weight, pdf, through ? SCATTERED_THROUGH : 0u);
}
