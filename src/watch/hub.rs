//! What the pages are to see. Each client takes the newest there is when it is ready for it, so that a slow one skips images
//! and holds up nobody.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Replies that wait for a client; one that takes none is not worth more memory.
const MOST_REPLIES: usize = 64;

/// A message to a page.
#[derive(Clone, Debug, PartialEq)]
pub enum ToPage {
    /// JSON.
    Text(Arc<String>),
    /// A length (little-endian u32), JSON of that length, and the bytes of an image.
    Binary(Arc<Vec<u8>>),
}

#[derive(Default)]
struct State {
    sequence: u64,
    status: Option<(u64, Arc<String>)>,
    frame: Option<(u64, Arc<Vec<u8>>)>,
    replies: HashMap<u64, VecDeque<ToPage>>,
    next_client: u64,
}

/// The newest status and the newest image, and what single clients asked for.
#[derive(Default)]
pub struct Hub {
    state: Mutex<State>,
    changed: Condvar,
}

/// What a client has seen.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    status: u64,
    frame: u64,
}

impl Hub {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Every change is one assignment: what a panic leaves is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A new client, unless there are `most` already.
    pub fn join(&self, most: usize) -> Option<u64> {
        let mut state = self.lock();
        if state.replies.len() >= most {
            return None;
        }
        state.next_client += 1;
        let client = state.next_client;
        state.replies.insert(client, VecDeque::new());
        Some(client)
    }

    /// The client is gone.
    pub fn leave(&self, client: u64) {
        self.lock().replies.remove(&client);
        self.changed.notify_all();
    }

    /// How many clients there are.
    pub fn clients(&self) -> usize {
        self.lock().replies.len()
    }

    /// The status for all.
    pub fn set_status(&self, status: String) {
        let mut state = self.lock();
        state.sequence += 1;
        state.status = Some((state.sequence, Arc::new(status)));
        self.changed.notify_all();
    }

    /// The image for all, with what is said about it.
    pub fn set_frame(&self, json: &str, image: &[u8]) {
        let mut state = self.lock();
        state.sequence += 1;
        state.frame = Some((state.sequence, Arc::new(packed(json, image))));
        self.changed.notify_all();
    }

    /// Something for one client; nothing if it is gone.
    pub fn reply(&self, client: u64, message: ToPage) {
        if let Some(replies) = self.lock().replies.get_mut(&client).filter(|replies| replies.len() < MOST_REPLIES) {
            replies.push_back(message);
        }
        self.changed.notify_all();
    }

    /// Waits for what a client has not seen; `None` once it is gone.
    pub fn next(&self, client: u64, seen: &mut Seen) -> Option<ToPage> {
        let mut state = self.lock();
        loop {
            if let Some(reply) = state.replies.get_mut(&client)?.pop_front() {
                return Some(reply);
            }
            if let Some((sequence, status)) = state.status.as_ref().filter(|(sequence, _)| *sequence > seen.status) {
                seen.status = *sequence;
                return Some(ToPage::Text(Arc::clone(status)));
            }
            if let Some((sequence, frame)) = state.frame.as_ref().filter(|(sequence, _)| *sequence > seen.frame) {
                seen.frame = *sequence;
                return Some(ToPage::Binary(Arc::clone(frame)));
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// JSON and bytes as one message.
pub fn packed(json: &str, bytes: &[u8]) -> Vec<u8> {
    let length = u32::try_from(json.len()).unwrap_or(u32::MAX);
    [&length.to_le_bytes(), json.as_bytes(), bytes].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_client_gets_the_newest_and_skips_the_rest() {
        let hub = Hub::default();
        let client = hub.join(1).unwrap();
        assert_eq!(hub.join(1), None, "there is room for one");
        for i in 0..100_u8 {
            hub.set_frame("{}", &[i]);
        }
        hub.set_status("status".to_owned());
        let mut seen = Seen::default();
        assert_eq!(hub.next(client, &mut seen), Some(ToPage::Text(Arc::new("status".to_owned()))));
        assert_eq!(hub.next(client, &mut seen), Some(ToPage::Binary(Arc::new(packed("{}", &[99])))));
        for _ in 0..2 * MOST_REPLIES {
            hub.reply(client, ToPage::Text(Arc::default()));
        }
        assert_eq!(hub.lock().replies[&client].len(), MOST_REPLIES);
        hub.leave(client);
        assert_eq!(hub.next(client, &mut seen), None);
        hub.reply(client, ToPage::Text(Arc::default()));
        assert!(hub.join(1).is_some());
    }
}
