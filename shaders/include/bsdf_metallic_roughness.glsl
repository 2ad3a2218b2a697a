// glTF 2.0's metallic-roughness model (specification, appendix B.3): a GGX specular lobe with Schlick's Fresnel term
// over a Lambertian base; KHR_materials_transmission lets a share of the base pass straight through (thin-walled).
//
//   f = F·D·V + (1 − F)·(1 − transmission)·c_diffuse/π + a delta lobe (1 − F(wo.y))·transmission·c_diffuse towards −wo

// Below this α the specular lobe is a delta. Components of the half vector carry rounding errors of 2^-24, which changes
// D(h) relatively by some 4·2^-24/α; at α = 2^-12 that is 2^-10, and the lobe's width is 2.4e-4 radians.
const float SMALLEST_ALPHA = 2.44140625e-4;

vec3 specular_f0(BsdfParameters p) { return mix(vec3(sqr((p.ior - 1.0) / (p.ior + 1.0))), p.color, p.metallic); }
vec3 diffuse_color(BsdfParameters p) { return p.color * (1.0 - p.metallic); }

bool metallic_roughness_has_continuous_lobe(BsdfParameters p) {
    return p.alpha > 0.0 || p.metallic < 1.0;
}

// Probabilities of the lobes (specular, diffuse, through), by about what each sends on. The specular one has at least the
// mean of Schlick's term over the hemisphere, F0 + (1 − F0)/21, so it is chosen wherever it is positive. The diffuse lobe's
// factor 1 − F(wo·h) is replaced by its mean too: unlike that of the light straight through, it does not vanish with wo.y,
// and a lobe chosen too seldom makes fireflies.
vec3 lobe_probabilities(BsdfParameters p, float cosine) {
    vec3 f0 = specular_f0(p);
    vec3 mean = f0 + (1.0 - f0) * (1.0 / 21.0);
    vec3 fresnel = fresnel_schlick(f0, cosine);
    float base = luminance(diffuse_color(p));
    vec3 weights = vec3(luminance(max(fresnel, mean)), base * (1.0 - p.transmission) * (1.0 - luminance(mean)),
                        base * p.transmission * (1.0 - luminance(fresnel)));
    return weights / (weights.x + weights.y + weights.z);
}

float ggx_distribution(vec3 h, float alpha) {
    float a2 = alpha * alpha;
    // 1 + cos²θ·(α² − 1), written without cancellation.
    float d = h.x * h.x + h.z * h.z + a2 * h.y * h.y;
    return a2 / (PI * d * d);
}

// Smith's G1 (Heitz 2014, eq. 43 and 72), as 2 / (1 + sqrt(1 + α² tan²θ)).
float ggx_masking(float cosine, float alpha) {
    float a2 = alpha * alpha;
    return 2.0 * cosine / (cosine + sqrt(a2 + (1.0 - a2) * cosine * cosine));
}

// Height-correlated masking and shadowing over 4·cos θo·cos θi (Heitz 2014, eq. 99).
float ggx_visibility(float cosine_o, float cosine_i, float alpha) {
    float a2 = alpha * alpha;
    return 0.5 / (cosine_i * sqrt(a2 + (1.0 - a2) * cosine_o * cosine_o) +
                  cosine_o * sqrt(a2 + (1.0 - a2) * cosine_i * cosine_i));
}

// A normal visible from wo (Heitz 2018, "Sampling the GGX Distribution of Visible Normals"), with +Y as the normal.
vec3 sample_visible_normal(vec3 wo, float alpha, vec2 u) {
    vec3 stretched = normalize(vec3(alpha * wo.x, wo.y, alpha * wo.z));
    float horizontal = stretched.x * stretched.x + stretched.z * stretched.z;
    vec3 t1 = horizontal > 0.0 ? vec3(-stretched.z, 0.0, stretched.x) * inversesqrt(horizontal) : vec3(1.0, 0.0, 0.0);
    vec3 t2 = cross(t1, stretched);
    vec2 disk = cos_sin_turns(u.y) * sqrt(u.x);
    float s = 0.5 * (1.0 + stretched.y);
    disk.y = (1.0 - s) * sqrt(max(0.0, 1.0 - disk.x * disk.x)) + s * disk.y;
    vec3 h = disk.x * t1 + disk.y * t2 + sqrt(max(0.0, 1.0 - dot(disk, disk))) * stretched;
    return normalize(vec3(alpha * h.x, max(h.y, 0.0), alpha * h.z));
}

float specular_pdf(vec3 wo, vec3 h, float alpha) {
    return ggx_masking(wo.y, alpha) * ggx_distribution(h, alpha) / (4.0 * wo.y);
}

vec3 metallic_roughness_evaluate(BsdfParameters p, vec3 wo, vec3 wi) {
    if (wi.y <= 0.0) return vec3(0.0);
    vec3 h = normalize(wo + wi);
    vec3 fresnel = fresnel_schlick(specular_f0(p), dot(wo, h));
    vec3 diffuse = (1.0 - fresnel) * (1.0 - p.transmission) * diffuse_color(p) * INV_PI;
    if (p.alpha == 0.0) return diffuse;
    return diffuse + fresnel * (ggx_distribution(h, p.alpha) * ggx_visibility(wo.y, wi.y, p.alpha));
}

float metallic_roughness_pdf(BsdfParameters p, vec3 wo, vec3 wi) {
    if (wi.y <= 0.0) return 0.0;
    vec3 probability = lobe_probabilities(p, wo.y);
    float diffuse = probability.y * wi.y * INV_PI;
    if (p.alpha == 0.0) return diffuse;
    return diffuse + probability.x * specular_pdf(wo, normalize(wo + wi), p.alpha);
}

BsdfSample metallic_roughness_scatter(BsdfParameters p, vec3 wo, vec3 u) {
    vec3 probability = lobe_probabilities(p, wo.y);
    vec3 wi;
    if (u.x < probability.x || probability.y + probability.z == 0.0) {
        if (p.alpha == 0.0)
            return BsdfSample(reflect_local(wo), fresnel_schlick(specular_f0(p), wo.y) / probability.x, 0.0,
                              SCATTERED_DELTA);
        vec3 h = sample_visible_normal(wo, p.alpha, u.yz);
        wi = h * (2.0 * dot(wo, h)) - wo;
    } else if (u.x < probability.x + probability.y || probability.z == 0.0) {
        wi = sample_cosine_hemisphere(u.yz);
    } else {
        vec3 through = (1.0 - fresnel_schlick(specular_f0(p), wo.y)) * p.transmission * diffuse_color(p);
        return BsdfSample(-wo, through / probability.z, 0.0, SCATTERED_DELTA | SCATTERED_THROUGH);
    }
    // The visible normal's reflection can point below the surface: that light is lost in the single-scattering model.
    if (wi.y <= 0.0) return ABSORBED;
    float pdf = metallic_roughness_pdf(p, wo, wi);
    return BsdfSample(wi, metallic_roughness_evaluate(p, wo, wi) * (wi.y / pdf), pdf, 0u);
}
