//! What the server, its worker and the page say to each other.

use serde::{Deserialize, Serialize};

pub use super::estimator::Estimator;

/// What is to be seen: the whole of it every time, so that a new worker needs no history.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct View {
    /// Index of the scene's camera.
    pub camera: usize,
    /// Where the camera has been moved to; `None` is where the scene has it.
    pub pose: Option<Pose>,
    /// The camera is being moved: fewer pixels, more images.
    pub moving: bool,
    /// What decides which code runs.
    #[serde(flatten)]
    pub estimator: Estimator,
    /// Exposure in steps: +1 doubles the brightness.
    pub exposure: f32,
    /// Name of a [`crate::film::tonemap::ToneMap`].
    pub tonemap: String,
    /// The picture is what shaders give to DEBUG_PIXEL, if any does.
    pub debug: bool,
    /// Name of the [`crate::film::aov::Aov`] that is the picture; of any other name it is the light.
    pub shown: String,
    /// Rays and their searches are counted.
    pub statistics: bool,
    /// The pixel (column, row) whose DEBUG_PRINT values are shown; `None` is the one in the middle.
    pub pixel: Option<[u32; 2]>,
}

/// A camera by what it looks at. World space, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The camera's place.
    pub eye: [f64; 3],
    /// What it looks at, and turns around.
    pub target: [f64; 3],
    /// What is up in the image.
    pub up: [f64; 3],
}

/// From the server to the worker.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum ToWorker {
    /// Show this.
    View(Box<View>),
    /// Render with the SPIR-V that follows.
    Kernel {
        /// Number of the edit that it comes from.
        edit: u32,
        /// It was compiled with DEBUG_PRINTS.
        prints: bool,
    },
    /// An edit is about to be compiled: leave the processor to it, unless the picture moves or is not there yet.
    Hold,
    /// Nothing came of it.
    Resume,
    /// Load the scene again.
    Scene {
        /// Number of the edit.
        edit: u32,
    },
    /// Answer with [`FromWorker::Pixel`].
    Inspect {
        /// The client that asks.
        client: u64,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// Answer with [`FromWorker::Saved`].
    Save {
        /// The client that asks.
        client: u64,
        /// `png` or `exr`.
        format: String,
    },
}

/// A camera of the scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CameraEntry {
    /// Its name; may be empty.
    pub name: String,
    /// Where it is.
    pub pose: Pose,
}

/// What the worker renders, and on what.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ready {
    /// Name of the scene.
    pub scene: String,
    /// Device, its driver and why.
    pub device: String,
    /// Macro values of the kernel's variant: trace back end and array form.
    pub variant: [u32; 2],
    /// The scene's cameras.
    pub cameras: Vec<CameraEntry>,
    /// What the loader could not honour.
    pub warnings: Vec<String>,
    /// Width and height of the whole image.
    pub resolution: [u32; 2],
    /// Names of the AOVs that the device can give.
    pub aovs: Vec<String>,
    /// The key of the kernel that renders.
    pub kernel: String,
}

/// What an image is like; the PNG follows.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Frame {
    /// Number of the edit whose kernel and scene it shows.
    pub edit: u32,
    /// Counts what makes rendering start anew.
    pub start: u32,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples per pixel.
    pub spp: u32,
    /// Seconds of rendering.
    pub seconds: f64,
    /// Rays so far.
    pub rays: u64,
    /// Relative error, an upper bound with the Sobol' sampler.
    pub error: Option<f64>,
    /// Samples that were NaN or infinite.
    pub non_finite: u64,
    /// The last one: all samples are done.
    pub done: bool,
    /// It was rendered while the camera moves.
    pub moving: bool,
    /// The AOV that the picture shows; `None` is the light.
    pub shown: Option<String>,
    /// What the colours of an AOV span.
    pub scale: Option<String>,
    /// What was counted, a [`crate::render::StatisticsReport`].
    pub statistics: Option<serde_json::Value>,
}

/// From the worker to the server.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum FromWorker {
    /// The scene is on the device.
    Ready(Ready),
    /// The kernel of an edit is being built, while the old one goes on. It hangs if nothing follows.
    Building {
        /// Number of the edit.
        edit: u32,
    },
    /// The kernel of an edit is built, and used from now on.
    Built {
        /// Number of the edit.
        edit: u32,
        /// Seconds that the driver and the scene's specialisation took; `None`: the kernel is the same.
        seconds: Option<f64>,
        /// The kernel's key.
        kernel: String,
        /// Of a scene that was loaded again: what was made anew, and what kept.
        reused: Option<String>,
    },
    /// An edit cannot be shown.
    Failed {
        /// Number of the edit.
        edit: u32,
        /// Why.
        message: String,
    },
    /// An image.
    Frame(Frame),
    /// What it does, each time that changes and while it renders: a worker that renders and is not heard of any more hangs.
    Stage(Stage),
    /// A pixel under the cursor.
    Pixel {
        /// The client that asked.
        client: u64,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Mean radiance.
        radiance: [f64; 3],
        /// Samples.
        samples: u32,
        /// Variance of the mean luminance, from independent samples.
        variance: Option<f64>,
        /// What is seen there.
        seen: Option<Seen>,
        /// Name and mean of each AOV that is summed.
        aovs: Vec<(String, Vec<f64>)>,
    },
    /// What the kernel prints for the first sample of a pixel.
    Prints {
        /// Number of the edit.
        edit: u32,
        /// Column and row.
        pixel: [u32; 2],
        /// The number of the line that prints, and the value.
        values: Vec<(u32, String)>,
    },
    /// An image file follows.
    Saved {
        /// The client that asked.
        client: u64,
        /// `png` or `exr`.
        format: String,
    },
}

/// The nearest surface behind the middle of a pixel, through a pinhole and as if nothing were transparent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Name of the material, or its number.
    pub material: String,
    /// Name of its BSDF.
    pub bsdf: String,
    /// Name of the mesh, or its number.
    pub mesh: String,
    /// Name of the instance (the node), or its number.
    pub instance: String,
    /// Number of the primitive in its mesh.
    pub primitive: usize,
    /// Number of the triangle in its primitive.
    pub triangle: usize,
    /// From the camera, in metres.
    pub distance: f64,
    /// Whether its back is seen.
    pub is_back: bool,
}

/// What a worker is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stage {
    /// Reads and prepares the scene.
    Load,
    /// Renders.
    Render,
    /// Waits for something to do.
    Idle,
}

/// From the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum FromPage {
    /// Show this.
    View(Box<View>),
    /// A pixel.
    Inspect {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// The image as a file.
    Save {
        /// `png` or `exr`.
        format: String,
    },
}

impl Pose {
    /// Camera space to world space; `None` where eye, target and up make no frame.
    pub fn camera_to_world(&self) -> Option<glam::DAffine3> {
        let [eye, target, up] = [self.eye, self.target, self.up].map(glam::DVec3::from_array);
        let back = (eye - target).try_normalize()?;
        let right = up.cross(back).try_normalize()?;
        let matrix = glam::DMat3::from_cols(right, back.cross(right), back);
        let to_world = glam::DAffine3 { matrix3: matrix, translation: eye };
        to_world.is_finite().then_some(to_world)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_looks_at_its_target_with_up_upwards() {
        let pose = Pose { eye: [1.0, 2.0, 3.0], target: [1.0, 2.0, 0.0], up: [0.1, 5.0, 0.0] };
        let to_world = pose.camera_to_world().unwrap();
        assert_eq!(to_world.matrix3.z_axis.to_array(), [0.0, 0.0, 1.0]);
        assert!((to_world.matrix3.determinant() - 1.0).abs() < 1e-12);
        assert!(to_world.matrix3.y_axis.y > 0.99);
        let nowhere = Pose { target: pose.eye, ..pose };
        assert!(nowhere.camera_to_world().is_none());
        assert!(Pose { up: [0.0, 0.0, 1.0], ..pose }.camera_to_world().is_none());
        assert!(Pose { eye: [f64::NAN; 3], ..pose }.camera_to_world().is_none());
    }

    #[test]
    fn the_page_may_leave_out_what_it_does_not_change() {
        let message = r#"{"type":"view","camera":1,"pose":null}"#;
        let Ok(FromPage::View(view)) = serde_json::from_str(message) else { panic!("a view") };
        assert_eq!((view.camera, view.pose), (1, None));
        assert!(serde_json::from_str::<FromPage>(r#"{"type":"file","path":"/etc/passwd"}"#).is_err());
    }
}
