//! Messages between the server and its worker: two lengths (little-endian u32), then JSON, then bytes that need none.

use std::io::{self, Read, Write};

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Longer parts are a sign of a broken stream: 1 GiB.
const LONGEST: u32 = 1 << 30;

/// Writes one message and flushes it.
///
/// # Errors
/// When the other side is gone.
pub fn write_message(to: &mut impl Write, message: &impl Serialize, bytes: &[u8]) -> io::Result<()> {
    let json = serde_json::to_vec(message)?;
    let length = |part: &[u8]| u32::try_from(part.len()).map_err(io::Error::other);
    to.write_all(&length(&json)?.to_le_bytes())?;
    to.write_all(&length(bytes)?.to_le_bytes())?;
    to.write_all(&json)?;
    to.write_all(bytes)?;
    to.flush()
}

/// Reads one message.
///
/// # Errors
/// [`io::ErrorKind::UnexpectedEof`] when the other side is gone, [`io::ErrorKind::InvalidData`] for what is no message.
pub fn read_message<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<(T, Vec<u8>)> {
    let mut lengths = [[0; 4]; 2];
    from.read_exact(&mut lengths[0])?;
    from.read_exact(&mut lengths[1])?;
    let [json, bytes] = lengths.map(u32::from_le_bytes);
    if json.max(bytes) > LONGEST {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "a message longer than 1 GiB"));
    }
    let mut part = |length: u32| {
        let mut part = vec![0; length as usize];
        from.read_exact(&mut part).map(|()| part)
    };
    let (json, bytes) = (part(json)?, part(bytes)?);
    Ok((serde_json::from_slice(&json)?, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_back_as_they_went() {
        let mut stream = Vec::new();
        write_message(&mut stream, &("a", 1), b"xyz").unwrap();
        write_message(&mut stream, &("b", 2), b"").unwrap();
        let mut from = stream.as_slice();
        assert_eq!(read_message::<(String, u32)>(&mut from).unwrap(), (("a".to_owned(), 1), b"xyz".to_vec()));
        assert_eq!(read_message::<(String, u32)>(&mut from).unwrap(), (("b".to_owned(), 2), Vec::new()));
        assert_eq!(read_message::<(String, u32)>(&mut from).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn a_broken_stream_is_an_error_and_no_allocation() {
        let noise = [0xff; 64];
        assert_eq!(read_message::<u32>(&mut noise.as_slice()).unwrap_err().kind(), io::ErrorKind::InvalidData);
    }
}
