//! The hand behind spacenavd, a daemon that has the device for itself and tells its motion to programs through a socket: its events become
//! the reports of a hand.
//!
//! Source: the daemon's protocol 0 (libspnav): each event is eight 32-bit numbers in the machine's byte order: 0, the six axes and the time
//! since the event before; or 1 (pressed) or 2 (let go) and the button. Its axes, as the daemon comes: x right, y up, z away from the user.

use crate::hid::{HidHost, HidPort, OpenPort, ReadFailure};
use crate::lights::Lights;
use crate::piece_reader::PieceReader;
use crate::{AXIS_LIMIT_COUNTS, DeviceChoice, HidReport, MasterError, RawReport};
use rustix::net::{
    AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with, sockopt::socket_peercred,
};
use rustix::process::geteuid;
use std::fs::File;
use std::io::{Error, Read};
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::time::Duration;

/// Bytes of an event.
const EVENT_BYTES: usize = 32;
const MOTION: i32 = 0;
const PRESS: i32 = 1;
const RELEASE: i32 = 2;
/// A report that no device sends: what is no event of the daemon is handed on as one, and is refused and counted.
const UNKNOWN: [u8; 1] = [0xff];

/// The daemon that listens at a path.
pub(crate) struct SpacenavHost {
    pub(crate) socket: PathBuf,
}

impl HidHost for SpacenavHost {
    fn open(&mut self, _choice: &DeviceChoice) -> Result<OpenPort, MasterError> {
        let refused = |source: Error| MasterError::Spacenavd { path: self.socket.clone(), source };
        let address = SocketAddrUnix::new(&self.socket).map_err(|error| refused(error.into()))?;
        // One that does not block: of a daemon that hangs nobody waits for an answer.
        let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
        let socket = socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None);
        let socket = socket.map_err(|error| refused(error.into()))?;
        connect(&socket, &address).map_err(|error| refused(error.into()))?;
        let (peer, own) = (socket_peercred(&socket).map_err(|error| refused(error.into()))?.uid, geteuid());
        if !peer.is_root() && peer != own {
            let whose = format!("who listens there is user id {}, expected root or {}", peer.as_raw(), own.as_raw());
            return Err(refused(Error::other(whose)));
        }
        // A socket is read like a file.
        Ok(OpenPort { port: Box::new(SpacenavPort::new(File::from(socket))), vid_pid: (0, 0) })
    }
}

/// A conversation with the daemon, or a test's pipe.
struct SpacenavPort<F> {
    reader: PieceReader<F, EVENT_BYTES>,
    buttons: u32,
}

impl<F: Read + AsFd> SpacenavPort<F> {
    fn new(file: F) -> Self {
        Self { reader: PieceReader::new(file), buttons: 0 }
    }

    /// The report that an event is; none for a button beyond the hand's; the error for what is no event.
    fn report_of(&mut self, event: &[u8; EVENT_BYTES]) -> Result<Option<HidReport>, ()> {
        let [bytes_of_kind, rest @ ..] = event.as_chunks::<4>().0 else { return Err(()) };
        let mut words = [0; 7];
        for (word, bytes) in words.iter_mut().zip(rest) {
            *word = i32::from_ne_bytes(*bytes);
        }
        let [x, y, z, rx, ry, rz, _period_ms] = words;
        match i32::from_ne_bytes(*bytes_of_kind) {
            MOTION => {
                let limit = i32::from(AXIS_LIMIT_COUNTS);
                // Within the limit after the clamp.
                let counts = |value: i32| value.clamp(-limit, limit) as i16;
                let axes = [counts(x), -counts(z), -counts(y), counts(rx), -counts(rz), -counts(ry)];
                Ok(Some(HidReport::Motion(axes)))
            }
            kind @ (PRESS | RELEASE) => {
                let Some(bit) = u32::try_from(x).ok().and_then(|button| 1_u32.checked_shl(button)) else {
                    return Ok(None);
                };
                self.buttons = if kind == PRESS { self.buttons | bit } else { self.buttons & !bit };
                Ok(Some(HidReport::Buttons(self.buttons)))
            }
            _ => Err(()),
        }
    }

    /// The next event that was read and says something, as bytes.
    fn next(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES]) -> usize {
        while let Some(event) = self.reader.next_piece() {
            let raw = match self.report_of(&event) {
                Ok(None) => continue,
                Ok(Some(report)) => report.encode(),
                Err(()) => RawReport::clipped(&UNKNOWN),
            };
            buffer[..raw.as_bytes().len()].copy_from_slice(raw.as_bytes());
            return raw.as_bytes().len();
        }
        0
    }
}

impl<F: Read + AsFd + Send> HidPort for SpacenavPort<F> {
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], timeout: Duration) -> Result<usize, ReadFailure> {
        let n_bytes = self.next(buffer);
        if n_bytes > 0 || !self.reader.wait(timeout)? {
            return Ok(n_bytes);
        }
        Ok(self.next(buffer))
    }

    /// The light of the device is the daemon's.
    fn show(&mut self, _lights: Lights) {}

    fn rest_lights(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hid_source::tests::wait_for_event;
    use crate::{HidSource, Plug, SourceEvent};
    use std::io::Write;
    use std::os::unix::net::{UnixListener, UnixStream};

    fn event(words: [i32; 8]) -> Vec<u8> {
        words.into_iter().flat_map(i32::to_ne_bytes).collect()
    }

    /// What a port makes of bytes that come in pieces of some length.
    fn told(bytes: &[u8], piece: usize) -> Vec<Result<HidReport, crate::Refusal>> {
        let (reader, mut writer) = std::io::pipe().expect("a pipe");
        let mut port = SpacenavPort::new(reader);
        let (mut told, mut buffer) = (Vec::new(), [0; RawReport::MAX_BYTES]);
        for bytes in bytes.chunks(piece) {
            writer.write_all(bytes).expect("written");
            while let Ok(n_bytes @ 1..) = port.read(&mut buffer, Duration::ZERO) {
                told.push(HidReport::decode(&buffer[..n_bytes]));
            }
        }
        told
    }

    #[test]
    fn events_are_reports_in_the_hands_own_frame_also_where_they_come_in_pieces() {
        let events = [
            event([0, 1, 2, 3, 4, 5, 6, 16]),
            event([1, 0, 0, 0, 0, 0, 0, 0]),
            event([1, 31, 0, 0, 0, 0, 0, 0]),
            event([2, 0, 0, 0, 0, 0, 0, 0]),
            event([0; 8]),
        ];
        for piece in [1, 7, 32, 1000] {
            let due = [
                HidReport::Motion([1, -3, -2, 4, -6, -5]),
                HidReport::Buttons(1),
                HidReport::Buttons(1 | 1 << 31),
                HidReport::Buttons(1 << 31),
                HidReport::Motion([0; 6]),
            ];
            assert_eq!(told(&events.concat(), piece), due.map(Ok), "pieces of {piece}");
        }
    }

    #[test]
    fn values_are_bounded_and_what_is_no_event_is_refused_and_counted_and_never_a_press() {
        let wild = event([0, i32::MAX, i32::MIN, -351, 350, 0, 0, 0]);
        assert_eq!(told(&wild, 32), [Ok(HidReport::Motion([350, 350, 350, 350, 0, 0]))]);
        for button in [32, 1000, -1, i32::MIN] {
            assert_eq!(told(&event([1, button, 0, 0, 0, 0, 0, 0]), 32), [], "button {button} is nobody's");
        }
        for kind in [3, 4, -1, 0x101, i32::MAX] {
            let told = told(&event([kind, 1, 1, 1, 1, 1, 1, 1]), 32);
            assert!(matches!(told[..], [Err(_)]), "{kind}: {told:?}");
        }
    }

    /// A socket of this test's own, and its path.
    fn daemon(name: &str) -> (UnixListener, PathBuf) {
        let path = std::env::temp_dir().join(format!("krait-spnav-{name}-{}", std::process::id()));
        drop(std::fs::remove_file(&path));
        (UnixListener::bind(&path).expect("a socket"), path)
    }

    #[test]
    fn the_end_of_the_daemon_is_the_loss_of_the_hand_and_another_one_is_found() {
        let (listener, path) = daemon("restart");
        let mut source = HidSource::open_spacenavd(&path).expect("open");
        let serve = |listener: &UnixListener| -> UnixStream { listener.accept().expect("a client").0 };
        for is_first in [true, false] {
            let mut client = serve(&listener);
            assert!(
                is_first || matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::In, .. })
            );
            client.write_all(&event([0, 100, 0, 0, 0, 0, 0, 0])).expect("written");
            let SourceEvent::HidReport { report, .. } = wait_for_event(&mut source) else { panic!("a report") };
            assert_eq!(HidReport::decode(report.as_bytes()), Ok(HidReport::Motion([100, 0, 0, 0, 0, 0])));
            drop(client);
            assert!(matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::Out, .. }));
        }
        drop(source);
        std::fs::remove_file(path).expect("removed");
    }

    #[test]
    fn a_daemon_that_is_not_there_or_has_gone_is_named_with_what_to_do() {
        let (listener, path) = daemon("gone");
        drop(listener);
        let gone = HidSource::open_spacenavd(&path).expect_err("nobody listens").to_string();
        std::fs::remove_file(&path).expect("removed");
        let absent = HidSource::open_spacenavd(&path).expect_err("not there").to_string();
        let long = HidSource::open_spacenavd(&PathBuf::from("/x".repeat(100))).expect_err("too long").to_string();
        for error in [gone, absent, long] {
            assert!(error.contains("spacenavd") && error.contains("systemctl start spacenavd"), "{error}");
            assert!(!error.contains('\n'), "{error}");
        }
    }
}
