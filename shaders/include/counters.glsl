// Counters behind --stats, and the visits behind the AOV `cost`. Where nobody asks for them nothing of this is left: all uses
// stand behind a constant of features.glsl.
//
// They are the lane's, in private variables, so that no structure of the search or the path has a place for them.
#ifndef COUNTERS_GLSL
#define COUNTERS_GLSL
#include "features.glsl"
#include "layout.glsl"

RayCounters counters;     // of the block
uint visited_nodes;       // of the search under way
uint tested_triangles;    // likewise

const uvec3 RAY_CAMERA = uvec3(1u, 0u, 0u);
const uvec3 RAY_SCATTERED = uvec3(0u, 1u, 0u);
const uvec3 RAY_SHADOW = uvec3(0u, 0u, 1u);

// A count stops at the largest number, by which the host knows that there was more.
uint add_count(uint sum, uint more) { return sum + min(more, ~sum); }
uvec3 add_count(uvec3 sum, uvec3 more) { return sum + min(more, ~sum); }

// Of the lanes that run together (a subgroup, a vector) each counts its step, and one of them the step of the vector.
void count_search_step() {
    counters.search_steps = add_count(counters.search_steps, 1u);
    if (subgroupElect()) counters.search_vectors = add_count(counters.search_vectors, 1u);
}

void count_shading() {
    counters.shadings = add_count(counters.shadings, 1u);
    if (subgroupElect()) counters.shading_vectors = add_count(counters.shading_vectors, 1u);
}

void begin_counters() {
    const uvec3 none = uvec3(0u);
    counters = RayCounters(none, 0u, none, 0u, none, 0u, gl_SubgroupSize, 0u, 0u, 0u);
}

void begin_visits() {
    visited_nodes = 0u;
    tested_triangles = 0u;
}

// A search is done: what it visited counts for rays of its kind. Returns how much that was.
uint count_ray(uvec3 kind) {
    uint visits = visited_nodes + tested_triangles;
    if (HAS_STATISTICS) {
        counters.rays = add_count(counters.rays, kind);
        counters.nodes = add_count(counters.nodes, kind * visited_nodes);
        counters.triangles = add_count(counters.triangles, kind * tested_triangles);
    }
    begin_visits();
    return visits;
}

#endif
