//! What an image file says about itself: the EXR attributes, as plain data, and the camera matrices among them.

use std::collections::BTreeMap;
use std::ops::Range;

use exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::Vec2;
use glam::{DAffine3, DMat4, DVec3, DVec4};

/// Attributes of an image. Any may be missing, since a file may come from another program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// `samplesPerPixel` (float): samples of an average pixel.
    pub samples_per_pixel: Option<f32>,
    /// `seed` (int; values from 2³¹ on appear negative in other programs).
    pub seed: Option<u32>,
    /// `sampleRanges` (string, `0..64` or `0..16,32..48`): the sample indices that the image is the mean of.
    pub sample_ranges: Vec<Range<u32>>,
    /// `renderTime` (float): seconds.
    pub render_time_seconds: Option<f32>,
    /// `worldToCamera` (m44f), see [`world_to_camera`].
    pub world_to_camera: Option<[f32; 16]>,
    /// `worldToNDC` (m44f), see [`world_to_ndc_perspective`].
    pub world_to_ndc: Option<[f32; 16]>,
    /// `chromaticities`: CIE xy of red, green, blue and white. Missing means Rec.709, says OpenEXR.
    pub chromaticities: Option<[[f32; 2]; 4]>,
    /// `software` (string): `sunfleck VERSION`.
    pub software: Option<String>,
    /// `kernelKey` (string): what the kernel was built with; equal keys compute equal bits on one device.
    pub kernel_key: Option<String>,
    /// `scene` (string).
    pub scene: Option<String>,
    /// `integrator` (string).
    pub integrator: Option<String>,
    /// `sampler` (string): how its samples were drawn.
    pub sampler: Option<String>,
    /// `clampIndirect` (float): the bound of an image whose indirect light was cut off; a biased one.
    pub clamp_indirect: Option<f32>,
    /// `estimatedError` (float): relative, see [`super::replicates::ErrorEstimate`].
    pub estimated_error: Option<f32>,
    /// `estimatedErrorInterval` (v2f): its bounds.
    pub estimated_error_interval: Option<[f32; 2]>,
    /// `device` (string): device and driver.
    pub device: Option<String>,
    /// All other string attributes, by name.
    pub other: BTreeMap<String, String>,
}

/// CIE 1931 xy of the Rec.709 primaries and of D65, the white point (ITU-R BT.709).
pub const REC709_CHROMATICITIES: [[f32; 2]; 4] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

/// `sunfleck VERSION`, as images name the program that made them.
pub fn software() -> String {
    format!("sunfleck {}", env!("CARGO_PKG_VERSION"))
}

/// The `worldToCamera` attribute for a camera that looks down its −Z with +Y up.
///
/// OpenEXR's camera space is RenderMan's: left-handed, looking down +Z; so z is flipped. Its matrices multiply row
/// vectors from the right, so what is stored row by row is our matrix column by column.
pub fn world_to_camera(camera_to_world: DAffine3) -> [f32; 16] {
    (flip_z() * DMat4::from(camera_to_world.inverse())).as_mat4().to_cols_array()
}

/// The `worldToNDC` attribute of a perspective camera: (0, 0) is the image's upper left, (1, 1) its lower right, z is
/// between 0 at `near` and 1 at infinity. `aspect` is width / height.
pub fn world_to_ndc_perspective(camera_to_world: DAffine3, yfov_radians: f64, aspect: f64) -> [f32; 16] {
    let scale_y = 1.0 / (0.5 * yfov_radians).tan();
    // Depth has no meaning for the image; a near plane of 1 mm at z = 0 and infinity at z = 1 keep the matrix regular.
    let near = 1e-3;
    let projection = DMat4::from_cols(
        DVec4::new(scale_y / aspect, 0.0, 0.0, 0.0),
        DVec4::new(0.0, scale_y, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 1.0, 1.0),
        DVec4::new(0.0, 0.0, -near, 0.0),
    );
    to_ndc(projection, camera_to_world)
}

/// The `worldToNDC` attribute of an orthographic camera of half height `ymag`; z is the distance in metres.
pub fn world_to_ndc_orthographic(camera_to_world: DAffine3, ymag: f64, aspect: f64) -> [f32; 16] {
    to_ndc(DMat4::from_scale(DVec3::new(1.0 / (ymag * aspect), 1.0 / ymag, 1.0)), camera_to_world)
}

fn flip_z() -> DMat4 {
    DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0))
}

/// Puts a projection to [−1, 1]², y upwards, behind the camera transform, and its result into [0, 1]², y downwards.
fn to_ndc(projection: DMat4, camera_to_world: DAffine3) -> [f32; 16] {
    let screen_to_ndc =
        DMat4::from_translation(DVec3::new(0.5, 0.5, 0.0)) * DMat4::from_scale(DVec3::new(0.5, -0.5, 1.0));
    (screen_to_ndc * projection * flip_z() * DMat4::from(camera_to_world.inverse())).as_mat4().to_cols_array()
}

impl Metadata {
    /// Puts the attributes where the `exr` crate wants each of them.
    pub(super) fn store(&self, image: &mut ImageAttributes, layer: &mut LayerAttributes) {
        image.chromaticities = self.chromaticities.map(|[r, g, b, w]| {
            let point = |[x, y]: [f32; 2]| Vec2(x, y);
            Chromaticities { red: point(r), green: point(g), blue: point(b), white: point(w) }
        });
        layer.world_to_camera = self.world_to_camera;
        layer.world_to_normalized_device = self.world_to_ndc;
        layer.software_name = self.software.as_deref().map(text);
        let mut put = |name: &str, value: Option<AttributeValue>| {
            if let Some(value) = value {
                layer.other.insert(text(name), value);
            }
        };
        put("samplesPerPixel", self.samples_per_pixel.map(AttributeValue::F32));
        put("seed", self.seed.map(|s| AttributeValue::I32(s.cast_signed())));
        put("renderTime", self.render_time_seconds.map(AttributeValue::F32));
        put("clampIndirect", self.clamp_indirect.map(AttributeValue::F32));
        put("estimatedError", self.estimated_error.map(AttributeValue::F32));
        let interval = self.estimated_error_interval.map(|[low, high]| AttributeValue::FloatVec2(Vec2(low, high)));
        put("estimatedErrorInterval", interval);
        let ranges = (!self.sample_ranges.is_empty()).then(|| format_ranges(&self.sample_ranges));
        let strings = [
            ("sampleRanges", ranges.as_ref()),
            ("kernelKey", self.kernel_key.as_ref()),
            ("scene", self.scene.as_ref()),
            ("integrator", self.integrator.as_ref()),
            ("sampler", self.sampler.as_ref()),
            ("device", self.device.as_ref()),
        ];
        let others = self.other.iter().map(|(name, value)| (name.as_str(), Some(value)));
        for (name, value) in strings.into_iter().chain(others) {
            put(name, value.map(|v| AttributeValue::Text(text(v))));
        }
    }

    /// Collects the attributes that this program knows, and the strings among the rest.
    pub(super) fn load(image: &ImageAttributes, layer: &LayerAttributes) -> Self {
        let mut metadata = Self {
            chromaticities: image.chromaticities.map(|c| [c.red, c.green, c.blue, c.white].map(|v| [v.0, v.1])),
            world_to_camera: layer.world_to_camera,
            world_to_ndc: layer.world_to_normalized_device,
            software: layer.software_name.as_ref().map(string),
            ..Self::default()
        };
        for (name, value) in image.other.iter().chain(&layer.other) {
            match (string(name).as_str(), value) {
                ("samplesPerPixel", AttributeValue::F32(v)) => metadata.samples_per_pixel = Some(*v),
                ("samplesPerPixel", AttributeValue::I32(v)) => metadata.samples_per_pixel = Some(*v as f32),
                ("seed", AttributeValue::I32(v)) => metadata.seed = Some(v.cast_unsigned()),
                ("renderTime", AttributeValue::F32(v)) => metadata.render_time_seconds = Some(*v),
                ("clampIndirect", AttributeValue::F32(v)) => metadata.clamp_indirect = Some(*v),
                ("estimatedError", AttributeValue::F32(v)) => metadata.estimated_error = Some(*v),
                ("estimatedErrorInterval", AttributeValue::FloatVec2(v)) => {
                    metadata.estimated_error_interval = Some([v.0, v.1]);
                }
                ("sampleRanges", AttributeValue::Text(v)) => metadata.sample_ranges = parse_ranges(&string(v)),
                ("kernelKey", AttributeValue::Text(v)) => metadata.kernel_key = Some(string(v)),
                ("scene", AttributeValue::Text(v)) => metadata.scene = Some(string(v)),
                ("integrator", AttributeValue::Text(v)) => metadata.integrator = Some(string(v)),
                ("sampler", AttributeValue::Text(v)) => metadata.sampler = Some(string(v)),
                ("device", AttributeValue::Text(v)) => metadata.device = Some(string(v)),
                (other, AttributeValue::Text(v)) => drop(metadata.other.insert(other.to_owned(), string(v))),
                _ => {}
            }
        }
        metadata
    }
}

/// EXR strings are bytes; they are written as UTF-8, which is what today's programs expect.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

fn string(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

/// `0..16,32..48`.
pub fn format_ranges(ranges: &[Range<u32>]) -> String {
    ranges.iter().map(|r| format!("{}..{}", r.start, r.end)).collect::<Vec<_>>().join(",")
}

/// The inverse of [`format_ranges`]. A file of another program may hold anything: what is no range is left out.
fn parse_ranges(text: &str) -> Vec<Range<u32>> {
    let range = |part: &str| {
        let (start, end) = part.split_once("..")?;
        Some(start.trim().parse().ok()?..end.trim().parse().ok()?)
    };
    text.split(',').filter_map(range).collect()
}
