// The trace interface over our own BVH: four-wide quantised nodes, incremental (a step visits one slot), two levels.
//
// The traversal keeps for each inner node that still has children to visit one entry: its child group, and the ordered
// list of those children, two bits each below a leading one. The newest entry is `top`; the next four stay in registers
// (a store at a divergent address costs a branch a lane on software devices), the rest in memory.
#include "alpha.glsl"
#include "counters.glsl"
#include "features.glsl"
#include "records.glsl"
#include "trace_baked.glsl"
#include "watertight.glsl"

const uint LIST_BITS = 7u;
const uint LIST_MASK = (1u << LIST_BITS) - 1u;
// Below this entry lies the world level; it stands for "leave the instance". No group is that large.
const uint LEAVE_INSTANCE = 0xffffff80u;

// A flag of Trace::first.
const uint ASKS = 0x80000000u;

struct Trace {
    vec3 origin;  // the ray in the space of `instance`
    vec3 inverse_direction;
    RaySpace space;
    Hit hit;      // its barycentric weights times `determinant`
    float determinant;
    uint current;   // slot to visit, NONE when done
    uint instance;  // the instance being traversed, NONE at the world level
    uint top;       // newest entry, 0 if there is none
    uint entry_0;
    uint entry_1;
    uint entry_2;
    uint entry_3;
    uint depth;  // entries in memory
    bool any_hit;
    TriangleId from;
    TriangleId towards;
    vec3 world_origin;
    vec3 world_direction;
    // Of the current slot, triangles with lower numbers are done. With ASKS, a triangle with alpha would be the hit, and the
    // search stays at its slot until it is known whether it is there.
    uint first;
    uvec2 alpha_key;
};

uint trace_stack[STACK_SIZE];

// In memory entries stand inverted. lavapipe (Mesa 25) runs a handful of instructions behind a condition for all lanes, in place of a
// branch, and what it stores and loads there lane by lane; with one more instruction it branches (docs/benchmarks).
void push_entry(inout Trace trace, uint entry) {
    if (trace.entry_3 != 0u) trace_stack[trace.depth++] = ~trace.entry_3;
    trace.entry_3 = trace.entry_2;
    trace.entry_2 = trace.entry_1;
    trace.entry_1 = trace.entry_0;
    trace.entry_0 = entry;
}

uint pop_entry(inout Trace trace) {
    uint entry = trace.entry_0;
    trace.entry_0 = trace.entry_1;
    trace.entry_1 = trace.entry_2;
    trace.entry_2 = trace.entry_3;
    trace.entry_3 = 0u;
    // Entries spill one by one, so memory holds any only while all four registers were full: refill at the end.
    if (trace.depth > 0u) trace.entry_3 = ~trace_stack[--trace.depth];
    return entry;
}

// 1/d for the slab test. A component below 2^-80 counts as 2^-80: the slack of the slab test (see visit_inner) then spans
// 2^60 times the box, so that no box around the ray's plane is missed, and no product overflows below 2^47 metres.
vec3 slab_inverse(vec3 d) {
    const float SMALLEST = 8.271806125530277e-25;
    vec3 magnitude = max(abs(d), vec3(SMALLEST));
    return vec3(d.x < 0.0 ? -1.0 : 1.0, d.y < 0.0 ? -1.0 : 1.0, d.z < 0.0 ? -1.0 : 1.0) / magnitude;
}

void set_ray(inout Trace trace, vec3 origin, vec3 direction) {
    trace.origin = origin;
    trace.inverse_direction = slab_inverse(direction);
    trace.space = ray_space(direction);
}

// The large faces, which are compiled in, before the tree of the rest.
void meet_large_faces(inout Trace trace, RenderConstants constants, Ray ray) {
    Found found = find_nearest(constants, ray);
    if (found.slot == NONE) return;
    TriangleMeeting meeting = meet_number(ray, trace.space, found.slot);
    // Interpolated, as those of the tree are, so that their order is kept. Only where it is lost to rounding, by the plane.
    float t = meeting.t > 0.0 ? meeting.t : found.t;
    trace.hit = Hit(TriangleId(found.slot, NONE), t, meeting.scaled);
    trace.determinant = meeting.determinant;
    if (ray.any_hit) trace.current = NONE;
}

void trace_begin(out Trace trace, RenderConstants constants, Ray ray, uvec2 alpha_key) {
    set_ray(trace, ray.origin, ray.direction);
    trace.hit = Hit(NO_TRIANGLE, ray.t_max, vec2(0.0));
    trace.determinant = 1.0;
    uint root = BAKES_LARGE_FACES ? constants.rest_root_slot : constants.root_slot;
    trace.current = ray_is_valid(ray) ? root : NONE;
    trace.instance = NONE;
    trace.top = 0u;
    trace.entry_0 = 0u;
    trace.entry_1 = 0u;
    trace.entry_2 = 0u;
    trace.entry_3 = 0u;
    trace.depth = 0u;
    trace.any_hit = ray.any_hit;
    trace.from = ray.from;
    trace.towards = ray.towards;
    trace.world_origin = ray.origin;
    trace.world_direction = ray.direction;
    trace.first = 0u;
    trace.alpha_key = alpha_key;
    if (BAKES_LARGE_FACES) meet_large_faces(trace, constants, ray);
    if (BAKES_GEOMETRY) {
        // Done at once.
        trace.current = NONE;
        if (!ray.any_hit || trace_occluded(constants, ray)) trace.hit = trace_nearest(constants, ray);
    }
}

bool asks(Trace trace) { return (trace.first & ASKS) != 0u; }
bool trace_done(Trace trace) { return trace.current == NONE; }
Hit trace_hit(Trace trace) { return Hit(trace.hit.triangle, trace.hit.t, trace.hit.barycentric / trace.determinant); }

// Child k's byte of a word of bounds, as a float.
float bound_0(uint word) { return float(word & 255u); }
float bound_1(uint word) { return float((word >> 8u) & 255u); }
float bound_2(uint word) { return float((word >> 16u) & 255u); }
float bound_3(uint word) { return float(word >> 24u); }

const int MISSED = 0x7fffffff;

// Distances to the near and far planes; comparing their bits as integers is right for non-negative floats, and a negative
// far plane is a negative integer. The child's number rides in the low bits of the key.
#define CHILD_KEY(bound, k, key)                                                                                   \
    {                                                                                                              \
        int near_t = max(max(floatBitsToInt(bound(near_x) * scale.x + near_offset.x),                              \
                             floatBitsToInt(bound(near_y) * scale.y + near_offset.y)),                             \
                         max(floatBitsToInt(bound(near_z) * scale.z + near_offset.z), 0));                         \
        int far_t = min(min(floatBitsToInt(bound(far_x) * scale.x + far_offset.x),                                 \
                            floatBitsToInt(bound(far_y) * scale.y + far_offset.y)),                                \
                        min(floatBitsToInt(bound(far_z) * scale.z + far_offset.z), t_max));                        \
        key = near_t <= far_t ? ((near_t & ~3) | k) : MISSED;                                                      \
    }
#define SORT_PAIR(a, b)      \
    {                        \
        int smaller = min(a, b); \
        b = max(a, b);       \
        a = smaller;         \
    }

// Visits an inner slot: the nearest child that the ray meets becomes `next`, the others an entry (0 if there are none).
//
// The plane at origin + q·step is met at t = (q·step + (origin − o)) / d. With u = 2^-24, the computed q·scale + offset
// differs from it by at most 8u·(|q·scale| + |offset|): one rounding of the difference, 2.5 ulp of the division and one
// rounding of the product for the offset; the same division, a product and a product for the scale; and the sum. The
// slabs are widened by 16u·(255·|scale| + |offset|), so a box that the ray meets is never missed.
void visit_inner(Trace trace, uvec4 q0, uvec4 q1, uvec4 q2, out uint next, out uint entry) {
    vec3 grid_step = uintBitsToFloat((uvec3(q0.w, q0.w >> 8u, q0.w >> 16u) & 255u) << 23u);
    vec3 scale = grid_step * trace.inverse_direction;
    vec3 offset = (uintBitsToFloat(q0.xyz) - trace.origin) * trace.inverse_direction;
    vec3 slack = (abs(scale) * 255.0 + abs(offset)) * (16.0 * UNIT_ROUNDOFF);
    vec3 near_offset = offset - slack;
    vec3 far_offset = offset + slack;
    bvec3 reversed = lessThan(trace.inverse_direction, vec3(0.0));
    uint near_x = reversed.x ? q1.w : q1.x;
    uint far_x = reversed.x ? q1.x : q1.w;
    uint near_y = reversed.y ? q2.x : q1.y;
    uint far_y = reversed.y ? q1.y : q2.x;
    uint near_z = reversed.z ? q2.y : q1.z;
    uint far_z = reversed.z ? q1.z : q2.y;
    int t_max = floatBitsToInt(trace.hit.t);
    int key_0, key_1, key_2, key_3;
    CHILD_KEY(bound_0, 0, key_0)
    CHILD_KEY(bound_1, 1, key_1)
    CHILD_KEY(bound_2, 2, key_2)
    CHILD_KEY(bound_3, 3, key_3)
    SORT_PAIR(key_0, key_1)
    SORT_PAIR(key_2, key_3)
    SORT_PAIR(key_0, key_2)
    SORT_PAIR(key_1, key_3)
    SORT_PAIR(key_1, key_2)
    uint list_bits = (key_1 != MISSED ? 2u : 0u) + (key_2 != MISSED ? 2u : 0u) + (key_3 != MISSED ? 2u : 0u);
    uint list = uint(key_1 & 3) | uint(key_2 & 3) << 2u | uint(key_3 & 3) << 4u;
    uint leading_one = 1u << list_bits;
    entry = list_bits != 0u ? (q2.z << LIST_BITS | leading_one | (list & (leading_one - 1u))) : 0u;
    next = key_0 != MISSED ? (q2.z << 2u | uint(key_0 & 3)) : NONE;
}

// The triangle becomes the hit if the ray meets it before; one with alpha is asked first. `edges` are its edge functions,
// opposite to its vertices in turn, which are the weights of the vertices' sheared `depths` but for a factor.
void visit_triangle(inout Trace trace, uint number, vec3 edges, vec3 depths, bool has_alpha) {
    precise float determinant = edges.x + edges.y + edges.z;
    precise float scaled_t = (edges.x * depths.x + edges.y * depths.y + edges.z * depths.z) * trace.space.shear.z;
    bool inside = all(greaterThanEqual(edges, vec3(0.0))) || all(lessThanEqual(edges, vec3(0.0)));
    float t = scaled_t / determinant;
    TriangleId triangle = TriangleId(number, trace.instance);
    bool excluded = same_triangle(triangle, trace.from) || same_triangle(triangle, trace.towards);
    // With ASKS, all wait.
    if (HAS_ALPHA) excluded = excluded || number < trace.first;
    // A zero determinant gives an infinite or undefined t, which fails here; that of an absent triangle is zero, see below.
    bool meets = inside && determinant != 0.0 && t > 0.0 && t < trace.hit.t && !excluded;
    if (HAS_ALPHA && meets && has_alpha) trace.first = number | ASKS;
    if (meets && !(HAS_ALPHA && has_alpha)) {
        trace.hit = Hit(triangle, t, edges.yz);
        trace.determinant = determinant;
    }
}

// A leaf whose triangles have alpha begins with the vertex of its diagonal whose words are the larger (src/prepare/pairs.rs).
bool leaf_has_alpha(uvec4 q0, uvec4 q1, uvec4 q2) {
    uvec3 a = q0.xyz;
    uvec3 c = uvec3(q1.zw, q2.x);
    return a.x != c.x ? a.x > c.x : (a.y != c.y ? a.y > c.y : a.z > c.z);
}

// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection": vertices are sheared into ray space, each by the
// same operations wherever it is shared, and edges are tested there by differences of products. Rounding is monotonic, so
// a computed edge function never has the wrong sign, it can only be zero; zero counts as inside. Hence a closed mesh has
// no gap. `precise` keeps the compiler from fusing, which would break the symmetry between neighbours.
//
// Both triangles of the slot are tested, (a, b, c) and (a, c, d). Their common edge is computed once: the other way round,
// the difference of the same products has the opposite sign exactly. Where d is a, the second has the edge functions e, 0
// and −e, whose sum is zero.
void visit_leaf(inout Trace trace, uvec4 q0, uvec4 q1, uvec4 q2) {
    bool has_alpha = HAS_ALPHA && leaf_has_alpha(q0, q1, q2);
    precise vec3 a = rotate_axis(uintBitsToFloat(q0.xyz) - trace.origin, trace.space.axis);
    precise vec3 b = rotate_axis(uintBitsToFloat(uvec3(q0.w, q1.xy)) - trace.origin, trace.space.axis);
    precise vec3 c = rotate_axis(uintBitsToFloat(uvec3(q1.zw, q2.x)) - trace.origin, trace.space.axis);
    precise vec3 d = rotate_axis(uintBitsToFloat(q2.yzw) - trace.origin, trace.space.axis);
    precise vec2 pa = a.xy - trace.space.shear.xy * a.z;
    precise vec2 pb = b.xy - trace.space.shear.xy * b.z;
    precise vec2 pc = c.xy - trace.space.shear.xy * c.z;
    precise vec2 pd = d.xy - trace.space.shear.xy * d.z;
    precise float bc = pc.x * pb.y - pc.y * pb.x;
    precise float ca = pa.x * pc.y - pa.y * pc.x;
    precise float ab = pb.x * pa.y - pb.y * pa.x;
    precise float cd = pd.x * pc.y - pd.y * pc.x;
    precise float da = pa.x * pd.y - pa.y * pd.x;
    visit_triangle(trace, 2u * trace.current, vec3(bc, ca, ab), vec3(a.z, b.z, c.z), has_alpha);
    visit_triangle(trace, 2u * trace.current + 1u, vec3(cd, da, -ca), vec3(a.z, c.z, d.z), has_alpha);
}

// Continues at the instance's root with the ray in object space; t keeps its meaning since the direction is not rescaled.
void enter_instance(inout Trace trace, RenderConstants constants, uint instance) {
    Affine m = load_world_to_object(constants, instance);
    set_ray(trace, transform_point(m, trace.world_origin), transform_vector(m, trace.world_direction));
    if (trace.top != 0u) push_entry(trace, trace.top);
    trace.top = LEAVE_INSTANCE;
    trace.instance = instance;
    trace.current = load_instance_header(constants, instance).x;
}

void leave_instance(inout Trace trace) {
    set_ray(trace, trace.world_origin, trace.world_direction);
    trace.instance = NONE;
    trace.top = pop_entry(trace);
}

// An instance counts as a node.
void count_slot(bool leaf, uvec4 q0, uvec4 q2) {
    if (!leaf) visited_nodes += 1u;
    // Where a leaf holds one triangle, its last vertex is its first.
    if (leaf) tested_triangles += q0.xyz == q2.yzw ? 1u : 2u;
}

// Visits one slot.
void trace_step(inout Trace trace, RenderConstants constants) {
    if (HAS_STATISTICS) count_search_step();
    uint base = trace.current * SLOT_TEXELS;
    uvec4 q0 = LOAD4(SLOTS, base);
    uvec4 q1 = LOAD4(SLOTS, base + 1u);
    uvec4 q2 = LOAD4(SLOTS, base + 2u);
    // The last word of a leaf is a coordinate, those of the others are NaN.
    bool leaf = q2.w < SLOT_NO_LEAF;
    uint next = NONE;
    uint entry = 0u;
    if (COUNTS_VISITS) count_slot(leaf, q0, q2);
    if (HAS_INSTANCES && q2.w == SLOT_INSTANCE) {
        enter_instance(trace, constants, q2.y);
        return;
    }
    if (leaf) {
        visit_leaf(trace, q0, q1, q2);
        if (HAS_ALPHA && asks(trace)) return;
        if (trace.any_hit && trace.hit.triangle.slot != NONE) {
            trace.current = NONE;
            return;
        }
    } else {
        visit_inner(trace, q0, q1, q2, next, entry);
    }
    if (next == NONE) {
        if (HAS_INSTANCES && trace.top == LEAVE_INSTANCE) leave_instance(trace);
        if (trace.top != 0u) {
            next = (trace.top >> LIST_BITS) << 2u | (trace.top & 3u);
            uint list = (trace.top & LIST_MASK) >> 2u;
            trace.top = list == 1u ? pop_entry(trace) : ((trace.top & ~LIST_MASK) | list);
        }
    } else if (entry != 0u) {
        if (trace.top != 0u) push_entry(trace, trace.top);
        trace.top = entry;
    }
    trace.current = next;
    if (HAS_ALPHA) trace.first = 0u;
}

// The triangle that is asked becomes the hit if its surface is there. Not within a step, where all lanes would run it for the
// few that ask, at both triangles. It is met again, by the same operations as in visit_leaf: to keep what was found would cost
// every step more.
void answer(inout Trace trace, RenderConstants constants) {
    uint number = trace.first & ~ASKS;
    trace.first = number + 1u;
    TriangleVertices v = load_triangle(number);
    TriangleMeeting meeting = meet_triangle(trace.space, trace.origin, v.a, v.b, v.c);
    vec2 barycentric = meeting.scaled / meeting.determinant;
    if (!alpha_hits(constants, trace.alpha_key, number, trace.instance, barycentric)) return;
    trace.hit = Hit(TriangleId(number, trace.instance), meeting.t, meeting.scaled);
    trace.determinant = meeting.determinant;
    if (trace.any_hit) trace.current = NONE;
}

// Steps until the next look at which lanes are done: more leave finished lanes idle, fewer have them do what follows in small
// groups (docs/benchmarks).
const int STEPS_PER_ADVANCE = 6;

// At most so many rounds of loops has trace_advance.
uint trace_advance_rounds() { return uint(STEPS_PER_ADVANCE) + 1u; }

void trace_advance(inout Trace trace, RenderConstants constants) {
    for (int i = 0; i < STEPS_PER_ADVANCE; ++i) {
        if (trace.current == NONE || (HAS_ALPHA && asks(trace))) break;
        trace_step(trace, constants);
    }
    if (HAS_ALPHA && asks(trace)) answer(trace, constants);
}
