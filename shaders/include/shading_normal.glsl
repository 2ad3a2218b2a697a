// Normals that are not the surface's own, interpolated ones and those of normal maps: which normal a BSDF sees, where the
// horizon is that no light passes, and what becomes of light that a BSDF sends through it (docs/estimators.md).
#ifndef SHADING_NORMAL_GLSL
#define SHADING_NORMAL_GLSL
#include "attributes.glsl"
#include "frame.glsl"
#include "geometry.glsl"

const bool HAS_SHADING_NORMALS = HAS_NORMALS || HAS_NORMAL_MAPS;

// All of it on the side of wo.
struct Shading {
    Frame frame;     // of the BSDF; wo is above it
    vec3 horizon;    // reflected light leaves above the plane of this normal: the geometric one, or that of `lift`
    vec3 lift;       // from the triangle to the smooth surface that it stands for, from which reflected light leaves
};

vec3 mirrored(vec3 direction, vec3 normal) { return direction - normal * (2.0 * dot(direction, normal)); }

// The normal n, mirrored so that wo is above it: an interpolated normal or a facet that is seen from behind turns up to the
// side that is seen. This is continuous, and what was above a plane that wo is above stays above it.
vec3 turned_to(vec3 n, vec3 wo) {
    float cosine = dot(n, wo);
    return cosine < 0.0 ? n - wo * (2.0 * cosine) : n;
}

// The offset from a point of a coarse triangle to the smooth surface of its vertex normals: half of what Hanika 2021,
// "Hacking the Shadow Terminator" (Ray Tracing Gems II, ch. 4), takes. For vertices of a sphere of radius R with the
// sphere's normals, Hanika's Σ bᵢ·max(0, (vᵢ − p)·nᵢ)·nᵢ has the length (R² − |p|²)/R, twice the way to the sphere. Zero
// where the surface is flat or concave, and where a normal is more than 45° off the triangle's: edges of more than 90° are
// no part of a smooth surface. `side` is −1 where the normals' back is seen.
vec3 smooth_lift(RenderConstants constants, TriangleVertices t, mat3 corners, uint instance, vec2 barycentric, float side) {
    vec3 weights = vec3(1.0 - barycentric.x - barycentric.y, barycentric);
    vec3 p = t.a * weights.x + t.b * weights.y + t.c * weights.z;
    vec3 face = safe_normalize(cross(t.b - t.a, t.c - t.a));
    vec3 cosines = abs(face * corners);
    if (min(cosines.x, min(cosines.y, cosines.z)) < 0.70710678) return vec3(0.0);
    vec3 depth = vec3(dot(t.a - p, corners[0]), dot(t.b - p, corners[1]), dot(t.c - p, corners[2]));
    vec3 lift = corners * (0.5 * weights * max(depth * side, 0.0)) * side;
    if (HAS_INSTANCES && instance != NONE) lift = transform_vector(load_object_to_world(constants, instance), lift);
    return lift;
}

// The normal of a normal map: glTF 2.0, section 3.9.3, about the front normal n.
vec3 mapped_normal(RenderConstants constants, Material material, Vertices vertices, vec3 n) {
    vec3 tangent = vertices.tangent.xyz - n * dot(n, vertices.tangent.xyz);
    if (max_component(abs(tangent)) == 0.0) return n;
    tangent = safe_normalize(tangent);
    vec3 bitangent = cross(n, tangent) * vertices.tangent.w;
    vec3 map = sample_texture(constants, material.normal_texture, vertices.texcoords).xyz * 2.0 - 1.0;
    vec3 direction = (tangent * map.x + bitangent * map.y) * material.normal_scale + n * map.z;
    return max_component(abs(direction)) > 0.0 ? safe_normalize(direction) : n;
}

// A frame about n. Where there is a tangent, frame.tangent is its part in the plane of n, and frame.bitangent points up the
// image, whichever side is seen; `front` is the normal of the tangent space.
Frame frame_about(vec3 n, vec3 front, vec4 tangent) {
    if (!HAS_TANGENTS || tangent.w == 0.0) return frame_from_normal(n);
    vec3 t = tangent.xyz - n * dot(n, tangent.xyz);
    if (max_component(abs(t)) == 0.0) return frame_from_normal(n);
    t = safe_normalize(t);
    float handedness = dot(n, front) < 0.0 ? -tangent.w : tangent.w;
    return Frame(t, n, cross(n, t) * handedness);
}

Shading shading_at(RenderConstants constants, Material material, TriangleVertices triangle, Vertices vertices,
                   SurfacePoint point, Hit hit, vec3 side_normal, vec3 wo) {
    Shading s = Shading(frame_from_normal(side_normal), side_normal, vec3(0.0));
    if (!HAS_SHADING_NORMALS && !HAS_TANGENTS) return s;
    vec3 front = point.geometric_normal;
    bool smooth_shaded = HAS_NORMALS && max_component(abs(vertices.normal)) > 0.0;
    if (smooth_shaded) front = vertices.normal;
    float side = dot(front, side_normal) < 0.0 ? -1.0 : 1.0;
    vec3 n = turned_to(front * side, wo);
    if (smooth_shaded) {
        vec3 lift = smooth_lift(constants, triangle, vertices.corners, hit.triangle.instance, hit.barycentric, side);
        // What is less than the error of the position is none.
        if (dot(lift, side_normal) > dot(abs(side_normal), point.error)) {
            s.lift = lift;
            s.horizon = n;
        }
    }
    if (HAS_NORMAL_MAPS && material.normal_texture != NONE && vertices.tangent.w != 0.0) {
        n = mapped_normal(constants, material, vertices, front) * side;
        if (dot(n, s.horizon) < 0.0) n = mirrored(n, s.horizon);
        n = turned_to(n, wo);
    }
    // Exactly edge-on, a BSDF has no say.
    if (dot(n, wo) <= 0.0) {
        s.horizon = side_normal;
        s.lift = vec3(0.0);
        n = side_normal;
    }
    s.frame = frame_about(n, front, vertices.tangent);
    return s;
}

#endif
