// glTF 2.0's metallic-roughness model (specification, appendix B.3) with KHR_materials_ior, _specular, _anisotropy,
// _transmission and _volume: a GGX lobe with Schlick's Fresnel term over a base that is diffuse or transmits.
//
//   f = F·D·V + (1 − metallic)·color·(1 − E)·((1 − transmission)/π  or  transmission·D·V(mirrored wi)/E₁)
//
// Where the surface is the boundary of a volume, the share (1 − metallic)·transmission of it is bsdf_dielectric.glsl's
// instead, and the rest is this without transmission.
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
    vec3 of_dielectric = multiple_scattering(p, f0) * (1.0 - p.metallic - dielectric_share(p));
    vec3 of_metal = multiple_scattering(p, p.color) * p.metallic;
    return Schlick(f0 * of_dielectric + p.color * of_metal, (HAS_SPECULAR ? p.specular : 1.0) * of_dielectric + of_metal);
}

bool metallic_roughness_has_continuous_lobe(BsdfParameters p) {
    if (p.metallic < 1.0 && p.transmission < 1.0) return true;
    return !ggx_is_delta(p) && (dielectric_share(p) < 1.0 || !dielectric_is_delta(p));
}

// What follows from wo alone; done once a hit.
void metallic_roughness_prepare(RenderConstants constants, inout BsdfParameters p, vec3 wo) {
    p.albedo = ggx_is_delta(p) ? GgxAlbedo(1.0, pow5(1.0 - wo.y)) : ggx_albedo(constants.ggx_albedo, wo, p.alpha);
    if (dielectric_share(p) > 0.0 && !dielectric_is_delta(p)) {
        p.dielectric_albedo = dielectric_albedo(constants, wo, p);
    }
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

// The shares of the base that are diffuse, and that pass straight through a thin wall.
float diffuse_share(BsdfParameters p) { return HAS_TRANSMISSION || HAS_VOLUME ? 1.0 - p.transmission : 1.0; }
float through_share(BsdfParameters p) { return HAS_TRANSMISSION && !(HAS_VOLUME && p.solid) ? p.transmission : 0.0; }

// A pane: a clear thin wall, behind which light goes on as it came.
bool bsdf_is_pane(BsdfParameters p) {
    return HAS_TRANSMISSION && HAS_BSDF(BSDF_METALLIC_ROUGHNESS) && p.kind == BSDF_METALLIC_ROUGHNESS &&
           through_share(p) > 0.0 && ggx_is_delta(p);
}

// What of the light goes straight through a pane.
vec3 pane_transmittance(BsdfParameters p) { return base_albedo(p) * through_share(p); }

// Probabilities of the lobes (specular, diffuse, through, dielectric boundary): their albedos.
vec4 lobe_probabilities(BsdfParameters p) {
    float base = luminance(base_albedo(p));
    vec4 weights = vec4(luminance(specular_albedo(p, specular_term(p))), base * diffuse_share(p),
                        base * through_share(p), dielectric_share(p));
    float total = weights.x + weights.y + weights.z + weights.w;
    return total > 0.0 ? weights / total : vec4(0.0);
}

// Value and density of a boundary that is a part of the material and of the samples.
vec4 dielectric_part(BsdfParameters p, float probability, vec3 wo, vec3 wi) {
    float share = dielectric_share(p);
    if (share == 0.0 || dielectric_is_delta(p)) return vec4(0.0);
    return dielectric_evaluate(p, wo, wi) * vec4(vec3(share), probability);
}

vec3 metallic_roughness_evaluate(BsdfParameters p, vec3 wo, vec3 wi) {
    if (wi.y == 0.0) return vec3(0.0);
    vec3 dielectric = dielectric_part(p, 0.0, wo, wi).rgb;
    if (wi.y < 0.0) {
        if (through_share(p) == 0.0 || ggx_is_delta(p)) return dielectric;
        vec3 up = mirrored(wi);
        float lobe = ggx_distribution(normalize(wo + up), p.alpha) * ggx_visibility(wo, up, p.alpha);
        return base_albedo(p) * (through_share(p) * lobe / p.albedo.white);
    }
    vec3 diffuse = base_albedo(p) * (diffuse_share(p) * INV_PI);
    if (ggx_is_delta(p)) return diffuse;
    vec3 h = normalize(wo + wi);
    Schlick term = specular_term(p);
    vec3 fresnel = term.f0 + (term.f90 - term.f0) * pow5(1.0 - dot(wo, h));
    return dielectric + diffuse + fresnel * (ggx_distribution(h, p.alpha) * ggx_visibility(wo, wi, p.alpha));
}

float metallic_roughness_pdf(BsdfParameters p, vec3 wo, vec3 wi) {
    vec4 probability = lobe_probabilities(p);
    if (wi.y == 0.0) return 0.0;
    float dielectric = dielectric_part(p, probability.w, wo, wi).a;
    if (wi.y < 0.0) {
        if (through_share(p) == 0.0 || ggx_is_delta(p)) return dielectric;
        return probability.z * ggx_reflection_pdf(wo, normalize(wo + mirrored(wi)), p.alpha);
    }
    float diffuse = probability.y * wi.y * INV_PI;
    if (ggx_is_delta(p)) return diffuse;
    return dielectric + diffuse + probability.x * ggx_reflection_pdf(wo, normalize(wo + wi), p.alpha);
}

// A sample of the continuous lobes together, in a direction that one of them chose.
BsdfSample metallic_roughness_sample(BsdfParameters p, vec3 wo, vec3 wi) {
    float pdf = metallic_roughness_pdf(p, wo, wi);
    // So close to the edge of a facet that wi's rounding is beyond it.
    if (pdf == 0.0) return ABSORBED;
    vec3 weight = metallic_roughness_evaluate(p, wo, wi) * (abs(wi.y) / pdf);
    return BsdfSample(wi, weight, pdf, wi.y < 0.0 ? SCATTERED_THROUGH : 0u);
}

BsdfSample metallic_roughness_scatter(BsdfParameters p, vec3 wo, vec3 u) {
    vec4 probability = lobe_probabilities(p);
    vec3 end = vec3(probability.x, probability.x + probability.y, probability.x + probability.y + probability.z);
    bool dielectric = HAS_VOLUME && u.x >= end.z && probability.w > 0.0;
    if (dielectric) {
        float v = min((u.x - end.z) / probability.w, LARGEST_BELOW_1);
        if (dielectric_is_delta(p)) return smooth_dielectric_scatter(p, wo, v, probability.w);
        vec3 wi = rough_dielectric_direction(p, wo, vec3(v, u.yz));
        if (wi.y == 0.0) return ABSORBED;
        return metallic_roughness_sample(p, wo, wi);
    }
    if (u.x >= end.x && (u.x < end.y || probability.z == 0.0)) {
        if (probability.y == 0.0) return ABSORBED;  // black, or rounding at the end of the last lobe
        return metallic_roughness_sample(p, wo, sample_cosine_hemisphere(u.yz));
    }
    bool through = u.x >= end.x;
    if (ggx_is_delta(p)) {
        if (through)
            return BsdfSample(-wo, pane_transmittance(p) / probability.z, 0.0, SCATTERED_DELTA | SCATTERED_THROUGH);
        return BsdfSample(reflect_local(wo), specular_albedo(p, specular_term(p)) / probability.x, 0.0, SCATTERED_DELTA);
    }
    vec3 h = sample_visible_normal(wo, p.alpha, ggx_bound(wo, p.alpha), u.yz);
    vec3 wi = h * (2.0 * dot(wo, h)) - wo;
    // Reflected below the surface by normals that the bound did not exclude: no light comes from there.
    if (wi.y <= 0.0) return ABSORBED;
    return metallic_roughness_sample(p, wo, through ? mirrored(wi) : wi);
}
