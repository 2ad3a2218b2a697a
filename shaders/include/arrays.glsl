// The scene arrays behind one accessor: LOAD4(NAME, texel index) and LOAD1(NAME, word index), as texel buffer, storage
// buffer or device address (ARRAY_FORM, chosen by the host from the device's limits). An array over a limit is split into
// chunks of 2^CHUNK_SHIFT texels; CHUNK_SHIFT 31 means that none is.
#ifndef ARRAYS_GLSL
#define ARRAYS_GLSL

#define FORM_TEXEL_BUFFER 0
#define FORM_STORAGE_BUFFER 1
#define FORM_DEVICE_ADDRESS 2

layout(constant_id = 1) const uint CHUNK_SHIFT = 31u;

// A word is picked from its element by an index. Selects, whose operands depend on words that were picked before, take
// SwiftShader minutes and gigabytes to compile (docs/benchmarks).
//
// Chunk c of array a is element 4·a + c. All indices below are constants: dynamic indexing of descriptors is a feature
// that not every device has.
#if ARRAY_FORM == FORM_TEXEL_BUFFER
layout(set = 0, binding = 3) uniform usamplerBuffer scene_arrays[20];
#define FETCH(element, index) texelFetch(scene_arrays[element], int(index))
#elif ARRAY_FORM == FORM_STORAGE_BUFFER
layout(set = 0, binding = 3, std430) readonly buffer SceneArrayBlock { uvec4 texels[]; } scene_arrays[20];
#define FETCH(element, index) scene_arrays[element].texels[index]
#else
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer TexelReference { uvec4 texels[]; };
layout(set = 0, binding = 3, std140) uniform ArrayAddresses { uvec4 array_addresses[20]; };
#define FETCH(element, index) TexelReference(array_addresses[element].xy).texels[index]
#endif

#define DEFINE_ARRAY(name, number)                                             \
    uvec4 load4_##name(uint index) {                                           \
        if (CHUNK_SHIFT < 31u) {                                               \
            uint chunk = index >> CHUNK_SHIFT;                                 \
            uint offset = index & ((1u << CHUNK_SHIFT) - 1u);                  \
            if (chunk == 0u) return FETCH(4 * number, offset);                 \
            if (chunk == 1u) return FETCH(4 * number + 1, offset);             \
            if (chunk == 2u) return FETCH(4 * number + 2, offset);             \
            return FETCH(4 * number + 3, offset);                              \
        }                                                                      \
        return FETCH(4 * number, index);                                       \
    }                                                                          \
    uint load1_##name(uint index) {                                            \
        return load4_##name(index >> 2u)[index & 3u];                          \
    }

DEFINE_ARRAY(SLOTS, 0)
DEFINE_ARRAY(ATTRIBUTES, 1)
DEFINE_ARRAY(TABLES, 2)
DEFINE_ARRAY(TEXELS, 3)
DEFINE_ARRAY(ENVIRONMENT, 4)

#define LOAD4(name, index) load4_##name(index)
#define LOAD1(name, index) load1_##name(index)

#endif
