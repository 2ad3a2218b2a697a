// Discrete distributions as cumulative 32-bit integers (src/prepare/cdf.rs): n + 1 words from 0 to CDF_TOTAL = 2^31. The
// probability of a bin is read off the stored differences, so it is exactly that of picking it.
#ifndef CDF_GLSL
#define CDF_GLSL
#include "arrays.glsl"

struct CdfSample {
    uint index;
    float probability;
};

// A bin that was picked, and what the number leaves to say within it: uniform in [0, count).
struct CdfBin {
    uint index;
    uint count;      // of the CDF_TOTAL numbers
    uint remainder;
};

// The last of the n bins that starts at or below x; a bin of probability 0 is never it.
#define DEFINE_CDF(name)                                                                     \
    float cdf_probability_##name(uint first_word, uint index) {                              \
        uint count = LOAD1(name, first_word + index + 1u) - LOAD1(name, first_word + index); \
        return float(count) * (1.0 / 2147483648.0);                                          \
    }                                                                                        \
    CdfBin cdf_bin_##name(uint first_word, uint n, uint bits) {                              \
        uint x = bits >> 1u;                                                                 \
        uint low = 0u;                                                                       \
        uint high = n;                                                                       \
        while (high - low > 1u) {                                                            \
            uint middle = (low + high) >> 1u;                                                \
            if (LOAD1(name, first_word + middle) <= x) low = middle; else high = middle;     \
        }                                                                                    \
        uint start = LOAD1(name, first_word + low);                                          \
        return CdfBin(low, LOAD1(name, first_word + low + 1u) - start, x - start);           \
    }                                                                                        \
    CdfSample cdf_sample_##name(uint first_word, uint n, uint bits) {                        \
        CdfBin bin = cdf_bin_##name(first_word, n, bits);                                    \
        return CdfSample(bin.index, float(bin.count) * (1.0 / 2147483648.0));                \
    }

DEFINE_CDF(TABLES)
DEFINE_CDF(ENVIRONMENT)

#endif
