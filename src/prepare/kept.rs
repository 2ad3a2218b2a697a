//! What is dear to prepare, kept for a scene that is loaded again: each by all that it depends on. What the rest takes is a
//! pass over triangles and texels, which asks in turn whether they are still the same.

use std::convert::Infallible;
use std::sync::Arc;

use super::bvh::{BvhQuality, Primitive, Tree};
use super::environment::{self, PreparedEnvironment};
use super::mip::mip_chain;
use super::textures::ColorSpace;
use super::{EnvironmentSampling, PrepareError};
use crate::memo::Memo;
use crate::scene::{Environment, Image};

/// The parts of earlier calls to [`super::prepare_again`]. The default keeps none.
#[derive(Debug, Default)]
pub struct Kept {
    trees: Memo<(Vec<Primitive>, BvhQuality), Tree>,
    chains: Memo<(Arc<Image>, ColorSpace), Chain>,
    environments: Memo<(Environment, EnvironmentSampling), PreparedEnvironment>,
}

/// Levels of texels.
type Chain = Vec<Vec<[u16; 4]>>;

/// How many parts were made, and how many were asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reuse {
    /// Trees: the world's, and one for each mesh that instances share.
    pub trees: (u32, u32),
    /// Mip chains of images.
    pub chains: (u32, u32),
    /// Environment images with their distributions: one or none.
    pub environments: (u32, u32),
}

impl Kept {
    /// Keeps what a call has made for the next.
    pub fn keeping() -> Self {
        Self { trees: Memo::keeping(), chains: Memo::keeping(), environments: Memo::keeping() }
    }

    /// Counts anew, after a call that failed.
    pub fn count_anew(&self) {
        self.trees.count_anew();
        self.chains.count_anew();
        self.environments.count_anew();
    }

    /// Forgets what was not asked for since the last time.
    pub fn sweep(&self) -> Reuse {
        Reuse { trees: self.trees.sweep(), chains: self.chains.sweep(), environments: self.environments.sweep() }
    }

    /// A tree depends on the boxes alone. Which triangles there are at all, alpha and emission decide with the geometry; what
    /// stands in their records is no part of it.
    pub(super) fn tree(&self, mut primitives: Vec<Primitive>, quality: BvhQuality) -> Arc<Tree> {
        // Building reorders them: only what is kept needs a copy.
        if !self.trees.keeps() {
            return Arc::new(Tree::build(&mut primitives, quality));
        }
        let is_key = |(its_primitives, its_quality): &(Vec<Primitive>, BvhQuality)| {
            *its_quality == quality && *its_primitives == primitives
        };
        let make = || Ok::<_, Infallible>(Tree::build(&mut primitives.clone(), quality));
        let Ok(tree) = self.trees.get(is_key, || (primitives.clone(), quality), make);
        tree
    }

    /// See [`mip_chain`].
    pub(super) fn chain(&self, image: &Arc<Image>, space: ColorSpace) -> Arc<Chain> {
        let is_key =
            |(its_image, its_space): &(Arc<Image>, ColorSpace)| Arc::ptr_eq(its_image, image) && *its_space == space;
        let make = || Ok::<_, Infallible>(mip_chain(image, space));
        let Ok(chain) = self.chains.get(is_key, || (Arc::clone(image), space), make);
        chain
    }

    /// See [`environment::prepare`].
    ///
    /// # Errors
    /// Likewise.
    pub(super) fn environment(
        &self,
        environment: &Environment,
        sampling: EnvironmentSampling,
    ) -> Result<Arc<PreparedEnvironment>, PrepareError> {
        let make = || environment::prepare(environment, sampling);
        if !matches!(environment, Environment::Image { .. }) {
            return make().map(Arc::new);
        }
        let is_key = |(its_environment, its_sampling): &(Environment, EnvironmentSampling)| {
            *its_sampling == sampling && is_same(its_environment, environment)
        };
        self.environments.get(is_key, || (environment.clone(), sampling), make)
    }
}

/// Whether both are the same image, placed alike.
fn is_same(a: &Environment, b: &Environment) -> bool {
    type Factors = (u32, u64);
    let parts = |environment: &Environment| -> Option<(*const Vec<[f32; 3]>, u32, u32, Factors)> {
        let Environment::Image { width, height, texels, strength, rotation_radians, .. } = environment else {
            return None;
        };
        Some((Arc::as_ptr(texels), *width, *height, (strength.to_bits(), rotation_radians.to_bits())))
    };
    parts(a).is_some() && parts(a) == parts(b)
}
