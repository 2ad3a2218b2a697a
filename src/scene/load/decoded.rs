//! Images that were decoded before: a scene that is watched is loaded again whenever one of its files is saved.

use std::path::Path;
use std::sync::Arc;

use super::image::{Radiance, decode_radiance, decode_texture, read_environment};
use crate::memo::Memo;
use crate::scene::{Environment, Image, SceneResult};

/// Decoded images by the bytes they were decoded from: whatever has become of a file's name or time, the image is that of
/// its bytes. The default keeps none.
#[derive(Debug, Default)]
pub struct Decoded {
    /// By name, which the image bears, and bytes.
    textures: Memo<(String, Vec<u8>), Image>,
    environments: Memo<Vec<u8>, Radiance>,
}

impl Decoded {
    /// Keeps the images of a load for the next.
    pub fn keeping() -> Self {
        Self { textures: Memo::keeping(), environments: Memo::keeping() }
    }

    /// Counts anew, after a load that failed.
    pub fn count_anew(&self) {
        self.textures.count_anew();
        self.environments.count_anew();
    }

    /// Forgets the images that no load since the last call has asked for. How many were decoded, and how many asked for.
    pub fn sweep(&self) -> (u32, u32) {
        let (textures, environments) = (self.textures.sweep(), self.environments.sweep());
        (textures.0 + environments.0, textures.1 + environments.1)
    }

    /// See [`decode_texture`].
    pub(super) fn texture(&self, name: &str, bytes: &[u8]) -> Result<Arc<Image>, String> {
        self.textures.get(
            |(its_name, its_bytes)| its_name == name && its_bytes == bytes,
            || (name.to_owned(), bytes.to_vec()),
            || decode_texture(name, bytes),
        )
    }

    /// See [`super::load_environment`].
    ///
    /// # Errors
    /// Those of [`super::load_environment`].
    pub fn environment(&self, path: &Path, strength: f32, rotation_degrees: f64) -> SceneResult<Environment> {
        read_environment(path, strength, rotation_degrees, |bytes| {
            self.environments.get(|its_bytes| *its_bytes == bytes, || bytes.clone(), || decode_radiance(&bytes))
        })
    }
}
