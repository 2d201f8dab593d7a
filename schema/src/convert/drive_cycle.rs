//! Mirror of a cycle of the bus. Only the actuators that there are take room.

use super::Mirrored;
use crate::proto;
use krait_ipc::message::{ActuatorCycle, DriveCycle, MAX_ACTUATORS};

impl Mirrored for DriveCycle {
    type Mirror = proto::DriveCycle;

    fn mirror(&self) -> proto::DriveCycle {
        proto::DriveCycle {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            answered_ns: self.answered_ns,
            cycle: self.cycle,
            n_left_out: self.n_left_out,
            wish_ns: self.wish_ns,
            turn: self.turn,
            flags: self.flags,
            phase: self.phase,
            failure: self.failure.cast_signed(),
            failure_actuator: self.failure_actuator,
            failure_text: self.failure_text,
            actuators: self.actuators().iter().map(mirror_of).collect(),
        }
    }

    fn restore(mirror: &proto::DriveCycle) -> Result<Self, String> {
        let mut actuators = [ActuatorCycle::default(); MAX_ACTUATORS];
        let n = mirror.actuators.len();
        let Some(own) = actuators.get_mut(..n) else {
            return Err(format!("{n} actuators in a cycle, expected at most {MAX_ACTUATORS}"));
        };
        for (own, mirror) in own.iter_mut().zip(&mirror.actuators) {
            *own = actuator_of(mirror);
        }
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            answered_ns: mirror.answered_ns,
            cycle: mirror.cycle,
            n_left_out: mirror.n_left_out,
            wish_ns: mirror.wish_ns,
            turn: mirror.turn,
            flags: mirror.flags,
            phase: mirror.phase,
            failure: mirror.failure.cast_unsigned(),
            failure_actuator: mirror.failure_actuator,
            failure_text: mirror.failure_text,
            n_actuators: n as u32,
            actuators,
        })
    }
}

fn mirror_of(own: &ActuatorCycle) -> proto::ActuatorCycle {
    proto::ActuatorCycle {
        wish_q_m: own.wish_q_m,
        sampled_ns: own.sampled_ns,
        told_counts: own.told_counts,
        told_counts_per_s: own.told_counts_per_s,
        goal_counts: own.goal_counts,
        counts: own.counts,
        current_a: own.current_a,
        torque_nm: own.torque_nm,
        temperature_celsius: own.temperature_celsius,
        supply_v: own.supply_v,
        n_boots: own.n_boots,
        flags: own.flags,
        state: own.state.cast_signed(),
        trouble: own.trouble,
        trouble_code: own.trouble_code,
        trouble_text: own.trouble_text,
        emergency_code: own.emergency_code,
    }
}

fn actuator_of(mirror: &proto::ActuatorCycle) -> ActuatorCycle {
    ActuatorCycle {
        wish_q_m: mirror.wish_q_m,
        sampled_ns: mirror.sampled_ns,
        told_counts_per_s: mirror.told_counts_per_s,
        current_a: mirror.current_a,
        torque_nm: mirror.torque_nm,
        temperature_celsius: mirror.temperature_celsius,
        supply_v: mirror.supply_v,
        told_counts: mirror.told_counts,
        goal_counts: mirror.goal_counts,
        counts: mirror.counts,
        n_boots: mirror.n_boots,
        flags: mirror.flags,
        state: mirror.state.cast_unsigned(),
        trouble: mirror.trouble,
        trouble_code: mirror.trouble_code,
        trouble_text: mirror.trouble_text,
        emergency_code: mirror.emergency_code,
    }
}
