//! The hand of whoever drives from a page: published by `console` while a page holds its drive pad, judged by `master`.

use super::message;
use iceoryx2::prelude::ZeroCopySend;

/// What a page's drive pad said at one instant. It counts for a short while only, so a page that falls silent drives nothing.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.DriveWish")]
pub struct DriveWish {
    /// Position among the wishes of this console, from 1.
    pub sequence: u64,
    /// When the hand was like this, CLOCK_MONOTONIC, nanoseconds; never later than when the console heard of it.
    pub sample_ns: i64,
    /// Which page of this console, from 1.
    pub page: u64,
    /// Position among what this page said, from 1; 0 where the console lets go for it.
    pub frame: u64,
    /// Process id of the console.
    pub sender_pid: u32,
    /// Bits of [`DriveWish::HELD`], [`DriveWish::JAW_OPENS`], [`DriveWish::JAW_CLOSES`].
    pub flags: u32,
    /// Deflection along x (right) and y (down) of the `view` frame, thousandths of the full one, [`DriveWish::FULL_PERMILLE`].
    pub deflection_permille: [i32; 2],
}

message!(DriveWish, "drive_wish", 2, super::RARE);

impl DriveWish {
    /// Flag: the pad is held. Nothing moves without it.
    pub const HELD: u32 = 1;
    /// Flag: the jaw of a gripper shall open while the pad is held; with [`DriveWish::JAW_CLOSES`] beside it, it stays.
    pub const JAW_OPENS: u32 = 2;
    /// Flag: the jaw of a gripper shall close while the pad is held.
    pub const JAW_CLOSES: u32 = 4;
    /// How long a held pad counts, ns from the instant that the wish is about.
    pub const LEASE_NS: i64 = 150_000_000;
    /// A full deflection, thousandths.
    pub const FULL_PERMILLE: i32 = 1000;

    /// Whether the pad is held.
    pub fn is_held(&self) -> bool {
        self.flags & Self::HELD != 0
    }

    /// Whether the jaw shall open, and whether it shall close.
    pub fn jaw(&self) -> [bool; 2] {
        [Self::JAW_OPENS, Self::JAW_CLOSES].map(|flag| self.flags & flag != 0)
    }

    /// Whether it says what a pad can say.
    pub fn is_valid(&self) -> bool {
        let is_within = |permille: i32| (-Self::FULL_PERMILLE..=Self::FULL_PERMILLE).contains(&permille);
        self.flags & !(Self::HELD | Self::JAW_OPENS | Self::JAW_CLOSES) == 0
            && self.deflection_permille.into_iter().all(is_within)
    }
}
