//! From the kernel's input events to the reports of a hand. Pure, allocates nothing in a step.
//!
//! A frame of events ends with a synchronisation event; only whole frames count. Time is the stamps of the events.

use crate::axis_scale::PlaceScale;
use crate::evdev_ioctl::InputState;
use crate::evdev_names::axis_name;
use crate::way_window::{WINDOW_US, WayWindow};
use crate::{AxisFrom, HidReport, Profile, ProfileAxis, ProfileButton};
use libc::time_t;

/// One event of the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct InputEvent {
    /// When it was, us, on a clock of the kernel that somebody may set.
    pub(crate) stamp_us: i64,
    pub(crate) kind: u16,
    pub(crate) code: u16,
    pub(crate) value: i32,
}

/// Kinds and codes of linux/input-event-codes.h.
pub(crate) const EV_SYN: u16 = 0;
pub(crate) const EV_KEY: u16 = 1;
pub(crate) const EV_REL: u16 = 2;
pub(crate) const EV_ABS: u16 = 3;
pub(crate) const EV_LED: u16 = 0x11;
pub(crate) const EV_FF: u16 = 0x15;
pub(crate) const SYN_REPORT: u16 = 0;
pub(crate) const SYN_DROPPED: u16 = 3;
/// Values of a key: let go, pressed. 2 is a key that repeats: it is still down, and nothing new.
const KEY_UP: i32 = 0;
const KEY_DOWN: i32 = 1;

/// Bytes of the time before kind, code and value: seconds, then microseconds.
const TIME_BYTES: usize = size_of::<libc::timeval>();

impl InputEvent {
    /// Bytes of one event as the kernel writes it.
    pub(crate) const N_BYTES: usize = TIME_BYTES + 8;

    /// Takes one event apart.
    pub(crate) fn decode(bytes: &[u8; Self::N_BYTES]) -> Self {
        let [time @ .., k0, k1, c0, c1, v0, v1, v2, v3] = *bytes;
        let half = |from: usize| {
            let mut number = [0; TIME_BYTES / 2];
            number.copy_from_slice(&time[from..from + TIME_BYTES / 2]);
            time_t::from_ne_bytes(number)
        };
        Self {
            stamp_us: half(0).wrapping_mul(1_000_000).wrapping_add(half(TIME_BYTES / 2)),
            kind: u16::from_ne_bytes([k0, k1]),
            code: u16::from_ne_bytes([c0, c1]),
            value: i32::from_ne_bytes([v0, v1, v2, v3]),
        }
    }

    /// An event to the kernel, which gives it a time of its own.
    pub(crate) fn to_kernel(kind: u16, code: u16, value: i32) -> [u8; Self::N_BYTES] {
        let mut bytes = [0; Self::N_BYTES];
        bytes[TIME_BYTES..TIME_BYTES + 2].copy_from_slice(&kind.to_ne_bytes());
        bytes[TIME_BYTES + 2..TIME_BYTES + 4].copy_from_slice(&code.to_ne_bytes());
        bytes[TIME_BYTES + 4..].copy_from_slice(&value.to_ne_bytes());
        bytes
    }
}

/// What the kernel says of an absolute axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct AxisInfo {
    pub(crate) value: i32,
    pub(crate) min: i32,
    pub(crate) max: i32,
    /// The noise that the driver filters, and the one around rest that it does not.
    pub(crate) fuzz: i32,
    pub(crate) flat: i32,
}

/// Why the events so far are not gone on with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Break {
    /// The kernel has thrown events away: what is held and pressed is not known any more, until it is asked for.
    EventsLost,
    /// The key was pressed that gives the device back.
    GivenBack,
}

/// Follows one device.
#[derive(Debug)]
pub(crate) struct EvdevDecoder {
    axes: Vec<(ProfileAxis, AxisState)>,
    buttons: Vec<ProfileButton>,
    release: Option<u16>,
    window: WayWindow,
    counts: [i16; 6],
    bits: u32,
    told: ([i16; 6], u32),
    /// When the axes were told last, us; after silence, of which there is no stamp, the next one.
    told_us: Option<i64>,
    is_window_over: bool,
}

/// What of the device an axis comes from, and how it is now.
#[derive(Clone, Copy, Debug)]
enum AxisState {
    Place(u16, PlaceScale),
    Way(u16, f64),
    Keys { keys: [u16; 2], is_down: [bool; 2], deflection_ratio: f64 },
}

/// What a frame of events has changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Frame {
    pub(crate) motion: Option<HidReport>,
    pub(crate) buttons: Option<HidReport>,
}

impl EvdevDecoder {
    /// A decoder for a device, which is asked for its axes and keys. A button that is down already is not pressed by that.
    ///
    /// # Errors
    /// One phrase: an axis that the device does not have, or one whose range is none.
    pub(crate) fn new(profile: &Profile, device: &impl InputState) -> Result<Self, String> {
        let mut axes = Vec::new();
        for axis in &profile.axes {
            axes.push((
                *axis,
                match axis.from {
                    AxisFrom::Place(place) => {
                        let info = device.axis_info(place.code);
                        let info = info.map_err(|error| format!("axis {}: {error}", axis_name(place.code)))?;
                        AxisState::Place(place.code, PlaceScale::new(&place, &info)?)
                    }
                    AxisFrom::Way { code, full_counts_per_s } => AxisState::Way(code, full_counts_per_s),
                    AxisFrom::Keys { plus, minus, deflection_ratio } => {
                        AxisState::Keys { keys: [plus, minus], is_down: [false; 2], deflection_ratio }
                    }
                },
            ));
        }
        let mut decoder = Self {
            axes,
            buttons: profile.buttons.clone(),
            release: profile.release,
            window: WayWindow::default(),
            counts: [0; 6],
            bits: 0,
            told: ([0; 6], 0),
            told_us: None,
            is_window_over: false,
        };
        decoder.ask(device).map_err(|error| error.to_string())?;
        Ok(decoder)
    }

    /// Asks the device anew how it is; buttons count as let go until they are pressed again. True where the key is down that gives
    /// it back.
    ///
    /// # Errors
    /// What the kernel says: the device is gone.
    pub(crate) fn ask(&mut self, device: &impl InputState) -> std::io::Result<bool> {
        let has_keys = self.axes.iter().any(|(_, state)| matches!(state, AxisState::Keys { .. }));
        let down = if has_keys || self.release.is_some() { Some(device.keys_down()?) } else { None };
        let is_held = |key: u16| down.as_ref().is_some_and(|down| down.contains(key));
        (self.window, self.bits) = (WayWindow::default(), 0);
        for (axis, state) in &mut self.axes {
            self.counts[axis.axis_idx] = match state {
                AxisState::Place(code, scale) => axis.counts_of_place(scale, device.axis_info(*code)?.value),
                AxisState::Way(..) => 0,
                AxisState::Keys { keys, is_down, deflection_ratio } => {
                    *is_down = keys.map(is_held);
                    axis.counts_of_keys(*is_down, *deflection_ratio)
                }
            };
        }
        Ok(self.release.is_some_and(is_held))
    }

    /// Takes an event; the end of a frame gives what it has changed.
    ///
    /// # Errors
    /// [`Break`]; after lost events the device is then to be asked anew.
    pub(crate) fn take(&mut self, event: InputEvent) -> Result<Option<Frame>, Break> {
        if self.window.advance(event.stamp_us) {
            self.is_window_over = true;
            self.put_speeds();
        }
        match (event.kind, event.code) {
            (EV_SYN, SYN_DROPPED) => return Err(Break::EventsLost),
            (EV_SYN, SYN_REPORT) => return Ok(Some(self.frame(event.stamp_us))),
            (EV_REL, code) if self.has_way(code) => self.window.add(code, event.value, event.stamp_us),
            (EV_ABS, code) => {
                for (axis, state) in &self.axes {
                    if let AxisState::Place(own, scale) = state
                        && *own == code
                    {
                        self.counts[axis.axis_idx] = axis.counts_of_place(scale, event.value);
                    }
                }
            }
            (EV_KEY, code) if matches!(event.value, KEY_UP | KEY_DOWN) => {
                if event.value == KEY_DOWN && self.release == Some(code) {
                    return Err(Break::GivenBack);
                }
                self.put_key(code, event.value == KEY_DOWN);
            }
            _ => {}
        }
        Ok(None)
    }

    fn has_way(&self, code: u16) -> bool {
        self.axes.iter().any(|(_, state)| matches!(state, AxisState::Way(own, _) if *own == code))
    }

    fn put_key(&mut self, code: u16, is_pressed: bool) {
        if let Some(button) = self.buttons.iter().find(|button| button.code == code) {
            let bit = 1 << button.button;
            self.bits = if is_pressed { self.bits | bit } else { self.bits & !bit };
        }
        for (axis, state) in &mut self.axes {
            if let AxisState::Keys { keys, is_down, deflection_ratio } = state
                && let Some(which) = keys.iter().position(|key| *key == code)
            {
                is_down[which] = is_pressed;
                self.counts[axis.axis_idx] = axis.counts_of_keys(*is_down, *deflection_ratio);
            }
        }
    }

    fn put_speeds(&mut self) {
        for (axis, state) in &self.axes {
            if let AxisState::Way(code, full_counts_per_s) = state {
                self.counts[axis.axis_idx] = axis.counts_of_speed(self.window.counts_per_s(*code), *full_counts_per_s);
            }
        }
    }

    /// What has changed since the frame before. Of a deflection each window is told, and where there is none, as often: other axes
    /// and keys may keep the device from falling silent.
    fn frame(&mut self, now_us: i64) -> Frame {
        let told_us = *self.told_us.get_or_insert(now_us);
        let is_fresh = (told_us..told_us.saturating_add(WINDOW_US)).contains(&now_us);
        let is_due = self.counts != [0; 6] && (!is_fresh || self.is_window_over);
        let frame = Frame {
            motion: (is_due || self.told.0 != self.counts).then_some(HidReport::Motion(self.counts)),
            buttons: (self.told.1 != self.bits).then_some(HidReport::Buttons(self.bits)),
        };
        if frame.motion.is_some() {
            self.told_us = Some(now_us);
        }
        (self.told, self.is_window_over) = ((self.counts, self.bits), false);
        frame
    }

    /// Nothing came for the length of a window: ways are at their end. Where the axes are, while any is deflected or has just ceased
    /// to be.
    pub(crate) fn on_silence(&mut self) -> Option<HidReport> {
        if self.window.end_by_silence() {
            self.put_speeds();
        }
        self.told_us = None;
        let before = std::mem::replace(&mut self.told.0, self.counts);
        (self.counts != [0; 6] || before != self.counts).then_some(HidReport::Motion(self.counts))
    }

    /// Whether silence would say something.
    pub(crate) fn waits_for_silence(&self) -> bool {
        self.window.is_moving() || self.counts != [0; 6]
    }

    /// Everything as it is, as after the device was asked.
    pub(crate) fn whole(&mut self) -> [HidReport; 2] {
        self.told = (self.counts, self.bits);
        [HidReport::Motion(self.counts), HidReport::Buttons(self.bits)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evdev_ioctl::Answers;

    const STICK: &str = "name = \"Stick\"\nid = \"046d:c215\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\nrange = [0, 1000]\nrest = 400\nnoise = 20\n[[axis]]\nof = \"ry\"\nfrom = \"ABS_RZ\"\nsign = \"-\"\n[[button]]\nof = 3\nfrom = \"BTN_TRIGGER\"\n";

    fn stick() -> EvdevDecoder {
        let profile = Profile::parse("stick.toml", STICK).expect("a profile");
        let info = AxisInfo { value: 128, min: 0, max: 255, fuzz: 0, flat: 15 };
        let at_rest = |code| if code == 0 { AxisInfo { value: 400, ..AxisInfo::default() } } else { info };
        EvdevDecoder::new(&profile, &Answers(at_rest, Vec::new)).expect("a decoder")
    }

    fn frame(decoder: &mut EvdevDecoder, events: &[(u16, u16, i32)]) -> Frame {
        frame_at(decoder, 0, events)
    }

    fn frame_at(decoder: &mut EvdevDecoder, stamp_us: i64, events: &[(u16, u16, i32)]) -> Frame {
        for &(kind, code, value) in events {
            assert_eq!(decoder.take(InputEvent { stamp_us, kind, code, value }), Ok(None));
        }
        let end = InputEvent { stamp_us, kind: EV_SYN, code: SYN_REPORT, value: 0 };
        decoder.take(end).expect("whole").expect("a frame")
    }

    fn x_of(decoder: &mut EvdevDecoder, value: i32) -> i16 {
        frame(decoder, &[(EV_ABS, 0, value)]);
        decoder.counts[0]
    }

    #[test]
    fn range_rest_noise_and_sign_make_a_deflection_of_each_value() {
        let mut stick = stick();
        let counts = [400, 420, 380, 421, 1000, 0, 710, 2000, -70_000, i32::MAX, i32::MIN].map(|v| x_of(&mut stick, v));
        assert_eq!(counts, [0, 0, 0, 1, 350, -350, 175, 350, -350, 350, -350]);
        let turned = frame(&mut stick, &[(EV_ABS, 0, 400), (EV_ABS, 5, 255)]);
        assert_eq!(turned.motion, Some(HidReport::Motion([0, 0, 0, 0, -350, 0])));
        assert_eq!(
            frame(&mut stick, &[(EV_ABS, 5, 140)]).motion,
            Some(HidReport::Motion([0; 6])),
            "within the kernel's flat"
        );
    }

    #[test]
    fn a_frame_tells_what_has_changed_and_only_when_it_is_whole() {
        let mut stick = stick();
        assert_eq!(frame(&mut stick, &[]), Frame::default());
        let both = frame(&mut stick, &[(EV_ABS, 0, 1000), (EV_KEY, 0x120, 1), (EV_KEY, 0x121, 1), (4, 4, 7)]);
        assert_eq!(both.motion, Some(HidReport::Motion([350, 0, 0, 0, 0, 0])));
        assert_eq!(both.buttons, Some(HidReport::Buttons(1 << 3)), "another button is nobody's");
        assert_eq!(
            frame(&mut stick, &[(EV_KEY, 0x120, 2)]),
            Frame::default(),
            "a key that repeats is not pressed again"
        );
        let let_go = frame(&mut stick, &[(EV_KEY, 0x120, 0), (EV_ABS, 0, 400)]);
        assert_eq!(let_go.buttons, Some(HidReport::Buttons(0)));
        assert_eq!((let_go.motion, stick.waits_for_silence()), (Some(HidReport::Motion([0; 6])), false));
    }

    #[test]
    fn a_deflection_is_repeated_while_the_device_chatters_of_something_else() {
        let mut stick = stick();
        let told = (1..=100)
            .filter(|k| frame_at(&mut stick, k * 1000, &[(EV_ABS, 0, 1000), (EV_ABS, 40, 7)]).motion.is_some());
        assert_eq!(told.count(), 7, "at once, and every 16 of 100 ms");
    }

    #[test]
    fn an_axis_that_the_device_does_not_have_is_named() {
        let profile = Profile::parse("stick.toml", STICK).expect("a profile");
        let answers = Answers(|_| AxisInfo::default(), Vec::new);
        let error = EvdevDecoder::new(&profile, &answers).expect_err("no range");
        assert!(error.contains("ABS_RZ"), "{error}");
    }

    #[test]
    fn a_device_that_is_deflected_when_it_is_opened_says_so() {
        let profile = Profile::parse("stick.toml", &STICK.replace("rest = 400", "rest = 255")).expect("a profile");
        let info = AxisInfo { value: 255, min: 0, max: 255, fuzz: 0, flat: 15 };
        let mut stick = EvdevDecoder::new(&profile, &Answers(|_| info, Vec::new)).expect("a decoder");
        assert_eq!(stick.on_silence(), Some(HidReport::Motion([0, 0, 0, 0, -350, 0])));
    }

    #[test]
    fn whatever_the_kernel_says_an_axis_stays_within_its_limit() {
        let more = "[[axis]]\nof = \"z\"\nfrom = \"REL_Y\"\nfull_counts_per_s = 3\n[[axis]]\nof = \"y\"\nplus = \"2\"\nminus = \"BTN_0\"\ndeflection = 1\n";
        let text = format!("release = \"KEY_ESC\"\n{STICK}{more}");
        let profile = Profile::parse("stick.toml", &text).expect("a profile");
        let state = std::cell::Cell::new(1_u64);
        let dice = || {
            state.set(state.get().wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407));
            let state = state.get();
            // Small numbers, the ends of the range, and anything between.
            match state >> 62 {
                0 => (state >> 40) as i32 & 0x1FF,
                1 => i32::MAX,
                2 => i32::MIN,
                _ => (state >> 24) as i32,
            }
        };
        let mut n_opened = 0;
        for _ in 0..20_000 {
            let info = |_| AxisInfo { value: dice(), min: dice(), max: dice(), fuzz: dice(), flat: dice() };
            let keys = || vec![dice() as u16 & 0x3ff];
            let Ok(mut stick) = EvdevDecoder::new(&profile, &Answers(info, keys)) else { continue };
            n_opened += 1;
            for _ in 0..20 {
                let (kind, code, value) = (dice() as u16 & 7, dice() as u16 & 0x127, dice());
                let event = InputEvent { stamp_us: i64::from(dice()) << 20, kind, code, value };
                if stick.take(event).is_err() {
                    continue;
                }
                assert!(stick.counts.iter().all(|counts| (-350..=350).contains(counts)), "{event:?} {stick:?}");
            }
        }
        assert!(n_opened > 1000, "{n_opened}");
    }
}
