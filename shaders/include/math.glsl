// Elementary functions whose error is known on every driver (Vulkan allows sin and cos 2^-11 and atan 4096 ulp), and
// vectors that neither overflow nor vanish. What is relied on of a driver's float arithmetic is listed in
// docs/accuracy/float-behaviour.md and tested by tests/stress/float_behaviour.rs.
#ifndef MATH_GLSL
#define MATH_GLSL

const float PI = 3.14159265358979;
const float INV_PI = 0.318309886183791;
#define INFINITY uintBitsToFloat(0x7f800000u)
// Half a unit in the last place of 1: the bound on the relative error of one rounded operation.
const float UNIT_ROUNDOFF = 5.9604644775390625e-8;

const float LARGEST_BELOW_1 = 0.999999940395355;

// γ(n) = n·u / (1 − n·u) bounds the relative error of n rounded operations (Higham 2002, §3.1).
#define GAMMA(n) (float(n) * UNIT_ROUNDOFF / (1.0 - float(n) * UNIT_ROUNDOFF))

bool is_finite(float x) { return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u; }
bool is_finite(vec3 v) { return is_finite(v.x) && is_finite(v.y) && is_finite(v.z); }

float max_component(vec3 v) { return max(v.x, max(v.y, v.z)); }
float sqr(float x) { return x * x; }
float luminance(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }

// A unit vector along v, for lengths whose squares under- or overflow too. v must not be zero.
vec3 safe_normalize(vec3 v) {
    vec3 scaled = v / max_component(abs(v));
    return scaled * inversesqrt(dot(scaled, scaled));
}

// A whole number in [0, 2^23) by its bits. A conversion saturates, which lavapipe (Mesa 25) does lane by lane. What is not
// finite gives 0 or 2^22.
uint small_whole(float x) { return floatBitsToUint(x + 8388608.0) & 0x7fffffu; }
uvec2 small_whole(vec2 x) { return floatBitsToUint(x + 8388608.0) & 0x7fffffu; }

// The texel at the corner of a lookup's square: whole numbers from −1 on.
ivec2 texel_of_corner(vec2 corner) { return ivec2(small_whole(corner + 1.0)) - 1; }

// (cos 2πu, sin 2πu) for u in [0, 1]. The argument is reduced to [−π/4, π/4], where the polynomials (the single-precision
// ones of the Cephes library, sinf.c) are good to 1 ulp.
vec2 cos_sin_turns(float u) {
    float quadrant = floor(u * 4.0 + 0.5);
    float x = (u * 4.0 - quadrant) * (0.5 * PI);
    float x2 = x * x;
    float s = x * (1.0 + x2 * (-1.6666654611e-1 + x2 * (8.3321608736e-3 + x2 * -1.9515295891e-4)));
    float c = 1.0 + x2 * (-0.5 + x2 * (4.166664568298827e-2 + x2 * (-1.388731625493765e-3 + x2 * 2.443315711809948e-5)));
    uint k = small_whole(quadrant);
    bool swap = (k & 1u) != 0u;
    float sine = swap ? c : s;
    float cosine = swap ? s : c;
    return vec2(((k + 1u) & 2u) != 0u ? -cosine : cosine, (k & 2u) != 0u ? -sine : sine);
}

// e^−x for x ≥ 0 to 2 ulp, infinity too (Cephes expf.c); 0 where it is below the normal numbers.
float exp_minus(float x) {
    if (x > 87.0) return 0.0;
    float n = floor(x * 1.44269504088896341 + 0.5);
    float r = (n * 0.693359375 - x) + n * -2.12194440e-4;
    float p = ((((1.9875691500e-4 * r + 1.3981999507e-3) * r + 8.3334519073e-3) * r + 4.1665795894e-2) * r +
               1.6666665459e-1) * r + 5.0000001201e-1;
    return (p * r * r + r + 1.0) * uintBitsToFloat((127u - small_whole(n)) << 23u);
}

// atan(x) for x in [0, 1] (Cephes atanf.c): above tan(π/8) the argument (x − 1)/(x + 1) is used.
float atan_unit(float x) {
    bool upper = x > 0.4142135623730950;
    float y = upper ? (x - 1.0) / (x + 1.0) : x;
    float z = y * y;
    float p = (((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1) * z * y + y;
    return p + (upper ? 0.25 * PI : 0.0);
}

// The angle of (x, y) in turns, in [0, 1): atan2(y, x) / 2π. Zero for the zero vector.
float turns(float y, float x) {
    float ax = abs(x);
    float ay = abs(y);
    float larger = max(ax, ay);
    float a = larger > 0.0 ? atan_unit(min(ax, ay) / larger) : 0.0;
    a = ay > ax ? 0.5 * PI - a : a;
    a = x < 0.0 ? PI - a : a;
    float t = (y < 0.0 ? -a : a) * (0.5 * INV_PI);
    t = t < 0.0 ? t + 1.0 : t;
    return t < 1.0 ? t : 0.0;
}

// The nearest floats above and below; zero steps to the smallest normal number, since a device may
// flush denormals; infinities stay.
float next_float_up(float x) {
    uint bits = floatBitsToUint(x);
    if ((bits & 0x7fffffffu) == 0u) return uintBitsToFloat(0x00800000u);
    if (bits == 0x7f800000u) return x;
    return uintBitsToFloat((bits & 0x80000000u) == 0u ? bits + 1u : bits - 1u);
}
float next_float_down(float x) { return -next_float_up(-x); }

#endif
