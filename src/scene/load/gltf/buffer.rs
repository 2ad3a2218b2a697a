//! Buffers and buffer views: bytes from files, data URIs and the binary chunk of a .glb, read when first needed.

use std::collections::HashMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;

use super::json::Json;
use crate::scene::SceneResult;
use crate::scene::load::file;

/// The buffers that were needed so far.
pub(super) struct Buffers {
    binary_chunk: Option<Arc<Vec<u8>>>,
    loaded: HashMap<usize, Arc<Vec<u8>>>,
}

/// A range of a buffer.
#[derive(Clone)]
pub(super) struct View {
    buffer: Arc<Vec<u8>>,
    range: Range<usize>,
    /// Distance of elements in bytes, if the view defines it.
    pub(super) stride: Option<usize>,
}

impl View {
    /// The bytes of the range.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.buffer[self.range.clone()]
    }
}

impl Buffers {
    /// No buffer is loaded yet; buffer 0 of a .glb is its binary chunk.
    pub(super) fn new(binary_chunk: Option<Vec<u8>>) -> Self {
        Self { binary_chunk: binary_chunk.map(Arc::new), loaded: HashMap::new() }
    }

    /// The buffer view at that place.
    pub(super) fn view(&mut self, view: &Json<'_>) -> SceneResult<View> {
        let (index, buffer) = view.require("buffer")?.refer("buffers")?;
        let bytes = self.buffer(index, &buffer)?;
        let offset = view.unsigned_or("byteOffset", 0)?;
        let length = view.require("byteLength")?.unsigned()?;
        let end = offset.checked_add(length).filter(|&end| end <= bytes.len()).ok_or_else(|| {
            let message =
                format!("the view's bytes {offset}+{length} lie outside of buffer {index} of {} bytes", bytes.len());
            view.fail(message).hint("the file is damaged: export it again")
        })?;
        let stride = view.get("byteStride")?.map(|stride| stride.unsigned()).transpose()?;
        Ok(View { buffer: bytes, range: offset..end, stride })
    }

    fn buffer(&mut self, index: usize, buffer: &Json<'_>) -> SceneResult<Arc<Vec<u8>>> {
        if let Some(bytes) = self.loaded.get(&index) {
            return Ok(bytes.clone());
        }
        let length = buffer.require("byteLength")?.unsigned()?;
        let bytes = match (buffer.get("uri")?, &self.binary_chunk) {
            (Some(uri), _) => Arc::new(read_uri(&uri)?),
            (None, Some(chunk)) if index == 0 => chunk.clone(),
            (None, _) => {
                return Err(buffer.fail("the buffer has no \"uri\", and no binary chunk of a .glb stands for it"));
            }
        };
        if bytes.len() < length {
            let message = format!("the buffer should have {length} bytes, but only {} are there", bytes.len());
            return Err(buffer.fail(message).hint("the file is damaged: copy or export it again"));
        }
        self.loaded.insert(index, bytes.clone());
        Ok(bytes)
    }
}

/// The bytes that a URI names: a data URI, or a file beside the scene's.
pub(super) fn read_uri(uri: &Json<'_>) -> SceneResult<Vec<u8>> {
    match file_of_uri(uri)? {
        Some(path) => file::read(&path).map_err(|error| {
            let hint = format!("put the file there, beside {}", uri.document.path.display());
            uri.fail(format!("the file {}: {}", path.display(), error.message)).hint(hint)
        }),
        None => decode_data_uri(uri.string()?).map_err(|message| uri.fail(message)),
    }
}

/// The file that a URI names; `None` for a data URI.
pub(super) fn file_of_uri(uri: &Json<'_>) -> SceneResult<Option<PathBuf>> {
    let text = uri.string()?;
    if text.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        return Ok(None);
    }
    let shown: String = text.chars().take(80).collect();
    let fail = |message| uri.fail(format!("\"{shown}\": {message}")).hint("use a relative path or a data URI");
    file::resolve_uri(&uri.document.path, text).map(Some).map_err(fail)
}

/// Decodes `data:[type][;base64],bytes` (RFC 2397).
fn decode_data_uri(uri: &str) -> Result<Vec<u8>, String> {
    let (header, data) = uri.split_once(',').ok_or("the data URI has no comma")?;
    if !header.to_ascii_lowercase().ends_with(";base64") {
        return Ok(percent_decode_str(data).collect());
    }
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let data = percent_decode_str(data).collect::<Vec<u8>>();
    GeneralPurpose::new(&STANDARD, config).decode(data).map_err(|error| format!("the data URI is not base64: {error}"))
}

#[cfg(test)]
mod tests {
    use super::decode_data_uri;

    #[test]
    fn data_uris_are_decoded() {
        assert_eq!(decode_data_uri("data:application/octet-stream;base64,AQID").as_deref(), Ok(&[1, 2, 3][..]));
        assert_eq!(decode_data_uri("data:;base64,AQI").as_deref(), Ok(&[1, 2][..]));
        assert_eq!(decode_data_uri("data:,a%20b").as_deref(), Ok(&b"a b"[..]));
        assert!(decode_data_uri("data:;base64,A").is_err());
        assert!(decode_data_uri("data:;base64").is_err());
    }
}
