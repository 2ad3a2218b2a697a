// Records of the scene arrays, decoded.
#ifndef RECORDS_GLSL
#define RECORDS_GLSL
#include "layout.glsl"
#include "arrays.glsl"
#include "baked_tables.glsl"
#include "math.glsl"

// Texels that no feature of the kernel looks at are not read: the optimiser drops their loads with their uses.
#define MATERIAL_TEXEL(baked, k) (BAKES_MATERIALS ? baked(index) : LOAD4(TABLES, base + k))
Material load_material(RenderConstants constants, uint index) {
    uint base = constants.materials + index * MATERIAL_TEXELS;
    uvec4 a = MATERIAL_TEXEL(baked_material_0, 0u);
    uvec4 b = MATERIAL_TEXEL(baked_material_1, 1u);
    uvec4 c = MATERIAL_TEXEL(baked_material_2, 2u);
    uvec4 d = MATERIAL_TEXEL(baked_material_3, 3u);
    uvec4 e = MATERIAL_TEXEL(baked_material_4, 4u);
    uvec4 f = MATERIAL_TEXEL(baked_material_5, 5u);
    uvec4 g = MATERIAL_TEXEL(baked_material_6, 6u);
    uvec4 h = MATERIAL_TEXEL(baked_material_7, 7u);
    Material m;
    m.base_color = uintBitsToFloat(a.xyz);
    m.kind_flags = a.w;
    m.emission = uintBitsToFloat(b.xyz);
    m.roughness = uintBitsToFloat(b.w);
    m.metallic = uintBitsToFloat(c.x);
    m.ior = uintBitsToFloat(c.y);
    m.transmission = uintBitsToFloat(c.z);
    m.alpha = uintBitsToFloat(c.w);
    m.base_color_texture = d.x;
    m.metallic_roughness_texture = d.y;
    m.emission_texture = d.z;
    m.normal_texture = d.w;
    m.specular_color = uintBitsToFloat(e.xyz);
    m.specular = uintBitsToFloat(e.w);
    m.absorption = uintBitsToFloat(f.xyz);
    m.alpha_cutoff = uintBitsToFloat(f.w);
    m.anisotropy = uintBitsToFloat(g.x);
    m.anisotropy_turns = uintBitsToFloat(g.y);
    m.normal_scale = uintBitsToFloat(g.z);
    m.unused = g.w;
    m.transmission_texture = h.x;
    m.specular_texture = h.y;
    m.specular_color_texture = h.z;
    m.anisotropy_texture = h.w;
    return m;
}

TextureHeader load_texture_header(RenderConstants constants, uint index) {
    uint base = constants.textures + index * TEXTURE_TEXELS;
    uvec4 a = LOAD4(TABLES, base);
    TextureHeader header = TextureHeader(a.x, a.y, a.z, a.w, vec3(1.0, 0.0, 0.0), NONE, vec3(0.0, 1.0, 0.0));
    if (HAS_MIP && (header.sampling & TEXTURE_MIPS) != 0u) header.mips = LOAD4(TABLES, base + 1u).w;
    if ((header.sampling & TEXTURE_TRANSFORMED) != 0u) {
        header.u_row = uintBitsToFloat(LOAD4(TABLES, base + 1u).xyz);
        header.v_row = uintBitsToFloat(LOAD4(TABLES, base + 2u).xyz);
    }
    return header;
}

#define LIGHT_TEXEL(baked, k) (BAKES_LIGHTS ? baked(index) : LOAD4(TABLES, base + k))
Light load_light(RenderConstants constants, uint index) {
    uint base = constants.lights + index * LIGHT_TEXELS;
    uvec4 a = LIGHT_TEXEL(baked_light_0, 0u);
    uvec4 b = LIGHT_TEXEL(baked_light_1, 1u);
    uvec4 c = LIGHT_TEXEL(baked_light_2, 2u);
    uvec4 d = LIGHT_TEXEL(baked_light_3, 3u);
    Light light;
    light.kind = a.x;
    light.slot = a.y;
    light.instance = a.z;
    light.material = a.w;
    light.position = uintBitsToFloat(b.xyz);
    light.cone_scale = uintBitsToFloat(b.w);
    light.intensity = uintBitsToFloat(c.xyz);
    light.cone_offset = uintBitsToFloat(c.w);
    light.direction = uintBitsToFloat(d.xyz);
    return light;
}

// A triangle's kind, by its number.
uint load_triangle_kind(RenderConstants constants, uint number) {
    if (!HAS_ATTRIBUTES || (FOR_ANY_SCENE && constants.vertex_texels == 0u)) return LOAD1(ATTRIBUTES, number);
    return LOAD4(ATTRIBUTES, number).w;
}

struct TriangleVertices {
    vec3 a;
    vec3 b;
    vec3 c;
};

// By the triangle's number: see LeafSlot in src/layout/bvh.rs.
TriangleVertices load_triangle(uint number) {
    uint base = (number >> 1u) * SLOT_TEXELS;
    uvec4 q0 = LOAD4(SLOTS, base);
    uvec4 q1 = LOAD4(SLOTS, base + 1u);
    uvec4 q2 = LOAD4(SLOTS, base + 2u);
    bool second = (number & 1u) != 0u;
    uvec3 b = second ? uvec3(q1.zw, q2.x) : uvec3(q0.w, q1.xy);
    uvec3 c = second ? q2.yzw : uvec3(q1.zw, q2.x);
    return TriangleVertices(uintBitsToFloat(q0.xyz), uintBitsToFloat(b), uintBitsToFloat(c));
}

// The triangle with this number, which is the light with this index. Of one that is compiled in there are nine floats.
TriangleVertices load_lamp(uint light, uint number) {
    if (!BAKES_LIGHTS) return load_triangle(number);
    uvec4 q0 = baked_lamp_0(light);
    uvec4 q1 = baked_lamp_1(light);
    uvec4 q2 = baked_lamp_2(light);
    return TriangleVertices(uintBitsToFloat(q0.xyz), uintBitsToFloat(uvec3(q0.w, q1.xy)),
                            uintBitsToFloat(uvec3(q1.zw, q2.x)));
}

// A 3×4 affine matrix as three rows.
struct Affine {
    vec4 x;
    vec4 y;
    vec4 z;
};

// The rows that begin at a texel of an instance's record.
Affine load_affine(uint texel) {
    return Affine(uintBitsToFloat(LOAD4(TABLES, texel)), uintBitsToFloat(LOAD4(TABLES, texel + 1u)),
                  uintBitsToFloat(LOAD4(TABLES, texel + 2u)));
}
Affine load_object_to_world(RenderConstants constants, uint instance) {
    return load_affine(constants.instances + instance * INSTANCE_TEXELS);
}
Affine load_world_to_object(RenderConstants constants, uint instance) {
    return load_affine(constants.instances + instance * INSTANCE_TEXELS + 3u);
}
// (root slot, first light, mirrored, unused)
uvec4 load_instance_header(RenderConstants constants, uint instance) {
    return LOAD4(TABLES, constants.instances + instance * INSTANCE_TEXELS + 6u);
}

vec3 transform_vector(Affine m, vec3 v) { return vec3(dot(m.x.xyz, v), dot(m.y.xyz, v), dot(m.z.xyz, v)); }
vec3 transform_point(Affine m, vec3 p) { return transform_vector(m, p) + vec3(m.x.w, m.y.w, m.z.w); }
// The transpose: carries normals when m is the inverse of the points' transform.
vec3 transform_transposed(Affine m, vec3 n) { return m.x.xyz * n.x + m.y.xyz * n.y + m.z.xyz * n.z; }

// A triangle's light and material; the light is NONE if it is none.
struct TriangleLook {
    uint light;
    uint material;
};
TriangleLook triangle_look(RenderConstants constants, uint kind, uint instance) {
    uint index = kind & TRIANGLE_INDEX_MASK;
    if (!HAS_LIGHT(LIGHT_TRIANGLE) || (kind & TRIANGLE_LIGHT) == 0u) return TriangleLook(NONE, index);
    if (HAS_INSTANCES && instance != NONE) index += load_instance_header(constants, instance).y;
    uvec4 light = BAKES_LIGHTS ? baked_light_0(index) : LOAD4(TABLES, constants.lights + index * LIGHT_TEXELS);
    return TriangleLook(index, light.w);
}

#endif
