// Emissive triangles that are near: sampled uniformly by the solid angle under which they are seen. Far ones are sampled
// by area (light.glsl), which is cheaper and as good there.
#ifndef LIGHT_TRIANGLE_GLSL
#define LIGHT_TRIANGLE_GLSL
#include "geometry.glsl"

// Near is what is no farther than its longest edge L, by the distance d of the nearest vertex. Sampled by area, a
// direction's weight goes as cos/d² = h/d³, h the height over the plane: the deviation along the edge is L/√18 at most
// and that of the weight, relatively, 3·cos φ·L/(√18·d), φ the angle of the view to the plane; so its variance is
// (L/d)²·cos² φ/2. At this distance that is a half at most and a quarter at a middling angle; farther away it is less than
// what the solid angle costs of the time of a sample (docs/benchmarks/README.md). An inner point is at most L/√3 from a
// vertex, so all points of far triangles are at least √(2/3)·L away.
// A triangle's vertices relative to a point.
struct RelativeTriangle {
    vec3 a;
    vec3 b;
    vec3 c;
    bool front;  // which side the point is on
};

RelativeTriangle relative_triangle(RenderConstants constants, TriangleVertices vertices, uint instance, vec3 from) {
    precise vec3 a = vertices.a;
    precise vec3 b = vertices.b;
    precise vec3 c = vertices.c;
    if (HAS_INSTANCES && instance != NONE) {
        Affine m = load_object_to_world(constants, instance);
        a = transform_point(m, a);
        b = transform_point(m, b);
        c = transform_point(m, c);
    }
    RelativeTriangle t = RelativeTriangle(a - from, b - from, c - from, false);
    t.front = dot(t.a, cross(b - a, c - a)) < 0.0;
    if (HAS_INSTANCES && instance != NONE && load_instance_header(constants, instance).z != 0u) t.front = !t.front;
    return t;
}

// `precise`, so that light and BSDF sampling, which start from the same point, agree about it.
bool triangle_is_near(RelativeTriangle t) {
    precise vec3 ab = t.b - t.a;
    precise vec3 ac = t.c - t.a;
    precise vec3 bc = t.c - t.b;
    precise float edge = max(dot(ab, ab), max(dot(ac, ac), dot(bc, bc)));
    precise float nearest = min(dot(t.a, t.a), min(dot(t.b, t.b), dot(t.c, t.c)));
    return edge >= nearest;
}

// A triangle on the unit sphere.
struct SphericalTriangle {
    vec3 distances;    // of the vertices
    vec3 a;            // unit directions to them
    vec3 b;
    vec3 c;
    float volume;      // |det(a, b, c)|
    float cosine_sum;  // 1 + a·b + b·c + c·a
    float half_turns;  // half the solid angle in turns, (0, 1/2]; not positive if it is not known well enough
};

// tan(Ω/2) = |det(a, b, c)| / (1 + a·b + b·c + c·a) (Van Oosterom and Strackee 1983, eq. 8). The determinant is a·n over
// two of the distances, n the cross product of the edges, which keeps its digits for slivers. The sum has an error of
// 2^-22, and from a point close to an edge a and b are nearly opposite and it is of the order of |a + b|. So where that is
// below 2^-10 for any edge, within some 2^-11 of its length, and where the triangle is seen edge-on or from a vertex, there
// is no solid angle, and the triangle is sampled by area; anywhere else it is good to 2^-12.
SphericalTriangle spherical_triangle(RelativeTriangle t) {
    SphericalTriangle s;
    s.distances = sqrt(vec3(dot(t.a, t.a), dot(t.b, t.b), dot(t.c, t.c)));
    s.a = t.a / s.distances.x;
    s.b = t.b / s.distances.y;
    s.c = t.c / s.distances.z;
    s.volume = abs(dot(s.a, cross(t.b - t.a, t.c - t.a))) / s.distances.y / s.distances.z;
    precise vec3 cosines = vec3(dot(s.a, s.b), dot(s.b, s.c), dot(s.c, s.a));
    s.cosine_sum = 1.0 + cosines.x + cosines.y + cosines.z;
    // 1 + a·b = |a + b|²/2.
    bool known = min(cosines.x, min(cosines.y, cosines.z)) >= -1.0 + 8.0 * UNIT_ROUNDOFF;
    s.half_turns = known ? turns(s.volume, s.cosine_sum) : 0.0;
    return s;
}

// Not positive where the triangle is sampled by area.
float triangle_solid_angle(RelativeTriangle t) { return 4.0 * PI * spherical_triangle(t).half_turns; }

// Weights of the second and third vertex of a point that is uniform by solid angle (Arvo 1995), and the solid angle. As
// Peters 2021, "BRDF Importance Sampling for Polygons", §3, has it: the arc from a to c is cut at a' so that (a, b, a')
// has the share u.x of the solid angle, by reflecting a at r = α·a + β·c; then the arc from b to a' is cut at a share u.y
// of 1 − cos. All three directions stay combinations of a, b and c with positive weights, here computed without
// cancellation, so that the point is inside of however thin a sliver, and the planar mapping is what is left far away.
vec3 sample_solid_angle(RelativeTriangle t, vec2 u) {
    SphericalTriangle s = spherical_triangle(t);
    vec3 middle = s.a + s.b;
    float difference = length(vec2(s.volume, s.cosine_sum)) * cos_sin_turns((1.0 - u.x) * s.half_turns).y;
    float beta = 0.5 * dot(middle, middle) * cos_sin_turns(u.x * s.half_turns).y;
    float scale = 1.0 / (difference + 2.0 * beta);  // makes α + β = 1; α − β is `difference`
    difference *= scale;
    beta *= scale;
    float chord = 1.0 - dot(s.a, s.c);
    float squared = 1.0 - 2.0 * (difference + beta) * beta * chord;
    float of_a = difference / squared;
    float of_c = 2.0 * beta * (1.0 - beta * chord) / squared;
    // 1 + b·a' = |b + a'|²/2, of which the length is known to 2^-22. It is that small only for a point that touches the
    // inside of the triangle, where a' is opposite to b.
    vec3 opposite = of_a * s.a + of_c * s.c + s.b;
    float rest = max(0.5 * dot(opposite, opposite), 5.684341886080802e-14);
    float whole = max(2.0 - rest, 0.0);  // 1 − b·a'
    float cut = sqrt(u.y * (2.0 - u.y * whole) / rest);
    vec3 weights = vec3(cut * of_a, (1.0 - cut) + whole * (cut - u.y), cut * of_c) * (s.distances.x / s.distances);
    return vec3(weights.yz / (weights.x + weights.y + weights.z), 4.0 * PI * s.half_turns);
}

#endif
