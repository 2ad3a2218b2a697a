// The slice's atoms: how a lane takes one, and what it brings back of it. It stands on the kernel's bindings and on aov.glsl,
// which path_trace.comp includes.
#ifndef QUEUE_GLSL
#define QUEUE_GLSL
#include "emission_rays.glsl"
#include "lane.glsl"

// Rounds of loops that a lane, and so its vector, may have run before it takes no further atom, and before it waits for the next
// dispatch. Mesa's lavapipe leaves every loop, without a word, once all of an invocation's loops together have had 65,535
// rounds. The room above is for the longest search of a ray, and for loops that the driver makes.
const uint ROUNDS_FOR_ATOMS = 24000u;
const uint ROUNDS_FOR_RAYS = 32000u;

uint finished_atoms = 0u;  // of the lane, in this dispatch

// The result of an atom that the lane has finished and not stored yet. lavapipe stores every word lane by lane, for all lanes
// whenever one has something to store, which is dear beside the paths of a scene that is compiled in: there a lane keeps its
// result until the others of its vector have theirs, in most cases.
BlockResult kept_result;
uint kept_atom = NONE;
uint turns_kept = 0u;

// Turns of the loop of a kernel with the scene compiled in for each sample of an atom, between two looks at what lanes keep.
// Lanes that run together have the same count, so they store together.
const uint TURNS_PER_SAMPLE = 4u;

void begin_extras() {
    if (HAS_AOVS) begin_aovs();
    if (HAS_STATISTICS) begin_counters();
    if (COUNTS_VISITS) begin_visits();
}

void store_extras(uint atom) {
    if (HAS_AOVS) block_aovs[atom] = aovs;
    if (HAS_STATISTICS) block_counters[atom] = counters;
}

// What the block has so far, if the lane goes on with it.
void load_extras(uint atom) {
    begin_extras();
    if (HAS_AOVS) aovs = block_aovs[atom];
    if (HAS_STATISTICS) counters = block_counters[atom];
}

void store_kept_result() {
    if (kept_atom == NONE) return;
    results[kept_atom] = kept_result;
    kept_atom = NONE;
}

// In every turn of the loop.
void store_kept_result_in_turn() {
    turns_kept += 1u;
    if (turns_kept < TURNS_PER_SAMPLE * slice.most_samples) return;
    turns_kept = 0u;
    store_kept_result();
}

void finish_atom(LaneState lane) {
    if (BAKES_GEOMETRY) {
        store_kept_result();
        kept_result = block_result(lane);
        kept_atom = lane.atom;
    } else {
        results[lane.atom] = block_result(lane);
    }
    if (HAS_EXTRAS) store_extras(lane.atom);
    finished_atoms += 1u;
}

// Takes the slice's next atom; false if none is left.
bool take_atom(inout LaneState lane) {
    lane.atom = NONE;
    if (rounds >= ROUNDS_FOR_ATOMS) return false;
    uint number = atomicAdd(queue.taken, 1u);
    if (number >= slice.atoms) return false;
    begin_atom(lane, atoms[number], number, slice.ray_budget);
    if (HAS_EXTRAS) begin_extras();
    if (HAS_EMISSION_RAYS) begin_emission_rays(lane, constants);
    return true;
}

// An atom each would keep the cores waiting for one another.
void count_finished_atoms() {
    if (finished_atoms > 0u) atomicAdd(queue.done, finished_atoms);
}

#endif
