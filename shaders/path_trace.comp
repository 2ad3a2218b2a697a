#version 460
// The path tracer: a lane renders atoms, each of one pixel and one aligned block of at most 16 sample indices, in order. A
// lane traces one ray at a time, whatever it is for, in one loop, takes its next sample as soon as a path ends, and the
// slice's next atom as soon as one is finished, so that neighbouring lanes stay busy. A lane that has used up an atom's
// budget of rays saves its state for the next dispatch: the image depends neither on where it was cut nor on the lane.
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#if TRACE_BACKEND == 1
#extension GL_EXT_ray_query : require
#endif
#if ARRAY_FORM == 2
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#endif
layout(local_size_x_id = 0, local_size_y = 1, local_size_z = 1) in;

#include "include/layout.glsl"
#include "include/features.glsl"
#include "include/rng.glsl"
#include "include/camera.glsl"
#include "include/mis.glsl"
#include "include/surface.glsl"
#include "include/aov.glsl"

layout(set = 0, binding = 0, std140) uniform RenderConstantsBlock { RenderConstants constants; };
layout(set = 0, binding = 1, std430) writeonly buffer ResultBlock { BlockResult results[]; };
#include "include/lane.glsl"
layout(set = 0, binding = 2, std430) buffer LaneBlock { LaneState lanes[]; };
layout(set = 0, binding = 5, std430) buffer AovBlock { AovSums block_aovs[]; };
layout(set = 0, binding = 6, std430) buffer CounterBlock { RayCounters block_counters[]; };
layout(set = 0, binding = 7, std430) buffer QueueBlock { SliceQueue queue; };
layout(set = 0, binding = 9, std430) readonly buffer AtomBlock { Atom atoms[]; };
layout(push_constant) uniform SliceBlock { SliceConstants slice; };
#include "include/queue.glsl"

#ifdef DEBUG_PRINTS
// The dispatch that prints has one lane; behind its result stand what it prints, and an empty header.
uint debug_count = 0u;
void debug_end() { results[1u + debug_count].rays_and_samples = 0u; }
void debug_write(uint header, uvec4 words) {
    if (slice.prints == 0u || debug_count >= DEBUG_RECORDS) return;
    debug_count += 1u;
    // Nothing is done with these floats that could change their bits.
    vec3 bits = uintBitsToFloat(words.xyz);
    results[debug_count] = BlockResult(bits.x, bits.y, bits.z, 0.0, 0.0, 0.0, 0.0, header, words.w);
}
#endif

// At most so many rounds has the shading of one hit: a light found in a table or down the light BVH and up again, and a texel
// of the environment.
uint shading_rounds() {
    uint count = 0u;
    if (!BAKES_LIGHTS) count = 32u;
    if (HAS_LIGHT_BVH) count = 128u;
    if (environment_is_sampled_by_texels()) count += 32u;
    return count;
}

// Times that a lane may search on, or end a shadow ray, leave the scene and start the next path, before those that have met
// surfaces shade them together. The dearer shading is beside a step of a search, the longer lanes should wait (docs/benchmarks).
// A ray query is one step, and nothing waits for it.
int searches_per_shading() {
    bool is_dear = HAS_TEXTURES || HAS_LIGHT_BVH || environment_is_sampled_by_texels();
    if (TRACE_BACKEND == TRACE_RAY_QUERY) return 1;
    if (is_dear) return 8;
    // A scene without walls loses many paths to the outside: few lanes meet a surface at a time. Where nothing is compiled in,
    // as on GPUs, nobody has looked for walls.
    if (BAKED != 0u && !BAKES_LARGE_FACES) return 4;
    if (SAMPLER == SAMPLER_INDEPENDENT) return 1;
    return 2;
}

// Longest path; reported when it is met. Roulette ends paths long before.
const uint BOUNCE_CAP = 65535u;

SampleKey sample_key(LaneState lane) { return SampleKey(lane.pixel, lane.sample_index, constants.seed); }
// A shadow ray that may pass panes looks for the nearest surface, as a path's ray does.
bool is_shadow_ray(LaneState lane) { return lane.ray.any_hit || (HAS_PANES && lane.pane_search != 0u); }
uvec2 alpha_key(LaneState lane) {
    if (HAS_ALPHA && is_emission_ray(lane)) return emission_alpha_key(lane, sample_key(lane));
    return alpha_key(sample_key(lane), lane.bounce, is_shadow_ray(lane));
}

// Begins at the camera: `bits` are the place in the pixel and on the lens.
void start_path(inout LaneState lane, uvec4 bits) {
    lane.bounce = 0u;
    lane.radiance_scale = 1.0;
    lane.pdf = 0.0;
    lane.emission_weight = WEIGHT_FULL;
    lane.passed = 0.0;
    if (HAS_VOLUME) lane.media = OUTSIDE;
    CameraRay camera = camera_ray(constants, uvec2(lane.pixel & 0xffffu, lane.pixel >> 16u), to_unit(bits));
    if (HAS_MIP) lane.cone = camera_cone(constants, camera.direction);
    lane.ray = Ray(camera.origin, camera.direction, INFINITY, false, NO_TRIANGLE, NO_TRIANGLE);
}

void start_sample(inout LaneState lane) {
    lane.radiance = vec3(0.0);
    lane.throughput = vec3(1.0);
    lane.emission_ray = 0u;
    start_path(lane, sample_bits(sample_key(lane), 0u, DIMENSIONS_FILM));
}

// Begins the sample's next emission ray, after its path; false if there is none.
bool start_emission_ray(inout LaneState lane) {
    if (lane.emission_ray >= lane.emission_rays) return false;
    lane.emission_ray += 1u;
    lane.throughput = vec3(1.0 / float(lane.emission_rays));
    start_path(lane, emission_ray_bits(lane, sample_key(lane)));
    return true;
}

// Scaled down to a largest component of `most`, in its own colour. Biased: only --clamp-indirect asks for it. A NaN stays,
// and infinite light becomes one.
vec3 clamp_light(vec3 light, float most) {
    float largest = max_component(light);
    return largest > most ? light * (most / largest) : light;
}

// Adds the light found after `bounce` scattering events, if the integrator counts them.
void add_radiance(inout LaneState lane, uint bounce, vec3 light) {
    bool counts = bounce == 0u ? ADDS_EMISSION : (bounce == 1u ? ADDS_DIRECT : ADDS_INDIRECT);
    if (!counts || leaves_emission(lane, bounce)) return;
    if (CLAMPS_INDIRECT && bounce >= 2u) light = clamp_light(light, constants.clamp_indirect);
#ifndef DEBUG_VIEW
    lane.radiance += light;
    accumulate(lane, light);
#endif
}

// The share of emission seen along a BSDF sample whose density light sampling matches with `light_pdf`.
float emission_weight(LaneState lane, float light_pdf) {
    if (lane.emission_weight == WEIGHT_FULL || light_pdf == 0.0) return 1.0;
    if (lane.emission_weight == WEIGHT_NONE) return 0.0;
    return LIGHT_SAMPLING == LIGHT_SAMPLING_MIXTURE ? mixture_weight(lane.pdf, light_pdf)
                                                    : mis_weight(lane.pdf, light_pdf);
}

void add_environment(inout LaneState lane) {
    vec4 light = environment_radiance_and_pdf(constants, lane.ray.direction);
    float pdf = 0.0;
    if (HAS_LIGHT(LIGHT_ENVIRONMENT) && constants.environment_light != NONE && lane.emission_weight != WEIGHT_FULL)
        pdf = light.w * far_light_pick_probability(constants, constants.environment_light);
    add_radiance(lane, lane.bounce, lane.throughput * light.rgb * emission_weight(lane, pdf));
}

void add_emission(inout LaneState lane, Surface surface, Hit hit) {
    if (max_component(surface.emission) <= 0.0) return;
    float pdf = 0.0;
    if (HAS_LIGHT(LIGHT_TRIANGLE) && surface.light != NONE && lane.emission_weight != WEIGHT_FULL)
        pdf = triangle_light_pdf(constants, lane.receiver, surface.light, hit.triangle, surface.point, lane.ray.direction,
                                 HAS_PANES ? lane.passed + hit.t : hit.t);
    add_radiance(lane, lane.bounce, lane.throughput * surface.emission * emission_weight(lane, pdf));
}

// Next-event estimation at the surface: leaves a shadow ray and what it adds if nothing is in its way.
bool sample_direct_light(inout LaneState lane, Surface surface, vec3 wo, TriangleId triangle) {
    if (!scene_has_lights() || !bsdf_has_continuous_lobe(surface.bsdf)) return false;
    SampleKey key = sample_key(lane);
    uvec4 bits = sample_bits(key, lane.bounce, DIMENSIONS_LIGHT);
    uvec4 environment_bits = uvec4(0u);
    if (HAS_LIGHT(LIGHT_ENVIRONMENT)) environment_bits = sample_bits(key, lane.bounce, DIMENSIONS_ENVIRONMENT);
    // Above the surface, unless light can come through: then its side is known once the light is.
    vec3 origin = scattered_origin(surface, false);
    LightReceiver receiver = light_receiver(surface, origin);
    if (HAS_LIGHT_BVH || HAS_NEAR_LAMPS) lane.receiver = receiver;
    LightSample light = sample_light(constants, receiver, bits.xyz, environment_bits);
    bool through = bsdf_transmits(surface.bsdf) && dot(light.direction, surface.side_normal) < 0.0;
    bool below = !through && dot(light.direction, surface.horizon) <= 0.0;
    // One branch for both: the radiance of a constant environment is a matter of uniforms alone (FOR_ANY_SCENE).
    if (any(bvec2(below, max_component(light.radiance) <= 0.0))) return false;
    if (through) origin = scattered_origin(surface, true);
    Scattering scattering = surface_scattering(surface, wo, light.direction, through);
    float weight = 1.0;
    if (light.pdf > 0.0) {
        if (LIGHT_SAMPLING == LIGHT_SAMPLING_BSDF) return false;
        // Mixture: half of the samples leave the light to the BSDF.
        if (LIGHT_SAMPLING == LIGHT_SAMPLING_MIXTURE && bits.w >= 0x80000000u) return false;
        if (LIGHT_SAMPLING == LIGHT_SAMPLING_MIXTURE) weight = mixture_weight(light.pdf, scattering.pdf);
        if (LIGHT_SAMPLING == LIGHT_SAMPLING_MIS) weight = mis_weight(light.pdf, scattering.pdf);
    }
    lane.shadow_light = lane.throughput * scattering.value * weight * light.radiance;
    if (HAS_VOLUME) {
        Media media = surface.near;
        if (through) media = surface.far;
        lane.shadow_light *= transmittance(constants, media, light.distance);
    }
    if (max_component(lane.shadow_light) <= 0.0) return false;
    TriangleId from = scattered_from(surface, triangle, light.direction, through);
    lane.ray = Ray(origin, light.direction, light.distance, true, from, light.triangle);
    return true;
}

// How much of the emission that the scattered ray finds is left to it.
uint scattered_emission_weight(LaneState lane, BsdfSample scattered) {
    if ((scattered.flags & SCATTERED_DELTA) != 0u || LIGHT_SAMPLING == LIGHT_SAMPLING_BSDF) return WEIGHT_FULL;
    if (LIGHT_SAMPLING == LIGHT_SAMPLING_NEE) return WEIGHT_NONE;
    if (LIGHT_SAMPLING == LIGHT_SAMPLING_MIXTURE) {
        uvec4 bits = sample_bits(sample_key(lane), lane.bounce, DIMENSIONS_LIGHT);
        return bits.w >= 0x80000000u ? WEIGHT_SHARED : WEIGHT_NONE;
    }
    return WEIGHT_SHARED;
}

// Russian roulette: survives with probability min(1, 2 max throughput · η²), which keeps the expectation (Arvo and Kirk
// 1990). Only a path that carries less than half of what it set out with can end: the factor 2 is measured
// (docs/benchmarks). It starts at the third scattering event; late paths always have a chance of 1/256 to end, so that
// white closed rooms end too.
bool survives_roulette(inout LaneState lane, float u) {
    if (lane.bounce < 2u) return true;
    float survival = min(1.0, 2.0 * max_component(lane.throughput) * lane.radiance_scale);
    if (lane.bounce >= 64u) survival = min(survival, 0.99609375);
    // Written so that a NaN survives and is seen.
    if (u >= survival) return false;
    lane.throughput /= survival;
    return true;
}

RayCone scattered_cone(RayCone cone, Surface surface, BsdfSample scattered, vec3 wo) {
    if ((scattered.flags & SCATTERED_DELTA) == 0u) return lobe_cone(scattered.pdf);
    bool through = (scattered.flags & SCATTERED_THROUGH) != 0u;
    float cos_t = abs(dot(scattered.wi, surface.frame.normal));
    return delta_cone(cone, surface.curved, through, surface.bsdf.eta, abs(wo.y), cos_t);
}

// Light sampling at the last vertex that is no pane also looks through panes. So behind a pane a path goes on as if none had
// been there: `before` is where light was last looked for.
void remember_scattering(inout LaneState lane, Surface surface, BsdfSample scattered, float distance, LightReceiver before) {
    const uint STRAIGHT = SCATTERED_DELTA | SCATTERED_THROUGH;
    if (HAS_PANES && (scattered.flags & STRAIGHT) == STRAIGHT && bsdf_is_pane(surface.bsdf)) {
        lane.passed += distance;
        lane.receiver = before;
        return;
    }
    lane.emission_weight = scattered_emission_weight(lane, scattered);
    lane.pdf = scattered.pdf;
    lane.passed = 0.0;
}

// Draws the next direction and stores its ray; false if the path ends here.
bool scatter(inout LaneState lane, Surface surface, vec3 wo, Hit hit, LightReceiver before) {
    vec4 u = to_unit(sample_bits(sample_key(lane), lane.bounce, DIMENSIONS_SCATTER));
    BsdfSample scattered = surface_scatter(surface, wo, u.xyz);
    bool through = (scattered.flags & SCATTERED_THROUGH) != 0u;
    lane.throughput *= scattered.weight;
    if (through) {
        lane.radiance_scale *= surface.bsdf.eta * surface.bsdf.eta;
        if (HAS_VOLUME) lane.media = surface.far;
    }
    if (max_component(lane.throughput) == 0.0 || !survives_roulette(lane, u.w)) return false;
    remember_scattering(lane, surface, scattered, hit.t, before);
    if (HAS_MIP) lane.cone = scattered_cone(lane.cone, surface, scattered, wo);
    lane.next_origin = scattered_origin(surface, through);
    lane.next_direction = safe_normalize(scattered.wi);
    lane.next_from = scattered_from(surface, hit.triangle, scattered.wi, through);
    return true;
}

void finish_sample(inout LaneState lane) {
#ifdef DEBUG_VIEW
    lane.radiance = take_debug_value();
    accumulate(lane, lane.radiance);
#endif
    uint bit = 1u << (lane.sample_index % BLOCK_SAMPLES);
    if (!is_finite(lane.radiance)) lane.non_finite |= bit;
    lane.luminance_squared += sqr(luminance(lane.radiance));
    lane.samples += 1u;
    lane.sample_index += 1u;
}

// Follows the scattered ray after the shadow ray.
void follow_scattered(inout LaneState lane) {
    lane.ray = Ray(lane.next_origin, lane.next_direction, INFINITY, false, lane.next_from, NO_TRIANGLE);
    lane.bounce += 1u;
}

// The shadow ray is done: its light is added if nothing was in its way. Each pane that it passed is a scattering event.
bool finish_shadow(inout LaneState lane, bool free) {
    uint panes = HAS_PANES && lane.pane_search != 0u ? lane.pane_search - 1u : 0u;
    if (free) add_radiance(lane, lane.bounce + 1u + panes, lane.shadow_light);
    lane.pane_search = 0u;
    if (lane.path_ends != 0u) return false;
    follow_scattered(lane);
    return true;
}

// Whether the shadow ray has met something that may be a pane; then the nearest surface is looked for from here on.
bool may_be_pane(Hit hit) {
    if (hit.triangle.slot == NONE) return false;
    uint kind = load_triangle_kind(constants, hit.triangle.slot);
    Material material = load_material(constants, triangle_look(constants, kind, hit.triangle.instance).material);
    return material.transmission > 0.0 && (material.kind_flags & MATERIAL_VOLUME) == 0u;
}

// Sends the shadow ray on behind a pane; false if the surface is none, or the path would have too many events.
bool passes_pane(inout LaneState lane, Surface surface, Hit hit) {
    uint events = lane.bounce + 1u + lane.pane_search;
    if (surface.black || !bsdf_is_pane(surface.bsdf) || events > min(constants.max_bounces, BOUNCE_CAP)) return false;
    lane.shadow_light *= pane_transmittance(surface.bsdf);
    if (max_component(lane.shadow_light) <= 0.0) return false;
    lane.pane_search += 1u;
    vec3 direction = lane.ray.direction;
    TriangleId from = scattered_from(surface, hit.triangle, direction, true);
    lane.ray = Ray(scattered_origin(surface, true), direction, lane.ray.t_max - hit.t, false, from, lane.ray.towards);
    return true;
}

// The ray leaves the scene.
void leave_scene(inout LaneState lane) {
    if (HAS_VOLUME) lane.throughput *= transmittance(constants, lane.media, INFINITY);
    add_environment(lane);
}

// A ray that looks for the nearest surface has met one: adds what it emits and prepares the next ray. False if the path
// ends.
bool shade_surface(inout LaneState lane, Hit hit) {
    if (HAS_STATISTICS) count_shading();
    vec3 view = -lane.ray.direction;
    // A shadow ray has the scattered ray's cone, and leaves it as it is.
    float width = HAS_MIP ? cone_width(lane.cone, hit.t) : 0.0;
    Surface surface = surface_at(constants, hit, view, lane.media, width);
    if (HAS_PANES && lane.pane_search != 0u) return passes_pane(lane, surface, hit) || finish_shadow(lane, false);
    if (HAS_AOVS && lane.bounce == 0u && !is_emission_ray(lane)) add_surface_aovs(constants, surface);
    if (HAS_MIP) lane.cone.width = width;
    if (HAS_VOLUME) {
        lane.media = surface.near;
        lane.throughput *= transmittance(constants, lane.media, hit.t);
    }
    add_emission(lane, surface, hit);
    if (surface.black || is_emission_ray(lane) || lane.bounce >= constants.max_bounces) return false;
    if (lane.bounce >= BOUNCE_CAP) {
        lane.capped |= 1u << (lane.sample_index % BLOCK_SAMPLES);
        return false;
    }
    vec3 wo = to_local(surface.frame, view);
    // The shadow ray replaces lane.ray; its contribution uses the throughput before scattering.
    LightReceiver before = lane.receiver;
    bool shadow = sample_direct_light(lane, surface, wo, hit.triangle);
    bool goes_on = scatter(lane, surface, wo, hit, before);
    lane.path_ends = goes_on ? 0u : 1u;
    if (shadow) return true;
    if (goes_on) follow_scattered(lane);
    return goes_on;
}

void count_traced(uvec3 kind) {
    uint visits = count_ray(kind);
    if (HAS_COST) aovs.visits = add_count(aovs.visits, visits);
}
uvec3 path_ray_kind(LaneState lane) { return lane.bounce == 0u ? RAY_CAMERA : RAY_SCATTERED; }

// The lane's ray has been traced, and no surface is to be shaded for it. False if the sample is finished.
bool advance_without_surface(inout LaneState lane, Hit hit) {
    if (!is_shadow_ray(lane)) {
        leave_scene(lane);
        return false;
    }
    if (HAS_PANES && lane.ray.any_hit && may_be_pane(hit)) {
        lane.ray.any_hit = false;
        lane.pane_search = 1u;
        return true;
    }
    return finish_shadow(lane, hit.triangle.slot == NONE);
}

// Starts the lane's next sample, of the next atom if its own is finished; false if the slice has no more.
bool start_next(inout LaneState lane) {
    if (lane.sample_index >= lane.end_sample) {
        if (lane.atom != NONE) finish_atom(lane);
        if (!take_atom(lane)) return false;
    }
    start_sample(lane);
    lane.has_path = 1u;
    return true;
}

// The path goes on with its next ray, or the sample is finished.
void follow_path(inout LaneState lane, bool goes_on) {
    if (!SAMPLE_ENDS(!goes_on)) return;
#ifndef DEBUG_VIEW
    if (HAS_EMISSION_RAYS && start_emission_ray(lane)) return;
#endif
    finish_sample(lane);
    lane.has_path = 0u;
}

bool must_wait(LaneState lane) { return lane.rays >= lane.ray_limit || rounds >= ROUNDS_FOR_RAYS; }

// The lane's next ray, if there is one for it in this dispatch.
bool next_ray(inout LaneState lane) { return (lane.has_path != 0u || start_next(lane)) && !must_wait(lane); }

void count_ray_of(inout LaneState lane) {
    lane.rays += 1u;
    if (COUNTS_VISITS) count_traced(is_shadow_ray(lane) ? RAY_SHADOW : path_ray_kind(lane));
}

// Between two rays the lane's state is whole: a later dispatch can go on from there.
void render(inout LaneState lane) {
    Trace trace;
    bool ends = false;
    bool searches = false;  // or waits with the surface that it has found
    while (!ends) {
        for (int i = 0; i < searches_per_shading(); ++i) {
            rounds += trace_advance_rounds() + 1u;
            if (!searches && !ends) {
                searches = next_ray(lane);
                ends = !searches;
                if (searches) trace_begin(trace, constants, lane.ray, alpha_key(lane));
            }
            if (!searches) continue;
            trace_advance(trace, constants);
            // What met a ray for any hit is nothing that is shaded.
            bool waits = trace.hit.triangle.slot != NONE && !lane.ray.any_hit;
            if (!trace_done(trace) || waits) continue;
            count_ray_of(lane);
            follow_path(lane, advance_without_surface(lane, trace_hit(trace)));
            searches = false;
        }
        rounds += shading_rounds() + 1u;
        if (!searches || !trace_done(trace)) continue;
        count_ray_of(lane);
        follow_path(lane, shade_surface(lane, trace_hit(trace)));
        searches = false;
    }
}

#if TRACE_BACKEND == TRACE_BVH
// A search ends at once, so that all lanes shade together; the shadow ray is traced by a search of its own, which only asks
// whether there is anything.
void render_baked(inout LaneState lane) {
    while (true) {
        rounds += shading_rounds() + 4u;
        store_kept_result_in_turn();
        if (!next_ray(lane)) break;
        Found found = find_nearest(constants, lane.ray);
        count_ray_of(lane);
        bool goes_on = false;
        // Behind the one test, the triangle is loaded once for the hit and for shading.
        if (found.slot != NONE) goes_on = shade_surface(lane, found_hit(lane.ray, found));
        else leave_scene(lane);
        if (goes_on && lane.ray.any_hit) {
            bool free = !trace_occluded(constants, lane.ray);
            count_ray_of(lane);
            goes_on = finish_shadow(lane, free);
        }
        follow_path(lane, goes_on);
    }
}
#endif

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= slice.lanes) return;
    LaneState lane = idle_lane();
    if (slice.resume != 0u) {
        // A lane without an atom takes the next, like a new one.
        if (lanes[index].atom != NONE) {
            lane = lanes[index];
            lane.ray_limit = lane.rays + slice.ray_budget;
            if (HAS_EXTRAS) load_extras(lane.atom);
        }
    }
#if TRACE_BACKEND == TRACE_BVH
    if (BAKES_GEOMETRY) render_baked(lane);
    else
#endif
    render(lane);
#ifdef DEBUG_PRINTS
    if (slice.prints != 0u) debug_end();
#endif
    if (BAKES_GEOMETRY) store_kept_result();
    count_finished_atoms();
    // A lane without an atom has no state.
    if (lane.atom == NONE) lanes[index].atom = NONE;
    else lanes[index] = lane;
    if (HAS_EXTRAS && lane.atom != NONE) store_extras(lane.atom);
}
