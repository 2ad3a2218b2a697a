//! Shows an image in the viewer tev while it is rendered, by tev's protocol over TCP.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::exr::{ChannelValues, ExrImage};

/// The port that tev listens on unless it is told otherwise.
pub const DEFAULT_PORT: u16 = 14158;
/// How long the viewer may take to connect, and to take each part of an image: it must not hold up the render.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two pictures.
const INTERVAL: Duration = Duration::from_millis(500);

/// A connection to a running tev, with one image in it.
pub struct TevViewer {
    client: TevClient,
    name: String,
    is_created: bool,
    shown: Option<Instant>,
}

impl TevViewer {
    /// Connects to the viewer at `HOST` or `HOST:PORT`; `name` is what the image is called there.
    ///
    /// # Errors
    /// If nobody listens there.
    pub fn connect(address: &str, name: &str) -> io::Result<Self> {
        let with_port = if has_port(address) { address.to_owned() } else { format!("{address}:{DEFAULT_PORT}") };
        let mut outcome = Err(io::Error::new(io::ErrorKind::NotFound, "the host has no address"));
        for socket in with_port.to_socket_addrs()? {
            outcome = TcpStream::connect_timeout(&socket, PATIENCE);
            if outcome.is_ok() {
                break;
            }
        }
        let stream = outcome?;
        stream.set_write_timeout(Some(PATIENCE))?;
        Ok(Self { client: TevClient::wrap(stream), name: name.to_owned(), is_created: false, shown: None })
    }

    /// Whether the last picture is long enough ago for another.
    pub fn is_due(&self) -> bool {
        self.shown.is_none_or(|shown| shown.elapsed() >= INTERVAL)
    }

    /// Shows the image's channels of floats: radiance, variance and AOVs by the names that they have in EXR files.
    ///
    /// # Errors
    /// If the viewer is gone or does not keep up.
    pub fn show(&mut self, image: &ExrImage) -> io::Result<()> {
        let channels: Vec<(&str, &Vec<f32>)> = image
            .channels
            .iter()
            .filter_map(|channel| match &channel.values {
                ChannelValues::F32(values) => Some((channel.name.as_str(), values)),
                ChannelValues::U32(_) => None,
            })
            .collect();
        let names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
        let (width, height) = (image.width, image.height);
        if !self.is_created {
            let packet =
                PacketCreateImage { image_name: &self.name, grab_focus: true, width, height, channel_names: &names };
            self.client.send(packet)?;
            self.is_created = true;
        }
        let pixels = u64::from(width) * u64::from(height);
        let offsets: Vec<u64> = (0..names.len() as u64).map(|index| index * pixels).collect();
        let data: Vec<f32> = channels.iter().flat_map(|(_, values)| values.iter().copied()).collect();
        self.client.send(PacketUpdateImage {
            image_name: &self.name,
            grab_focus: false,
            channel_names: &names,
            channel_offsets: &offsets,
            channel_strides: &vec![1; names.len()],
            x: 0,
            y: 0,
            width,
            height,
            data: &data,
        })?;
        self.shown = Some(Instant::now());
        Ok(())
    }
}

/// Whether the address ends with a port; an IPv6 address without brackets has colons of its own.
fn has_port(address: &str) -> bool {
    match address.rsplit_once(':') {
        Some((host, port)) => port.parse::<u16>().is_ok() && (!host.contains(':') || host.ends_with(']')),
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_told_from_addresses() {
        for with in ["localhost:14158", "10.0.0.1:1", "[::1]:80"] {
            assert!(has_port(with), "{with}");
        }
        for without in ["localhost", "10.0.0.1", "[::1]", "::1", "host:", "host:x"] {
            assert!(!has_port(without), "{without}");
        }
    }
}
