// The GGX microfacet distribution with Smith's height-correlated masking and shadowing. +Y is the normal; `alpha` is the
// roughness along x and z. Its reflections: sampled by bounded visible normals, and how much light one scattering keeps.
#ifndef GGX_GLSL
#define GGX_GLSL
#include "arrays.glsl"
#include "features.glsl"
#include "layout.glsl"
#include "math.glsl"

// Below this α the lobe is a delta. Components of the half vector carry rounding errors of 2^-24, which changes
// D(h) relatively by some 4·2^-24/α; at α = 2^-12 that is 2^-10, and the lobe's width is 2.4e-4 radians.
const float SMALLEST_ALPHA = 2.44140625e-4;

float ggx_distribution(vec3 h, vec2 alpha) {
    // αx·αz·(h.x²/αx² + h.y² + h.z²/αz²): for equal roughness sin²θ/1 + α²cos²θ over α², without cancellation.
    float a2 = alpha.x * alpha.y;
    float d = sqr(h.x) * (alpha.y / alpha.x) + sqr(h.z) * (alpha.x / alpha.y) + a2 * sqr(h.y);
    return a2 / (PI * d * d);
}

// |(αx·x, y, αz·z)|: cos θ·(1 + 2Λ) of Smith's function.
float ggx_stretched_length(vec3 w, vec2 alpha) {
    return sqrt(sqr(alpha.x * w.x) + sqr(w.y) + sqr(alpha.y * w.z));
}

// Height-correlated masking and shadowing over 4·cos θo·cos θi (Heitz 2014, eq. 99).
float ggx_visibility(vec3 wo, vec3 wi, vec2 alpha) {
    return 0.5 / (wi.y * ggx_stretched_length(wo, alpha) + wo.y * ggx_stretched_length(wi, alpha));
}

// The share of the spherical cap of reflections that is above the surface for certain (Eto and Tokuyoshi 2023, "Bounded
// VNDF Sampling for Smith–GGX Reflections", eq. 5).
float ggx_bound(vec3 wo, vec2 alpha) {
    float a2 = sqr(min(min(alpha.x, alpha.y), 1.0));
    float s2 = sqr(1.0 + sqrt(sqr(wo.x) + sqr(wo.z)));
    return (1.0 - a2) * s2 / (s2 + a2 * sqr(wo.y));
}

// A half vector by visible normals (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps"), of those
// whose reflection can be above the surface; `bound` = 1 draws all visible normals.
vec3 sample_visible_normal(vec3 wo, vec2 alpha, float bound, vec2 u) {
    vec3 stretched = normalize(vec3(alpha.x * wo.x, wo.y, alpha.y * wo.z));
    float b = bound * stretched.y;
    float y = (1.0 - u.x) * (1.0 + b) - b;
    vec2 horizontal = cos_sin_turns(u.y) * sqrt(max(0.0, (1.0 - y) * (1.0 + y)));
    vec3 h = stretched + vec3(horizontal.x, y, horizontal.y);
    return normalize(vec3(alpha.x * h.x, h.y, alpha.y * h.z));
}

// Density of the reflection about such a half vector, per solid angle of wi.
float ggx_reflection_pdf(vec3 wo, vec3 h, vec2 alpha) {
    return ggx_distribution(h, alpha) / (2.0 * (ggx_bound(wo, alpha) * wo.y + ggx_stretched_length(wo, alpha)));
}

// What one scattering keeps of the light: ∫ D·V·cos θi dωi, and the same with Schlick's (1 − wo·h)⁵.
struct GgxAlbedo {
    float white;
    float schlick;
};

// The equal roughness that loses about as much as an anisotropic one: with it the albedo is off by −2 % to +3 % where one
// roughness is up to four times the other. The margin, added to the albedo in proportion to their difference over their
// sum, makes an error a loss: what is given back is never too much (tests/gpu/bsdf_chi_square.rs).
float ggx_equal_alpha(vec3 wo, vec2 alpha) {
    vec2 squared = alpha * alpha;
    return sqrt(0.5 * (squared.x + squared.y) + 0.125 * (squared.y - squared.x) * (sqr(wo.x) - sqr(wo.z)));
}
const float ANISOTROPIC_MARGIN = 0.065;

// Coordinates of albedo tables, in [0, 1]: the polar angle φ of the direction stretched by the roughness, as
// √tan(π/4 − φ/2), and √α. Albedos are smooth in them down to grazing angles and to the delta.
vec2 ggx_albedo_coordinates(vec3 wo, vec2 alpha) {
    float horizontal = sqrt(sqr(alpha.x * wo.x) + sqr(alpha.y * wo.z));
    return sqrt(vec2(wo.y / (ggx_stretched_length(wo, alpha) + horizontal),
                     HAS_ANISOTROPY ? ggx_equal_alpha(wo, alpha) : alpha.x));
}

// By a table made by quadrature (tests/common/ggx_albedo.rs).
GgxAlbedo ggx_albedo(uint table, vec3 wo, vec2 alpha) {
    float stretched = ggx_stretched_length(wo, alpha);
    vec2 at = ggx_albedo_coordinates(wo, alpha) * float(GGX_ALBEDO_SIZE - 1u);
    uvec2 cell = min(uvec2(at), uvec2(GGX_ALBEDO_SIZE - 2u));
    vec2 f = at - vec2(cell);
    uint first = table + cell.y * GGX_ALBEDO_SIZE + cell.x;
    vec4 low = uintBitsToFloat(LOAD4(TABLES, first));
    vec4 high = uintBitsToFloat(LOAD4(TABLES, first + GGX_ALBEDO_SIZE));
    vec4 mixed = mix(low, high, f.y);
    vec2 entry = mix(mixed.xy, mixed.zw, f.x);
    if (HAS_ANISOTROPY) entry.x = min(1.0, entry.x + ANISOTROPIC_MARGIN * abs(alpha.x - alpha.y) / (alpha.x + alpha.y));
    float remaining = 1.0 - (wo.y + stretched * entry.y);
    float squared = remaining * remaining;
    return GgxAlbedo(entry.x, entry.x * squared * squared * remaining);
}

#endif
