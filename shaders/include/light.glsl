// Sampling of lights: one is picked by the tree over them or by a table, then a point or direction of it.
#ifndef LIGHT_GLSL
#define LIGHT_GLSL
#include "alpha.glsl"
#include "cdf.glsl"
#include "environment.glsl"
#include "geometry.glsl"
#include "light_bvh.glsl"
#include "light_triangle.glsl"
#include "texture.glsl"

struct LightSample {
    vec3 direction;      // unit, towards the light
    float distance;      // infinite for directional lights and the environment
    vec3 radiance;       // radiance / pdf, or for a delta light its irradiance facing it / probability of the pick
    float pdf;           // per solid angle, the pick included; 0 for a delta light
    TriangleId triangle; // of an emissive triangle
};
const LightSample NO_LIGHT = LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, NO_TRIANGLE);

bool scene_has_lights() { return LIGHTS != 0u; }

// Lights without a place are not in the tree.
const bool ONLY_NEAR_LIGHTS = (LIGHTS & (1u << LIGHT_DIRECTIONAL | 1u << LIGHT_ENVIRONMENT)) == 0u;

uint baked_light_start(uint index) { return baked_light_cdf_0(index).x; }
float baked_light_probability(uint light) {
    return cdf_probability(baked_light_start(light + 1u) - baked_light_start(light));
}

// cdf_sample_TABLES over the lights.
CdfSample baked_light_pick(uint bits) {
    uint x = bits >> 1u;
    uint index = baked_light_search(x);
    uint start = baked_light_start(index);
    uint count = baked_light_start(index + 1u) - start;
    return CdfSample(index, cdf_probability(count), x - start, count);
}

// The light that `bits` fall to, NONE if none. The table's last bin stands for the tree, if there is one.
CdfSample light_pick(RenderConstants constants, LightReceiver receiver, uint bits) {
    if (BAKES_LIGHTS && !HAS_LIGHT_BVH) return baked_light_pick(bits);
    if (!HAS_LIGHT_BVH) return cdf_sample_TABLES(constants.light_cdf_word, constants.light_count, bits);
    uint far = CDF_TOTAL - constants.light_bvh_counts;
    uint x = bits >> 1u;
    if (ONLY_NEAR_LIGHTS || x >= far) return light_bvh_sample(constants, receiver, x - far);
    CdfSample pick = cdf_sample_TABLES(constants.light_cdf_word, constants.light_count - constants.near_lights, bits);
    pick.index += constants.near_lights;
    return pick;
}

// Probability with which light_pick picks a light.
float light_pick_probability(RenderConstants constants, LightReceiver receiver, uint light) {
    if (BAKES_LIGHTS && !HAS_LIGHT_BVH) return baked_light_probability(light);
    if (!HAS_LIGHT_BVH) return cdf_probability_TABLES(constants.light_cdf_word, light);
    if (ONLY_NEAR_LIGHTS || light < constants.near_lights) return light_bvh_probability(constants, receiver, light);
    return cdf_probability_TABLES(constants.light_cdf_word, light - constants.near_lights);
}

// The same for a light that is known to have no place: the receiver does not matter.
float far_light_pick_probability(RenderConstants constants, uint light) {
    if (BAKES_LIGHTS && !HAS_LIGHT_BVH) return baked_light_probability(light);
    return cdf_probability_TABLES(constants.light_cdf_word, HAS_LIGHT_BVH ? light - constants.near_lights : light);
}

// Emission of a triangle towards a direction on its front (`front`) or back.
bool emits_to_side(Material material, bool front) {
    uint sides = material.kind_flags & (MATERIAL_DOUBLE_SIDED | MATERIAL_BLACK_BACK);
    return front || sides == MATERIAL_DOUBLE_SIDED;
}

// Uniform by solid angle if the triangle is near, by area if not. `from` is the origin of the shadow ray.
LightSample sample_triangle_light(RenderConstants constants, uint index, Light light, vec3 from, vec2 u, float pick) {
    TriangleVertices vertices = load_lamp(index, light.slot);
    float root = sqrt(u.x);
    vec2 barycentric = vec2(root * (1.0 - u.y), root * u.y);
    float solid_angle = 0.0;
    if (HAS_NEAR_LAMPS) {
        RelativeTriangle relative = relative_triangle(constants, vertices, light.instance, from);
        // Beside a lamp, on the wall that it is set in, lanes would wait for nothing.
        if (triangle_is_near(relative) && emits_to_side(load_material(constants, light.material), relative.front)) {
            vec3 s = sample_solid_angle(relative, u);
            solid_angle = s.z;
            if (solid_angle > 0.0) barycentric = s.xy;
        }
    }
    SurfacePoint point = surface_point(constants, vertices, light.instance, barycentric);
    vec3 offset = point.position - from;
    float scale = max_component(abs(offset));
    if (scale == 0.0) return NO_LIGHT;
    vec3 direction = safe_normalize(offset);
    float distance = dot(offset, direction);
    float cosine = -dot(direction, point.geometric_normal);
    Material material = load_material(constants, light.material);
    if (cosine == 0.0 || !emits_to_side(material, cosine > 0.0)) return NO_LIGHT;
    vec3 emission = material.emission;
    Vertices attributes = interpolate_vertices(constants, light.slot, light.instance, barycentric);
    if (HAS_TEXTURES) emission = material_emission(constants, material, attributes.texcoords);
    // The shadow ray does not ask the triangle that it aims at whether it is there.
    if (HAS_ALPHA) emission *= surface_opacity(constants, material, attributes);
    float pdf = pick / point.area * (distance * distance) / abs(cosine);
    if (solid_angle > 0.0) pdf = pick / solid_angle;
    return LightSample(direction, distance, emission / pdf, pdf,
                       TriangleId(light.slot, light.instance));
}

// Density with which light sampling at the receiver draws the point of a triangle, `distance` away along unit `direction`.
float triangle_light_pdf(RenderConstants constants, LightReceiver receiver, uint light, TriangleId triangle,
                         SurfacePoint point, vec3 direction, float distance) {
    float pick = light_pick_probability(constants, receiver, light);
    float pdf = pick / point.area * (distance * distance) / abs(dot(direction, point.geometric_normal));
    if (HAS_NEAR_LAMPS) {
        TriangleVertices vertices = load_triangle(triangle.slot);
        RelativeTriangle relative = relative_triangle(constants, vertices, triangle.instance, receiver.point);
        float solid_angle = triangle_is_near(relative) ? triangle_solid_angle(relative) : 0.0;
        if (solid_angle > 0.0) pdf = pick / solid_angle;
    }
    return pdf;
}

// Point and spot lights (KHR_lights_punctual).
LightSample sample_positional_light(Light light, vec3 from, float pick) {
    vec3 offset = light.position - from;
    if (max_component(abs(offset)) == 0.0) return NO_LIGHT;
    vec3 direction = safe_normalize(offset);
    float distance = dot(offset, direction);
    vec3 intensity = light.intensity;
    if (HAS_LIGHT(LIGHT_SPOT) && light.kind == LIGHT_SPOT)
        intensity *= sqr(clamp(-dot(direction, light.direction) * light.cone_scale + light.cone_offset, 0.0, 1.0));
    return LightSample(direction, distance, intensity / (distance * distance) / pick, 0.0, NO_TRIANGLE);
}

// `bits`: which light, digits below it, position v: the position's u is where in the light's bin the first number falls.
// `environment_bits`: see environment_sample.
LightSample sample_light(RenderConstants constants, LightReceiver receiver, uvec3 bits, uvec4 environment_bits) {
    CdfSample pick = light_pick(constants, receiver, bits.x);
    if (HAS_LIGHT_BVH && pick.index == NONE) return NO_LIGHT;
    vec3 from = receiver.point;
    Light light = load_light(constants, pick.index);
    if (HAS_LIGHT(LIGHT_TRIANGLE) && light.kind == LIGHT_TRIANGLE) {
        vec2 u = vec2(cdf_rest(pick, bits.y), to_unit(bits.z));
        return sample_triangle_light(constants, pick.index, light, from, u, pick.probability);
    }
    if (HAS_LIGHT(LIGHT_ENVIRONMENT) && light.kind == LIGHT_ENVIRONMENT) {
        EnvironmentSample s = environment_sample(constants, environment_bits);
        float pdf = s.pdf * pick.probability;
        return LightSample(s.direction, INFINITY, s.radiance / pdf, pdf, NO_TRIANGLE);
    }
    if (HAS_LIGHT(LIGHT_DIRECTIONAL) && light.kind == LIGHT_DIRECTIONAL)
        return LightSample(-light.direction, INFINITY, light.intensity / pick.probability, 0.0, NO_TRIANGLE);
    if (HAS_LIGHT(LIGHT_POINT) || HAS_LIGHT(LIGHT_SPOT)) return sample_positional_light(light, from, pick.probability);
    return NO_LIGHT;
}

#endif
