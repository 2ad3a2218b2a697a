// Fresnel reflectance. `eta` is the index of refraction of the far side relative to the near one.
#ifndef FRESNEL_GLSL
#define FRESNEL_GLSL

// Cosine of the transmitted angle; −1 where the reflection is total. Written so that eta = 1 gives exactly `cosine`.
float transmitted_cosine(float cosine, float eta) {
    float scaled = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    return scaled > 0.0 ? sqrt(scaled) / eta : -1.0;
}

// Unpolarised dielectric (PBR, 4th ed., eq. 9.12).
float fresnel_dielectric(float cosine, float cosine_transmitted, float eta) {
    if (cosine_transmitted < 0.0) return 1.0;
    float parallel = (eta * cosine - cosine_transmitted) / (eta * cosine + cosine_transmitted);
    float perpendicular = (cosine - eta * cosine_transmitted) / (cosine + eta * cosine_transmitted);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

float pow5(float x) { return x * x * x * x * x; }

// Schlick 1994 with the cosine on the optically thinner side, which makes it the same from both sides.
float fresnel_schlick_dielectric(float cosine, float cosine_transmitted, float eta) {
    if (cosine_transmitted < 0.0) return 1.0;
    float r0 = sqr((1.0 - eta) / (1.0 + eta));
    return r0 + (1.0 - r0) * pow5(1.0 - (eta < 1.0 ? cosine_transmitted : cosine));
}

vec3 fresnel_schlick(vec3 f0, float cosine) { return f0 + (1.0 - f0) * pow5(1.0 - cosine); }

#endif
