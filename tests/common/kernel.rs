//! Kernels of shaders/test/ with a scene, specialisation constants and macro definitions of the test's own choice.

use glam::{DAffine3, DVec3};
use sunfleck::gpu::TraceBackend;
use sunfleck::layout::RenderConstants;
use sunfleck::prepare::Prepared;
use sunfleck::render::{Bake, FunctionCall, LightChoice, Settings};
use sunfleck::scene::{Camera, Projection, Scene, builtin};

use super::gpu;
pub use super::random::Random;

/// A kernel, ready to be called.
pub struct TestKernel {
    file: String,
    /// The scene that is bound; a test may replace what is in it.
    pub prepared: Prepared,
    /// Its constants.
    pub constants: RenderConstants,
    /// The back end; only kernels that trace need the one under test.
    pub trace: TraceBackend,
    /// What is compiled in of the scene: nothing, unless a test adds it.
    pub bake: Bake,
    specialization: Vec<(u32, u32)>,
    defines: Vec<(&'static str, String)>,
}

impl TestKernel {
    /// `shaders/test/<file>` with a scene that does not matter.
    pub fn new(file: &str) -> Self {
        Self::with_scene(file, &builtin::builtin("cornell").expect("built in"))
    }

    /// `shaders/test/<file>` with a scene, whose first camera decides where the rebased space has its zero.
    pub fn with_scene(file: &str, scene: &Scene) -> Self {
        Self::with_choice(file, scene, LightChoice::default())
    }

    /// The same, lights being picked as is said.
    pub fn with_choice(file: &str, scene: &Scene, light_choice: LightChoice) -> Self {
        Self::with_settings(file, scene, &Settings { light_choice, ..gpu::settings(64, 64) })
    }

    /// The same, the scene being prepared for other settings.
    pub fn with_settings(file: &str, scene: &Scene, settings: &Settings) -> Self {
        let (prepared, constants) = gpu::prepared(scene, settings);
        let by_bvh = prepared.features.light_choice == LightChoice::Bvh;
        Self {
            file: format!("test/{file}"),
            prepared,
            constants,
            trace: TraceBackend::Bvh,
            bake: Bake::default(),
            specialization: vec![(11, by_bvh.into())],
            defines: Vec::new(),
        }
    }

    /// Sets a specialisation constant of shaders/include/features.glsl.
    #[must_use]
    pub fn specialize(mut self, id: u32, value: u32) -> Self {
        self.specialization.push((id, value));
        self
    }

    /// Defines a macro.
    #[must_use]
    pub fn define(mut self, name: &'static str, value: impl ToString) -> Self {
        self.defines.push((name, value.to_string()));
        self
    }

    /// Runs `lanes` lanes; every lane gives `outputs_per_lane` texels.
    pub fn run(&self, inputs: &[[u32; 4]], lanes: usize, outputs_per_lane: u32) -> Vec<[u32; 4]> {
        let call = FunctionCall {
            sources: gpu::sources(),
            file: &self.file,
            trace: self.trace,
            prepared: &self.prepared,
            constants: self.constants,
            specialization: &self.specialization,
            bake: &self.bake,
            defines: &self.defines,
        };
        let lanes = u32::try_from(lanes).expect("fewer lanes");
        let outputs = call.run(&gpu::device().gpu, inputs, lanes, outputs_per_lane).expect("the kernel runs");
        gpu::assert_no_validation_messages();
        outputs
    }
}

/// A scene of nothing but a camera.
pub fn empty_scene() -> Scene {
    Scene { name: String::from("test"), cameras: vec![camera()], ..Scene::default() }
}

/// A camera at the origin, for scenes whose picture does not matter.
pub fn camera() -> Camera {
    Camera {
        name: String::from("camera"),
        camera_to_world: DAffine3::IDENTITY,
        projection: Projection::Perspective { yfov_radians: 1.0 },
        lens_radius: 0.0,
        focus_distance: 1.0,
    }
}

/// The floats of a texel.
pub fn floats(texel: [u32; 4]) -> [f32; 4] {
    texel.map(f32::from_bits)
}

/// The first three floats of a texel.
pub fn vector(texel: [u32; 4]) -> DVec3 {
    let [x, y, z, _] = floats(texel);
    DVec3::new(x.into(), y.into(), z.into())
}

/// A texel of floats.
pub fn texel(x: f32, y: f32, z: f32, w: f32) -> [u32; 4] {
    [x, y, z, w].map(f32::to_bits)
}

/// A texel of a vector and a word.
pub fn vector_texel(v: DVec3, word: u32) -> [u32; 4] {
    [(v.x as f32).to_bits(), (v.y as f32).to_bits(), (v.z as f32).to_bits(), word]
}
