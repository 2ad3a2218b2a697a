// Camera rays that ask for emission alone. What the camera sees without scattering is noisy in few pixels, those with a
// lamp's edge above all, and cheap to see: there a sample's path leaves it to rays of their own, which end at the first
// surface. src/render/emission_pixels.rs picks the pixels and the number of rays; whatever it picks, the mean is the same.
// It stands on the kernel's bindings.
#ifndef EMISSION_RAYS_GLSL
#define EMISSION_RAYS_GLSL
#include "lane.glsl"
#include "rng.glsl"

layout(set = 0, binding = 8, std430) readonly buffer EmissionPixelBlock { uint emission_pixels[]; };

// The lane has an atom of another pixel.
void begin_emission_rays(inout LaneState lane, RenderConstants constants) {
    uint pixel = (lane.pixel >> 16u) * constants.width + (lane.pixel & 0xffffu);
    bool chosen = (emission_pixels[pixel / 32u] >> pixel % 32u & 1u) != 0u;
    lane.emission_rays = chosen ? constants.emission_rays : 0u;
}

bool is_emission_ray(LaneState lane) { return HAS_EMISSION_RAYS && lane.emission_ray != 0u; }

// Whether the lane's path leaves what it finds after `bounce` scattering events to emission rays.
bool leaves_emission(LaneState lane, uint bounce) {
    return HAS_EMISSION_RAYS && bounce == 0u && lane.emission_ray == 0u && lane.emission_rays != 0u;
}

// The place of an emission ray in the pixel and on the lens. Those of all samples of a pixel are one sequence.
uvec4 emission_ray_bits(LaneState lane, SampleKey key) {
    return sample_part_bits(key, lane.emission_rays, lane.emission_ray - 1u, DIMENSIONS_EMISSION);
}

// What all decisions about alpha along it are drawn from.
uvec2 emission_alpha_key(LaneState lane, SampleKey key) {
    key.index = key.index * lane.emission_rays + lane.emission_ray - 1u;
    return hashed_bits(key, 0u, DIMENSIONS_EMISSION_ALPHA).xy;
}

#endif
