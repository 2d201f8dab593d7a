//! ROBOTIS Dynamixel XL330 servos: what their registers are, in position control mode.
//!
//! Problem: what tells of a servo stands all over its table, and reading all of it takes longer than a period.
//!
//! Intuition: its indirect registers gather what is read each cycle. They are forgotten without power, so an answer in which they point
//! nowhere is that of a servo that started anew; they are set again, and nothing has power before they are read. A servo that is told
//! nothing for `gives_up_ms` stops by its own bus watchdog, under power, and takes no goals until power is switched anew.
//!
//! Nobody acknowledges what all are told, so each answer has the limit of the torque and the watchdog: until both are as they were
//! told, a servo counts as unguarded, and nothing begins to move.
//!
//! Failure: a hardware error takes its power until it is rebooted, which power that is switched anew does.
//!
//! Source: ROBOTIS e-Manual, XL330-M288 and XL330-M077; with a homing offset the bus watchdog moves the motor
//! (github.com/ROBOTIS-GIT/DynamixelSDK/issues/584); indirect registers are forgotten (issue 375).

mod identity;
pub(crate) mod packet;
pub(crate) mod table;

use crate::bus::{BusGone, Goals, PerActuator, Seen, Trouble};
use crate::error::OpenError;
use crate::serial::{Ask, Block, Line, ServoMake, Servos, settings};
use crate::texts::{ELECTRICAL, HEAT, OVERLOAD, QUICK_STOPPED, SENSOR, SEVERAL, VOLTAGE};
use identity::Own;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::MAX_ACTUATORS;
use krait_slave::DriveConfig;
use table::{
    BUS_WATCHDOG, GOAL_PWM, HAS_GIVEN_UP, INDIRECT_ADDRESS, PLAIN, POINTERS, PROFILE_ACCELERATION, PROFILE_VELOCITY,
    Status, TORQUE_ENABLE, pointers,
};

pub(crate) use table::STATUS;

/// Model numbers that are known, and their names.
pub(crate) const MODELS: [(u16, &str); 2] = [(1200, "XL330-M288"), (1190, "XL330-M077")];
/// Bit rates that these servos can be set to, the usual ones first; 9600 is too slow for anything.
pub(crate) const BAUDS: [u32; 6] = [1_000_000, 57_600, 115_200, 2_000_000, 3_000_000, 4_000_000];
/// From the model number to the protocol.
pub(crate) const WHO: Block = Block { address: 0, n: 14 };
/// Speed and goal, 4 bytes each.
pub(crate) const GOAL_BYTES: usize = 8;
/// Step of the present current, A.
pub(crate) const CURRENT_STEP_A: f64 = 1e-3;
/// Step of a speed, 0.229 turns a minute, counts/s.
pub(crate) const VELOCITY_STEP_COUNTS_PER_S: f64 = 0.229 / 60.0 * 4096.0;
/// Unit of the bus watchdog, ms.
const WATCHDOG_MS: u32 = 20;
/// Starts a servo anew.
pub(crate) const REBOOT: u8 = 0x08;
/// So long that may take, ns.
const REBOOT_NS: i64 = 1_500_000_000;

/// What is remembered of them.
#[derive(Debug, Default)]
pub(crate) struct Xl330 {
    /// What each is set to; none: they are only read.
    own: Vec<Own>,
    pwm: PerActuator<u16>,
    watchdog: u8,
    /// Whose indirect registers pointed nowhere when it last answered.
    is_blank: PerActuator<bool>,
    /// Who has no power by a hardware error.
    is_shut_down: PerActuator<bool>,
    /// Whose error is forgiven: to be rebooted.
    is_forgiven: PerActuator<bool>,
    /// Until when each starts anew, ns.
    busy_until_ns: PerActuator<i64>,
}

impl Servos for Xl330 {
    fn identify(&mut self, line: &mut Line, who: &[Vec<u8>], config: &DriveConfig, how: Ask) -> Result<(), OpenError> {
        let own = identity::check(line, who, config, how)?;
        self.pwm = core::array::from_fn(|k| {
            let limits = config.actuator.get(k).zip(own.get(k));
            limits.map_or(0, |(actuator, own)| (actuator.torque_limit * f64::from(own.pwm_limit)).round() as u16)
        });
        self.watchdog = config.gives_up_ms.div_ceil(WATCHDOG_MS).min(127) as u8;
        line.set(INDIRECT_ADDRESS, |_| pointers())?;
        for (k, found) in settings(line, POINTERS, how)?.iter().enumerate() {
            if *found != pointers() {
                let id = line.ids[k];
                return Err(OpenError::NoPointers { actuator: k + 1, id });
            }
        }
        self.own = own;
        Ok(())
    }

    fn tell(&mut self, line: &mut Line, goals: &Goals) -> Result<(), BusGone> {
        line.set(PROFILE_VELOCITY, |k| self.goal_bytes(goals, k))
    }

    /// The goal before the power, so that nothing leaps when it comes; the limit of the torque, which a servo without power forgets.
    /// The watchdog is silenced first: until then a servo that has given up takes no goal.
    fn switch(&mut self, line: &mut Line, on: bool, goals: &Goals) -> Result<(), BusGone> {
        if !on {
            return line.set(TORQUE_ENABLE, |_| [0]);
        }
        // Where a servo stands that starts anew is not known yet.
        if self.is_anybody_starting(monotonic_ns()) {
            return Ok(());
        }
        line.set(BUS_WATCHDOG, |_| [0])?;
        line.set(GOAL_PWM, |k| self.pwm[k].to_le_bytes())?;
        line.set(PROFILE_ACCELERATION, |_| [0; 4])?;
        self.tell(line, goals)?;
        line.set(TORQUE_ENABLE, |_| [1])?;
        line.set(BUS_WATCHDOG, |_| [self.watchdog])
    }

    fn ask(&mut self, line: &mut Line, seen: &mut Seen) -> Result<(), BusGone> {
        if self.own.is_empty() {
            return ask_plainly(line, seen);
        }
        self.reboot(line)?;
        let enough = line.ask_all(STATUS)?;
        let now_ns = monotonic_ns();
        for (k, answer) in line.answers(STATUS.n) {
            let status = Status::of(&answer);
            (seen.has_answered[k], seen.sampled_ns[k]) = (true, now_ns);
            // No supply is that low.
            self.is_blank[k] = status.voltage == 0;
            if self.is_blank[k] {
                (seen.is_powered[k], seen.has_let_go[k], seen.trouble[k]) = (false, true, Trouble::None);
                seen.is_unguarded[k] = false;
            } else {
                take(k, &status, seen);
                self.is_shut_down[k] = status.hardware_error != 0 && !status.is_powered;
                let watches = [self.watchdog, HAS_GIVEN_UP].contains(&status.watchdog);
                seen.is_unguarded[k] = status.is_powered && !(watches && status.goal_pwm == self.pwm[k]);
            }
        }
        for k in 0..line.ids.len() {
            if seen.has_answered[k] {
                self.busy_until_ns[k] = 0;
            }
            seen.is_busy[k] = now_ns < self.busy_until_ns[k];
        }
        if !enough {
            line.recover()?;
        }
        if self.is_blank.contains(&true) {
            let is_blank = self.is_blank;
            line.set_of(|k| is_blank[k], INDIRECT_ADDRESS, |_| pointers())?;
        }
        // Nobody acknowledges what all are told: where the torque's limit or the watchdog was spoilt, both are said again.
        let is_to_be_told: PerActuator<bool> = core::array::from_fn(|k| seen.has_answered[k] && seen.is_unguarded[k]);
        if is_to_be_told.contains(&true) {
            line.set_of(|k| is_to_be_told[k], GOAL_PWM, |k| self.pwm[k].to_le_bytes())?;
            line.set_of(|k| is_to_be_told[k], BUS_WATCHDOG, |_| [self.watchdog])?;
        }
        Ok(())
    }

    fn look_again(&mut self) {
        self.is_forgiven = core::mem::take(&mut self.is_shut_down);
    }
}

impl Xl330 {
    fn is_anybody_starting(&self, now_ns: i64) -> bool {
        let waits = self.is_blank.iter().chain(&self.is_forgiven).any(|waits| *waits);
        waits || self.busy_until_ns.iter().any(|until_ns| now_ns < *until_ns)
    }

    /// Speed 0 would be the largest.
    fn goal_bytes(&self, goals: &Goals, k: usize) -> [u8; GOAL_BYTES] {
        let most = self.own.get(k).map_or(1, |own| own.velocity_limit.max(1));
        let steps = (goals.counts_per_s[k] / VELOCITY_STEP_COUNTS_PER_S).ceil();
        let speed = steps.clamp(1.0, f64::from(most)) as u32;
        let goal = goals.counts[k].clamp(0, ServoMake::COUNTS_PER_TURN - 1);
        let mut bytes = [0; GOAL_BYTES];
        bytes[..4].copy_from_slice(&speed.to_le_bytes());
        bytes[4..].copy_from_slice(&goal.to_le_bytes());
        bytes
    }

    /// Starts those anew whose hardware error is forgiven; they have no power.
    fn reboot(&mut self, line: &mut Line) -> Result<(), BusGone> {
        let is_forgiven = core::mem::take(&mut self.is_forgiven);
        for k in (0..line.ids.len()).filter(|k| is_forgiven[*k]) {
            self.busy_until_ns[k] = monotonic_ns() + REBOOT_NS;
            if !line.tell_one(line.ids[k], REBOOT)? {
                line.recover()?;
            }
        }
        Ok(())
    }
}

/// Reads servos of which nothing is known, and changes nothing.
fn ask_plainly(line: &mut Line, seen: &mut Seen) -> Result<(), BusGone> {
    let mut statuses = [Status::default(); MAX_ACTUATORS];
    let mut n_answers = [0; MAX_ACTUATORS];
    for (n, block) in PLAIN.into_iter().enumerate() {
        let enough = line.ask_all(block)?;
        for (k, answer) in line.answers(block.n) {
            statuses[k].take_plain(n, &answer);
            n_answers[k] += 1;
        }
        if !enough {
            line.recover()?;
        }
    }
    for k in (0..line.ids.len()).filter(|k| n_answers[*k] == PLAIN.len()) {
        (seen.has_answered[k], seen.sampled_ns[k]) = (true, monotonic_ns());
        take(k, &statuses[k], seen);
    }
    Ok(())
}

fn take(k: usize, status: &Status, seen: &mut Seen) {
    seen.is_powered[k] = status.is_powered;
    seen.goal_counts[k] = status.goal;
    seen.counts[k] = status.position;
    seen.current_a[k] = f64::from(status.current_ma) * CURRENT_STEP_A;
    seen.supply_v[k] = f64::from(status.voltage) * 0.1;
    seen.temperature_celsius[k] = status.temperature_celsius.into();
    seen.trouble[k] = trouble(status);
    seen.has_let_go[k] = !status.is_powered;
}

/// What hardware error and bus watchdog mean.
fn trouble(status: &Status) -> Trouble {
    let code = status.hardware_error;
    if code >> 5 & 1 == 1 && !status.is_powered {
        return Trouble::Limp;
    }
    let meaning = match code {
        0 if status.watchdog == HAS_GIVEN_UP => {
            return Trouble::Tripped { code: HAS_GIVEN_UP.into(), meaning: QUICK_STOPPED };
        }
        0 => return Trouble::None,
        0x01 => VOLTAGE,
        0x04 => HEAT,
        0x08 => SENSOR,
        0x10 => ELECTRICAL,
        0x20 => OVERLOAD,
        _ => SEVERAL,
    };
    Trouble::Tripped { code: code.into(), meaning }
}
