// Small scenes compiled into the kernel: one search over all faces in straight code, with the geometry as literals.
//
// src/gpu/specialize/bake.rs replaces the bodies of the two functions `baked_*`, which it finds by their names.
#ifndef TRACE_BAKED_GLSL
#define TRACE_BAKED_GLSL
#include "features.glsl"
#include "records.glsl"
#include "watertight.glsl"

// Ray space (watertight.glsl) as two rows that map what is relative to the origin. Of each row one component is 1 and one
// 0, so a row times a vector has the two roundings of meet_triangle: no test differs from the other form's.
struct BakedRay {
    vec3 origin;
    vec3 direction;
    vec3 row_x;
    vec3 row_y;
    float t_max;
    uint from;
    uint towards;
};

// What the search finds; the point of the triangle is worked out by whoever asks for it.
struct Found {
    uint slot;  // NONE if there is nothing
    float t;
};

BakedRay baked_ray(Ray ray, RaySpace space) {
    float x = -space.shear.x;
    float y = -space.shear.y;
    vec3 row_x = space.x_largest ? vec3(x, 1.0, 0.0) : (space.y_largest ? vec3(0.0, x, 1.0) : vec3(1.0, 0.0, x));
    vec3 row_y = space.x_largest ? vec3(y, 0.0, 1.0) : (space.y_largest ? vec3(1.0, y, 0.0) : vec3(0.0, 1.0, y));
    float t_max = ray_is_valid(ray) ? ray.t_max : 0.0;
    return BakedRay(ray.origin, ray.direction, row_x, row_y, t_max, ray.from.slot, ray.towards.slot);
}

// `zero` is a 0 that no compiler knows: x + zero turns −0 into +0.
//
// Distance (as bits) and slot of the nearest triangle, NONE if there is none.
uvec2 baked_nearest(const vec3 origin, const vec3 direction, const vec3 row_x, const vec3 row_y, const float t_max,
                    const float zero, const uint from, const uint towards) {
    return uvec2(0u, NONE);
}

// Whether there is any.
bool baked_occluded(const vec3 origin, const vec3 direction, const vec3 row_x, const vec3 row_y, const float t_max,
                    const float zero, const uint from, const uint towards) {
    return false;
}

Found find_nearest(RenderConstants constants, Ray ray) {
    BakedRay b = baked_ray(ray, ray_space(ray.direction));
    uvec2 found = baked_nearest(b.origin, b.direction, b.row_x, b.row_y, b.t_max, constants.zero, b.from, b.towards);
    return Found(found.y, uintBitsToFloat(found.x));
}

// The hit of a triangle that was found.
Hit found_hit(Ray ray, Found found) {
    uint base = found.slot * SLOT_TEXELS;
    uvec4 q0 = LOAD4(SLOTS, base);
    uvec4 q1 = LOAD4(SLOTS, base + 1u);
    uvec4 q2 = LOAD4(SLOTS, base + 2u);
    TriangleMeeting meeting =
        meet_triangle(ray_space(ray.direction), ray.origin, uintBitsToFloat(q0.xyz),
                      uintBitsToFloat(uvec3(q0.w, q1.xy)), uintBitsToFloat(uvec3(q1.zw, q2.x)));
    return Hit(TriangleId(found.slot, NONE), found.t, meeting.scaled / meeting.determinant);
}

Hit trace_nearest(RenderConstants constants, Ray ray) {
    Found found = find_nearest(constants, ray);
    if (found.slot == NONE) return Hit(NO_TRIANGLE, ray.t_max, vec2(0.0));
    return found_hit(ray, found);
}

bool trace_occluded(RenderConstants constants, Ray ray) {
    BakedRay b = baked_ray(ray, ray_space(ray.direction));
    return baked_occluded(b.origin, b.direction, b.row_x, b.row_y, b.t_max, constants.zero, b.from, b.towards);
}

#endif
