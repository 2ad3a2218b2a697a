//! Feeds the viewer tev from a thread of its own: a render hands over a copy of its film when the viewer has taken the one
//! before, and never waits.

use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::Film;
use super::aov::AovFilm;
use super::exr::ExrImage;
use super::metadata::Metadata;
use super::tev::TevViewer;

/// Time between two pictures.
const INTERVAL: Duration = Duration::from_millis(500);
/// Time between two looks whether the viewer is there.
const LOOK: Duration = Duration::from_secs(1);
/// How long a finished render waits for the viewer to take the last picture.
const LAST: Duration = Duration::from_secs(3);

/// What becomes of the viewer.
#[derive(Debug)]
pub enum TevNews {
    /// It shows the image.
    Connected,
    /// Nobody listens there; it is tried again.
    Missing(io::Error),
    /// It has gone away, or takes no part of an image for two seconds.
    Lost(io::Error),
}

struct Picture {
    film: Film,
    aovs: Option<AovFilm>,
}

#[derive(Default)]
struct State {
    /// The newest picture, and the how-manieth it is.
    newest: Option<Arc<Picture>>,
    number: u64,
    /// Which of them the viewer has taken.
    taken: u64,
    handed: Option<Instant>,
    is_connected: bool,
    is_closing: bool,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

/// A viewer that is fed.
pub struct TevFeed {
    shared: Arc<Shared>,
}

struct Feeder {
    shared: Arc<Shared>,
    address: String,
    name: String,
    said: Box<dyn Fn(&TevNews) + Send>,
}

impl TevFeed {
    /// Feeds the viewer that listens at `HOST` or `HOST:PORT` until it goes away. `name` is what the image is called there;
    /// `said` hears what becomes of the viewer.
    ///
    /// # Errors
    /// If nobody listens there.
    pub fn connect(address: &str, name: &str, said: impl Fn(&TevNews) + Send + 'static) -> io::Result<Self> {
        let viewer = TevViewer::connect(address, name)?;
        let (feed, feeder) = Self::new(address, name, said);
        feed.shared.lock().is_connected = true;
        std::thread::spawn(move || feeder.feed(viewer));
        Ok(feed)
    }

    /// Feeds the viewer whenever there is one.
    pub fn keep(address: &str, name: &str, said: impl Fn(&TevNews) + Send + 'static) -> Self {
        let (feed, feeder) = Self::new(address, name, said);
        std::thread::spawn(move || feeder.keep());
        feed
    }

    fn new(address: &str, name: &str, said: impl Fn(&TevNews) + Send + 'static) -> (Self, Feeder) {
        let shared = Arc::new(Shared::default());
        let (address, name) = (address.to_owned(), name.to_owned());
        (Self { shared: Arc::clone(&shared) }, Feeder { shared, address, name, said: Box::new(said) })
    }

    /// Whether the viewer is there, has taken the last picture, and that is long enough ago for another.
    pub fn is_due(&self) -> bool {
        let state = self.shared.lock();
        state.is_connected
            && state.taken == state.number
            && state.handed.is_none_or(|handed| handed.elapsed() >= INTERVAL)
    }

    /// Hands over the image so far, in place of one that was not taken yet. A viewer that comes later gets it too.
    pub fn show(&self, film: &Film, aovs: Option<&AovFilm>) {
        let picture = Arc::new(Picture { film: film.clone(), aovs: aovs.cloned() });
        let mut state = self.shared.lock();
        state.newest = Some(picture);
        state.number += 1;
        state.handed = Some(Instant::now());
        self.shared.changed.notify_all();
    }

    /// Waits until the viewer has the last picture, or is gone, or three seconds are over.
    pub fn finish(self) {
        let (state, end) = (self.shared.lock(), Instant::now() + LAST);
        let waits = |state: &mut State| state.is_connected && state.taken != state.number && Instant::now() < end;
        drop(self.shared.changed.wait_timeout_while(state, LAST, waits));
    }
}

impl Drop for TevFeed {
    fn drop(&mut self) {
        self.shared.lock().is_closing = true;
        self.shared.changed.notify_all();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Every change is whole, whatever a panic leaves.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Feeder {
    /// Connects whenever the feed is not connected, and says once that nobody is there.
    fn keep(&self) {
        let mut is_said = false;
        loop {
            match TevViewer::connect(&self.address, &self.name) {
                Ok(viewer) => {
                    is_said = true;
                    {
                        let mut state = self.shared.lock();
                        // A new viewer has seen nothing yet.
                        (state.is_connected, state.taken) = (true, 0);
                    }
                    (self.said)(&TevNews::Connected);
                    self.feed(viewer);
                }
                Err(error) if !is_said => {
                    is_said = true;
                    (self.said)(&TevNews::Missing(error));
                }
                Err(_) => {}
            }
            let state = self.shared.lock();
            let waits = |state: &mut State| !state.is_closing;
            let waited = self.shared.changed.wait_timeout_while(state, LOOK, waits);
            if waited.is_ok_and(|(state, _)| state.is_closing) {
                return;
            }
        }
    }

    /// Until the viewer or the feed goes away.
    fn feed(&self, mut viewer: TevViewer) {
        loop {
            let state = self.shared.lock();
            let waits = |state: &mut State| state.taken == state.number && !state.is_closing;
            let Ok((state, _)) = self.shared.changed.wait_timeout_while(state, LOOK, waits) else { return };
            if state.is_closing {
                return;
            }
            let (number, picture) = (state.number, state.newest.clone());
            let is_new = state.taken != number;
            drop(state);
            let sent = match picture.filter(|_| is_new) {
                Some(picture) => viewer.show(&picture.image()),
                None => viewer.check(),
            };
            let mut state = self.shared.lock();
            match sent {
                Ok(()) => state.taken = number,
                Err(_) => state.is_connected = false,
            }
            self.shared.changed.notify_all();
            drop(state);
            if let Err(error) = sent {
                (self.said)(&TevNews::Lost(error));
                return;
            }
        }
    }
}

impl Picture {
    fn image(&self) -> ExrImage {
        let mut image = ExrImage::from_film(&self.film, Metadata::default());
        if let Some(aovs) = &self.aovs {
            aovs.push_layers(&self.film, &mut image);
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::net::{TcpListener, TcpStream};

    use super::*;

    fn film() -> Film {
        let mut film = Film::new(512, 512);
        (0..512 * 512).for_each(|pixel| film.add_block(pixel, [1.0; 3], 1.0, 1));
        film
    }

    fn until(what: impl Fn() -> bool) {
        let end = Instant::now() + Duration::from_secs(20);
        while !what() {
            assert!(Instant::now() < end, "for 20 seconds");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Reads a packet: its length, which counts itself, and the rest.
    fn packet(stream: &mut TcpStream) -> Vec<u8> {
        let mut length = [0; 4];
        stream.read_exact(&mut length).unwrap();
        let mut rest = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut rest).unwrap();
        rest
    }

    #[test]
    fn a_viewer_that_takes_nothing_keeps_nobody_waiting_and_is_lost() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (news, heard) = std::sync::mpsc::channel();
        let feed = TevFeed::connect(&address, "image", move |said| {
            let _ = news.send(matches!(said, TevNews::Lost(_)));
        });
        let (feed, _stream) = (feed.unwrap(), listener.accept().unwrap());
        assert!(feed.is_due());
        // Megabytes that nobody reads do not fit the socket.
        let film = film();
        let start = Instant::now();
        feed.show(&film, None);
        assert!(!feed.is_due(), "it has not taken the picture");
        feed.show(&film, None);
        assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
        assert!(heard.recv_timeout(Duration::from_secs(20)).unwrap());
        assert!(!feed.is_due());
        feed.finish();
    }

    #[test]
    fn a_viewer_may_come_late_go_and_come_again_and_gets_the_newest() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        drop(listener);
        let (news, heard) = std::sync::mpsc::channel();
        let feed = TevFeed::keep(&address, "image", move |said| {
            let _ = news.send(format!("{said:?}"));
        });
        assert!(heard.recv_timeout(Duration::from_secs(20)).unwrap().starts_with("Missing"));
        let film = film();
        feed.show(&film, None);
        for _ in 0..2 {
            let listener = TcpListener::bind(&address).unwrap();
            let (mut stream, _) = listener.accept().unwrap();
            drop(listener);
            assert!(heard.recv_timeout(Duration::from_secs(20)).unwrap().starts_with("Connected"));
            assert_eq!(packet(&mut stream)[0], 4, "an image is made");
            assert_eq!(packet(&mut stream)[0], 6, "and filled");
            until(|| feed.is_due());
            drop(stream);
            // Nothing is sent any more, and yet it is noticed.
            assert!(heard.recv_timeout(Duration::from_secs(20)).unwrap().starts_with("Lost"));
        }
    }
}
