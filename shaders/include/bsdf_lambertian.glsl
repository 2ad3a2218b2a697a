// Lambertian reflection: f = albedo / π, sampled by the cosine.

vec3 sample_cosine_hemisphere(vec2 u) {
    vec2 disk = cos_sin_turns(u.y) * sqrt(u.x);
    // u.x < 1, so the cosine is never zero.
    return vec3(disk.x, sqrt(1.0 - u.x), disk.y);
}

BsdfSample lambertian_scatter(BsdfParameters p, vec3 wo, vec3 u) {
    vec3 wi = sample_cosine_hemisphere(u.yz);
    return BsdfSample(wi, p.color, wi.y * INV_PI, 0u);
}

vec3 lambertian_evaluate(BsdfParameters p, vec3 wo, vec3 wi) { return wi.y > 0.0 ? p.color * INV_PI : vec3(0.0); }

float lambertian_pdf(BsdfParameters p, vec3 wo, vec3 wi) { return max(wi.y, 0.0) * INV_PI; }
