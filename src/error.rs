//! What can end the program early, and the exit code each kind of error has.

use std::io;
use std::path::{Path, PathBuf};

use crate::gpu::GpuError;
use crate::prepare::PrepareError;
use crate::scene::SceneError;

/// An error of the library. [`Error::exit_code`] is what the command line makes of it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The request itself is wrong: an unknown name, an impossible combination, something that is not built yet.
    #[error("{0}")]
    Usage(String),
    /// A scene file, or a file that it names, is bad.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Another input file (an image to compare or to merge) is bad.
    #[error("{}: {message}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// What is wrong with it and what to do.
        message: String,
    },
    /// A scene that is well formed but does not fit the renderer's limits.
    #[error("the scene cannot be prepared: {0}")]
    Prepare(#[from] PrepareError),
    /// The file system refused. An output that cannot be written is of this kind.
    #[error("{}: cannot {action}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried, as in "cannot …".
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// There is no usable device, or the one chosen lacks what was demanded.
    #[error("{0}")]
    Device(String),
    /// The device was lost during the work or ran out of memory.
    #[error("{0}")]
    DeviceLost(String),
    /// A result exists and must not be trusted (`--strict`), or a shader test's expectations are not met.
    #[error("{0}")]
    Untrustworthy(String),
    /// Stopped from outside, after what was there had been written.
    #[error("interrupted")]
    Interrupted,
}

impl From<GpuError> for Error {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::NoDriver(_) | GpuError::NoDevice(_) | GpuError::Lacks { .. } => Self::Device(error.to_string()),
            GpuError::OutOfMemory { .. } | GpuError::DeviceLost { .. } | GpuError::Vulkan { .. } => {
                Self::DeviceLost(error.to_string())
            }
            GpuError::Shader(_) => Self::Usage(error.to_string()),
        }
    }
}

/// Result of the library's fallible functions.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A [`Error::Io`] about `path`; `action` completes "cannot …".
    pub fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }

    /// A [`Error::Input`] about `path`.
    pub fn input(path: &Path, message: impl Into<String>) -> Self {
        Self::Input { path: path.to_owned(), message: message.into() }
    }

    /// The process exit code: 2 usage; 3 a bad scene or other input, also an output that cannot be written (the
    /// command was well formed, a file it names is not usable); 4 no usable device; 5 device lost or out of memory;
    /// 6 not trustworthy; 130 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Scene(_) | Self::Prepare(_) | Self::Input { .. } | Self::Io { .. } => 3,
            Self::Device(_) => 4,
            Self::DeviceLost(_) => 5,
            Self::Untrustworthy(_) => 6,
            Self::Interrupted => 130,
        }
    }
}
