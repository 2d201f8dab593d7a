//! Which model it is: a hash of what a model says, so that two processes never mean two machines by one chain.
//!
//! It covers the machine, the effects in their order with every value, and what is learnt and how. It does not cover the
//! bytes of the file, comments, the history, or where a value came from.

use crate::gripper::{Gripper, GripperNumbers};
use crate::model_file::{ForceMachine, Joints};
use crate::segments::{LineParameters, SegmentParameters, SegmentsParameters};
use crate::{ChainSettings, EffectSetting, MachineParameters};
use core::fmt;
use sha2::{Digest, Sha256};

/// The first eight bytes of the SHA-256 of a model's content; 16 hexadecimal digits in text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModelHash(pub u64);

impl fmt::Display for ModelHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// What goes into a hash: words and numbers, each with its length or its bits, so that no two lists run together.
struct Content(Sha256);

impl Content {
    fn word(&mut self, word: &str) {
        self.0.update((word.len() as u64).to_be_bytes());
        self.0.update(word);
    }

    /// Zero is one number, whatever its sign.
    fn number(&mut self, value: f64) {
        self.0.update((value + 0.0).to_bits().to_be_bytes());
    }

    fn numbers(&mut self, values: impl IntoIterator<Item = f64>) {
        values.into_iter().for_each(|value| self.number(value));
    }

    fn effects(&mut self, effects: &[EffectSetting]) {
        for effect in effects {
            self.word(effect.kind().name());
            if let Some(formula) = effect.formula_text() {
                [&formula.name, formula.hook.word(), &formula.text].into_iter().for_each(|word| self.word(word));
                formula.columns.iter().flat_map(|own| [&own.name, &own.column]).for_each(|word| self.word(word));
            }
            if let Some(own) = effect.varying() {
                ["by", own.parameter, &own.column].into_iter().for_each(|word| self.word(word));
                self.number(own.at);
            }
            for ((name, value), learn) in effect.parameter_names().zip(effect.values()).zip(effect.learns()) {
                self.word(name);
                self.number(*value);
                if let Some(learn) = learn {
                    self.word("learn");
                    self.numbers([learn.sd, learn.memory_s]);
                }
            }
        }
    }

    fn end(self) -> ModelHash {
        let digest = self.0.finalize();
        ModelHash(digest.iter().take(8).fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    }
}

/// Of a snake.
pub(crate) fn of_snake(
    machine: &MachineParameters,
    settings: ChainSettings,
    effects: &[EffectSetting],
    gripper: Option<&Gripper>,
) -> ModelHash {
    let mut content = Content(Sha256::new());
    content.word("snake");
    let MachineParameters { l_m, r_m, e_pa, d_outer_m, d_inner_m, l_d_m, l_c_m, phi_rad, rigid_lines } = *machine;
    let ChainSettings { strain_limit, transition_m } = settings;
    content.numbers([l_m, r_m, e_pa, d_outer_m, d_inner_m, l_d_m, l_c_m, phi_rad, strain_limit, transition_m]);
    content.word(if rigid_lines { "rigid" } else { "elastic" });
    content.effects(effects);
    if let Some(gripper) = gripper {
        content.word("gripper");
        let GripperNumbers { wire_m_per_rad, range_deg: [closed_deg, open_deg], max_vel_deg_per_s } =
            *gripper.numbers();
        content.numbers([wire_m_per_rad, closed_deg, open_deg, max_vel_deg_per_s]);
        content.effects(gripper.effects());
    }
    content.end()
}

/// Of segments.
pub(crate) fn of_segments(machine: &SegmentsParameters, effects: &[EffectSetting]) -> ModelHash {
    let mut content = Content(Sha256::new());
    content.word("segments");
    let SegmentsParameters { segments, phi_rad, rigid_lines, preload_n, low_n, high_n, settings } = machine;
    let ChainSettings { strain_limit, transition_m } = *settings;
    content.numbers([*phi_rad, *preload_n, *low_n, *high_n, strain_limit, transition_m]);
    content.word(if *rigid_lines { "rigid" } else { "elastic" });
    content.numbers([segments.len() as f64]);
    for segment in segments {
        let SegmentParameters { l_m, e_pa, d_outer_m, d_inner_m, l_d_m, l_c_m, lines } = segment;
        content.numbers([*l_m, *e_pa, *d_outer_m, *d_inner_m, *l_d_m, *l_c_m, lines.len() as f64]);
        for LineParameters { azimuth_rad, radius_m } in lines {
            content.numbers([*azimuth_rad, *radius_m]);
        }
    }
    content.effects(effects);
    content.end()
}

/// Of joints.
pub(crate) fn of_joints(joints: &Joints, effects: &[EffectSetting]) -> ModelHash {
    let mut content = Content(Sha256::new());
    content.word("joints");
    // What is known of gain and offset says where their values come from, and nothing about the machine.
    let Joints { n, gain, gain_known: _, offset, offset_known: _, u_unit, y_unit } = joints;
    content.numbers([*n as f64]);
    content.numbers(gain.iter().flatten().copied());
    content.numbers(offset.iter().copied());
    [u_unit, y_unit].into_iter().for_each(|unit| content.word(unit));
    content.effects(effects);
    content.end()
}

/// Of a machine of kind force.
pub(crate) fn of_force(force: &ForceMachine, effects: &[EffectSetting]) -> ModelHash {
    let mut content = Content(Sha256::new());
    content.word("force");
    content.numbers([force.n as f64]);
    content.word(force.unit.word());
    content.effects(effects);
    content.end()
}
