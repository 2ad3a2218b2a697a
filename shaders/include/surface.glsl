// What shading needs at a hit: the point, the frame, the BSDF's parameters and the emission.
#ifndef SURFACE_GLSL
#define SURFACE_GLSL
#include "bsdf.glsl"
#include "frame.glsl"
#include "light.glsl"

struct Surface {
    SurfacePoint point;
    Frame frame;        // normal on the side of wo
    vec3 side_normal;   // geometric normal on the side of wo
    BsdfParameters bsdf;
    vec3 emission;      // towards wo
    uint light;         // its light, NONE if light sampling cannot reach it
    bool black;         // scatters nothing
};

vec3 interpolated_normal(Vertices vertices, vec3 side_normal, vec3 wo, bool delta_lobes) {
    if (!HAS_NORMALS || max_component(abs(vertices.normal)) == 0.0) return side_normal;
    vec3 n = dot(vertices.normal, side_normal) < 0.0 ? -vertices.normal : vertices.normal;
    float cosine = dot(n, wo);
    // Seen from behind the interpolated normal, or mirrored into the surface: the geometric normal stands in.
    if (cosine <= 0.0) return side_normal;
    if (delta_lobes && dot(n * (2.0 * cosine) - wo, side_normal) <= 0.0) return side_normal;
    return n;
}

BsdfParameters bsdf_parameters(RenderConstants constants, Material material, vec2 uv, bool front) {
    BsdfParameters p;
    p.kind = material.kind_flags & MATERIAL_KIND_MASK;
    p.color = material.base_color;
    if (HAS_TEXTURES && material.base_color_texture != NONE)
        p.color *= sample_texture(constants, material.base_color_texture, uv).rgb;
    p.metallic = material.metallic;
    float roughness = material.roughness;
    if (HAS_TEXTURES && material.metallic_roughness_texture != NONE) {
        vec4 texel = sample_texture(constants, material.metallic_roughness_texture, uv);
        roughness *= texel.g;
        p.metallic *= texel.b;
    }
    float alpha = roughness * roughness;
    p.alpha = vec2(alpha < SMALLEST_ALPHA ? 0.0 : alpha);
    p.ior = material.ior;
    // A thin wall has the same medium on both sides.
    p.eta = p.kind == BSDF_METALLIC_ROUGHNESS ? 1.0 : (front ? material.ior : 1.0 / material.ior);
    p.transmission = material.transmission;
    p.specular = material.specular;
    p.specular_color = material.specular_color;
    if (HAS_SPECULAR && HAS_TEXTURES && material.specular_texture != NONE)
        p.specular *= sample_texture(constants, material.specular_texture, uv).a;
    if (HAS_SPECULAR && HAS_TEXTURES && material.specular_color_texture != NONE)
        p.specular_color *= sample_texture(constants, material.specular_color_texture, uv).rgb;
    if (HAS_TRANSMISSION && HAS_TEXTURES && material.transmission_texture != NONE)
        p.transmission *= sample_texture(constants, material.transmission_texture, uv).r;
    p.schlick = (material.kind_flags & MATERIAL_SCHLICK) != 0u;
    return p;
}

bool kind_has_delta_lobes(uint kind) { return kind == BSDF_MIRROR || kind == BSDF_REFRACT || kind == BSDF_GLASS; }

Surface surface_at(RenderConstants constants, Hit hit, vec3 wo) {
    Surface s;
    TriangleVertices vertices = load_triangle(hit.triangle.slot);
    s.point = surface_point(constants, vertices, hit.triangle.instance, hit.barycentric);
    bool front = dot(s.point.geometric_normal, wo) > 0.0;
    s.side_normal = front ? s.point.geometric_normal : -s.point.geometric_normal;
    Vertices attributes = interpolate_vertices(constants, vertices.triangle, hit.triangle.instance, hit.barycentric);
    Material material = load_material(constants, vertices.material);
    s.bsdf = bsdf_parameters(constants, material, attributes.texcoord, front);
    s.frame = frame_from_normal(interpolated_normal(attributes, s.side_normal, wo, kind_has_delta_lobes(s.bsdf.kind)));
    bsdf_prepare(constants, s.bsdf, to_local(s.frame, wo));
    s.emission = emits_to_side(material, front) ? material_emission(constants, material, attributes.texcoord) : vec3(0.0);
    s.light = vertices.light;
    if (HAS_INSTANCES && s.light != NONE && hit.triangle.instance != NONE)
        s.light += load_instance_header(constants, hit.triangle.instance).y;
    s.black = HAS_BLACK_BACKS && !front && (material.kind_flags & MATERIAL_BLACK_BACK) != 0u;
    if (HAS_BSDF(BSDF_UNLIT) && s.bsdf.kind == BSDF_UNLIT) {
        s.emission = s.bsdf.color;
        s.black = true;
    }
    return s;
}

#endif
