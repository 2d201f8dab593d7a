//! Takes whole events of the kernel's input system out of an open node, or out of a pipe or file that holds what such a node tells.

use crate::evdev_decoder::InputEvent;
use crate::hid::ReadFailure;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::time::Timespec;
use std::io::{ErrorKind, Read};
use std::os::fd::AsFd;
use std::time::Duration;

/// Events that are read at once.
const MOST_EVENTS: usize = 64;

/// An open node and what was read of it and not taken apart yet.
#[derive(Debug)]
pub(crate) struct EventReader<F> {
    file: F,
    buffer: [u8; MOST_EVENTS * InputEvent::N_BYTES],
    from: usize,
    to: usize,
}

impl<F: Read + AsFd> EventReader<F> {
    /// A reader of an open node that does not block.
    pub(crate) fn new(file: F) -> Self {
        Self { file, buffer: [0; MOST_EVENTS * InputEvent::N_BYTES], from: 0, to: 0 }
    }

    /// The next event that was read.
    pub(crate) fn next_event(&mut self) -> Option<InputEvent> {
        let (bytes, _) = self.buffer[self.from..self.to].split_first_chunk()?;
        self.from += InputEvent::N_BYTES;
        Some(InputEvent::decode(bytes))
    }

    /// The open node.
    pub(crate) fn file(&self) -> &F {
        &self.file
    }

    /// Throws away what was read and not taken apart.
    pub(crate) fn forget(&mut self) {
        (self.from, self.to) = (0, 0);
    }

    /// Waits for events and reads them; false when the time is up.
    pub(crate) fn wait(&mut self, timeout: Duration) -> Result<bool, ReadFailure> {
        // A second at most: the nanoseconds fit.
        let timeout = Timespec {
            tv_sec: i64::try_from(timeout.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: i64::from(timeout.subsec_nanos()),
        };
        match poll(&mut [PollFd::new(&self.file, PollFlags::IN)], Some(&timeout)) {
            Ok(0) => Ok(false),
            Ok(_) => self.fill().map(|()| true),
            Err(Errno::INTR) => Err(ReadFailure::Interrupted),
            Err(error) => Err(ReadFailure::Gone(error.to_string())),
        }
    }

    fn fill(&mut self) -> Result<(), ReadFailure> {
        // The kernel hands out whole events; a pipe may cut one.
        self.buffer.copy_within(self.from..self.to, 0);
        (self.from, self.to) = (0, self.to - self.from);
        match self.file.read(&mut self.buffer[self.to..]) {
            Ok(0) => Err(ReadFailure::Gone("the device has come to its end".to_owned())),
            Ok(n_bytes) => {
                self.to += n_bytes;
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(()),
            Err(error) if error.kind() == ErrorKind::Interrupted => Err(ReadFailure::Interrupted),
            Err(error) => Err(ReadFailure::Gone(error.to_string())),
        }
    }
}
