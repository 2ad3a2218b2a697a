// The trace interface over VK_KHR_ray_query. Primitive i of a mesh is slot first + i (inner slots are degenerate
// triangles there); the instance's custom index is ours, or 0xffffff for the baked mesh.
#include "features.glsl"
#include "records.glsl"

layout(set = 0, binding = 4) uniform accelerationStructureEXT top_level;

const uint BAKED_INSTANCE = 0xffffffu;

struct Trace {
    Ray ray;
    Hit hit;
    float t_min;
    bool done;
};

void trace_begin(out Trace trace, RenderConstants constants, Ray ray) {
    trace.ray = ray;
    trace.hit = Hit(NO_TRIANGLE, ray.t_max, vec2(0.0));
    trace.t_min = 0.0;
    trace.done = !ray_is_valid(ray);
}

bool trace_done(Trace trace) { return trace.done; }
Hit trace_hit(Trace trace) { return trace.hit; }

void trace_advance(inout Trace trace, RenderConstants constants) {
    if (trace.done) return;
    uint flags = gl_RayFlagsOpaqueEXT | (trace.ray.any_hit ? gl_RayFlagsTerminateOnFirstHitEXT : 0u);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, top_level, flags, 0xffu, trace.ray.origin, trace.t_min, trace.ray.direction,
                          trace.ray.t_max);
    while (rayQueryProceedEXT(query)) {
    }
    trace.done = true;
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT) return;
    uint custom = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
    uint primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
    float t = rayQueryGetIntersectionTEXT(query, true);
    TriangleId triangle;
    triangle.instance = custom == BAKED_INSTANCE ? NONE : custom;
    triangle.slot = primitive;
    if (HAS_INSTANCES && custom != BAKED_INSTANCE) triangle.slot += load_instance_header(constants, custom).x;
    // The triangles that the ray starts on or aims at do not count: search again behind the one, or before the other.
    // Each round shortens the interval, and nothing between them is lost.
    if (same_triangle(triangle, trace.ray.towards)) {
        trace.ray.t_max = next_float_down(t);
        trace.done = !(trace.t_min < trace.ray.t_max);
        return;
    }
    if (same_triangle(triangle, trace.ray.from) || t <= trace.t_min) {
        trace.t_min = max(next_float_up(t), next_float_up(trace.t_min));
        trace.done = !(trace.t_min < trace.ray.t_max);
        return;
    }
    trace.hit = Hit(triangle, t, rayQueryGetIntersectionBarycentricsEXT(query, true));
}
