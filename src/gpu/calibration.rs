//! What `sunfleck devices --calibrate` measured on a device: one file for each device, driver build and version of Sunfleck.
//! Nothing is measured unless it is asked for, so nothing timed decides which kernel runs unless the user has let it.

use std::fs;
use std::io;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::cache_folder::{cache_folder, write_parts};
use super::{ArrayForm, DeviceInfo, TraceBackend};

/// Repeated measurements of one variant differ by a few percent, on a machine that does other things too.
const CLEARLY: f64 = 1.05;

/// How fast one variant of the kernel was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibratedVariant {
    /// How rays were traced.
    pub trace: TraceBackend,
    /// How the scene's arrays were read.
    pub array_form: ArrayForm,
    /// Paths a second, a scene each.
    pub paths_per_second: Vec<f64>,
    /// Seconds that compiling took, a scene each.
    pub compile_seconds: Vec<f64>,
}

impl CalibratedVariant {
    /// The geometric mean over the scenes.
    pub fn mean_paths_per_second(&self) -> f64 {
        let logarithms: f64 = self.paths_per_second.iter().map(|rate| rate.ln()).sum();
        (logarithms / self.paths_per_second.len() as f64).exp()
    }
}

/// The measurements on one device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The version of Sunfleck that measured; another one's kernels may differ.
    version: String,
    /// The scenes that were traced.
    pub scenes: Vec<String>,
    /// Every variant that the device can run; what is taken unmeasured comes first.
    pub variants: Vec<CalibratedVariant>,
}

impl Calibration {
    /// Measurements of this version.
    pub fn new(scenes: Vec<String>, variants: Vec<CalibratedVariant>) -> Self {
        Self { version: env!("CARGO_PKG_VERSION").to_owned(), scenes, variants }
    }

    /// The fastest variant, if it is faster than the first by more than such measurements wander.
    pub fn best(&self) -> Option<&CalibratedVariant> {
        let first = self.variants.first()?;
        let better = |v: &&CalibratedVariant| v.mean_paths_per_second() > CLEARLY * first.mean_paths_per_second();
        let fastest = |a: &&CalibratedVariant, b: &&CalibratedVariant| {
            a.mean_paths_per_second().total_cmp(&b.mean_paths_per_second())
        };
        self.variants.iter().filter(better).max_by(fastest).or(Some(first))
    }

    /// What was stored for the device with this [`DeviceInfo::identity`] by this version.
    pub(super) fn load(identity: &str) -> Option<Self> {
        let text = fs::read(path(identity)?).ok()?;
        let read: Self = serde_json::from_slice(&text).ok()?;
        (read.version == env!("CARGO_PKG_VERSION") && read.best().is_some()).then_some(read)
    }

    /// Stores it for the device; returns where.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn store(&self, info: &DeviceInfo) -> io::Result<PathBuf> {
        let path = path(&info.identity).ok_or_else(|| io::Error::other("there is no folder for caches"))?;
        write_parts(&path, &[&serde_json::to_vec_pretty(self)?])?;
        Ok(path)
    }
}

/// Forgets what was measured on the device; whether there was anything.
///
/// # Errors
/// When the file cannot be removed.
pub fn forget_calibration(info: &DeviceInfo) -> io::Result<bool> {
    match path(&info.identity).map(fs::remove_file) {
        None => Ok(false),
        Some(Err(error)) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Some(result) => result.map(|()| true),
    }
}

fn path(identity: &str) -> Option<PathBuf> {
    cache_folder().map(|folder| folder.join("calibration").join(format!("{identity}.json")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variant(array_form: ArrayForm, paths_per_second: [f64; 2]) -> CalibratedVariant {
        let paths_per_second = paths_per_second.to_vec();
        CalibratedVariant { trace: TraceBackend::Bvh, array_form, paths_per_second, compile_seconds: vec![0.1; 2] }
    }

    #[test]
    fn the_best_has_the_highest_geometric_mean() {
        let variants = vec![variant(ArrayForm::TexelBuffer, [1.0, 9.0]), variant(ArrayForm::StorageBuffer, [4.0, 4.0])];
        let calibration = Calibration::new(vec!["a".into(), "b".into()], variants);
        assert_eq!(calibration.best().unwrap().array_form, ArrayForm::StorageBuffer);
        assert!((calibration.variants[0].mean_paths_per_second() - 3.0).abs() < 1e-12);
        let close = vec![calibration.variants[1].clone(), variant(ArrayForm::DeviceAddress, [4.1, 4.1])];
        let close = Calibration::new(vec!["a".into(), "b".into()], close);
        assert_eq!(close.best().unwrap().array_form, ArrayForm::StorageBuffer, "not clearly faster");
        let text = serde_json::to_string(&calibration).unwrap();
        assert!(text.contains("\"texel-buffer\"") && text.contains("\"bvh\""), "the names that people see: {text}");
        assert_eq!(serde_json::from_str::<Calibration>(&text).unwrap(), calibration);
    }
}
