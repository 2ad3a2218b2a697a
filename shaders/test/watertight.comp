#version 460
// Rays from inside of a closed mesh at its vertices and edges, made from a counter: many more than a buffer can hold.
// inputs[0]: rays a lane, first counter, number of triangles, instance. inputs[1..3]: rows of the affine map from
// [−1, 1]³ to where rays begin. inputs[4..]: the slots of the triangles, four a texel.
// Output: (rays that hit nothing, counter of the first of them or NONE, 0, 0).
#include "../include/test_kernel.glsl"
#include "../include/rng.glsl"
#include "../include/geometry.glsl"

vec3 to_cube(uvec3 bits) { return vec3(to_unit(bits.x), to_unit(bits.y), to_unit(bits.z)) * 2.0 - 1.0; }

// A vertex, the middle of an edge, a point of an edge, or one of its points near a vertex.
vec3 target(TriangleVertices vertices, uint kind, float u) {
    if (kind == 0u) return vertices.a;
    if (kind == 1u) return 0.5 * (vertices.b + vertices.c);
    float weight = kind == 2u ? u : u * u * u * u;
    return vertices.b * (1.0 - weight) + vertices.c * weight;
}

Ray ray_at(uint counter) {
    uvec4 a = pcg4d(uvec4(counter, 0u, 0u, 23u));
    uvec4 b = pcg4d(uvec4(counter, 1u, 0u, 23u));
    Affine start = Affine(uintBitsToFloat(inputs[1]), uintBitsToFloat(inputs[2]), uintBitsToFloat(inputs[3]));
    vec3 origin = transform_point(start, to_cube(a.xyz));
    uint index = min(uint(to_unit(a.w) * float(inputs[0].z)), inputs[0].z - 1u);
    uint slot = inputs[4u + index / 4u][index % 4u];
    TriangleVertices v = load_triangle(slot);
    // Which vertex comes first is random too.
    uint turn = (b.y >> 8u) % 3u;
    TriangleVertices turned = v;
    if (turn == 1u) { turned.a = v.b; turned.b = v.c; turned.c = v.a; }
    if (turn == 2u) { turned.a = v.c; turned.b = v.a; turned.c = v.b; }
    vec3 at = target(turned, b.y & 3u, to_unit(b.x));
    if (inputs[0].w != NONE) at = transform_point(load_object_to_world(constants, inputs[0].w), at);
    vec3 direction = at - origin;
    // Half of the directions keep their length, half of the rays are shadow rays.
    if ((b.z & 1u) != 0u) direction = normalize(direction);
    return Ray(origin, direction, INFINITY, (b.z & 2u) != 0u, NO_TRIANGLE, NO_TRIANGLE);
}

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uint counter = inputs[0].y + lane * inputs[0].x;
    uint end = counter + inputs[0].x;
    uint misses = 0u;
    uint first_miss = NONE;
    Trace trace;
    trace_begin(trace, constants, ray_at(counter), uvec2(0u));
    while (counter != end) {
        trace_advance(trace, constants);
        if (!trace_done(trace)) continue;
        if (trace_hit(trace).triangle.slot == NONE) {
            misses += 1u;
            first_miss = min(first_miss, counter);
        }
        counter += 1u;
        trace_begin(trace, constants, ray_at(counter), uvec2(0u));
    }
    outputs[lane] = uvec4(misses, first_miss, 0u, 0u);
}
