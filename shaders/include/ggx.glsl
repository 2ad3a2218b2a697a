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

// The roughness that floats can resolve: a delta where neither direction is wider than that limit; where one is, the other
// is as narrow as the limit, since a lobe that is a delta in one direction alone has no density over the sphere.
vec2 resolvable_alpha(vec2 alpha) {
    return max(alpha.x, alpha.y) < SMALLEST_ALPHA ? vec2(0.0) : max(alpha, vec2(SMALLEST_ALPHA));
}

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

// From what the tables hold: the albedo, and where the cosine whose weight is the mean of Schlick's lies, from cos θo on in
// units of |stretched wo|.
GgxAlbedo ggx_albedo_of(vec2 entry, float cos_o, float stretched) {
    float remaining = 1.0 - (cos_o + stretched * entry.y);
    float squared = remaining * remaining;
    // What is raised may pass 1, but what is under a reflection cannot get less than nothing.
    return GgxAlbedo(entry.x, min(entry.x, 1.0) * squared * squared * remaining);
}

// What the two numbers of the table below are stored in units of.
const vec2 GGX_ANISOTROPIC_UNITS = vec2(2.0, 8.0);

// Where the two roughnesses differ, azimuth and √(smaller/larger) are coordinates too, and √larger takes the place of √α.
// Stretched by both, directions resolve what happens when one sees along the grooves, however deep they are. The azimuth is
// the mean of the stretched direction's and wo's own, which the stretched one hardly tells apart where the ratio is large.
// The table is good to a percent at every ratio. Texels hold the four nodes of a cell of polar angle and azimuth.
vec2 ggx_anisotropic_cell(uint cell, vec2 f) {
    uvec4 nodes = LOAD4(TABLES, cell);
    return mix(mix(unpackSnorm2x16(nodes.x), unpackSnorm2x16(nodes.y), f.x),
               mix(unpackSnorm2x16(nodes.z), unpackSnorm2x16(nodes.w), f.x), f.y);
}

GgxAlbedo ggx_anisotropic_albedo(uint table, vec3 wo, vec2 alpha) {
    vec2 own = abs(alpha.x < alpha.y ? wo.zx : wo.xz);
    vec2 horizontal = own * vec2(max(alpha.x, alpha.y), min(alpha.x, alpha.y));
    float larger = max(alpha.x, alpha.y);
    float stretched = ggx_stretched_length(wo, alpha);
    vec4 at = vec4(sqrt(wo.y / (stretched + length(horizontal))), 2.0 * (turns(horizontal.y, horizontal.x) + turns(own.y, own.x)),
                   sqrt(min(alpha.x, alpha.y) / larger), sqrt(larger)) *
              vec4(GGX_ANISOTROPIC_SIZES - 1u);
    uvec4 node = min(uvec4(at), GGX_ANISOTROPIC_SIZES - 2u);
    vec4 f = at - vec4(node);
    uint row = GGX_ANISOTROPIC_SIZES.x * GGX_ANISOTROPIC_SIZES.y;
    uint first = table + (node.w * GGX_ANISOTROPIC_SIZES.z + node.z) * row + node.y * GGX_ANISOTROPIC_SIZES.x + node.x;
    uint next = first + GGX_ANISOTROPIC_SIZES.z * row;
    vec2 low = mix(ggx_anisotropic_cell(first, f.xy), ggx_anisotropic_cell(first + row, f.xy), f.z);
    vec2 high = mix(ggx_anisotropic_cell(next, f.xy), ggx_anisotropic_cell(next + row, f.xy), f.z);
    return ggx_albedo_of(mix(low, high, f.w) * GGX_ANISOTROPIC_UNITS, wo.y, stretched);
}

// Coordinates of the albedo tables for equal roughness, in [0, 1]: the polar angle φ of the direction stretched by the roughness, as
// √tan(π/4 − φ/2), and √α. Albedos are smooth in them down to grazing angles and to the delta.
vec2 ggx_albedo_coordinates(vec3 wo, vec2 alpha) {
    float horizontal = sqrt(sqr(alpha.x * wo.x) + sqr(alpha.y * wo.z));
    return sqrt(vec2(wo.y / (ggx_stretched_length(wo, alpha) + horizontal), alpha.x));
}

// By a table made by quadrature (tests/common/ggx_albedo.rs).
GgxAlbedo ggx_albedo(uint table, vec3 wo, vec2 alpha) {
    if (HAS_ANISOTROPY && alpha.x != alpha.y)
        return ggx_anisotropic_albedo(table + GGX_ALBEDO_SIZE * GGX_ALBEDO_SIZE, wo, alpha);
    float stretched = ggx_stretched_length(wo, alpha);
    vec2 at = ggx_albedo_coordinates(wo, alpha) * float(GGX_ALBEDO_SIZE - 1u);
    uvec2 cell = min(small_whole(floor(at)), uvec2(GGX_ALBEDO_SIZE - 2u));
    vec2 f = at - vec2(cell);
    uint first = table + cell.y * GGX_ALBEDO_SIZE + cell.x;
    vec4 low = uintBitsToFloat(LOAD4(TABLES, first));
    vec4 high = uintBitsToFloat(LOAD4(TABLES, first + GGX_ALBEDO_SIZE));
    vec4 mixed = mix(low, high, f.y);
    return ggx_albedo_of(mix(mixed.xy, mixed.zw, f.x), wo.y, stretched);
}

#endif
