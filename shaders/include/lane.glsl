// The state of a lane: its path, and the sums of its block. It survives a dispatch.
#ifndef LANE_GLSL
#define LANE_GLSL
#include "light_bvh.glsl"
#include "media.glsl"
#include "ray_cone.glsl"

// How emission found by the path's ray counts.
const uint WEIGHT_FULL = 0u;    // all of it: seen by the camera, after a delta lobe, or light sampling is off
const uint WEIGHT_SHARED = 1u;  // weighted against light sampling
const uint WEIGHT_NONE = 2u;    // none of what light sampling reaches

struct LaneState {
    Ray ray;
    uint pixel;
    uint sample_index;
    uint end_sample;
    uint bounce;           // scattering events so far
    vec3 throughput;
    float radiance_scale;  // product of η² of the boundaries crossed, which roulette takes out of the throughput
    vec3 radiance;         // of the current sample
    float pdf;             // density of the last scattering direction
    vec3 shadow_light;     // added if the shadow ray is free
    uint emission_weight;
    vec3 next_origin;      // the scattered ray, while the shadow ray is traced
    uint path_ends;
    vec3 next_direction;
    uint rays;
    TriangleId next_from;
    uint non_finite;
    uint capped;
    vec3 sum;              // of the block; the exact sum is sum + compensation
    float luminance_squared;
    vec3 compensation;
    uint samples;
    RayCone cone;          // of the path's ray, or after the shadow ray of the scattered one
    LightReceiver receiver; // the last vertex, as light sampling saw it
    Media media;           // that the path's ray, or after the shadow ray the scattered one, is in
    uint pane_search;      // the shadow ray looks for the nearest surface: 1 + panes passed; else 0
    float passed;          // from the last vertex that was no pane to the origin of the path's ray
    uint atom;             // of the slice, NONE if the lane has none
    uint ray_limit;        // rays of the atom at which the lane waits for the next dispatch
    uint has_path;         // 0 between samples
    uint emission_rays;    // of each sample of the atom; 0: its path adds what it sees without scattering itself
    uint emission_ray;     // the number of the emission ray that the lane traces; 0: the path
};

void begin_block(inout LaneState lane) {
    lane.rays = 0u;
    lane.non_finite = 0u;
    lane.capped = 0u;
    lane.sum = vec3(0.0);
    lane.luminance_squared = 0.0;
    lane.compensation = vec3(0.0);
    lane.samples = 0u;
}

LaneState idle_lane() {
    LaneState lane;
    lane.ray = Ray(vec3(0.0), vec3(0.0), 0.0, false, NO_TRIANGLE, NO_TRIANGLE);
    lane.pixel = 0u;
    lane.sample_index = 0u;
    lane.end_sample = 0u;
    lane.bounce = 0u;
    lane.throughput = vec3(1.0);
    lane.radiance_scale = 1.0;
    lane.radiance = vec3(0.0);
    lane.pdf = 0.0;
    lane.shadow_light = vec3(0.0);
    lane.emission_weight = WEIGHT_FULL;
    lane.next_origin = vec3(0.0);
    lane.path_ends = 0u;
    lane.next_direction = vec3(0.0);
    lane.next_from = NO_TRIANGLE;
    begin_block(lane);
    lane.cone = RayCone(0.0, 0.0);
    lane.receiver = LightReceiver(vec3(0.0), 0.0, vec3(0.0));
    lane.media = OUTSIDE;
    lane.pane_search = 0u;
    lane.passed = 0.0;
    lane.atom = NONE;
    lane.ray_limit = 0u;
    lane.has_path = 0u;
    lane.emission_rays = 0u;
    lane.emission_ray = 0u;
    return lane;
}

// Gives the lane the slice's atom of that number.
void begin_atom(inout LaneState lane, Atom atom, uint number, uint ray_budget) {
    lane.atom = number;
    lane.ray_limit = ray_budget;
    lane.pixel = atom.pixel;
    lane.sample_index = atom.first_sample;
    lane.end_sample = atom.end_sample;
    begin_block(lane);
}

// Adds to the block's sum without losing what rounding cuts off (Knuth's TwoSum): the sum of the integrators' images is
// then the image to the last bit. An infinite sum would make the compensation NaN; the sum alone says it then.
void accumulate(inout LaneState lane, vec3 light) {
    precise vec3 total = lane.sum + light;
    precise vec3 part = total - lane.sum;
    precise vec3 lost = (lane.sum - (total - part)) + (light - part);
    lane.sum = total;
    lane.compensation += lost;
}

// Few words: lavapipe stores each of them lane by lane (docs/benchmarks, "Few samples a pixel").
BlockResult block_result(LaneState lane) {
    uint rays = min(lane.rays, 0x07ffffffu);
    return BlockResult(lane.sum.x, lane.sum.y, lane.sum.z, lane.luminance_squared, lane.compensation.x,
                       lane.compensation.y, lane.compensation.z, rays << 5u | lane.samples,
                       lane.non_finite | lane.capped << 16u);
}

#endif
