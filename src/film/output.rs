//! Output images: which format a name asks for.

use std::path::Path;

use crate::{Error, Result};

/// A format that an image can be written in, chosen by the file name's extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// OpenEXR: linear 32-bit float radiance with all channels and attributes.
    Exr,
    /// PNG: tone-mapped 8-bit sRGB.
    Png,
}

impl ImageFormat {
    /// The format that a file name asks for.
    ///
    /// # Errors
    /// [`Error::Usage`] if the extension is neither `.exr` nor `.png`.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(Error::Usage(format!(
                "output '{}': its extension names no image format; use .exr (linear radiance) or .png (tone-mapped sRGB)",
                path.display()
            ))),
        }
    }
}
