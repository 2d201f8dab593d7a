//! A device of the kernel's input system as a port: its events become the reports of a hand.
//!
//! The kernel tells of an axis only when it changes, and of an unplugging at once. So while a port is deflected and its device
//! is there, it repeats where the axes are: the silence that follows then means what it means for every other hand.

use crate::evdev_decoder::EvdevDecoder;
use crate::evdev_reader::EventReader;
use crate::hid::{HidPort, ReadFailure};
use crate::{HidReport, RawReport};
use std::io::Read;
use std::os::fd::AsFd;
use std::time::Duration;

/// How often a deflection is repeated: as often as the slowest SpaceMouse sends one.
const REPEAT: Duration = Duration::from_millis(16);

/// An open device: a node of the kernel, or a test's pipe.
pub(crate) struct EvdevPort<F> {
    reader: EventReader<F>,
    decoder: EvdevDecoder,
    ready: [Option<HidReport>; 2],
}

impl<F: Read + AsFd + Send> EvdevPort<F> {
    /// A port on an open node that does not block.
    pub(crate) fn new(file: F, mut decoder: EvdevDecoder) -> Self {
        let ready = [decoder.frame().motion, None];
        Self { reader: EventReader::new(file), decoder, ready }
    }

    /// Goes through what was read, up to the end of a frame that has changed something.
    fn next_frame(&mut self) -> Result<bool, ReadFailure> {
        while let Some(event) = self.reader.next_event() {
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
}

impl<F: Read + AsFd + Send> HidPort for EvdevPort<F> {
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], timeout: Duration) -> Result<usize, ReadFailure> {
        if self.ready == [None; 2] && !self.next_frame()? {
            let repeats = self.decoder.deflected();
            let patience = if repeats.is_some() { timeout.min(REPEAT) } else { timeout };
            if self.reader.wait(patience)? {
                self.next_frame()?;
            } else {
                self.ready = [repeats, None];
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
