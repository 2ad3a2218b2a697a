//! The processes that work for the server: started, spoken to, killed.

use std::ffi::OsString;
use std::io::BufReader;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Sender, channel};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::wire::{read_message, write_message};
use crate::{Error, Result};

/// What is heard of a process.
pub(super) enum Heard<From> {
    /// A message, and the bytes that follow it.
    Message(From, Vec<u8>),
    /// Its output has ended.
    Gone,
}

/// A running process that is told `To`. Dropping it kills it.
pub(super) struct Helper<To> {
    child: Child,
    /// A thread writes: a process that hangs does not read, and must not hold up who speaks to it.
    orders: Sender<(To, Vec<u8>)>,
}

impl<To: Serialize + Send + 'static> Helper<To> {
    /// Starts this very program with other arguments. `heard` is called from a thread of its own.
    pub(super) fn start<From: DeserializeOwned>(
        arguments: &[OsString],
        heard: impl Fn(Heard<From>) + Send + 'static,
    ) -> Result<Self> {
        let failed = |e: std::io::Error| Error::Device(format!("a process cannot be started: {e}"));
        let program = std::env::current_exe().map_err(failed)?;
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        let (orders, to_write) = channel::<(To, Vec<u8>)>();
        if let Some(mut stdin) = child.stdin.take() {
            std::thread::spawn(move || {
                while let Ok((message, bytes)) = to_write.recv() {
                    if write_message(&mut stdin, &message, &bytes).is_err() {
                        return;
                    }
                }
            });
        }
        if let Some(stdout) = child.stdout.take() {
            std::thread::spawn(move || {
                let mut stdout = BufReader::new(stdout);
                while let Ok((message, bytes)) = read_message(&mut stdout) {
                    heard(Heard::Message(message, bytes));
                }
                heard(Heard::Gone);
            });
        }
        Ok(Self { child, orders })
    }

    /// Says something; a process that is gone is noticed elsewhere.
    pub(super) fn tell(&self, message: To, bytes: Vec<u8>) {
        let _ = self.orders.send((message, bytes));
    }

    /// Kills it if it still runs; says how it ended.
    pub(super) fn end(&mut self) -> String {
        self.end_status().map_or_else(|| "without a status".to_owned(), |status| status.to_string())
    }

    /// Kills it if it still runs.
    pub(super) fn end_status(&mut self) -> Option<ExitStatus> {
        // An exit by itself is told apart from the kill: its status is there a moment after its output has ended.
        for _ in 0..20 {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let _ = self.child.kill();
        self.child.wait().ok()
    }
}

impl<To> Drop for Helper<To> {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
