//! What a material's alpha comes to: nothing that is there everywhere, or nowhere, is decided while rays are traced.

use crate::scene::{AlphaMode, Material, Scene, Texels};

/// How much of a surface is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Presence {
    /// All of it.
    Opaque,
    /// Nothing of it.
    Absent,
    /// Where alpha is at least the cutoff.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// Each point of it with the probability alpha.
    Blend,
}

impl Presence {
    /// What a material comes to. Alpha lies between its factor times the least and times the largest alpha of the texels and
    /// of the vertices; interpolated ones lie between theirs.
    pub(super) fn of(scene: &Scene, index: usize) -> Self {
        let material = &scene.materials[index];
        if material.alpha_mode == AlphaMode::Opaque {
            return Self::Opaque;
        }
        let (texel_range, vertex_range) = (alpha_range(scene, material), vertex_alpha_range(scene, index));
        let (least, largest) = (texel_range.0 * vertex_range.0, texel_range.1 * vertex_range.1);
        match material.alpha_mode {
            AlphaMode::Opaque => Self::Opaque,
            AlphaMode::Mask { cutoff } if least >= cutoff => Self::Opaque,
            AlphaMode::Mask { cutoff } if largest < cutoff => Self::Absent,
            AlphaMode::Mask { cutoff } => Self::Mask { cutoff },
            AlphaMode::Blend if least >= 1.0 => Self::Opaque,
            AlphaMode::Blend if largest <= 0.0 => Self::Absent,
            AlphaMode::Blend => Self::Blend,
        }
    }
}

/// The least and the largest alpha of the vertices that have the material.
fn vertex_alpha_range(scene: &Scene, material: usize) -> (f32, f32) {
    let primitives = scene.meshes.iter().flat_map(|mesh| &mesh.primitives).filter(|p| p.material == material);
    range(primitives.flat_map(|primitive| {
        let colors = primitive.colors.as_deref().unwrap_or(&[[1.0; 4]]);
        colors.iter().map(|color| color[3])
    }))
}

/// The least and the largest alpha of the factor times the texels.
fn alpha_range(scene: &Scene, material: &Material) -> (f32, f32) {
    let Some(binding) = material.base_color_texture else { return (material.alpha, material.alpha) };
    let (least, largest) = match &scene.images[scene.textures[binding.texture].image].texels {
        Texels::Rgba8(texels) => range(texels.iter().map(|t| f32::from(t[3]) / 255.0)),
        Texels::Rgba16(texels) => range(texels.iter().map(|t| f32::from(t[3]) / 65535.0)),
    };
    (material.alpha * least, material.alpha * largest)
}

fn range(values: impl Iterator<Item = f32>) -> (f32, f32) {
    values.fold((f32::INFINITY, f32::NEG_INFINITY), |(least, largest), value| (least.min(value), largest.max(value)))
}
