// Discrete distributions as cumulative 32-bit integers (src/prepare/cdf.rs): n + 1 words from 0 to CDF_TOTAL = 2^31. The
// probability of a bin is read off the stored differences, so it is exactly that of picking it.
#ifndef CDF_GLSL
#define CDF_GLSL
#include "arrays.glsl"
#include "math.glsl"
#include "rng.glsl"

struct CdfSample {
    uint index;
    float probability;
    uint offset;  // which of the bin's counts
    uint count;   // of how many
};

float cdf_probability(uint count) { return float(count) * (1.0 / 2147483648.0); }

// Where in its bin a sample lies, the digits below its count being `bits`: uniform in [0, 1), whatever the bin.
float cdf_rest(CdfSample s, uint bits) {
    return min((float(s.offset) + to_unit(bits)) / float(s.count), LARGEST_BELOW_1);
}

// The last of the n bins that starts at or below x; a bin of probability 0 is never it.
#define DEFINE_CDF(name)                                                                                \
    float cdf_probability_##name(uint first_word, uint index) {                                         \
        return cdf_probability(LOAD1(name, first_word + index + 1u) - LOAD1(name, first_word + index)); \
    }                                                                                                   \
    CdfSample cdf_search_##name(uint first_word, uint low, uint high, uint x) {                         \
        while (high - low > 1u) {                                                                       \
            uint middle = (low + high) >> 1u;                                                           \
            if (LOAD1(name, first_word + middle) <= x) low = middle; else high = middle;                \
        }                                                                                               \
        uint start = LOAD1(name, first_word + low);                                                     \
        uint count = LOAD1(name, first_word + low + 1u) - start;                                        \
        return CdfSample(low, cdf_probability(count), x - start, count);                                \
    }                                                                                                   \
    CdfSample cdf_sample_##name(uint first_word, uint n, uint bits) {                                   \
        return cdf_search_##name(first_word, 0u, n, bits >> 1u);                                        \
    }

// log2 of the buckets of a guide, and the words of a CDF with its guide (src/prepare/cdf.rs).
uint cdf_guide_bits(uint n) { return uint(max(findMSB(n) - 1, 0)); }
uint cdf_guided_words(uint n) { return n + 2u + (1u << cdf_guide_bits(n)); }

// The same bin as by cdf_sample, found between the bins with which the number's bucket begins and ends.
#define DEFINE_GUIDED_CDF(name)                                                                       \
    CdfSample cdf_sample_guided_##name(uint first_word, uint n, uint bits) {                          \
        uint x = bits >> 1u;                                                                          \
        uint guide = first_word + n + 1u + (x >> (31u - cdf_guide_bits(n)));                          \
        return cdf_search_##name(first_word, LOAD1(name, guide), LOAD1(name, guide + 1u) + 1u, x);    \
    }

DEFINE_CDF(TABLES)
DEFINE_CDF(ENVIRONMENT)
DEFINE_GUIDED_CDF(ENVIRONMENT)

#endif
