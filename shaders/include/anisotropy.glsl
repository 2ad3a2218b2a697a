// Roughness that depends on the direction: KHR_materials_anisotropy, which widens the lobe along a direction of the tangent
// plane.
#ifndef ANISOTROPY_GLSL
#define ANISOTROPY_GLSL
#include "frame.glsl"
#include "math.glsl"
#include "texture.glsl"

// Turns the frame, whose tangent and bitangent are those of the texture coordinates, until its x axis is the direction of
// the larger roughness, and makes alpha.x that: mix(α, 1, strength²). The direction is the texture's, else the tangent,
// rotated towards the bitangent.
void make_anisotropic(RenderConstants constants, Material material, vec4 texcoords, inout Frame frame, inout vec2 alpha) {
    float strength = material.anisotropy;
    vec2 direction = cos_sin_turns(material.anisotropy_turns);
    if (HAS_TEXTURES && material.anisotropy_texture != NONE) {
        vec3 texel = sample_texture(constants, material.anisotropy_texture, texcoords).rgb;
        vec2 own = texel.rg * 2.0 - 1.0;
        // Opposite directions that filtering cancels leave none; the tangent is as good as any.
        if (own != vec2(0.0)) {
            own = normalize(own);
            direction = vec2(own.x * direction.x - own.y * direction.y, own.x * direction.y + own.y * direction.x);
        }
        strength *= texel.b;
    }
    frame = Frame(frame.tangent * direction.x + frame.bitangent * direction.y, frame.normal,
                  frame.bitangent * direction.x - frame.tangent * direction.y);
    alpha.x += (1.0 - alpha.x) * strength * strength;
}

#endif
