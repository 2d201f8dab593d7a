//! Feetech STS3215 servos: what their registers are.
//!
//! Nobody acknowledges what all are told, so each answer has the limit of the torque: until it is as it was told, a servo counts as
//! unguarded, and nothing begins to move.
//!
//! Source: the maker's memory table of the STS3215 (registers, units) and communication protocol manual.

mod identity;
pub(crate) mod packet;

use crate::bus::{BusGone, Goals, PerActuator, Seen, Trouble};
use crate::error::OpenError;
use crate::serial::{Answer, Ask, Block, Line, ServoMake, Servos, word};
use crate::texts::{CURRENT, HEAT, SENSOR, SEVERAL, VOLTAGE};
use krait_ipc::clock::monotonic_ns;
use krait_slave::DriveConfig;
use packet::signed;

/// Model number of an STS3215, and its name.
pub(crate) const MODELS: [(u16, &str); 1] = [(777, "STS3215")];
/// Bit rates that these servos can be set to, the usual one first.
pub(crate) const BAUDS: [u32; 8] = [1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400];
/// From the firmware to the mode.
pub(crate) const WHO: Block = Block { address: 0, n: 34 };
/// Power of the motor: 0 off, 1 on.
const TORQUE_ENABLE: u8 = 40;
/// Acceleration (1 byte), goal, time and speed (2 bytes each).
const GOAL: u8 = 41;
/// So many registers.
pub(crate) const GOAL_BYTES: usize = 7;
/// Largest torque, per mille of the servo's own; forgotten without power.
const TORQUE_LIMIT: u8 = 48;
/// What is read each cycle: from torque enable to present current.
pub(crate) const STATUS: Block = Block { address: TORQUE_ENABLE, n: 31 };
/// Step of the present current, A.
pub(crate) const CURRENT_STEP_A: f64 = 6.5e-3;

/// Largest torque that the servo keeps without power, per mille.
const MOST_TORQUE: usize = 16;

/// What is remembered of them.
#[derive(Debug, Default)]
pub(crate) struct Sts3215 {
    /// None: they are only read.
    limits: Option<Limits>,
}

/// Limits of the torque, per mille.
#[derive(Clone, Copy, Debug)]
struct Limits {
    told: PerActuator<u16>,
    /// What a servo may make of it that bounds it by its own.
    least: PerActuator<u16>,
}

impl Limits {
    fn of(who: &[Vec<u8>], config: &DriveConfig) -> Self {
        let told = core::array::from_fn(|k| {
            config.actuator.get(k).map_or(0, |actuator| (actuator.torque_limit * 1000.0).round() as u16)
        });
        let own = |k: usize| who.get(k).map_or(u16::MAX, |data| word(data, MOST_TORQUE));
        Self { told, least: core::array::from_fn(|k| told[k].min(own(k))) }
    }

    fn has(&self, k: usize, limit: u16) -> bool {
        limit == self.told[k] || limit == self.least[k]
    }
}

impl Servos for Sts3215 {
    fn identify(&mut self, _: &mut Line, who: &[Vec<u8>], config: &DriveConfig, _: Ask) -> Result<(), OpenError> {
        self.limits = Some(Limits::of(who, config));
        identity::check(who, config)
    }

    fn tell(&mut self, line: &mut Line, goals: &Goals) -> Result<(), BusGone> {
        line.set(GOAL, |k| goal_bytes(goals, k))
    }

    /// The goal before the power, so that nothing leaps when it comes; the torque limit, which a servo without power forgets.
    fn switch(&mut self, line: &mut Line, on: bool, goals: &Goals) -> Result<(), BusGone> {
        if on {
            if let Some(Limits { told, .. }) = self.limits {
                line.set(TORQUE_LIMIT, |k| told[k].to_le_bytes())?;
            }
            self.tell(line, goals)?;
        }
        line.set(TORQUE_ENABLE, |_| [u8::from(on)])
    }

    fn ask(&mut self, line: &mut Line, seen: &mut Seen) -> Result<(), BusGone> {
        let enough = line.ask_all(STATUS)?;
        let now_ns = monotonic_ns();
        for (k, answer) in line.answers(STATUS.n) {
            take_status(k, &answer, now_ns, seen);
            let limit = word(&answer.data, usize::from(TORQUE_LIMIT - STATUS.address));
            let is_bounded = self.limits.is_none_or(|limits| limits.has(k, limit));
            seen.is_unguarded[k] = seen.is_powered[k] && !is_bounded;
        }
        if !enough {
            line.recover()?;
        }
        self.tell_limits_again(line, seen)
    }
}

impl Sts3215 {
    /// Who answers with another limit of the torque than it was told hears it again.
    fn tell_limits_again(&self, line: &mut Line, seen: &Seen) -> Result<(), BusGone> {
        let Some(Limits { told, .. }) = self.limits else { return Ok(()) };
        let is_to_be_told: PerActuator<bool> = core::array::from_fn(|k| seen.has_answered[k] && seen.is_unguarded[k]);
        if is_to_be_told.contains(&true) {
            line.set_of(|k| is_to_be_told[k], TORQUE_LIMIT, |k| told[k].to_le_bytes())?;
        }
        Ok(())
    }
}

/// Acceleration 0 is the largest; the slave's gate has limited it.
fn goal_bytes(goals: &Goals, k: usize) -> [u8; GOAL_BYTES] {
    let [low, high] = (goals.counts[k].clamp(0, ServoMake::COUNTS_PER_TURN - 1) as u16).to_le_bytes();
    // Speed 0 would be the largest speed.
    let [slow, fast] = (goals.counts_per_s[k].clamp(1.0, 32_767.0) as u16).to_le_bytes();
    [0, low, high, 0, 0, slow, fast]
}

fn take_status(k: usize, answer: &Answer, now_ns: i64, seen: &mut Seen) {
    let at = |register: u8| usize::from(register - STATUS.address);
    let register = |address: u8| word(&answer.data, at(address));
    let (load, current) = (signed(register(60), 10), signed(register(69), 15));
    seen.has_answered[k] = true;
    seen.sampled_ns[k] = now_ns;
    seen.is_powered[k] = answer.data[at(TORQUE_ENABLE)] == 1;
    seen.goal_counts[k] = signed(register(42), 15);
    seen.counts[k] = signed(register(56), 15);
    // Some firmwares give the current without its direction; the duty has it always.
    let direction = if load < 0 { -1.0 } else { 1.0 };
    seen.current_a[k] = f64::from(current.abs()) * CURRENT_STEP_A * direction;
    seen.supply_v[k] = f64::from(answer.data[at(62)]) * 0.1;
    seen.temperature_celsius[k] = f64::from(answer.data[at(63)]);
    seen.trouble[k] = trouble(answer.error);
    seen.has_let_go[k] = !seen.is_powered[k];
}

/// What the error byte of an answer means.
fn trouble(error: u8) -> Trouble {
    if error >> 5 & 1 == 1 {
        return Trouble::Limp;
    }
    let meaning = match error {
        0 => return Trouble::None,
        0x01 => VOLTAGE,
        0x02 => SENSOR,
        0x04 => HEAT,
        0x08 => CURRENT,
        _ => SEVERAL,
    };
    Trouble::Tripped { code: error.into(), meaning }
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_slave::ActuatorConfig;

    #[test]
    fn a_limit_that_a_servo_bounds_by_its_own_counts_as_told_and_any_other_does_not() {
        let actuator = vec![ActuatorConfig { torque_limit: 0.5, ..ActuatorConfig::default() }; 2];
        let mut who = vec![vec![0; WHO.n]; 2];
        for (data, most) in who.iter_mut().zip([1000_u16, 300]) {
            data[MOST_TORQUE..MOST_TORQUE + 2].copy_from_slice(&most.to_le_bytes());
        }
        let limits = Limits::of(&who, &DriveConfig { actuator, ..DriveConfig::default() });
        assert_eq!([0, 300, 499, 500, 1000].map(|limit| limits.has(0, limit)), [false, false, false, true, false]);
        assert_eq!([0, 300, 499, 500, 1000].map(|limit| limits.has(1, limit)), [false, true, false, true, false]);
    }
}
