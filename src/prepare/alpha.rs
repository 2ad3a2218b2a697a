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
    /// What `material` comes to. Alpha lies between its factor times the least and times the largest alpha of the texels;
    /// interpolated ones lie between theirs.
    pub(super) fn of(scene: &Scene, material: &Material) -> Self {
        let (least, largest) = alpha_range(scene, material);
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

/// The least and the largest alpha that the surface can have.
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
