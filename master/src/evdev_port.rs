//! A device of the kernel's input system as a port: its events become the reports of a hand.
//!
//! The kernel tells of an axis only when it changes, and of an unplugging at once. So while a port is deflected and its device
//! is there, it repeats where the axes are: the silence that follows then means what it means for every other hand. A way ends by
//! silence, so that a mouse that is held still holds still.

use crate::evdev_decoder::{Break, EvdevDecoder, InputEvent};
use crate::evdev_ioctl::InputState;
use crate::hid::{HidPort, ReadFailure};
use crate::lights::{LightRole, Lights};
use crate::piece_reader::PieceReader;
use crate::rumble::Rumble;
use crate::way_window::WINDOW_US;
use crate::{HidReport, Profile, RawReport};
use std::io::Read;
use std::os::fd::AsFd;
use std::time::Duration;

/// How often a deflection is repeated: as often as the slowest SpaceMouse sends one, and as long as a window of ways.
const REPEAT: Duration = Duration::from_micros(WINDOW_US as u64);

/// An open device: a node of the kernel, or a test's pipe.
pub(crate) struct EvdevPort<F> {
    reader: PieceReader<F, { InputEvent::N_BYTES }>,
    decoder: EvdevDecoder,
    ready: [Option<HidReport>; 2],
    /// Lights, and how each was before the device was taken.
    lights: Vec<(LightRole, u16, bool)>,
    rumble: Rumble,
}

impl<F: Read + AsFd + InputState + Send> EvdevPort<F> {
    /// A port on an open node that does not block; of the profile only what it shows counts.
    pub(crate) fn new(file: F, mut decoder: EvdevDecoder, profile: &Profile) -> Self {
        let lights = &profile.lights;
        let ready = [decoder.on_silence(), None];
        // Of a device that does not say it, they go out at the end.
        let lit = if lights.is_empty() { None } else { file.lit().ok() };
        let lights = lights.iter().map(|(role, code)| (*role, *code, lit.is_some_and(|lit| lit >> code & 1 == 1)));
        let lights = lights.collect();
        Self { reader: PieceReader::new(file), decoder, ready, lights, rumble: Rumble::new(&profile.rumble) }
    }

    /// Switches each light; the kernel troubles the device only where that changes something.
    fn switch(&self, is_on: impl Fn(LightRole, bool) -> bool) {
        for (role, code, was_on) in &self.lights {
            if let Err(error) = self.reader.file().set_light(*code, is_on(*role, *was_on)) {
                tracing::debug!(%error, "the device did not take its light");
            }
        }
    }

    /// Goes through what was read, up to the end of a frame that has something to tell.
    fn next_frame(&mut self) -> Result<bool, ReadFailure> {
        while let Some(bytes) = self.reader.next_piece() {
            match self.decoder.take(InputEvent::decode(&bytes)) {
                Ok(Some(frame)) => self.ready = [frame.motion, frame.buttons],
                Ok(None) => {}
                Err(Break::GivenBack) => return Err(ReadFailure::GivenBack),
                Err(Break::EventsLost) => return Err(self.ask()),
            }
            if self.ready != [None; 2] {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Asks the device how it is, after events of it were lost. It is kept meanwhile: what a keyboard told then would be typed.
    fn ask(&mut self) -> ReadFailure {
        // What was read is older than the answer.
        self.reader.forget();
        match self.decoder.ask(self.reader.file()) {
            Ok(true) => ReadFailure::GivenBack,
            Ok(false) => {
                self.ready = self.decoder.whole().map(Some);
                ReadFailure::Dropped
            }
            Err(error) => ReadFailure::Gone(error.to_string()),
        }
    }
}

impl<F: Read + AsFd + InputState + Send> HidPort for EvdevPort<F> {
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], timeout: Duration) -> Result<usize, ReadFailure> {
        if self.ready == [None; 2] && !self.next_frame()? {
            let patience = if self.decoder.waits_for_silence() { timeout.min(REPEAT) } else { timeout };
            if self.reader.wait(patience)? {
                self.next_frame()?;
            } else {
                self.ready = [self.decoder.on_silence(), None];
            }
        }
        let Some(report) = self.ready.iter_mut().find_map(Option::take) else { return Ok(0) };
        let raw = report.encode();
        buffer[..raw.as_bytes().len()].copy_from_slice(raw.as_bytes());
        Ok(raw.as_bytes().len())
    }

    fn show(&mut self, lights: Lights) {
        self.switch(|role, _| lights.is_lit(role));
        self.rumble.show(self.reader.file(), lights);
    }

    fn rest_lights(&mut self) {
        self.switch(|_, was_on| was_on);
        self.rumble.rest(self.reader.file());
    }
}

#[cfg(test)]
mod tests;
