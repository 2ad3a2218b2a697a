// Choosing a light by a tree over all that have a place (src/prepare/light_bvh.rs): a four-wide node deals its counts, of
// 2^31 in all, to its children by a bound on the light that each can send to the receiver. Every light keeps one count, so
// that none is lost, and the probability of a light is exactly the counts that are left at its leaf.
#ifndef LIGHT_BVH_GLSL
#define LIGHT_BVH_GLSL
#include "arrays.glsl"
#include "cdf.glsl"
#include "features.glsl"
#include "layout.glsl"
#include "math.glsl"

// Where light is to arrive.
struct LightReceiver {
    vec3 point;   // origin of the shadow ray
    float slack;  // by how much the BSDF's cosine may exceed that about the normal
    vec3 normal;  // light arrives on this side; zero if on both
};

// More than ten roundings of numbers up to 1: the cosines below, by sums and products of rounded ones, are not further off.
const float COSINE_ERROR = 9.5367431640625e-7;

// An upper bound on cos max(0, a − b) by the cosine of a, and cosine and sine of b, all within [0, π]. Also the sine of a is
// bounded from above: its square is off by a few roundings.
vec4 cosine_of_difference(vec4 a, vec4 b, vec4 sine_b) {
    vec4 sine_a = sqrt(max(1.0 - a * a, 0.0) + COSINE_ERROR);
    return mix(a * b + sine_a * sine_b + COSINE_ERROR, vec4(1.0), greaterThanEqual(a, b));
}

// A bound on the irradiance that each of the node's children can send, relative to one another (PBR, 4th ed., §12.6.3, with
// the sphere around the lights for their box): I·cos θ'·cos θi/d², θ' the least angle between the lights' directions and
// the receiver's, θi that between the normal and a point of the sphere.
vec4 light_bounds(uint node, LightReceiver receiver) {
    vec4 x = uintBitsToFloat(LOAD4(TABLES, node)) - receiver.point.x;
    vec4 y = uintBitsToFloat(LOAD4(TABLES, node + 1u)) - receiver.point.y;
    vec4 z = uintBitsToFloat(LOAD4(TABLES, node + 2u)) - receiver.point.z;
    vec4 radius = uintBitsToFloat(LOAD4(TABLES, node + 3u));
    uvec4 cones = LOAD4(TABLES, node + 4u);
    uvec4 axes = LOAD4(TABLES, node + 5u);
    vec4 distance2 = x * x + y * y + z * z;
    vec4 radius2 = radius * radius;
    bvec4 inside = lessThanEqual(distance2, radius2);
    // In the middle of the sphere the mean of 1/d² over it is 3/r².
    vec4 near2 = max(distance2, radius2 * (1.0 / 3.0));
    vec4 inverse = inversesqrt(near2);
    // The angle under which the sphere is seen.
    vec4 sphere_sine = min(radius * inverse, 1.0);
    vec4 sphere_cosine = sqrt(1.0 - sphere_sine * sphere_sine);
    vec3 n = receiver.normal;
    vec4 middle = (x * n.x + y * n.y + z * n.z) * inverse;
    vec4 arriving = mix(cosine_of_difference(middle, sphere_cosine, sphere_sine), vec4(1.0), inside);
    // The axis of the normals, on the octahedron.
    vec4 ax = vec4(ivec4(axes << 16u) >> 16) * (1.0 / 32767.0);
    vec4 ay = vec4(ivec4(axes) >> 16) * (1.0 / 32767.0);
    vec4 az = 1.0 - abs(ax) - abs(ay);
    vec4 fold = max(-az, 0.0);
    ax -= mix(fold, -fold, lessThan(ax, vec4(0.0)));
    ay -= mix(fold, -fold, lessThan(ay, vec4(0.0)));
    vec4 cosine = -(x * ax + y * ay + z * az) * inverse * inversesqrt(ax * ax + ay * ay + az * az);
    cosine = mix(cosine, abs(cosine), equal(cones & 1u, uvec4(1u)));
    // How far the normals spread, and the light about each, by the sine of half the angle.
    vec4 half_spread = vec4(cones >> 8u & 0xffu) * (1.0 / 255.0);
    vec4 half_emission = vec4(cones >> 1u & 0x7fu) * (1.0 / 127.0);
    vec4 spread_sine = 2.0 * half_spread * sqrt(1.0 - half_spread * half_spread);
    vec4 spread_cosine = 1.0 - 2.0 * half_spread * half_spread;
    // Both angles together: past π they cover all directions.
    vec4 all_sine = spread_sine * sphere_cosine + spread_cosine * sphere_sine;
    vec4 all_cosine = spread_cosine * sphere_cosine - spread_sine * sphere_sine;
    vec4 leaving = cosine_of_difference(cosine, all_cosine, all_sine);
    leaving = mix(leaving, vec4(1.0), lessThanEqual(mix(all_sine, vec4(0.0), inside), vec4(COSINE_ERROR)));
    bvec4 lit = greaterThan(leaving, 1.0 - 2.0 * half_emission * half_emission);
    leaving = mix(vec4(0.0), max(leaving, 0.0), lit);
    // Where it can arrive, the mean of the bound and the cosine in the middle is the better guess.
    vec4 likely = 0.5 * (arriving + max(middle, 0.0)) + receiver.slack;
    arriving = mix(vec4(0.0), likely, greaterThan(arriving, vec4(0.0)));
    // Relative to the nearest, so that squares of any distance do.
    float nearest = min(min(near2.x, near2.y), min(near2.z, near2.w));
    return uintBitsToFloat(cones & 0xffff0000u) * leaving * arriving * (nearest / near2);
}

// How many of a node's counts each child gets: one a light, and of the rest a share by its bound. What rounding leaves over
// picks nothing. The sum of the shares stays within the rest: four quotients, their sum, and the rest as a float are off by
// less than eight roundings together.
uvec4 light_counts(uint node, uint counts, LightReceiver receiver) {
    vec4 bounds = light_bounds(node, receiver);
    uvec4 lights = LOAD4(TABLES, node + 7u);
    uint rest = counts - (lights.x + lights.y + lights.z + lights.w);
    float total = (bounds.x + bounds.y) + (bounds.z + bounds.w);
    // Below 2^-96 the quotient would overflow.
    if (total < 1.262177448353619e-29) return lights;
    return lights + uvec4(bounds * (float(rest) * (1.0 - 8.0 * UNIT_ROUNDOFF) / total));
}

uint component(uvec4 v, uint i) {
    uint low = (i & 1u) == 0u ? v.x : v.y;
    uint high = (i & 1u) == 0u ? v.z : v.w;
    return (i & 2u) == 0u ? low : high;
}

// The light that count x of the tree's falls to; NONE if none.
CdfSample light_bvh_sample(RenderConstants constants, LightReceiver receiver, uint x) {
    uint counts = constants.light_bvh_counts;
    uint child = 0u;
    do {
        uint node = constants.light_bvh + child * LIGHT_BVH_TEXELS;
        uvec4 own = light_counts(node, counts, receiver);
        uvec3 ends = uvec3(own.x, own.x + own.y, own.x + own.y + own.z);
        uint i = uint(x >= ends.x) + uint(x >= ends.y) + uint(x >= ends.z);
        if (i > 0u) x -= component(uvec4(0u, ends), i);
        counts = component(own, i);
        if (x >= counts) return CdfSample(NONE, 0.0, 0u, 1u);
        child = component(LOAD4(TABLES, node + 6u), i);
    } while (child < LIGHT_BVH_LEAF);
    return CdfSample(child - LIGHT_BVH_LEAF, cdf_probability(counts), x, counts);
}

// Probability of a light of the tree, by the way to its leaf: two bits a node.
float light_bvh_probability(RenderConstants constants, LightReceiver receiver, uint light) {
    uint trail = LOAD4(TABLES, constants.lights + light * LIGHT_TEXELS + 3u).w;
    uint counts = constants.light_bvh_counts;
    uint child = 0u;
    do {
        uint node = constants.light_bvh + child * LIGHT_BVH_TEXELS;
        counts = component(light_counts(node, counts, receiver), trail & 3u);
        child = component(LOAD4(TABLES, node + 6u), trail & 3u);
        trail >>= 2u;
    } while (child < LIGHT_BVH_LEAF);
    return cdf_probability(counts);
}

#endif
