// What a triangle's vertices carry, interpolated, and the base colour that follows from it. Nothing here knows of rays, so
// that traversal can ask for a surface's alpha.
#ifndef ATTRIBUTES_GLSL
#define ATTRIBUTES_GLSL
#include "features.glsl"
#include "records.glsl"
#include "texture.glsl"

const bool HAS_TANGENTS = HAS_NORMAL_MAPS || HAS_ANISOTROPY;

struct Vertices {
    vec3 normal;     // interpolated unit shading normal in world space, on the front; zero if the triangle is flat
    mat3 corners;    // the vertices' normals, in the space of the mesh
    vec4 texcoords;  // interpolated, set 0 and set 1; zero where there are none
    vec4 along_ab;   // their difference between the first vertex and the second
    vec4 along_ac;   // and the third
    mat4x3 footprint;  // of lookups in mip chains, see texture.glsl; none until somebody sets it
    vec4 tangent;    // interpolated, in world space, and the bitangent's sign; zero if there is none
    vec4 color;      // interpolated; 1 where there are none
};

// The point with the given weights of the second and third vertex.
Vertices interpolate_vertices(RenderConstants constants, uint triangle, uint instance, vec2 barycentric) {
    Vertices result = Vertices(vec3(0.0), mat3(0.0), vec4(0.0), vec4(0.0), vec4(0.0), NO_FOOTPRINT, vec4(0.0), vec4(1.0));
    if (!HAS_NORMALS && !HAS_TEXTURES && !HAS_TANGENTS && !HAS_VERTEX_COLORS) return result;
    if (FOR_ANY_SCENE && constants.vertex_texels == 0u) return result;
    uvec4 record = LOAD4(ATTRIBUTES, triangle);
    if ((record.w & TRIANGLE_ATTRIBUTES) == 0u) return result;
    vec3 weights = vec3(1.0 - barycentric.x - barycentric.y, barycentric);
    uvec3 first = constants.vertices + record.xyz * constants.vertex_texels;
    vec4 a = uintBitsToFloat(LOAD4(ATTRIBUTES, first.x));
    vec4 b = uintBitsToFloat(LOAD4(ATTRIBUTES, first.y));
    vec4 c = uintBitsToFloat(LOAD4(ATTRIBUTES, first.z));
    vec4 mixed = a * weights.x + b * weights.y + c * weights.z;
    bool placed = HAS_INSTANCES && instance != NONE;
    if (HAS_NORMALS && (record.w & TRIANGLE_NORMALS) != 0u) {
        vec3 normal = mixed.xyz;
        if (placed) normal = transform_transposed(load_world_to_object(constants, instance), normal);
        // Opposite vertex normals can cancel: then the triangle is flat there.
        if (max_component(abs(normal)) > 0.0) {
            result.normal = safe_normalize(normal);
            result.corners = mat3(a.xyz, b.xyz, c.xyz);
        }
    }
    if (HAS_TEXTURES && (record.w & TRIANGLE_TEXCOORDS) != 0u) {
        vec4 at_a = vec4(a.w, uintBitsToFloat(LOAD4(ATTRIBUTES, first.x + 1u).xyz));
        vec4 at_b = vec4(b.w, uintBitsToFloat(LOAD4(ATTRIBUTES, first.y + 1u).xyz));
        vec4 at_c = vec4(c.w, uintBitsToFloat(LOAD4(ATTRIBUTES, first.z + 1u).xyz));
        result.texcoords = at_a * weights.x + at_b * weights.y + at_c * weights.z;
        if (HAS_MIP) {
            result.along_ab = at_b - at_a;
            result.along_ac = at_c - at_a;
        }
    }
    if (HAS_TANGENTS && (record.w & TRIANGLE_TANGENTS) != 0u) {
        vec4 ta = uintBitsToFloat(LOAD4(ATTRIBUTES, first.x + 2u));
        vec3 tangent = ta.xyz * weights.x + uintBitsToFloat(LOAD4(ATTRIBUTES, first.y + 2u).xyz) * weights.y +
                       uintBitsToFloat(LOAD4(ATTRIBUTES, first.z + 2u).xyz) * weights.z;
        float bitangent_sign = ta.w;
        if (placed) {
            tangent = transform_vector(load_object_to_world(constants, instance), tangent);
            // A mirror turns the cross product of normal and tangent around.
            if (load_instance_header(constants, instance).z != 0u) bitangent_sign = -bitangent_sign;
        }
        if (max_component(abs(tangent)) > 0.0) result.tangent = vec4(safe_normalize(tangent), bitangent_sign);
    }
    if (HAS_VERTEX_COLORS && (record.w & TRIANGLE_COLORS) != 0u) {
        uvec3 last = first + (constants.vertex_texels - 1u);
        result.color = uintBitsToFloat(LOAD4(ATTRIBUTES, last.x)) * weights.x +
                       uintBitsToFloat(LOAD4(ATTRIBUTES, last.y)) * weights.y +
                       uintBitsToFloat(LOAD4(ATTRIBUTES, last.z)) * weights.z;
    }
    return result;
}

// Base colour and alpha: factor × vertex colour × texture.
vec4 base_color(RenderConstants constants, Material material, Vertices vertices) {
    vec4 color = vec4(material.base_color, material.alpha);
    if (HAS_VERTEX_COLORS) color *= vertices.color;
    if (HAS_TEXTURES && material.base_color_texture != NONE)
        color *= sample_texture(constants, material.base_color_texture, vertices.texcoords, vertices.footprint);
    return color;
}

#endif
