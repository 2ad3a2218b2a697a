// Sobol' points in pairs of dimensions, Owen-scrambled by hashing (Burley 2020, "Practical Hash-based Owen Scrambling"),
// shared out among the pixels of a tile so that neighbours complete each other.
//
// The first 2^m samples of a pixel, and every later aligned run of 2^m, are a (0, m, 2)-net in base 2: nothing has to know
// how many there will be. The first 2^m samples of all pixels of an aligned square of 2^k × 2^k pixels of a tile are a
// (0, m + 2k, 2)-net, so that the errors of neighbours cancel. docs/estimators.md derives it.
#ifndef SOBOL_GLSL
#define SOBOL_GLSL

// log2 of the width of a tile; tiles are scrambled independently of each other.
const uint SOBOL_TILE = 5u;
// Samples of a block and replicates of an error estimate, as on the host (BLOCK_SAMPLES, film::replicates::REPLICATES).
const uint SOBOL_BLOCK = 16u;
const uint SOBOL_REPLICATES = 8u;

// A random permutation in which each bit is flipped by the bits below it alone: Owen's scrambling of numbers whose digits
// are in reverse order. The hash is Vegdahl's of Laine and Karras' kind (2021, "Building a Better LK Hash").
uint scramble_reversed(uint x, uint seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// A permutation of whole numbers that keeps every aligned run of 2^k of them together.
uint shuffle(uint i, uint seed) { return bitfieldReverse(scramble_reversed(bitfieldReverse(i), seed)); }

// Bits k of x and y at 2k and 2k + 1, for x, y < 2^5.
uint morton(uint x, uint y) {
    uint z = x | y << 16u;
    z = (z | z << 4u) & 0x030f030fu;
    z = (z | z << 2u) & 0x33333333u;
    z = (z | z << 1u) & 0x55555555u;
    return (z | z >> 15u) & 0x3ffu;
}

// Σ over the levels l ≥ 1 of d_{2l−2} / (1 + x + x²)^l over F2 as a power series, where d_k is bit 31 − k of `digits`; bit r of
// the sum is the coefficient of x^r.
uint sum_over_levels(uint digits) {
    uint s = 0u;
    if ((digits & 0x80000000u) != 0u) s ^= 0xdb6db6dbu;
    if ((digits & 0x20000000u) != 0u) s ^= 0x45145145u;
    if ((digits & 0x08000000u) != 0u) s ^= 0x77077077u;
    if ((digits & 0x02000000u) != 0u) s ^= 0x11011011u;
    if ((digits & 0x00800000u) != 0u) s ^= 0x6b006b6bu;
    return s;
}

// By what a pixel's points are shifted: Σ (z_{2l−2} + z_{2l−1} x) / (1 + x + x²)^l, and in the second coordinate the same with
// z_{2l−2} + z_{2l−1} in the place of z_{2l−2}. Bit 31 − k of `digits` is z_k.
uvec2 pixel_shifts(uint digits) {
    uint odd = sum_over_levels(digits << 1u);
    uint first = sum_over_levels(digits) ^ odd << 1u;
    return uvec2(first, first ^ odd);
}

// The order of a pixel's samples: a permutation that keeps [2^m, 2^(m+1)) for every m, and within it aligned runs. Each
// pixel has its own, so that how pairs of dimensions are matched differs from pixel to pixel.
uint sobol_order(uint index, uint seed) {
    if (index == 0u) return 0u;
    uint below = (1u << findMSB(index)) - 1u;
    return (index & ~below) | (shuffle(index, seed) & below);
}

// Both coordinates of sample `index` in the pixel of Morton number `z` of its tile, as 32-bit fractions. `seeds`: the order
// of the samples, of the pixels, the scrambling of each coordinate.
uvec2 sobol_pair(uint index, uint z, uvec4 seeds) {
    uint i = sobol_order(index, seeds.x ^ z * 0x9e3779b9u);
    uvec2 shifts = pixel_shifts(scramble_reversed(bitfieldReverse(z), seeds.y));
    // The digits of the first coordinate are the bits of i; those of the second Pascal's triangle modulo 2 times them:
    // bit k ^= bit k + s, for every power of two s.
    uint j = i;
    j ^= (j >> 1u) & 0x55555555u;
    j ^= (j >> 2u) & 0x33333333u;
    j ^= (j >> 4u) & 0x0f0f0f0fu;
    j ^= (j >> 8u) & 0x00ff00ffu;
    j ^= (j >> 16u) & 0x0000ffffu;
    i ^= shifts.x;
    j ^= shifts.y;
    return uvec2(bitfieldReverse(scramble_reversed(i, seeds.z)), bitfieldReverse(scramble_reversed(j, seeds.w)));
}

#endif
