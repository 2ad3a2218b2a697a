// Weights that combine light sampling with BSDF sampling.
#ifndef MIS_GLSL
#define MIS_GLSL
#include "features.glsl"

// Weight of a sample drawn with density `own` that the other strategy draws with density `other` (Veach 1997, §9.2). By
// the ratio, so that squares of large densities do not overflow.
float mis_weight(float own, float other) {
    float ratio = other / own;
    return 1.0 / (1.0 + (MIS_HEURISTIC == MIS_POWER ? ratio * ratio : ratio));
}

// One-sample model with the averaged density: the strategy is chosen with probability ½, and the balance heuristic's
// weight divided by ½ makes f / ((own + other) / 2).
float mixture_weight(float own, float other) { return 2.0 / (1.0 + other / own); }

#endif
