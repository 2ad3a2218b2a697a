// Small tables compiled into the kernel: records as literals, chosen by their index. A choice among a few is cheaper than a
// load at a divergent address on software devices. src/gpu/specialize/bake.rs puts in the bodies, by the functions' names.
#ifndef BAKED_TABLES_GLSL
#define BAKED_TABLES_GLSL
#include "features.glsl"

#define BAKED_TEXEL(name) \
    uvec4 name(const uint index) { return uvec4(0u); }

BAKED_TEXEL(baked_material_0)
BAKED_TEXEL(baked_material_1)
BAKED_TEXEL(baked_material_2)
BAKED_TEXEL(baked_material_3)
BAKED_TEXEL(baked_material_4)
BAKED_TEXEL(baked_material_5)
BAKED_TEXEL(baked_material_6)
BAKED_TEXEL(baked_material_7)

BAKED_TEXEL(baked_light_0)
BAKED_TEXEL(baked_light_1)
BAKED_TEXEL(baked_light_2)
BAKED_TEXEL(baked_light_3)

// The vertices of the triangle that a light is.
BAKED_TEXEL(baked_lamp_0)
BAKED_TEXEL(baked_lamp_1)
BAKED_TEXEL(baked_lamp_2)

// Word `index` of the lights' CDF, in x.
BAKED_TEXEL(baked_light_cdf_0)

// The last bin of the lights' CDF that starts at or below x.
uint baked_light_search(const uint x) { return 0u; }

#endif
