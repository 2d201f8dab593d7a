//! From the kernel's input events to the reports of a hand: ranges, rest, noise, signs. Pure, allocates nothing in a step.
//!
//! a = sign (|v - rest| - noise) / (end - rest - noise) towards either end of the range,   0 within the noise,   at most 1
//!
//! where: v: the device's value, counts; a: the hand's axis, as a part of the full deflection, written as counts of -350..=350
//! like every other hand's. A frame of events ends with a synchronisation event; only whole frames count.

use crate::evdev_names::axis_name;
use crate::{AXIS_LIMIT_COUNTS, HidReport, Profile, ProfileAxis, ProfileButton, WatchedAxis};

/// One event of the kernel, without its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct InputEvent {
    pub(crate) kind: u16,
    pub(crate) code: u16,
    pub(crate) value: i32,
}

/// Kinds and codes of linux/input-event-codes.h.
pub(crate) const EV_SYN: u16 = 0;
pub(crate) const EV_KEY: u16 = 1;
pub(crate) const EV_ABS: u16 = 3;
const SYN_REPORT: u16 = 0;
pub(crate) const SYN_DROPPED: u16 = 3;

/// Bytes of the time before kind, code and value.
const TIME_BYTES: usize = size_of::<libc::timeval>();

impl InputEvent {
    /// Bytes of one event as the kernel writes it.
    pub(crate) const N_BYTES: usize = TIME_BYTES + 8;

    /// Takes one event apart.
    pub(crate) fn decode(bytes: &[u8; Self::N_BYTES]) -> Self {
        let [.., k0, k1, c0, c1, v0, v1, v2, v3] = *bytes;
        Self {
            kind: u16::from_ne_bytes([k0, k1]),
            code: u16::from_ne_bytes([c0, c1]),
            value: i32::from_ne_bytes([v0, v1, v2, v3]),
        }
    }
}

/// What the kernel says of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct AxisInfo {
    pub(crate) value: i32,
    pub(crate) min: i32,
    pub(crate) max: i32,
    /// The noise that the driver filters, and the one around rest that it does not.
    pub(crate) fuzz: i32,
    pub(crate) flat: i32,
}

/// The kernel has thrown events away: what is held and pressed is not known any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EventsLost;

/// Follows one device.
#[derive(Debug)]
pub(crate) struct EvdevDecoder {
    axes: Vec<(ProfileAxis, Scale)>,
    buttons: Vec<ProfileButton>,
    counts: [i16; 6],
    bits: u32,
    told: ([i16; 6], u32),
}

/// What a frame of events has changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Frame {
    pub(crate) motion: Option<HidReport>,
    pub(crate) buttons: Option<HidReport>,
}

impl EvdevDecoder {
    /// A decoder for a device, whose axes are asked for one by one.
    ///
    /// # Errors
    /// One phrase: an axis that the device does not have, or one whose range is none.
    pub(crate) fn new(
        profile: &Profile,
        mut info_of: impl FnMut(u16) -> std::io::Result<AxisInfo>,
    ) -> Result<Self, String> {
        let (mut axes, mut counts) = (Vec::new(), [0; 6]);
        for axis in &profile.axes {
            let info = info_of(axis.code).map_err(|error| format!("axis {}: {error}", axis_name(axis.code)))?;
            let scale = Scale::new(axis, &info)?;
            counts[axis.axis_idx] = scale.counts(info.value);
            axes.push((*axis, scale));
        }
        Ok(Self { axes, buttons: profile.buttons.clone(), counts, bits: 0, told: ([0; 6], 0) })
    }

    /// Takes an event; the end of a frame gives what it has changed.
    ///
    /// # Errors
    /// [`EventsLost`]; the device is then to be opened anew.
    pub(crate) fn take(&mut self, event: InputEvent) -> Result<Option<Frame>, EventsLost> {
        match (event.kind, event.code) {
            (EV_SYN, SYN_DROPPED) => return Err(EventsLost),
            (EV_SYN, SYN_REPORT) => return Ok(Some(self.frame())),
            (EV_ABS, code) => {
                if let Some((axis, scale)) = self.axes.iter().find(|(axis, _)| axis.code == code) {
                    self.counts[axis.axis_idx] = scale.counts(event.value);
                }
            }
            (EV_KEY, code) => {
                if let Some(button) = self.buttons.iter().find(|button| button.code == code) {
                    // 2 is a key that repeats: it is still down.
                    let bit = 1 << button.button;
                    self.bits = if event.value == 0 { self.bits & !bit } else { self.bits | bit };
                }
            }
            _ => {}
        }
        Ok(None)
    }

    /// What has changed since the frame before.
    pub(crate) fn frame(&mut self) -> Frame {
        let (axes, bits) = std::mem::replace(&mut self.told, (self.counts, self.bits));
        Frame {
            motion: (axes != self.counts).then_some(HidReport::Motion(self.counts)),
            buttons: (bits != self.bits).then_some(HidReport::Buttons(self.bits)),
        }
    }

    /// Where the axes are, as a report of its own, while any is deflected.
    pub(crate) fn deflected(&self) -> Option<HidReport> {
        (self.counts != [0; 6]).then_some(HidReport::Motion(self.counts))
    }
}

impl ProfileAxis {
    /// The hand's deflection, counts of -350..=350, that the chain would make of the axis as it is now; none where the value is
    /// not known, or where profile and device do not fit.
    pub fn deflection_counts(&self, axis: &WatchedAxis) -> Option<i16> {
        let [min, max] = axis.range.unwrap_or_default();
        let value = axis.value?;
        let scale = Scale::new(self, &AxisInfo { value, min, max, fuzz: axis.noise, flat: 0 }).ok()?;
        Some(scale.counts(value))
    }
}

/// The range of one axis, counts of the device.
#[derive(Clone, Copy, Debug)]
struct Scale {
    low: f64,
    high: f64,
    rest: f64,
    noise: f64,
    sign: f64,
}

impl Scale {
    fn new(axis: &ProfileAxis, info: &AxisInfo) -> Result<Self, String> {
        let [low, high] = axis.range.unwrap_or([info.min, info.max]).map(f64::from);
        let name = axis_name(axis.code);
        if low >= high {
            return Err(format!("axis {name}, which the device does not have, or whose range it does not tell"));
        }
        let rest = axis.rest.map_or((low + high) / 2.0, f64::from);
        let noise = f64::from(axis.noise.unwrap_or(info.fuzz.max(info.flat)).max(0));
        if !(low..=high).contains(&rest) || noise > (high - low) / 4.0 {
            return Err(format!("axis {name} with rest {rest} and noise {noise} in the range {low} to {high}"));
        }
        Ok(Self { low, high, rest, noise, sign: if axis.is_negated { -1.0 } else { 1.0 } })
    }

    /// A value beyond the range is a full deflection.
    fn counts(&self, value: i32) -> i16 {
        let away = f64::from(value) - self.rest;
        let way = if away < 0.0 { self.rest - self.low } else { self.high - self.rest } - self.noise;
        if away.abs() <= self.noise || way <= 0.0 {
            return 0;
        }
        let part = ((away.abs() - self.noise) / way).min(1.0);
        (self.sign * away.signum() * part * f64::from(AXIS_LIMIT_COUNTS)).round() as i16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) const STICK: &str = "name = \"Stick\"\nid = \"046d:c215\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\nrange = [0, 1000]\nrest = 400\nnoise = 20\n[[axis]]\nof = \"ry\"\nfrom = \"ABS_RZ\"\nsign = \"-\"\n[[button]]\nof = 3\nfrom = \"BTN_TRIGGER\"\n";

    fn stick() -> EvdevDecoder {
        let profile = Profile::parse("stick.toml", STICK).expect("a profile");
        let info = AxisInfo { value: 128, min: 0, max: 255, fuzz: 0, flat: 15 };
        let at_rest = |code| Ok(if code == 0 { AxisInfo { value: 400, ..AxisInfo::default() } } else { info });
        EvdevDecoder::new(&profile, at_rest).expect("a decoder")
    }

    fn frame(decoder: &mut EvdevDecoder, events: &[(u16, u16, i32)]) -> Frame {
        for &(kind, code, value) in events {
            assert_eq!(decoder.take(InputEvent { kind, code, value }), Ok(None));
        }
        decoder.take(InputEvent { kind: EV_SYN, code: SYN_REPORT, value: 0 }).expect("whole").expect("a frame")
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
        assert_eq!((let_go.motion, stick.deflected()), (Some(HidReport::Motion([0; 6])), None));
    }

    #[test]
    fn events_that_the_kernel_has_dropped_are_a_loss() {
        assert_eq!(stick().take(InputEvent { kind: EV_SYN, code: SYN_DROPPED, value: 0 }), Err(EventsLost));
    }

    #[test]
    fn an_axis_that_the_device_does_not_have_is_named() {
        let profile = Profile::parse("stick.toml", STICK).expect("a profile");
        let error = EvdevDecoder::new(&profile, |_| Ok(AxisInfo::default())).expect_err("no range");
        assert!(error.contains("ABS_RZ"), "{error}");
    }

    #[test]
    fn a_device_that_is_deflected_when_it_is_opened_says_so() {
        let profile = Profile::parse("stick.toml", STICK).expect("a profile");
        let info = AxisInfo { value: 255, min: 0, max: 255, fuzz: 0, flat: 15 };
        let mut stick = EvdevDecoder::new(&profile, |_| Ok(info)).expect("a decoder");
        assert_eq!(stick.frame().motion, stick.deflected());
        assert!(stick.deflected().is_some());
    }

    #[test]
    fn whatever_the_kernel_says_an_axis_stays_within_its_limit() {
        let profile = Profile::parse("stick.toml", STICK).expect("a profile");
        let mut state = 1_u64;
        let mut dice = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
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
            let mut info = || AxisInfo { value: dice(), min: dice(), max: dice(), fuzz: dice(), flat: dice() };
            let Ok(mut stick) = EvdevDecoder::new(&profile, |_| Ok(info())) else { continue };
            n_opened += 1;
            for _ in 0..20 {
                let event = InputEvent { kind: dice() as u16 & 7, code: dice() as u16 & 0x127, value: dice() };
                if stick.take(event).is_err() {
                    continue;
                }
                assert!(stick.counts.iter().all(|counts| (-350..=350).contains(counts)), "{event:?} {stick:?}");
            }
        }
        assert!(n_opened > 1000, "{n_opened}");
    }
}
