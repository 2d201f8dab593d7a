//! The rumble of an open device: which motor turns for what, and the one effect of the kernel that it is played by.
//!
//! The effect ends by itself after a second, and the kernel stops it when the device is closed: a master that hangs or is killed leaves
//! nothing that shakes.

use crate::LightRole;
use crate::evdev_ioctl::{InputState, Motors};
use crate::lights::Lights;

/// Longest that the motors turn without being told again, ms; no pulse is longer.
const LENGTH_MS: u16 = 1000;

/// What a device rumbles for.
pub(crate) struct Rumble {
    strengths: Vec<(LightRole, f64)>,
    /// The effect's number in the kernel, once it has one.
    id: Option<i16>,
    turning: Motors,
}

impl Rumble {
    /// For a profile; nothing turns yet.
    pub(crate) fn new(strengths: &[(LightRole, f64)]) -> Self {
        Self { strengths: strengths.to_vec(), id: None, turning: Motors::default() }
    }

    /// Has the motors turn as they shall; the kernel is troubled only where that changes.
    pub(crate) fn show(&mut self, device: &impl InputState, lights: Lights) {
        self.turn(device, self.motors(lights));
    }

    /// Stops.
    pub(crate) fn rest(&mut self, device: &impl InputState) {
        self.turn(device, Motors::default());
    }

    /// Limit and fault turn both motors, load the strong one, compensation the weak one. Where several turn one, the strongest counts.
    fn motors(&self, lights: Lights) -> Motors {
        let strongest = |but: LightRole| {
            let own = self.strengths.iter().filter(|(role, _)| *role != but && lights.rumbles(*role));
            let part = own.map(|(_, strength)| *strength).fold(0.0, f64::max);
            // A part of the whole, at most 1.
            (part * f64::from(u16::MAX)).round() as u16
        };
        Motors { strong: strongest(LightRole::Compensation), weak: strongest(LightRole::Load) }
    }

    fn turn(&mut self, device: &impl InputState, motors: Motors) {
        if motors == self.turning {
            return;
        }
        self.turning = motors;
        let told = if motors == Motors::default() {
            self.id.map_or(Ok(()), |id| device.play(id, false))
        } else {
            device.put_rumble(self.id, motors, LENGTH_MS).and_then(|id| {
                self.id = Some(id);
                device.play(id, true)
            })
        };
        if let Err(error) = told {
            tracing::debug!(%error, "the device did not take its rumble");
        }
    }
}
