//! The driver's pipeline cache, kept on disk: one file for each device and build of its driver, which in it finds pipelines
//! by their shaders (Vulkan 1.3, section 10.7). Mesa's lavapipe has nothing to keep there; it has a cache of its own.
//!
//! The data goes back to the driver only if it is whole: a driver need not survive damaged data. Whatever goes wrong with
//! the file costs time and nothing else, so it is logged and forgotten.

use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use ash::vk;

use super::cache_folder::{cache_folder, write_parts};
use super::{GpuError, GpuResult};

/// What a file begins with: the format and its version, then the length and the hash of the data, 8 bytes each.
const MAGIC: &[u8; 8] = b"SFPIPE01";
const HEADER_BYTES: usize = 24;
/// Above this a file is begun anew: shaders that were edited a thousand times are no longer wanted.
const MOST_BYTES: usize = 64 << 20;
/// Data with no pipeline in it is the header of `VkPipelineCacheHeaderVersionOne` alone.
const EMPTY_BYTES: usize = 32;

/// A device's pipeline cache and the file behind it.
pub(super) struct PipelineCache {
    raw: vk::PipelineCache,
    path: Option<PathBuf>,
    /// Bytes of the data that the file has.
    stored: Mutex<usize>,
}

impl PipelineCache {
    /// The cache of the device with this [`super::DeviceInfo::identity`], with what the file holds.
    ///
    /// # Errors
    /// When the driver cannot make a cache.
    pub(super) fn new(device: &ash::Device, identity: &str) -> GpuResult<Self> {
        let path = cache_folder().map(|folder| folder.join("pipelines").join(format!("{identity}.bin")));
        let data = path.as_deref().map_or_else(Vec::new, |path| {
            read(path).unwrap_or_else(|error| {
                tracing::debug!("{}: {error}; the pipeline cache is begun anew", path.display());
                Vec::new()
            })
        });
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the device is alive and the data outlives the call; it came from this driver, or is empty.
        let raw = unsafe { device.create_pipeline_cache(&info, None) }
            .map_err(GpuError::call("vkCreatePipelineCache", "the device"))?;
        Ok(Self { raw, path, stored: Mutex::new(data.len()) })
    }

    pub(super) fn raw(&self) -> vk::PipelineCache {
        self.raw
    }

    /// Writes the file if the driver has more than it holds.
    pub(super) fn store(&self, device: &ash::Device) {
        let Some(path) = &self.path else { return };
        let mut stored = self.stored.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        // SAFETY: device and cache are alive.
        let data = match unsafe { device.get_pipeline_cache_data(self.raw) } {
            Ok(data) if data.len() > EMPTY_BYTES && data.len() != *stored => data,
            _ => return,
        };
        match write(path, &data) {
            Ok(()) => *stored = data.len(),
            Err(error) => tracing::debug!("{}: {error}; the pipeline cache is not kept", path.display()),
        }
    }

    pub(super) fn destroy(&self, device: &ash::Device) {
        // SAFETY: the device is alive, and no pipeline is being made.
        unsafe { device.destroy_pipeline_cache(self.raw, None) };
    }
}

fn hash(data: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(data);
    hasher.finish()
}

/// The data of a file that is whole; nothing if there is no file.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    let bytes = match fs::read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        result => result?,
    };
    let damaged = || io::Error::new(io::ErrorKind::InvalidData, "damaged");
    let (header, data) = bytes.split_at_checked(HEADER_BYTES).ok_or_else(damaged)?;
    let expected = [&MAGIC[..], &(data.len() as u64).to_le_bytes(), &hash(data).to_le_bytes()].concat();
    if header == expected && data.len() <= MOST_BYTES { Ok(data.to_vec()) } else { Err(damaged()) }
}

fn write(path: &Path, data: &[u8]) -> io::Result<()> {
    write_parts(path, &[MAGIC, &(data.len() as u64).to_le_bytes(), &hash(data).to_le_bytes(), data])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipelines/device.bin");
        assert_eq!(read(&path).unwrap(), [0u8; 0], "no file is no error");
        for data in [&b"first"[..], b"a longer second one"] {
            write(&path, data).unwrap();
            assert_eq!(read(&path).unwrap(), data);
        }
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn damaged_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("device.bin");
        write(&path, b"pipelines").unwrap();
        let whole = fs::read(&path).unwrap();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).is_err(), "cut to {length} bytes");
        }
        for index in 0..whole.len() {
            let mut changed = whole.clone();
            changed[index] ^= 1;
            fs::write(&path, &changed).unwrap();
            assert!(read(&path).is_err(), "byte {index} changed");
        }
        fs::write(&path, [&whole[..], b"more"].concat()).unwrap();
        assert!(read(&path).is_err(), "with more at its end");
    }
}
