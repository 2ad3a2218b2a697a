#version 460
// The decoders of records.glsl and geometry.glsl: lane i loads record i of each table and writes its fields, texel by
// texel in the order in which they are documented in src/layout/.
#include "../include/test_kernel.glsl"
#include "../include/attributes.glsl"
#include "../include/geometry.glsl"

uint bits(float x) { return floatBitsToUint(x); }
uvec3 bits(vec3 v) { return floatBitsToUint(v); }

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lanes) return;
    uint o = 32u * lane;
    Material m = load_material(constants, lane);
    outputs[o] = uvec4(bits(m.base_color), m.kind_flags);
    outputs[o + 1u] = uvec4(bits(m.emission), bits(m.roughness));
    outputs[o + 2u] = uvec4(bits(m.metallic), bits(m.ior), bits(m.transmission), bits(m.alpha));
    outputs[o + 3u] = uvec4(m.base_color_texture, m.metallic_roughness_texture, m.emission_texture, m.normal_texture);
    outputs[o + 4u] = uvec4(bits(m.specular_color), bits(m.specular));
    outputs[o + 5u] = uvec4(bits(m.absorption), bits(m.alpha_cutoff));
    outputs[o + 6u] = uvec4(bits(m.anisotropy), bits(m.anisotropy_turns), bits(m.normal_scale), m.unused);
    outputs[o + 7u] = uvec4(m.transmission_texture, m.specular_texture, m.specular_color_texture, m.anisotropy_texture);
    Light light = load_light(constants, lane);
    outputs[o + 8u] = uvec4(light.kind, light.slot, light.instance, light.material);
    outputs[o + 9u] = uvec4(bits(light.position), bits(light.cone_scale));
    outputs[o + 10u] = uvec4(bits(light.intensity), bits(light.cone_offset));
    outputs[o + 11u] = uvec4(bits(light.direction), 0u);
    TextureHeader header = load_texture_header(constants, lane);
    outputs[o + 12u] = uvec4(header.first_word, header.width, header.height, header.sampling);
    outputs[o + 13u] = uvec4(bits(header.u_row), header.mips);
    outputs[o + 14u] = uvec4(bits(header.v_row), 0u);
    Affine forward = load_object_to_world(constants, lane);
    Affine backward = load_world_to_object(constants, lane);
    outputs[o + 15u] = floatBitsToUint(forward.x);
    outputs[o + 16u] = floatBitsToUint(forward.y);
    outputs[o + 17u] = floatBitsToUint(forward.z);
    outputs[o + 18u] = floatBitsToUint(backward.x);
    outputs[o + 19u] = floatBitsToUint(backward.y);
    outputs[o + 20u] = floatBitsToUint(backward.z);
    outputs[o + 21u] = load_instance_header(constants, lane);
    // The first and the second triangle of a slot: their third vertices are the slot's third and fourth.
    TriangleVertices t = load_triangle(2u * lane);
    TriangleVertices second = load_triangle(2u * lane + 1u);
    outputs[o + 22u] = uvec4(bits(t.a), bits(second.c.x));
    outputs[o + 23u] = uvec4(bits(t.b), bits(second.c.y));
    outputs[o + 24u] = uvec4(bits(t.c), bits(second.c.z));
    // At a corner the interpolated attributes are those of one vertex.
    Vertices v = interpolate_vertices(constants, lane, NONE, vec2(0.0, 1.0));
    outputs[o + 25u] = uvec4(bits(v.normal), load_triangle_kind(constants, lane));
    outputs[o + 26u] = floatBitsToUint(v.texcoords);
    outputs[o + 27u] = floatBitsToUint(v.tangent);
    outputs[o + 28u] = floatBitsToUint(v.color);
    // The generated words, through the word accessor.
    outputs[o + 29u] = uvec4(LOAD1(TEXELS, 4u * lane), LOAD1(TEXELS, 4u * lane + 1u), LOAD1(TEXELS, 4u * lane + 2u),
                             LOAD1(TEXELS, 4u * lane + 3u));
    outputs[o + 30u] = LOAD4(TEXELS, lane);
    outputs[o + 31u] = LOAD4(ENVIRONMENT, lane);
}
