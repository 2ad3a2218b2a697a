// The point of a triangle: position with a bound on its error, geometric normal, and where rays leave from it.
#ifndef GEOMETRY_GLSL
#define GEOMETRY_GLSL
#include "features.glsl"
#include "records.glsl"
#include "trace.glsl"

// A point of a triangle in world space.
struct SurfacePoint {
    vec3 position;
    vec3 error;             // bound on the absolute error of each coordinate
    vec3 geometric_normal;  // unit, on the front
    float area;             // of the triangle, in world space
    vec3 ab;                // its edges from the first vertex, in world space
    vec3 ac;
};

// The point with the given weights of the second and third vertex. Errors as in pbrt-v4 (PBR, 4th ed., §6.8.4).
SurfacePoint surface_point(RenderConstants constants, TriangleVertices vertices, uint instance, vec2 barycentric) {
    float b0 = 1.0 - barycentric.x - barycentric.y;
    vec3 pa = vertices.a * b0;
    vec3 pb = vertices.b * barycentric.x;
    vec3 pc = vertices.c * barycentric.y;
    SurfacePoint point;
    point.position = pa + pb + pc;
    point.error = (abs(pa) + abs(pb) + abs(pc)) * GAMMA(7);
    vec3 ab = vertices.b - vertices.a;
    vec3 ac = vertices.c - vertices.a;
    if (HAS_INSTANCES && instance != NONE) {
        Affine m = load_object_to_world(constants, instance);
        vec3 p = point.position;
        vec3 magnitude = vec3(dot(abs(m.x.xyz), abs(p)) + abs(m.x.w), dot(abs(m.y.xyz), abs(p)) + abs(m.y.w),
                              dot(abs(m.z.xyz), abs(p)) + abs(m.z.w));
        vec3 carried = vec3(dot(abs(m.x.xyz), point.error), dot(abs(m.y.xyz), point.error),
                            dot(abs(m.z.xyz), point.error));
        point.position = transform_point(m, p);
        point.error = magnitude * GAMMA(4) + carried * (1.0 + GAMMA(4));
        ab = transform_vector(m, ab);
        ac = transform_vector(m, ac);
    }
    // The cross product; preparation leaves out triangles of which these very operations make zero.
    precise vec3 normal = ab.yzx * ac.zxy - ab.zxy * ac.yzx;
    float scale = max_component(abs(normal));
    vec3 scaled = normal / scale;
    float length_scaled = sqrt(dot(scaled, scaled));
    point.area = 0.5 * scale * length_scaled;
    point.ab = ab;
    point.ac = ac;
    point.geometric_normal = scaled / length_scaled;
    if (HAS_INSTANCES && instance != NONE && load_instance_header(constants, instance).z != 0u)
        point.geometric_normal = -point.geometric_normal;
    return point;
}

// The origin of a ray that leaves the point to the side of `direction`: moved along the normal by the position's error,
// then each coordinate rounded away from the surface (PBR, 4th ed., §6.8.6).
vec3 offset_origin(SurfacePoint point, vec3 direction) {
    float side = dot(direction, point.geometric_normal) < 0.0 ? -1.0 : 1.0;
    vec3 offset = point.geometric_normal * (side * dot(abs(point.geometric_normal), point.error));
    vec3 p = point.position + offset;
    return vec3(offset.x > 0.0 ? next_float_up(p.x) : (offset.x < 0.0 ? next_float_down(p.x) : p.x),
                offset.y > 0.0 ? next_float_up(p.y) : (offset.y < 0.0 ? next_float_down(p.y) : p.y),
                offset.z > 0.0 ? next_float_up(p.z) : (offset.z < 0.0 ? next_float_down(p.z) : p.z));
}

#endif
