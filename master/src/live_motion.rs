//! The live scale and the locks of the operator's motion: asked for by a command or by the hand's own buttons. What was asked
//! for last counts.

use crate::MasterConfig;
use crate::presence::PressButton;
use krait_ipc::message::{MotionWish, OperatorInput};

/// How the hand's motion counts now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LiveMotion {
    /// Part of the configured speed, thousandths, within [`MotionWish::SCALE_PERMILLE`].
    pub scale_permille: u32,
    /// Bits of [`LiveMotion::LOCKS`].
    pub locks: u32,
}

impl Default for LiveMotion {
    /// At full scale, nothing locked.
    fn default() -> Self {
        Self { scale_permille: *MotionWish::SCALE_PERMILLE.end(), locks: 0 }
    }
}

impl LiveMotion {
    /// Every lock that there is.
    pub const LOCKS: u32 = OperatorInput::TRANSLATION_LOCKED | OperatorInput::ROTATION_LOCKED;
}

impl From<&OperatorInput> for LiveMotion {
    /// As an input says that it was.
    fn from(input: &OperatorInput) -> Self {
        Self { scale_permille: input.scale_permille, locks: input.flags & Self::LOCKS }
    }
}

/// Which buttons change it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Presses {
    fine: PressButton,
    fine_permille: u32,
    locks: [(PressButton, u32); 2],
}

impl Presses {
    pub(crate) fn new(config: &MasterConfig) -> Self {
        let locks = [
            (config.lock_translation, OperatorInput::TRANSLATION_LOCKED),
            (config.lock_rotation, OperatorInput::ROTATION_LOCKED),
        ];
        Self { fine: config.fine, fine_permille: (config.fine_scale * 1000.0).round() as u32, locks }
    }
}

impl LiveMotion {
    /// Takes a command's wish; one for what there is not changes nothing.
    pub(crate) fn wish(&mut self, wish: &MotionWish) {
        if wish.is_valid() {
            self.scale_permille = if wish.scale_permille == 0 { self.scale_permille } else { wish.scale_permille };
            self.locks = (self.locks | wish.lock) & !wish.unlock;
        }
    }

    /// Takes the buttons that were pressed since the report before: each press changes over.
    pub(crate) fn press(&mut self, presses: &Presses, pressed: u32) {
        if presses.fine.is_in(pressed) {
            let full = *MotionWish::SCALE_PERMILLE.end();
            self.scale_permille = if self.scale_permille == full { presses.fine_permille } else { full };
        }
        for (button, lock) in presses.locks {
            if button.is_in(pressed) {
                self.locks ^= lock;
            }
        }
    }

    /// A velocity at the live scale; nothing where its lock is set. At full scale it is the same to the last bit.
    pub(crate) fn scaled(&self, velocity: [f64; 3], lock: u32) -> [f64; 3] {
        match self.scale_permille {
            _ if self.locks & lock != 0 => [0.0; 3],
            1000 => velocity,
            permille => velocity.map(|v| v * f64::from(permille) / 1000.0),
        }
    }
}
