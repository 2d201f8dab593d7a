//! A device of the kernel's input system as a port: its events become the reports of a hand.
//!
//! The kernel tells of an axis only when it changes, and of an unplugging at once. So while a port is deflected and its device
//! is there, it repeats where the axes are: the silence that follows then means what it means for every other hand.

use crate::evdev_decoder::{EvdevDecoder, InputEvent};
use crate::hid::{HidPort, ReadFailure};
use crate::{HidReport, RawReport};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::time::Timespec;
use std::io::{ErrorKind, Read};
use std::os::fd::AsFd;
use std::time::Duration;

/// How often a deflection is repeated: as often as the slowest SpaceMouse sends one.
const REPEAT: Duration = Duration::from_millis(16);
/// Events that are read at once.
const MOST_EVENTS: usize = 64;

/// An open device: a node of the kernel, or a test's pipe.
pub(crate) struct EvdevPort<F> {
    file: F,
    decoder: EvdevDecoder,
    buffer: [u8; MOST_EVENTS * InputEvent::N_BYTES],
    // What of the buffer is not taken apart yet.
    from: usize,
    to: usize,
    ready: [Option<HidReport>; 2],
}

impl<F: Read + AsFd + Send> EvdevPort<F> {
    /// A port on an open node that does not block.
    pub(crate) fn new(file: F, mut decoder: EvdevDecoder) -> Self {
        let ready = [decoder.frame().motion, None];
        Self { file, decoder, buffer: [0; MOST_EVENTS * InputEvent::N_BYTES], from: 0, to: 0, ready }
    }

    /// Goes through what was read, up to the end of a frame that has changed something.
    fn next_frame(&mut self) -> Result<bool, ReadFailure> {
        while let Some((bytes, _)) = self.buffer[self.from..self.to].split_first_chunk() {
            let event = InputEvent::decode(bytes);
            self.from += InputEvent::N_BYTES;
            let lost = |_| ReadFailure::Gone("the kernel has dropped events; the device is opened anew".to_owned());
            if let Some(frame) = self.decoder.take(event).map_err(lost)? {
                self.ready = [frame.motion, frame.buttons];
                if self.ready != [None; 2] {
                    return Ok(true);
                }
            }
        }
        Ok(false)
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

impl<F: Read + AsFd + Send> HidPort for EvdevPort<F> {
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], timeout: Duration) -> Result<usize, ReadFailure> {
        if self.ready == [None; 2] && !self.next_frame()? {
            let repeats = self.decoder.deflected();
            let patience = if repeats.is_some() { timeout.min(REPEAT) } else { timeout };
            // A second at most: the nanoseconds fit.
            let timeout = Timespec {
                tv_sec: i64::try_from(patience.as_secs()).unwrap_or(i64::MAX),
                tv_nsec: i64::from(patience.subsec_nanos()),
            };
            let mut nodes = [PollFd::new(&self.file, PollFlags::IN)];
            match poll(&mut nodes, Some(&timeout)) {
                Ok(0) => self.ready = [repeats, None],
                Ok(_) => {
                    self.fill()?;
                    self.next_frame()?;
                }
                Err(Errno::INTR) => return Err(ReadFailure::Interrupted),
                Err(error) => return Err(ReadFailure::Gone(error.to_string())),
            }
        }
        let Some(report) = self.ready.iter_mut().find_map(Option::take) else { return Ok(0) };
        let raw = report.encode();
        buffer[..raw.as_bytes().len()].copy_from_slice(raw.as_bytes());
        Ok(raw.as_bytes().len())
    }

    fn set_light(&mut self, _is_on: bool) {}
}

#[cfg(test)]
mod tests;
