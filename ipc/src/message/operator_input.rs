//! What the operator's hand asks for: published by `master`, read by `resolve`.

use super::{HopStamps, message};
use iceoryx2::prelude::ZeroCopySend;

/// The operator's motion after axis map, dead zone, response curve and scale.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.OperatorInput")]
pub struct OperatorInput {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Instant of the input, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// When each stage touched the sample.
    pub stamps: HopStamps,
    /// Wanted linear velocity of the tip, in the `view` frame (x right, y down, z away from the viewer), m/s; finite.
    pub tip_vel_in_view_m_per_s: [f64; 3],
    /// Wanted angular velocity of the tip, in the `view` frame, rad/s; finite. Zero where the machine has no such motion.
    pub tip_angular_vel_in_view_rad_per_s: [f64; 3],
    /// The device's own six axes of the newest report, in its counts (x, y, z, rx, ry, rz).
    pub raw_axes: [i16; 6],
    /// Bits of [`OperatorInput::OPERATOR_PRESENT`], [`OperatorInput::CLUTCH`], [`OperatorInput::TRANSLATION_LOCKED`],
    /// [`OperatorInput::ROTATION_LOCKED`], [`OperatorInput::FROM_PAD`], [`OperatorInput::HAND_JUMPED`], [`OperatorInput::JAW_OPENS`],
    /// [`OperatorInput::JAW_CLOSES`], [`OperatorInput::GIVEN_BACK`].
    pub flags: u32,
    /// The device's buttons, bit n = button n.
    pub buttons: u32,
    /// See [`DeviceState`].
    pub device_state: u32,
    /// The live scale that the velocities have been multiplied with, thousandths; 0 in recordings of before that was known.
    pub scale_permille: u32,
    /// Reports decoded since start.
    pub n_reports: u64,
    /// Reports since start that a newer one had already replaced when they were read.
    pub n_drained: u64,
    /// Reports since start that were refused (wrong length, unknown id, out of range).
    pub n_refused: u64,
}

message!(OperatorInput, "input", 1, super::EVERY_SAMPLE);

impl OperatorInput {
    /// Flag: the operator is present (dead-man held or toggled on). Nothing moves without it.
    pub const OPERATOR_PRESENT: u32 = 1;
    /// Flag: the clutch is pressed; the hand moves, the snake does not.
    pub const CLUTCH: u32 = 2;
    /// Flag: no translation is asked for, whatever the hand does.
    pub const TRANSLATION_LOCKED: u32 = 4;
    /// Flag: no rotation is asked for, whatever the hand does.
    pub const ROTATION_LOCKED: u32 = 8;
    /// Flag: the hand is on the drive pad of a page, whose axes are thousandths along view x and y.
    pub const FROM_PAD: u32 = 16;
    /// Flag: the pose of the hand jumped; it counts as gone until it has let go.
    pub const HAND_JUMPED: u32 = 32;
    /// Flag: the jaw of a gripper shall open while this holds.
    pub const JAW_OPENS: u32 = 64;
    /// Flag: it shall close; with both it stays.
    pub const JAW_CLOSES: u32 = 128;
    /// Flag: the device's user has given it back to the rest of the machine; nobody takes it again but another start.
    pub const GIVEN_BACK: u32 = 256;

    /// Whether the operator is present.
    pub fn operator_present(&self) -> bool {
        self.flags & Self::OPERATOR_PRESENT != 0
    }

    /// Whether the clutch is pressed.
    pub fn clutch_pressed(&self) -> bool {
        self.flags & Self::CLUTCH != 0
    }

    /// Whether the motion comes from the drive pad of a page.
    pub fn is_from_pad(&self) -> bool {
        self.flags & Self::FROM_PAD != 0
    }

    /// Part of the configured speed at which the hand moves the tip; `None` in a recording from before that was told.
    pub fn scale(&self) -> Option<f64> {
        (self.scale_permille != 0).then(|| f64::from(self.scale_permille) / 1000.0)
    }

    /// What is not taken from the hand, in words.
    pub fn locked(&self) -> impl Iterator<Item = &'static str> {
        let all = [(Self::TRANSLATION_LOCKED, "translation"), (Self::ROTATION_LOCKED, "rotation")];
        all.into_iter().filter(|(flag, _)| self.flags & flag != 0).map(|(_, what)| what)
    }

    /// Which way the jaw of a gripper is asked to go: 1 open, -1 closed, 0 neither.
    pub fn jaw_direction(&self) -> f64 {
        let asks = |flag| f64::from(u8::from(self.flags & flag != 0));
        asks(Self::JAW_OPENS) - asks(Self::JAW_CLOSES)
    }

    /// Whether the device was given back by its user.
    pub fn is_given_back(&self) -> bool {
        self.flags & Self::GIVEN_BACK != 0
    }

    /// The typed device state, or `None` for a value that no version of krait sends.
    pub fn device(&self) -> Option<DeviceState> {
        DeviceState::from_u32(self.device_state)
    }
}

/// What is known of the operator's device. A device at rest falls silent; so does an unplugged one: they are told apart.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceState {
    /// No report has arrived yet.
    Waiting = 0,
    /// Reports arrive.
    Live = 1,
    /// The last reports were zero and the device fell silent, as it does when nobody touches it.
    AtRest = 2,
    /// The device fell silent while deflected, or was unplugged: its last word must not be trusted.
    Lost = 3,
    /// The recording or script has been played to its end.
    Ended = 4,
}

impl DeviceState {
    /// The state for a value received from another process.
    pub fn from_u32(value: u32) -> Option<Self> {
        [Self::Waiting, Self::Live, Self::AtRest, Self::Lost, Self::Ended].into_iter().find(|s| *s as u32 == value)
    }
}
