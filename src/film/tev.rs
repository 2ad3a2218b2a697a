//! A connection to the viewer tev, by its protocol over TCP. [`super::tev_feed`] keeps it out of the way of a render.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::exr::{ChannelValues, ExrImage};

/// The port that tev listens on unless it is told otherwise.
pub const DEFAULT_PORT: u16 = 14158;
/// How long the viewer may take to connect, and to take each part of an image.
const PATIENCE: Duration = Duration::from_secs(2);

/// A connection to a running tev, with one image in it.
pub struct TevViewer {
    client: TevClient,
    /// The client's socket, to ask whether the viewer is still there.
    socket: TcpStream,
    name: String,
    /// Size and channels of the image that the viewer was told to make.
    made: Option<(u32, u32, Vec<String>)>,
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
        let socket = stream.try_clone()?;
        Ok(Self { client: TevClient::wrap(stream), socket, name: name.to_owned(), made: None })
    }

    /// Whether the connection still stands, as far as can be told without sending anything.
    ///
    /// # Errors
    /// If it does not.
    pub fn check(&self) -> io::Result<()> {
        self.socket.set_nonblocking(true)?;
        // The viewer never says anything: there is nothing to read, or the end.
        let peeked = self.socket.peek(&mut [0]);
        self.socket.set_nonblocking(false)?;
        match peeked {
            Ok(0) => Err(io::ErrorKind::ConnectionReset.into()),
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
            _ => Ok(()),
        }
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
        let wanted = (width, height, names.iter().map(|&name| name.to_owned()).collect());
        if self.made.as_ref() != Some(&wanted) {
            // Takes the place of an image of that name.
            let grab_focus = self.made.is_none();
            let packet = PacketCreateImage { image_name: &self.name, grab_focus, width, height, channel_names: &names };
            self.client.send(packet)?;
            self.made = Some(wanted);
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
        })
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
