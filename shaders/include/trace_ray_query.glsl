// The trace interface over VK_KHR_ray_query. Primitive i of a mesh is triangle 2·first + i (those of slots that are
// no leaves are degenerate); the instance's custom index is ours, or 0xffffff for the baked mesh.
#include "alpha.glsl"
#include "counters.glsl"
#include "features.glsl"
#include "records.glsl"

layout(set = 0, binding = 4) uniform accelerationStructureEXT top_level;

const uint BAKED_INSTANCE = 0xffffffu;

struct Trace {
    Ray ray;
    Hit hit;
    float t_min;
    uvec2 alpha_key;
    bool done;
};

void trace_begin(out Trace trace, RenderConstants constants, Ray ray, uvec2 alpha_key) {
    trace.ray = ray;
    trace.hit = Hit(NO_TRIANGLE, ray.t_max, vec2(0.0));
    trace.t_min = 0.0;
    trace.alpha_key = alpha_key;
    trace.done = !ray_is_valid(ray);
}

bool trace_done(Trace trace) { return trace.done; }
Hit trace_hit(Trace trace) { return trace.hit; }

// The triangle of a primitive that a query names.
TriangleId query_triangle(RenderConstants constants, uint custom, uint primitive) {
    bool baked = custom == BAKED_INSTANCE;
    uint first = HAS_INSTANCES && !baked ? load_instance_header(constants, custom).x : 0u;
    return TriangleId(2u * first + primitive, baked ? NONE : custom);
}

// The rounds of a software driver's own loops, for a large scene; a driver does not tell.
uint trace_advance_rounds() { return 256u; }

void trace_advance(inout Trace trace, RenderConstants constants) {
    if (trace.done) return;
    if (HAS_STATISTICS) count_search_step();
    uint flags = (HAS_ALPHA ? gl_RayFlagsNoneEXT : gl_RayFlagsOpaqueEXT) | (trace.ray.any_hit ? gl_RayFlagsTerminateOnFirstHitEXT : 0u);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, top_level, flags, 0xffu, trace.ray.origin, trace.t_min, trace.ray.direction,
                          trace.ray.t_max);
    // Only triangles of surfaces with alpha are candidates; the others are opaque geometry, which the driver commits by itself.
    while (rayQueryProceedEXT(query)) {
        if (!HAS_ALPHA) continue;
        TriangleId candidate =
            query_triangle(constants, uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false)),
                           uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false)));
        vec2 barycentric = rayQueryGetIntersectionBarycentricsEXT(query, false);
        if (alpha_hits(constants, trace.alpha_key, candidate.slot, candidate.instance, barycentric))
            rayQueryConfirmIntersectionEXT(query);
    }
    trace.done = true;
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT) return;
    float t = rayQueryGetIntersectionTEXT(query, true);
    TriangleId triangle = query_triangle(constants, uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true)),
                                         uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true)));
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
