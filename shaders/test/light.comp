#version 460
// sample_light at one point a lane: (origin of the shadow ray, which light), (digits below it, position v, 0, 0),
// (environment) as 32-bit numbers -> (direction, distance), (radiance, density), (slot, instance, light, the density of the
// same point by triangle_light_pdf).
#include "../include/test_kernel.glsl"
#include "../include/light.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[3u * lane];
    uvec4 b = inputs[3u * lane + 1u];
    LightReceiver receiver = LightReceiver(uintBitsToFloat(a.xyz), 1.0, vec3(0.0));
    LightSample s = sample_light(constants, receiver, uvec3(a.w, b.xy), inputs[3u * lane + 2u]);
    CdfSample pick = light_pick(constants, receiver, a.w);
    float pdf = 0.0;
    if (s.triangle.slot != NONE) {
        // As where a ray finds the light: the point is known by the intersection, not by the numbers it was drawn with.
        TriangleVertices vertices = load_triangle(s.triangle.slot);
        SurfacePoint point = surface_point(constants, vertices, s.triangle.instance, vec2(0.25));
        pdf = triangle_light_pdf(constants, receiver, pick.index, s.triangle, point, s.direction, s.distance);
    }
    outputs[3u * lane] = floatBitsToUint(vec4(s.direction, s.distance));
    outputs[3u * lane + 1u] = floatBitsToUint(vec4(s.radiance, s.pdf));
    outputs[3u * lane + 2u] = uvec4(s.triangle.slot, s.triangle.instance, pick.index, floatBitsToUint(pdf));
}
