// The boundary of a volume, rough or smooth: microfacets that reflect the share F of the light and refract the rest (Walter
// et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"), with GGX and height-correlated masking.
//
//   reflection:  F·D·V·tint / E
//   refraction:  (1 − F)·color·D·4V(mirrored wi)·|wo·h||wi·h|/(wo·h + η·wi·h)² / E
//
// E(wo) is what one scattering keeps of the light, reflected and refracted; dividing by it gives back the rest, as Cycles
// does. It comes from a table (tests/common/dielectric_albedo.rs). F is the exact Fresnel reflectance, times the factor of
// KHR_materials_specular where reflection is not total.

// The largest |ln η|, as (η − 1)/(η + 1), at which the surface counts as smooth. With η = 1.01 refraction by facets
// however tilted turns light by less than 0.01 of their slope, while at grazing angles from the inside the model of one
// scattering keeps as little as 1 % of the light, and says nothing of the rest.
const float DIELECTRIC_SMALLEST_CONTRAST = 0.005;
const float DIELECTRIC_LARGEST_CONTRAST = 0.98;

float index_contrast(float eta) { return (eta - 1.0) / (eta + 1.0); }

// Share of the material that is such a boundary.
float dielectric_share(BsdfParameters p) {
    return HAS_VOLUME && p.solid ? (1.0 - p.metallic) * p.transmission : 0.0;
}

bool dielectric_is_delta(BsdfParameters p) {
    return ggx_is_delta(p) || abs(index_contrast(p.eta)) < DIELECTRIC_SMALLEST_CONTRAST;
}

// Reflectance of a facet; `transmitted` is the cosine of the refracted direction, negative where reflection is total.
float facet_reflectance(BsdfParameters p, float cosine, float transmitted) {
    float reflectance = fresnel_dielectric(cosine, transmitted, p.eta);
    return HAS_SPECULAR && transmitted >= 0.0 ? reflectance * p.specular : reflectance;
}

// KHR_materials_specular's colour: reflection at normal incidence has it, at grazing angles it is white. A colour above 1
// counts as 1, since what is reflected more would have to be refracted less.
vec3 dielectric_tint(BsdfParameters p, float cosine) {
    return HAS_SPECULAR ? mix(min(p.specular_color, vec3(1.0)), vec3(1.0), pow5(1.0 - cosine)) : vec3(1.0);
}

// Density of the visible normal h seen from wo.
float visible_normal_pdf(BsdfParameters p, vec3 wo, vec3 h) {
    return 2.0 * ggx_distribution(h, p.alpha) * dot(wo, h) / (wo.y + ggx_stretched_length(wo, p.alpha));
}

// The normal that refracts wo to wi, on the side of wo.
vec3 refraction_normal(vec3 wo, vec3 wi, float eta) {
    vec3 h = normalize(wo + wi * eta);
    return h.y < 0.0 ? -h : h;
}

// Value and density of the rough boundary.
vec4 dielectric_evaluate(BsdfParameters p, vec3 wo, vec3 wi) {
    if (wi.y > 0.0) {
        vec3 h = normalize(wo + wi);
        float cosine = dot(wo, h);
        float reflectance = facet_reflectance(p, cosine, transmitted_cosine(cosine, p.eta));
        float value = reflectance * ggx_distribution(h, p.alpha) * ggx_visibility(wo, wi, p.alpha);
        float pdf = reflectance * visible_normal_pdf(p, wo, h) / (4.0 * cosine);
        return vec4(dielectric_tint(p, cosine) * (value / p.dielectric_albedo), pdf);
    }
    vec3 h = refraction_normal(wo, wi, p.eta);
    float near = dot(wo, h);
    float far = -dot(wi, h);
    // A normal from which one of them is seen from behind refracts nothing.
    if (near <= 0.0 || far <= 0.0) return vec4(0.0);
    float refracted = 1.0 - facet_reflectance(p, near, far);
    float jacobian = far / sqr(near - p.eta * far);
    float lobe = ggx_distribution(h, p.alpha) * 4.0 * ggx_visibility(wo, mirrored(wi), p.alpha);
    float value = refracted * lobe * near * jacobian;
    float pdf = refracted * visible_normal_pdf(p, wo, h) * sqr(p.eta) * jacobian;
    return vec4(p.color * (value / p.dielectric_albedo), pdf);
}

// A direction of the smooth boundary, which takes `probability` of all samples.
BsdfSample smooth_dielectric_scatter(BsdfParameters p, vec3 wo, float u, float probability) {
    float transmitted = transmitted_cosine(wo.y, p.eta);
    float weight = dielectric_share(p) / probability;
    if (u < facet_reflectance(p, wo.y, transmitted))
        return BsdfSample(reflect_local(wo), dielectric_tint(p, wo.y) * weight, 0.0, SCATTERED_DELTA);
    return BsdfSample(refract_local(wo, transmitted, p.eta), p.color * (weight / sqr(p.eta)), 0.0,
                      SCATTERED_DELTA | SCATTERED_THROUGH);
}

// A direction of the rough boundary for `u`: reflection, normal u, normal v; zero where the facet sends it into the surface.
vec3 rough_dielectric_direction(BsdfParameters p, vec3 wo, vec3 u) {
    vec3 h = sample_visible_normal(wo, p.alpha, 1.0, u.yz);
    float cosine = dot(wo, h);
    float transmitted = transmitted_cosine(cosine, p.eta);
    if (u.x < facet_reflectance(p, cosine, transmitted)) {
        vec3 wi = h * (2.0 * cosine) - wo;
        return wi.y > 0.0 ? wi : vec3(0.0);
    }
    vec3 wi = h * (cosine / p.eta - transmitted) - wo / p.eta;
    return wi.y < 0.0 ? wi : vec3(0.0);
}

// The equal roughness that loses about as much as an anisotropic one, within −2 % to +3 % of the albedo where one
// roughness is up to four times the other. The margin, in proportion to their difference over their sum, makes an error a
// loss.
float equal_alpha(vec3 wo, vec2 alpha) {
    vec2 squared = alpha * alpha;
    return sqrt(0.5 * (squared.x + squared.y) + 0.125 * (squared.y - squared.x) * (sqr(wo.x) - sqr(wo.z)));
}
const float ANISOTROPIC_MARGIN = 0.065;

// What one scattering keeps, between nodes of a table, whose first two coordinates are those of ggx_albedo and the third
// is ln |contrast|. A texel holds a node and the three next to it along the first two. Half of a node is E, the other half E
// without reflection: E is linear in the factor of the reflectance.
float dielectric_albedo(RenderConstants constants, vec3 wo, BsdfParameters p) {
    const uvec3 size = DIELECTRIC_ALBEDO_SIZE;
    vec2 alpha = p.alpha;
    if (HAS_ANISOTROPY && alpha.x != alpha.y) alpha = vec2(equal_alpha(wo, alpha));
    float contrast = index_contrast(p.eta);
    const float range = log(DIELECTRIC_LARGEST_CONTRAST / DIELECTRIC_SMALLEST_CONTRAST);
    float z = log(abs(contrast) / DIELECTRIC_SMALLEST_CONTRAST) / range;
    vec3 at = vec3(ggx_albedo_coordinates(wo, alpha), clamp(z, 0.0, 1.0)) * vec3(size - 1u);
    uvec3 cell = min(uvec3(at), size - 2u);
    vec3 f = at - vec3(cell);
    uint slice = cell.z + (contrast < 0.0 ? size.z : 0u);
    // The table stands before that of GGX.
    uint table = constants.ggx_albedo - 2u * size.x * size.y * size.z;
    uint first = table + (slice * size.y + cell.y) * size.x + cell.x;
    vec2 albedo = vec2(0.0);
    for (uint i = 0u; i < 2u; i++) {
        uvec4 nodes = LOAD4(TABLES, first + i * size.x * size.y);
        vec2 low = mix(unpackUnorm2x16(nodes.x), unpackUnorm2x16(nodes.y), f.x);
        vec2 high = mix(unpackUnorm2x16(nodes.z), unpackUnorm2x16(nodes.w), f.x);
        albedo += mix(low, high, f.y) * (i == 0u ? 1.0 - f.z : f.z);
    }
    float kept = HAS_SPECULAR ? mix(albedo.y, albedo.x, p.specular) : albedo.x;
    if (HAS_ANISOTROPY) kept += ANISOTROPIC_MARGIN * abs(p.alpha.x - p.alpha.y) / (p.alpha.x + p.alpha.y);
    return kept;
}
