//! The container of a .glb file: a header, a JSON chunk and an optional binary one.

use std::path::Path;

use crate::scene::{SceneError, SceneResult};

/// What a binary glTF file begins with.
pub(super) const MAGIC: &[u8] = b"glTF";

/// Splits a .glb into its JSON and its binary chunk.
pub(super) fn split<'a>(path: &Path, bytes: &'a [u8]) -> SceneResult<(&'a [u8], Option<&'a [u8]>)> {
    let damaged =
        |message: String| SceneError::file(path, message).hint("the file is damaged: copy or export it again");
    let word = |offset: usize| {
        let four = bytes.get(offset..)?.first_chunk::<4>()?;
        Some(u32::from_le_bytes(*four) as usize)
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(damaged(format!("the .glb is truncated: its header alone has 12 bytes, the file {}", bytes.len())));
    };
    if version != 2 {
        return Err(SceneError::file(path, format!("binary glTF of version {version} is not supported"))
            .hint("convert it to glTF 2.0"));
    }
    if length > bytes.len() {
        let message =
            format!("the .glb is truncated: it should have {length} bytes, but only {} are there", bytes.len());
        return Err(damaged(message));
    }
    let (mut json, mut binary) = (None, None);
    let mut offset = 12;
    while offset < length {
        let (Some(size), Some(kind)) = (word(offset), bytes.get(offset + 4..offset + 8)) else {
            return Err(damaged(format!("the .glb is truncated in the header of a chunk at byte {offset}")));
        };
        let Some(content) = bytes[..length].get(offset + 8..).and_then(|rest| rest.get(..size)) else {
            return Err(damaged(format!("the chunk of {size} bytes at byte {offset} goes beyond the end of the file")));
        };
        match (kind, json.is_some()) {
            (b"JSON", false) => json = Some(content),
            (_, false) => return Err(damaged(String::from("the first chunk of a .glb must be JSON"))),
            (b"BIN\0", true) if binary.is_none() => binary = Some(content),
            // Chunks of other kinds are for extensions, and to be skipped.
            _ => {}
        }
        offset += 8 + size;
    }
    let json = json.ok_or_else(|| damaged(String::from("the .glb has no JSON chunk")))?;
    Ok((json, binary))
}
