// What shading needs at a hit: the point, the frame, the BSDF's parameters and the emission.
#ifndef SURFACE_GLSL
#define SURFACE_GLSL
#include "anisotropy.glsl"
#include "bsdf.glsl"
#include "frame.glsl"
#include "light.glsl"
#include "media.glsl"
#include "shading_normal.glsl"

struct Surface {
    SurfacePoint point;
    Frame frame;        // of the BSDF, normal on the side of wo
    vec3 horizon;       // normal of the plane above which reflected light leaves
    vec3 lift;          // where it leaves: this far from the point
    vec3 side_normal;   // geometric normal on the side of wo
    BsdfParameters bsdf;
    vec3 emission;      // towards wo
    uint light;         // its light, NONE if light sampling cannot reach it
    Media near;         // on the side of wo
    Media far;          // on the other side
    bool black;         // scatters nothing
    bool curved;        // its normal changes from point to point
};

BsdfParameters bsdf_parameters(RenderConstants constants, Material material, Vertices vertices, bool front) {
    vec4 uv = vertices.texcoords;
    mat4x3 footprint = vertices.footprint;
    BsdfParameters p;
    p.kind = material.kind_flags & MATERIAL_KIND_MASK;
    p.color = base_color(constants, material, vertices).rgb;
    p.metallic = material.metallic;
    float roughness = material.roughness;
    if (HAS_TEXTURES && material.metallic_roughness_texture != NONE) {
        vec4 texel = sample_texture(constants, material.metallic_roughness_texture, uv, footprint);
        roughness *= texel.g;
        p.metallic *= texel.b;
    }
    p.alpha = vec2(roughness * roughness);
    p.ior = material.ior;
    // A thin wall has the same medium on both sides.
    p.eta = p.kind == BSDF_METALLIC_ROUGHNESS ? 1.0 : (front ? material.ior : 1.0 / material.ior);
    p.solid = false;
    p.transmission = material.transmission;
    p.specular = material.specular;
    p.specular_color = material.specular_color;
    if (HAS_SPECULAR && HAS_TEXTURES && material.specular_texture != NONE)
        p.specular *= sample_texture(constants, material.specular_texture, uv, footprint).a;
    if (HAS_SPECULAR && HAS_TEXTURES && material.specular_color_texture != NONE)
        p.specular_color *= sample_texture(constants, material.specular_color_texture, uv, footprint).rgb;
    if (HAS_TRANSMISSION && HAS_TEXTURES && material.transmission_texture != NONE)
        p.transmission *= sample_texture(constants, material.transmission_texture, uv, footprint).r;
    p.schlick = (material.kind_flags & MATERIAL_SCHLICK) != 0u;
    return p;
}

// A surface that encloses a volume: which media are on its sides, and their indices of refraction. One that is met from
// behind, though the path did not enter it, was entered before the path began, by the camera.
void set_media(RenderConstants constants, inout Surface s, uint material, bool front, Media media) {
    if (!front && !is_inside(media, material)) media = entered(media, material);
    s.near = media;
    s.far = front ? entered(media, material) : left(media, material);
    s.bsdf.solid = true;
    // Of two volumes that overlap, the one entered last goes on where the other ends: there is no boundary.
    bool same = s.near.stack.x == s.far.stack.x;
    s.bsdf.eta = same ? 1.0 : medium_ior(constants, s.far) / medium_ior(constants, s.near);
    if (s.bsdf.kind == BSDF_METALLIC_ROUGHNESS) s.bsdf.ior = s.bsdf.eta;
}

// The gradients of the texture coordinates times `width`, all turned by 90° in the triangle's plane: (∇u × n)·2·area =
// ac·Δu_ab − ab·Δu_ac.
mat4x3 texture_footprint(SurfacePoint point, Vertices vertices, float width) {
    float scale = 0.5 * width / point.area;
    vec3 ab = point.ab * scale;
    vec3 ac = point.ac * scale;
    vec4 d = vertices.along_ab;
    vec4 e = vertices.along_ac;
    return mat4x3(ac * d.x - ab * e.x, ac * d.y - ab * e.y, ac * d.z - ab * e.z, ac * d.w - ab * e.w);
}

bool is_curved(Material material, Vertices vertices) {
    if (HAS_NORMAL_MAPS && material.normal_texture != NONE) return true;
    mat3 n = vertices.corners;
    return HAS_NORMALS && (n[0] != n[1] || n[0] != n[2]);
}

// `media` are those that the ray to the hit began in; `width` is that of the ray's cone at the hit.
Surface surface_at(RenderConstants constants, Hit hit, vec3 wo, Media media, float width) {
    Surface s;
    TriangleVertices vertices = load_triangle(hit.triangle.slot);
    s.point = surface_point(constants, vertices, hit.triangle.instance, hit.barycentric);
    bool front = dot(s.point.geometric_normal, wo) > 0.0;
    s.side_normal = front ? s.point.geometric_normal : -s.point.geometric_normal;
    TriangleLook look =
        triangle_look(constants, load_triangle_kind(constants, hit.triangle.slot), hit.triangle.instance);
    Vertices attributes = interpolate_vertices(constants, hit.triangle.slot, hit.triangle.instance, hit.barycentric);
    if (HAS_MIP) attributes.footprint = texture_footprint(s.point, attributes, width);
    Material material = load_material(constants, look.material);
    s.bsdf = bsdf_parameters(constants, material, attributes, front);
    s.near = media;
    s.far = media;
    if (HAS_VOLUME && (material.kind_flags & MATERIAL_VOLUME) != 0u)
        set_media(constants, s, look.material, front, media);
    Shading shading = shading_at(constants, material, vertices, attributes, s.point, hit, s.side_normal, wo);
    s.frame = shading.frame;
    if (HAS_ANISOTROPY && material.anisotropy > 0.0 && attributes.tangent.w != 0.0)
        make_anisotropic(constants, material, attributes.texcoords, s.frame, s.bsdf.alpha);
    s.bsdf.alpha = resolvable_alpha(s.bsdf.alpha);
    s.horizon = shading.horizon;
    s.lift = shading.lift;
    // Between the two horizons of a lifted point, light would come through and be reflected too.
    if (bsdf_transmits(s.bsdf)) {
        s.horizon = s.side_normal;
        s.lift = vec3(0.0);
    }
    bsdf_prepare(constants, s.bsdf, to_local(s.frame, wo));
    s.emission = emits_to_side(material, front) ? material_emission(constants, material, attributes.texcoords) : vec3(0.0);
    s.curved = is_curved(material, attributes);
    s.light = look.light;
    s.black = HAS_BLACK_BACKS && !front && (material.kind_flags & MATERIAL_BLACK_BACK) != 0u;
    if (HAS_BSDF(BSDF_UNLIT) && s.bsdf.kind == BSDF_UNLIT) {
        s.emission = s.bsdf.color;
        s.black = true;
    }
    return s;
}

// f·|cos θi| towards a direction, and the density with which it is scattered to.
struct Scattering {
    vec3 value;
    float pdf;
};

// Only lobes on the side of the surface count to which the direction leads.
void add_scattering(inout Scattering sum, Surface s, vec3 wo, vec3 direction, bool through) {
    vec3 wi = to_local(s.frame, direction);
    if (wi.y < 0.0 != through || wi.y == 0.0) return;
    sum.value += bsdf_evaluate(s.bsdf, wo, wi) * abs(wi.y);
    sum.pdf += bsdf_pdf(s.bsdf, wo, wi);
}

// The continuous lobes, with what they send through the horizon mirrored back at it: no light is lost and none gained.
Scattering surface_scattering(Surface s, vec3 wo, vec3 direction, bool through) {
    Scattering sum = Scattering(vec3(0.0), 0.0);
    add_scattering(sum, s, wo, direction, through);
    if (HAS_SHADING_NORMALS)
        add_scattering(sum, s, wo, mirrored(direction, through ? s.side_normal : s.horizon), through);
    return sum;
}

// Draws a direction, in world space, as bsdf_scatter does in the BSDF's frame.
BsdfSample surface_scatter(Surface s, vec3 wo, vec3 u) {
    BsdfSample drawn = bsdf_scatter(s.bsdf, wo, u);
    drawn.wi = to_world(s.frame, drawn.wi);
    if (!HAS_SHADING_NORMALS) return drawn;
    bool through = (drawn.flags & SCATTERED_THROUGH) != 0u;
    vec3 horizon = through ? -s.side_normal : s.horizon;
    vec3 other = mirrored(drawn.wi, horizon);
    if (drawn.pdf > 0.0) {
        Scattering sum = Scattering(drawn.weight * drawn.pdf, drawn.pdf);
        add_scattering(sum, s, wo, other, through);
        if (sum.pdf > drawn.pdf) {
            drawn.weight = sum.value / sum.pdf;
            drawn.pdf = sum.pdf;
        }
    }
    if (dot(drawn.wi, horizon) < 0.0) drawn.wi = other;
    return drawn;
}

// The origin of a ray that is scattered at the surface.
vec3 scattered_origin(Surface s, bool through) {
    SurfacePoint point = s.point;
    if (HAS_NORMALS && !through) point.position += s.lift;
    return offset_origin(point, through ? -s.side_normal : s.side_normal);
}

// What choosing a light goes by. The BSDF's cosine is that about the frame's normal n, which may lie off the horizon's h by
// an angle δ: |cos θn| ≤ cos θh·cos δ + sin θh·sin δ ≤ cos θh + sin δ. Light that comes through arrives from everywhere.
LightReceiver light_receiver(Surface s, vec3 origin) {
    if (bsdf_transmits(s.bsdf)) return LightReceiver(origin, 1.0, vec3(0.0));
    float slack = HAS_SHADING_NORMALS ? length(cross(s.frame.normal, s.horizon)) : 0.0;
    return LightReceiver(origin, slack, s.horizon);
}

// The triangle that a scattered ray cannot hit: its own, unless it leaves above the triangle and goes below.
TriangleId scattered_from(Surface s, TriangleId own, vec3 direction, bool through) {
    return HAS_NORMALS && !through && dot(direction, s.side_normal) < 0.0 ? NO_TRIANGLE : own;
}

#endif
