//! Takes whole pieces of a fixed size, such as the kernel's input events, out of an open node or socket, or out of a pipe or file that holds
//! what such a one tells.

use crate::hid::ReadFailure;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::time::Timespec;
use std::io::{ErrorKind, Read};
use std::os::fd::AsFd;
use std::time::Duration;

/// Pieces that are read at once.
const MOST_PIECES: usize = 64;

/// An open node and what was read of it and not taken apart yet, in pieces of `N` bytes.
#[derive(Debug)]
pub(crate) struct PieceReader<F, const N: usize> {
    file: F,
    buffer: [[u8; N]; MOST_PIECES],
    from: usize,
    to: usize,
}

impl<F: Read + AsFd, const N: usize> PieceReader<F, N> {
    /// A reader of an open node that does not block.
    pub(crate) fn new(file: F) -> Self {
        Self { file, buffer: [[0; N]; MOST_PIECES], from: 0, to: 0 }
    }

    /// The next piece that was read.
    pub(crate) fn next_piece(&mut self) -> Option<[u8; N]> {
        let (bytes, _) = self.buffer.as_flattened()[self.from..self.to].split_first_chunk()?;
        self.from += N;
        Some(*bytes)
    }

    /// The open node.
    pub(crate) fn file(&self) -> &F {
        &self.file
    }

    /// Throws away what was read and not taken apart.
    pub(crate) fn forget(&mut self) {
        (self.from, self.to) = (0, 0);
    }

    /// Waits for bytes and reads them; false when the time is up.
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
        // The kernel hands out whole events; a pipe or socket may cut a piece.
        let buffer = self.buffer.as_flattened_mut();
        buffer.copy_within(self.from..self.to, 0);
        (self.from, self.to) = (0, self.to - self.from);
        match self.file.read(&mut buffer[self.to..]) {
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
