// Small scenes compiled into the kernel: one search over all faces in straight code, with the geometry as literals.
//
// src/gpu/specialize/bake.rs replaces the bodies of the functions `baked_*`, which it finds by their names.
#ifndef TRACE_BAKED_GLSL
#define TRACE_BAKED_GLSL
#include "counters.glsl"
#include "features.glsl"
#include "records.glsl"
#include "watertight.glsl"

// The distance to a plane is height over speed along the normal, whose largest component is 1: of a direction d, with
// u = 2^-24, rounding moves the speed by 4u·3·max|d| at most. So where it is above 2^-12·max|d|, the distance is good to
// 2^-8 and has the right sign unless the origin lies in the plane. A triangle that is met at a smaller angle is doubtful, and
// the search is done once more by interpolated distances, which stay between those of the vertices: where no other triangle
// is met, as at an edge, this one is not missed. (One ray in some 10^7.)
const float BAKED_GRAZING = 0.000244140625;

// Ray space (watertight.glsl) as two rows that map what is relative to the origin. Of each row one component is 1 and one
// 0, so a row times a vector has the two roundings of meet_triangle: no test differs from the other form's. The vectors begin
// at a vertex and end at the origin; where that does not cancel, the other factor's sign is turned too: the third row's, and the
// direction's (`back`).
struct BakedRay {
    vec3 row_x;
    vec3 row_y;
    vec3 row_z;
    float t_max;
    float grazing;  // squared speed towards a plane at and below which the distance to it is not to be trusted
};

BakedRay baked_ray(Ray ray) {
    RaySpace space = ray_space(ray.direction);
    float x = -space.shear.x;
    float y = -space.shear.y;
    BakedRay b;
    b.row_x = space.axis == 0u ? vec3(x, 1.0, 0.0) : (space.axis == 1u ? vec3(0.0, x, 1.0) : vec3(1.0, 0.0, x));
    b.row_y = space.axis == 0u ? vec3(y, 0.0, 1.0) : (space.axis == 1u ? vec3(1.0, y, 0.0) : vec3(0.0, 1.0, y));
    float z = -space.shear.z;
    b.row_z = space.axis == 0u ? vec3(z, 0.0, 0.0) : (space.axis == 1u ? vec3(0.0, z, 0.0) : vec3(0.0, 0.0, z));
    b.t_max = ray_is_valid(ray) ? ray.t_max : 0.0;
    b.grazing = sqr(max_component(abs(ray.direction)) * BAKED_GRAZING);
    return b;
}

// What the search finds; the point of the triangle is worked out by whoever asks for it.
struct Found {
    uint slot;  // NONE if there is nothing
    float t;
};

// `zero` is a 0 that no compiler knows: x + zero turns −0 into +0.
//
// Distance (as bits) and slot of the nearest triangle, NONE if there is none, and whether a triangle was doubtful.
uvec3 baked_nearest(const vec3 origin, const vec3 back, const vec3 row_x, const vec3 row_y, const vec3 row_z,
                    const float t_max, const float zero, const float grazing, const uint from, const uint towards) {
    return uvec3(0u, NONE, 0u);
}

// Whether there is any, and whether a triangle was doubtful.
uvec2 baked_occluded(const vec3 origin, const vec3 back, const vec3 row_x, const vec3 row_y, const vec3 row_z,
                     const float t_max, const float zero, const float grazing, const uint from, const uint towards) {
    return uvec2(0u);
}

// One more than the largest number of a triangle.
uint baked_numbers() { return 0u; }

// Triangles that each of the two searches tests.
uint baked_nearest_tests() { return 0u; }
uint baked_occluded_tests() { return 0u; }

TriangleMeeting meet_number(Ray ray, RaySpace space, uint number) {
    TriangleVertices vertices = load_triangle(number);
    return meet_triangle(space, ray.origin, vertices.a, vertices.b, vertices.c);
}

// All triangles one by one, by interpolated distances.
Found search_numbers(Ray ray) {
    RaySpace space = ray_space(ray.direction);
    Found found = Found(NONE, ray.t_max);
    uint numbers = baked_numbers();
    // Each lane of a wide vector may have such a search, at another time.
    rounds += 16u * numbers;
    for (uint number = 0u; number < numbers; ++number) {
        // A leaf without a second triangle, and an empty slot, have one there whose determinant is 0.
        bool is_triangle = LOAD4(SLOTS, (number >> 1u) * SLOT_TEXELS + 2u).w < SLOT_NO_LEAF;
        if (COUNTS_VISITS && is_triangle) tested_triangles += 1u;
        TriangleMeeting meeting = meet_number(ray, space, number);
        bool excluded = number == ray.from.slot || number == ray.towards.slot;
        if (is_triangle && meeting.inside && meeting.determinant != 0.0 && meeting.t > 0.0 && meeting.t < found.t && !excluded)
            found = Found(number, meeting.t);
    }
    return found;
}

Found find_nearest(RenderConstants constants, Ray ray) {
    if (HAS_STATISTICS) count_search_step();
    if (COUNTS_VISITS) tested_triangles += baked_nearest_tests();
    BakedRay b = baked_ray(ray);
    uvec3 found = baked_nearest(ray.origin, -ray.direction, b.row_x, b.row_y, b.row_z, b.t_max, constants.zero, b.grazing,
                                ray.from.slot, ray.towards.slot);
    if (found.z != 0u) return search_numbers(ray);
    return Found(found.y, uintBitsToFloat(found.x));
}

// The hit of a triangle that was found.
Hit found_hit(Ray ray, Found found) {
    TriangleMeeting meeting = meet_number(ray, ray_space(ray.direction), found.slot);
    return Hit(TriangleId(found.slot, NONE), found.t, meeting.scaled / meeting.determinant);
}

Hit trace_nearest(RenderConstants constants, Ray ray) {
    Found found = find_nearest(constants, ray);
    if (found.slot == NONE) return Hit(NO_TRIANGLE, ray.t_max, vec2(0.0));
    return found_hit(ray, found);
}

bool trace_occluded(RenderConstants constants, Ray ray) {
    if (HAS_STATISTICS) count_search_step();
    if (COUNTS_VISITS) tested_triangles += baked_occluded_tests();
    BakedRay b = baked_ray(ray);
    uvec2 found = baked_occluded(ray.origin, -ray.direction, b.row_x, b.row_y, b.row_z, b.t_max, constants.zero, b.grazing,
                                 ray.from.slot, ray.towards.slot);
    if (found.y != 0u) return search_numbers(ray).slot != NONE;
    return found.x != 0u;
}

#endif
