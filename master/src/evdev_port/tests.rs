//! The bytes that the kernel writes, through a pipe: sticks that move, rest, repeat, vanish and cut their events.

mod mouse_and_keyboard;
mod pedal;

use super::*;
use crate::evdev_decoder::AxisInfo;
use crate::evdev_ioctl::{KeysDown, Lit, Motors};
use crate::{Engage, HidReport, MasterConfig, MasterCore, Presence, Profile};
use std::io::{PipeReader, PipeWriter, Write, pipe};
use std::os::fd::BorrowedFd;
use std::sync::{Arc, Mutex};

const STICK: &str = "name = \"Stick\"\nid = \"046d:c215\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\nrange = [0, 1023]\nnoise = 12\n[[axis]]\nof = \"z\"\nfrom = \"ABS_Y\"\nrange = [0, 1023]\nnoise = 12\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n";

const SYN: (u16, u16, i32) = (0, 0, 0);

/// A node whose events come through a pipe, and which answers that its keys are these and its axes where they were put.
struct Node {
    pipe: PipeReader,
    now: Now,
    lights: Arc<Mutex<Vec<(u16, bool)>>>,
    effects: Arc<Mutex<Vec<Told>>>,
}

/// What its motors were told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Told {
    Put(Option<i16>, Motors),
    Play(i16, bool),
}

impl Read for Node {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.pipe.read(bytes)
    }
}

impl AsFd for Node {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pipe.as_fd()
    }
}

impl InputState for Node {
    fn axis_info(&self, _: u16) -> std::io::Result<AxisInfo> {
        Ok(AxisInfo { value: self.now.lock().expect("now").0, ..AxisInfo::default() })
    }

    fn keys_down(&self) -> std::io::Result<KeysDown> {
        Ok(self.now.lock().expect("now").1.iter().copied().collect())
    }

    fn lit(&self) -> std::io::Result<Lit> {
        Ok(1 << 0)
    }

    fn set_light(&self, code: u16, is_on: bool) -> std::io::Result<()> {
        self.lights.lock().expect("lights").push((code, is_on));
        Ok(())
    }

    fn put_rumble(&self, id: Option<i16>, motors: Motors, length_ms: u16) -> std::io::Result<i16> {
        assert!((500..=1000).contains(&length_ms), "longer than every pulse, and not for long");
        self.effects.lock().expect("effects").push(Told::Put(id, motors));
        Ok(5)
    }

    fn play(&self, id: i16, is_on: bool) -> std::io::Result<()> {
        self.effects.lock().expect("effects").push(Told::Play(id, is_on));
        Ok(())
    }
}

type Now = Arc<Mutex<(i32, Vec<u16>)>>;

fn opened(profile: &Profile) -> (PipeWriter, Now, EvdevPort<Node>) {
    let (pipe, writer) = pipe().expect("a pipe");
    let now = Arc::new(Mutex::new((511, Vec::new())));
    let node = Node { pipe, now: Arc::clone(&now), lights: Arc::default(), effects: Arc::default() };
    let decoder = EvdevDecoder::new(profile, &node).expect("a decoder");
    (writer, now, EvdevPort::new(node, decoder, profile))
}

fn stick() -> (PipeWriter, EvdevPort<Node>) {
    let (writer, _, port) = opened(&Profile::parse("stick.toml", STICK).expect("a profile"));
    (writer, port)
}

/// Events as the kernel writes them, all at one instant.
fn bytes_of(events: &[(u16, u16, i32)]) -> Vec<u8> {
    bytes_at(0, events)
}

/// The same at an instant, us.
fn bytes_at(stamp_us: i64, events: &[(u16, u16, i32)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (kind, code, value) in events {
        bytes.extend(stamp_us.div_euclid(1_000_000).to_ne_bytes());
        bytes.extend(stamp_us.rem_euclid(1_000_000).to_ne_bytes());
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(code.to_ne_bytes());
        bytes.extend(value.to_ne_bytes());
    }
    bytes
}

fn read(port: &mut EvdevPort<Node>) -> Option<HidReport> {
    read_bytes(port).map(|bytes| HidReport::decode(&bytes).expect("a report"))
}

fn read_bytes(port: &mut EvdevPort<Node>) -> Option<Vec<u8>> {
    let mut buffer = [0; RawReport::MAX_BYTES];
    let n_bytes = port.read(&mut buffer, Duration::ZERO).expect("it lives");
    (n_bytes > 0).then(|| buffer[..n_bytes].to_vec())
}

#[test]
fn every_frame_arrives_in_order_also_where_its_bytes_come_in_pieces() {
    let (mut writer, mut port) = stick();
    let mut bytes = Vec::new();
    for step in 0..300 {
        bytes.extend(bytes_of(&[(3, 0, 524 + step), (1, 0x120, step % 2), SYN]));
    }
    let (mut found, mut place) = (Vec::new(), None);
    for piece in bytes.chunks(1000) {
        writer.write_all(piece).expect("written");
        while let Some(report) = read(&mut port) {
            // A frame tells only what has changed: the same motion once more is the repetition of a port that has no more.
            if Some(report) == place {
                break;
            }
            if matches!(report, HidReport::Motion(_)) {
                place = Some(report);
            }
            found.push(report);
        }
    }
    let buttons = found.iter().filter(|report| matches!(report, HidReport::Buttons(_))).count();
    assert_eq!(buttons, 299, "every press and every release, none twice");
    let mut last = 0;
    for report in &found {
        if let HidReport::Motion([x, 0, 0, 0, 0, 0]) = report {
            assert!(*x >= last, "{x} after {last}");
            last = *x;
        }
    }
    assert_eq!(last, ((300.0_f64 - 0.5) / 499.5 * 350.0).round() as i16);
}

#[test]
fn a_deflection_is_repeated_while_the_device_is_there_and_rest_is_silent() {
    let (mut writer, mut port) = stick();
    assert_eq!(read(&mut port), None);
    writer.write_all(&bytes_of(&[(3, 0, 1023), SYN])).expect("written");
    for _ in 0..5 {
        assert_eq!(read(&mut port), Some(HidReport::Motion([350, 0, 0, 0, 0, 0])));
    }
    writer.write_all(&bytes_of(&[(3, 0, 512), SYN])).expect("written");
    assert_eq!(read(&mut port), Some(HidReport::Motion([0; 6])));
    assert_eq!(read(&mut port), None);
}

#[test]
fn the_end_of_a_device_is_its_loss_and_after_events_that_the_kernel_dropped_it_is_asked_anew() {
    let mut buffer = [0; RawReport::MAX_BYTES];
    let (writer, mut port) = stick();
    drop(writer);
    assert!(matches!(port.read(&mut buffer, Duration::ZERO), Err(ReadFailure::Gone(_))));
    let (mut writer, now, mut port) = opened(&Profile::parse("stick.toml", STICK).expect("a profile"));
    writer.write_all(&bytes_of(&[(1, 0x120, 1), SYN])).expect("written");
    assert_eq!(read(&mut port), Some(HidReport::Buttons(1)));
    // The stick has moved meanwhile, and only the kernel knows; what stands behind the gap is older than what it answers.
    now.lock().expect("now").0 = 0;
    writer.write_all(&bytes_of(&[(3, 0, 1023), (0, 3, 0), (3, 0, 1023), SYN])).expect("written");
    assert!(matches!(port.read(&mut buffer, Duration::ZERO), Err(ReadFailure::Dropped)));
    assert_eq!(read(&mut port), Some(HidReport::Motion([-350, 0, -350, 0, 0, 0])));
    assert_eq!(read(&mut port), Some(HidReport::Buttons(0)), "to be pressed anew");
}

#[test]
fn the_same_events_move_the_tip_through_the_same_core_as_every_hand_and_a_loss_stops_it() {
    let config = MasterConfig { engage: Engage::Once, presence: Presence::Hold(0), ..MasterConfig::default() };
    let inputs = || {
        let (mut writer, mut port) = stick();
        let mut core = MasterCore::new(&config).expect("a configuration");
        let mut inputs = Vec::new();
        for step in 0..200_i32 {
            let pressed = i32::from(step >= 20);
            writer.write_all(&bytes_of(&[(3, 0, 511 + step * 2), (1, 0x120, pressed), SYN])).expect("written");
            let now_ns = i64::from(step) * 4_000_000;
            for _ in 0..2 {
                let mut buffer = [0; RawReport::MAX_BYTES];
                let n_bytes = port.read(&mut buffer, Duration::ZERO).expect("it lives");
                if n_bytes > 0 {
                    core.on_report(&buffer[..n_bytes], now_ns).expect("a report");
                }
            }
            inputs.push(core.on_tick(now_ns));
        }
        core.on_unplugged();
        inputs.push(core.on_tick(801_000_000));
        inputs
    };
    let (first, again) = (inputs(), inputs());
    assert_eq!(first, again, "the same events, the same inputs");
    assert!(first[..20].iter().all(|input| !input.operator_present()), "nobody holds the button yet");
    assert!(first[150].operator_present() && first[150].tip_vel_in_view_m_per_s[0] > 0.0);
    let lost = first.last().expect("the last");
    assert_eq!((lost.operator_present(), lost.tip_vel_in_view_m_per_s), (false, [0.0; 3]));
}

#[test]
fn a_rumble_is_as_strong_as_the_profile_says_ends_with_its_pulse_and_rests_with_the_port() {
    use crate::lights::{HandSeen, HandState, LightShow};
    let text = STICK.replacen("[[axis]]", "rumble = { limit = 0.5, load = 0.2 }\n[[axis]]", 1);
    let (_writer, _, mut port) = opened(&Profile::parse("stick.toml", &text).expect("a profile"));
    let mut show = LightShow::new(1000);
    let mut told = |state, load_ratio, n_looks| {
        for _ in 0..n_looks {
            port.show(show.look(Some(HandSeen { state, load_ratio, compensation_share: 0.9 })));
        }
        port.rest_lights();
        std::mem::take(&mut *port.reader.file().effects.lock().expect("effects"))
    };
    let [both, strong] = [(0.5, 0.5), (0.2, 0.0)].map(|(strong, weak): (f64, f64)| Motors {
        strong: (strong * 65535.0).round() as u16,
        weak: (weak * 65535.0).round() as u16,
    });
    assert_eq!(told(HandState::Engaged, 0.1, 100), [], "nothing to tell, and compensation is not asked for");
    assert_eq!(told(HandState::Fault, 0.1, 100), [], "nor is a fault");
    let on = |id, motors| [Told::Put(id, motors), Told::Play(5, true)];
    assert_eq!(told(HandState::Limit, 0.1, 60), [&on(None, both)[..], &[Told::Play(5, false)]].concat());
    let pulse = [&on(Some(5), strong)[..], &[Told::Play(5, false)]].concat();
    assert_eq!(told(HandState::Engaged, 0.6, 60), [&pulse[..], &pulse].concat(), "two quarters");
    // The device is let go in the middle of a pulse.
    assert_eq!(told(HandState::Engaged, 0.9, 1).last(), Some(&Told::Play(5, false)));
}
