//! What a scene needs: the part of the kernel key that the scene decides. What is not needed is not loaded, not compiled
//! and not run.

use super::LightChoice;
use super::environment::EnvironmentKind;
use crate::layout::{
    BSDF_GLASS, BSDF_LAMBERTIAN, BSDF_METALLIC_ROUGHNESS, BSDF_MIRROR, BSDF_REFRACT, BSDF_UNLIT, LIGHT_DIRECTIONAL,
    LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_SPOT, LIGHT_TRIANGLE,
};

/// The features of a kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Features {
    /// Bit `1 << BSDF_*` for each scattering model in use.
    pub bsdfs: u32,
    /// Bit `1 << LIGHT_*` for each kind of light that is sampled.
    pub lights: u32,
    /// How a light is picked.
    pub light_choice: LightChoice,
    /// Any texture.
    pub textures: bool,
    /// Any texture with a mip chain: paths carry ray cones.
    pub mip: bool,
    /// Any surface so near to an emissive triangle that its solid angle is sampled.
    pub near_lamps: bool,
    /// Any emission texture.
    pub emission_textures: bool,
    /// Two-level traversal.
    pub instances: bool,
    /// Any triangle with shading normals.
    pub normals: bool,
    /// Any emissive surface, sampled or not.
    pub emission: bool,
    /// Any metallic-roughness surface that transmits.
    pub transmission: bool,
    /// Any clear thin wall: light samples pass it.
    pub panes: bool,
    /// Any surface that encloses a volume.
    pub volume: bool,
    /// Any dielectric whose specular reflection is not the plain one of its index of refraction.
    pub specular: bool,
    /// Any anisotropic roughness.
    pub anisotropy: bool,
    /// Any normal texture.
    pub normal_maps: bool,
    /// Any triangle with vertex colours.
    pub vertex_colors: bool,
    /// Any surface that rays may pass where its alpha says so.
    pub alpha: bool,
    /// Any surface with a black back.
    pub black_back: bool,
    /// Any glass with Schlick's Fresnel term.
    pub schlick: bool,
    /// What rays see that leave the scene.
    pub environment: EnvironmentKind,
    /// The environment is picked by its CDFs.
    pub environment_importance: bool,
    /// The environment's texels are in RGBE.
    pub environment_rgbe: bool,
}

impl Features {
    /// Every feature's name, and whether it is in.
    /// Whether the kernel reads attributes of vertices (`HAS_ATTRIBUTES` in shaders/include/features.glsl).
    pub fn has_attributes(&self) -> bool {
        self.normals || self.textures || self.normal_maps || self.anisotropy || self.vertex_colors
    }

    fn list(&self) -> Vec<(&'static str, bool)> {
        let bsdf = |kind: u32| self.bsdfs & (1 << kind) != 0;
        let light = |kind: u32| self.lights & (1 << kind) != 0;
        vec![
            ("lambertian", bsdf(BSDF_LAMBERTIAN)),
            ("mirror", bsdf(BSDF_MIRROR)),
            ("refract", bsdf(BSDF_REFRACT)),
            ("glass", bsdf(BSDF_GLASS)),
            ("schlick", self.schlick),
            ("metallic-roughness", bsdf(BSDF_METALLIC_ROUGHNESS)),
            ("transmission", self.transmission),
            ("panes", self.panes),
            ("volume", self.volume),
            ("specular", self.specular),
            ("anisotropy", self.anisotropy),
            ("unlit", bsdf(BSDF_UNLIT)),
            ("black-back", self.black_back),
            ("emission", self.emission),
            ("textures", self.textures),
            ("mip", self.mip),
            ("emission-textures", self.emission_textures),
            ("normals", self.normals),
            ("normal-maps", self.normal_maps),
            ("vertex-colors", self.vertex_colors),
            ("alpha", self.alpha),
            ("instances", self.instances),
            ("triangle-lights", light(LIGHT_TRIANGLE)),
            ("near-lamps", self.near_lamps),
            ("point-lights", light(LIGHT_POINT)),
            ("spot-lights", light(LIGHT_SPOT)),
            ("directional-lights", light(LIGHT_DIRECTIONAL)),
            ("environment-light", light(LIGHT_ENVIRONMENT)),
            ("light-bvh", self.light_choice == LightChoice::Bvh),
            ("constant-environment", self.environment == EnvironmentKind::Constant),
            ("image-environment", self.environment == EnvironmentKind::Image),
            ("environment-importance", self.environment_importance),
            ("environment-rgbe", self.environment_rgbe),
        ]
    }

    /// Names of the features that are in.
    pub fn kept(&self) -> Vec<&'static str> {
        self.list().into_iter().filter(|(_, kept)| *kept).map(|(name, _)| name).collect()
    }

    /// Names of the features that are left out.
    pub fn dropped(&self) -> Vec<&'static str> {
        self.list().into_iter().filter(|(_, kept)| !kept).map(|(name, _)| name).collect()
    }
}
