#version 460
// The trace interface at one ray a lane: (origin, t_max), (direction, any hit), (from, towards) -> (slot, instance, t, 0)
// and the barycentric coordinates.
#include "../include/test_kernel.glsl"
#include "../include/trace.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[3u * lane];
    uvec4 b = inputs[3u * lane + 1u];
    uvec4 c = inputs[3u * lane + 2u];
    Ray ray = Ray(uintBitsToFloat(a.xyz), uintBitsToFloat(b.xyz), uintBitsToFloat(a.w), b.w != 0u,
                  TriangleId(c.x, c.y), TriangleId(c.z, c.w));
    Trace trace;
    trace_begin(trace, constants, ray, uvec2(0u));
    while (!trace_done(trace)) trace_advance(trace, constants);
    Hit hit = trace_hit(trace);
    outputs[2u * lane] = uvec4(hit.triangle.slot, hit.triangle.instance, floatBitsToUint(hit.t), 0u);
    outputs[2u * lane + 1u] = floatBitsToUint(vec4(hit.barycentric, 0.0, 0.0));
}
