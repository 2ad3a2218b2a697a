// The watertight test of a ray and a triangle (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection").
#ifndef WATERTIGHT_GLSL
#define WATERTIGHT_GLSL

// v rotated so that component `axis` is the last.
vec3 rotate_axis(vec3 v, uint axis) { return axis == 0u ? v.yzx : (axis == 1u ? v.zxy : v); }

// Ray space: the largest component of the direction comes last, and the other two are sheared away.
struct RaySpace {
    uint axis;  // of the largest component
    vec3 shear;
};

RaySpace ray_space(vec3 direction) {
    vec3 magnitude = abs(direction);
    RaySpace space;
    bool x_largest = magnitude.x > magnitude.y && magnitude.x > magnitude.z;
    space.axis = x_largest ? 0u : (magnitude.y > magnitude.z ? 1u : 2u);
    vec3 d = rotate_axis(direction, space.axis);
    precise float shear_z = 1.0 / d.z;
    precise float shear_x = d.x * shear_z;
    precise float shear_y = d.y * shear_z;
    space.shear = vec3(shear_x, shear_y, shear_z);
    return space;
}

// Where the line of the ray meets the plane of the triangle.
struct TriangleMeeting {
    bool inside;
    float determinant;  // 0: edge-on
    float t;
    vec2 scaled;        // barycentric weights of the second and third vertex, times the determinant
};

// Vertices are sheared into ray space, each by the same operations wherever it is shared, and edges are tested there by
// differences of products. Rounding is monotonic, so a computed edge function never has the wrong sign, it can only be
// zero; zero counts as inside. Hence a closed mesh has no gap. `precise` keeps the compiler from fusing, which would break
// the symmetry between neighbours.
TriangleMeeting meet_triangle(RaySpace space, vec3 origin, vec3 vertex_a, vec3 vertex_b, vec3 vertex_c) {
    precise vec3 a = rotate_axis(vertex_a - origin, space.axis);
    precise vec3 b = rotate_axis(vertex_b - origin, space.axis);
    precise vec3 c = rotate_axis(vertex_c - origin, space.axis);
    precise float ax = a.x - space.shear.x * a.z;
    precise float ay = a.y - space.shear.y * a.z;
    precise float bx = b.x - space.shear.x * b.z;
    precise float by = b.y - space.shear.y * b.z;
    precise float cx = c.x - space.shear.x * c.z;
    precise float cy = c.y - space.shear.y * c.z;
    precise float u = cx * by - cy * bx;
    precise float v = ax * cy - ay * cx;
    precise float w = bx * ay - by * ax;
    precise float determinant = u + v + w;
    precise float scaled_t = (u * a.z + v * b.z + w * c.z) * space.shear.z;
    bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    return TriangleMeeting(inside, determinant, scaled_t / determinant, vec2(v, w));
}

#endif
