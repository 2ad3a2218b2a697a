// The trace interface. One implementation is compiled in (TRACE_BACKEND):
//
//   void trace_begin(out Trace trace, RenderConstants constants, Ray ray, uvec2 alpha_key);   // see alpha.glsl
//   void trace_advance(inout Trace trace, RenderConstants constants);   // a bounded amount of work
//   uint trace_advance_rounds();                                        // the rounds that its loops have at most
//   bool trace_done(Trace trace);
//   Hit  trace_hit(Trace trace);                                        // slot NONE: nothing was hit
//
// Alpha is part of the search: a triangle that is not there for the ray is passed.
// A ray with a non-finite or zero direction or a non-finite origin hits nothing; t_max may be infinite.
#ifndef TRACE_GLSL
#define TRACE_GLSL
#include "layout.glsl"
#include "math.glsl"

// A triangle of the scene: its number, which is twice its slot and one more for the second of a slot, and the instance
// that places it (NONE for baked meshes).
struct TriangleId {
    uint slot;
    uint instance;
};
const TriangleId NO_TRIANGLE = TriangleId(NONE, NONE);
bool same_triangle(TriangleId a, TriangleId b) { return a.slot == b.slot && a.instance == b.instance; }

struct Ray {
    vec3 origin;
    vec3 direction;
    float t_max;         // hits are at 0 < t < t_max
    bool any_hit;        // the first hit found ends the search
    TriangleId from;     // the triangle the ray starts on and
    TriangleId towards;  // the one it aims at, where t_max ends it: planar, so neither can be hit again
};

struct Hit {
    TriangleId triangle;
    float t;
    vec2 barycentric;  // weights of the second and third vertex
};

// At most so many rounds have the loops of the lane's vector had in this dispatch (shaders/path_trace.comp).
uint rounds = 0u;

bool ray_is_valid(Ray ray) {
    return is_finite(ray.origin) && is_finite(ray.direction) && dot(ray.direction, ray.direction) > 0.0;
}

#define TRACE_BVH 0
#define TRACE_RAY_QUERY 1
#if TRACE_BACKEND == TRACE_RAY_QUERY
#include "trace_ray_query.glsl"
#else
#include "trace_bvh.glsl"
#endif

#endif
