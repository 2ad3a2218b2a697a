#version 460
// What the vertices carry at a point of a triangle: (triangle, instance, barycentric weights) -> normal, texture coordinates,
// tangent, colour, base colour.
#include "../include/test_kernel.glsl"
#include "../include/attributes.glsl"
#include "../include/geometry.glsl"

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uvec4 a = inputs[lane];
    TriangleLook look = triangle_look(constants, load_triangle_kind(constants, a.x), a.y);
    Vertices v = interpolate_vertices(constants, a.x, a.y, uintBitsToFloat(a.zw));
    outputs[5u * lane] = floatBitsToUint(vec4(v.normal, 0.0));
    outputs[5u * lane + 1u] = floatBitsToUint(v.texcoords);
    outputs[5u * lane + 2u] = floatBitsToUint(v.tangent);
    outputs[5u * lane + 3u] = floatBitsToUint(v.color);
    Material material = load_material(constants, look.material);
    outputs[5u * lane + 4u] = floatBitsToUint(base_color(constants, material, v));
}
