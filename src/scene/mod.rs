//! What a scene is: plain data in f32 object space and f64 transforms, with no GPU types in it.
//!
//! Conventions: right-handed world, +Y up, metres; linear Rec.709 radiance. [`Scene::validate`] states what every
//! consumer may rely on.

pub mod builtin;
mod camera;
mod complete;
mod environment;
mod error;
mod light;
pub mod load;
mod lobe;
mod material;
mod mesh;
mod tangents;
mod texture;
mod validate;

use std::sync::Arc;

pub use camera::{Camera, Projection};
pub use environment::Environment;
pub use error::{SceneError, SceneResult};
pub use light::{PunctualKind, PunctualLight};
pub use lobe::Lobe;
pub use material::{AlphaMode, Bsdf, Fresnel, Material, Volume};
pub use mesh::{Instance, Mesh, Primitive};
pub use texture::{Filter, Image, Texels, Texture, TextureBinding, TextureTransform, Wrap};

/// A scene: meshes placed by instances, seen by cameras, lit by emissive materials, punctual lights and an environment.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Name for messages: the file's name or the built-in's.
    pub name: String,
    /// Cameras in file order; may be empty straight after loading (see [`Scene::frame_if_no_camera`]).
    pub cameras: Vec<Camera>,
    /// Meshes in object space.
    pub meshes: Vec<Mesh>,
    /// Materials; [`Primitive::material`] indexes them.
    pub materials: Vec<Material>,
    /// Textures: an image and how it is sampled.
    pub textures: Vec<Texture>,
    /// Decoded images; several textures may share one, and so may scenes.
    pub images: Vec<Arc<Image>>,
    /// Placed meshes (the node hierarchy, flattened to world transforms).
    pub instances: Vec<Instance>,
    /// Point, spot and directional lights in world space.
    pub lights: Vec<PunctualLight>,
    /// What a ray sees that leaves the scene.
    pub environment: Environment,
    /// What the loader met and could not honour, one line each, for the user.
    pub warnings: Vec<String>,
    /// What was added because the file lacks it (a camera, an environment), one line each, for the user.
    pub notes: Vec<String>,
}
