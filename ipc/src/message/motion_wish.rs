//! How anybody of the same user asks for another scale or lock of the operator's motion: the master takes it with its next
//! input, which says so.

use super::{OperatorInput, message};
use iceoryx2::prelude::ZeroCopySend;

/// Processes that may ask at the same time.
const MAX_ASKING: usize = 8;

/// A wish; read by the master. What it changes stands in every [`OperatorInput`] from then on.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.MotionWish")]
pub struct MotionWish {
    /// Position among the wishes of this sender, from 1.
    pub sequence: u64,
    /// When it was asked for, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// The scale, thousandths, [`MotionWish::SCALE_PERMILLE`]; 0: as it is.
    pub scale_permille: u32,
    /// Locks to set, bits as in [`OperatorInput::flags`].
    pub lock: u32,
    /// Locks to open.
    pub unlock: u32,
    /// Process id of the sender.
    pub sender_pid: u32,
}

message!(MotionWish, "motion_wish", 1, super::RARE, MAX_ASKING);

impl MotionWish {
    /// The scales that can be asked for, thousandths: never faster than configured.
    pub const SCALE_PERMILLE: core::ops::RangeInclusive<u32> = 10..=1000;
    /// Every lock.
    pub const LOCKS: u32 = OperatorInput::TRANSLATION_LOCKED | OperatorInput::ROTATION_LOCKED;

    /// Whether it asks for what there is.
    pub fn is_valid(&self) -> bool {
        let is_scale = self.scale_permille == 0 || Self::SCALE_PERMILLE.contains(&self.scale_permille);
        is_scale && (self.lock | self.unlock) & !Self::LOCKS == 0 && self.lock & self.unlock == 0
    }
}
