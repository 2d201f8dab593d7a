//! Makes the shipped recording: a synthetic operator at a SpaceNavigator, so that the demonstration needs no hardware and
//! everybody's first run is the same. `cargo run -p krait-master --example generate_recording` writes it anew.
//!
//! The operator plans a bend over time ([`crate::plan`]), sees (without delay) what the snake's setpoint has become, and
//! pushes the cap with the velocity that leads there, through the inverse of the default operator mapping. A rate
//! controller: deflection is tip velocity. On top comes a tremor near 9 and 11 Hz and one count of noise, from a fixed seed.

use crate::arc;
use crate::plan::{Act, end_s, plan_at};
use krait_master::{AXIS_LIMIT_COUNTS, HidRecordingWriter, HidReport, Layout, MasterConfig, RecordingHeader, Response};
use std::io;

/// The device sends one report per 8 ms.
const SLOT_S: f64 = 0.008;
/// A pair of halves, translation then rotation.
const PAIR_S: f64 = 2.0 * SLOT_S;
/// After the cap is let go the device sends this many pairs of zeros and falls silent.
const N_ZERO_PAIRS: u32 = 3;
/// How strongly the operator corrects what is seen, 1/s.
const CORRECTION_PER_S: f64 = 2.0;
/// When presence is switched on, s, and for how long its button is down.
const PRESENCE_AT_S: f64 = 0.4;
const PRESS_S: f64 = 0.1;
/// What the cap is moved by while the clutch is pressed, counts.
const CLUTCHED_COUNTS: f64 = 140.0;
const TREMOR_COUNTS: f64 = 2.5;
const TREMOR_HZ: [f64; 2] = [8.7, 11.3];
/// How far a report's stamp is off its slot at most, ns.
const JITTER_NS: u64 = 200_000;
const SEED: u64 = 20_060_515;

/// The text of the shipped recording, made anew.
///
/// # Errors
/// None in practice: it writes to memory.
pub fn shipped_recording_text() -> io::Result<Vec<u8>> {
    let header = RecordingHeader {
        vendor_id: 0x046d,
        product_id: 0xc626,
        layout: Some(Layout::Split),
        beside: Vec::new(),
        notes: NOTES.map(str::to_owned).to_vec(),
    };
    let mut device = Device { out: HidRecordingWriter::new(Vec::new(), &header)?, slot: 0, random: Random(SEED) };
    let mut hand = Hand { response: Response::new(&MasterConfig::default()), bend_rad: [0.0; 2], buttons: 0 };
    let mut n_zero_pairs = 0;
    while device.time_s() < end_s() + 2.0 * PRESS_S + 0.1 {
        let time_s = device.time_s();
        let buttons = buttons_at(time_s);
        if buttons != hand.buttons {
            hand.buttons = buttons;
            device.send(HidReport::Buttons(buttons))?;
            // The button took a slot of its own; the axes of the last pair held on for it.
            continue;
        }
        let axes = hand.push(time_s, &mut device.random);
        n_zero_pairs = if axes == [0; 6] { n_zero_pairs + 1 } else { 0 };
        if n_zero_pairs > N_ZERO_PAIRS {
            device.slot += 2;
            continue;
        }
        let [x, y, z, rx, ry, rz] = axes;
        device.send(HidReport::Translation([x, y, z]))?;
        device.send(HidReport::Rotation([rx, ry, rz]))?;
    }
    device.out.finish()
}

const NOTES: [&str; 8] = [
    "This is not a human hand and not a real device: a synthetic operator made it (krait-master, src/generate.rs).",
    "It sends what a SpaceNavigator sends: one report per 8 ms, translation and rotation in turn,",
    "three pairs of zeros when the cap is let go, then silence; buttons in reports of their own.",
    "Minimum-jerk strokes bend a 26 mm snake up to 55 deg, with reversals, plane rotations, rests and a clutch.",
    "The hand pushes with the tip's velocity (default axis map, dead zone, curve and scale of krait master),",
    "corrects what it sees without delay, and trembles by a few counts near 9 and 11 Hz from a fixed seed.",
    "Stamps are off their 8 ms grid by up to 0.2 ms. Button 0 at 0.4 s: operator present. Button 1: clutch.",
    "The first 17 s hold every kind of motion; cargo run -p krait-master --example generate_recording makes it anew.",
];

/// The buttons that are down: presence is pressed at the beginning and at the end, the clutch around its part.
fn buttons_at(time_s: f64) -> u32 {
    let is_pressed = |from_s: f64| (from_s..from_s + PRESS_S).contains(&time_s);
    let presence = is_pressed(PRESENCE_AT_S) || is_pressed(end_s());
    let clutch = plan_at(time_s).act == Act::Clutch;
    u32::from(presence) | (u32::from(clutch) << 1)
}

/// The device's clock and output.
struct Device {
    out: HidRecordingWriter<Vec<u8>>,
    slot: u32,
    random: Random,
}

impl Device {
    fn time_s(&self) -> f64 {
        f64::from(self.slot) * SLOT_S
    }

    fn send(&mut self, report: HidReport) -> io::Result<()> {
        let jitter_ns = if self.slot == 0 { 0 } else { self.random.below(JITTER_NS) };
        let stamp_ns = i64::from(self.slot) * 8_000_000 + jitter_ns as i64;
        self.slot += 1;
        self.out.push(stamp_ns, report.encode().as_bytes())
    }
}

/// The operator's hand, and the bend that its own pushing has led to.
struct Hand {
    response: Response,
    bend_rad: [f64; 2],
    buttons: u32,
}

impl Hand {
    /// The six axes for one pair of reports, counts.
    fn push(&mut self, time_s: f64, random: &mut Random) -> [i16; 6] {
        let (now, next) = (plan_at(time_s), plan_at(time_s + PAIR_S));
        let mut axes = match now.act {
            Act::Rest => return [0; 6],
            Act::Clutch => clutched_axes(now.progress),
            Act::Stroke => self.response.axes_for(self.wanted_tip_vel_m_per_s(now.bend_rad, next.bend_rad)),
        };
        for (idx, axis) in axes.iter_mut().enumerate() {
            // Only the translation trembles visibly; turning is what the fingers add without wanting to.
            let amplitude = if idx < 3 { TREMOR_COUNTS } else { 2.0 * TREMOR_COUNTS };
            let noise = amplitude * tremor(time_s, idx) + random.below(3) as f64 - 1.0;
            let limit = f64::from(AXIS_LIMIT_COUNTS);
            *axis = (f64::from(*axis) + noise).round().clamp(-limit, limit) as i16;
        }
        if now.act == Act::Stroke {
            let vel = self.response.tip_vel_in_view_m_per_s(axes);
            let rate = arc::bend_vel_rad_per_s(self.bend_rad, vel);
            self.bend_rad = std::array::from_fn(|k| self.bend_rad[k] + PAIR_S * rate[k]);
        }
        axes
    }

    fn wanted_tip_vel_m_per_s(&self, now_rad: [f64; 2], next_rad: [f64; 2]) -> [f64; 3] {
        let rate: [f64; 2] = std::array::from_fn(|k| {
            (next_rad[k] - now_rad[k]) / PAIR_S + CORRECTION_PER_S * (now_rad[k] - self.bend_rad[k])
        });
        arc::tip_vel_in_base_m_per_s(self.bend_rad, rate)
    }
}

/// Out and back to the side and up, begun after the clutch is down and over before it is released.
fn clutched_axes(progress: f64) -> [i16; 6] {
    let push =
        (CLUTCHED_COUNTS * (std::f64::consts::TAU * ((progress - 0.2) / 0.6).clamp(0.0, 1.0)).sin()).round() as i16;
    [push, 0, -push / 2, 0, 0, 0]
}

/// -1..=1, another phase for each axis.
fn tremor(time_s: f64, axis_idx: usize) -> f64 {
    let phase = axis_idx as f64 * 2.1;
    let wave = |hz: f64| (std::f64::consts::TAU * hz * time_s + phase).sin();
    0.5 * (wave(TREMOR_HZ[0]) + wave(TREMOR_HZ[1]))
}

/// SplitMix64 (Steele, Lea and Flood 2014): the same numbers on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % limit
    }
}
