//! Mirrors of the messages that make up the chain. The structs are written out in full on both sides, so that a field that
//! is added and forgotten here does not compile.

use super::{
    Mirrored, bend, covariance, from_bend, from_covariance, from_joints, from_lines, from_three_lines, from_vector3,
    from_wanted_joints, joints, lines, three_lines, vector3, wanted_joints,
};
use crate::proto;
use krait_ipc::message::{
    Command, HopStamps, LearntValue, MAX_LEARNT, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState, StateCommand,
};

impl Mirrored for OperatorInput {
    type Mirror = proto::OperatorInput;

    fn mirror(&self) -> proto::OperatorInput {
        let [x, y, z, rx, ry, rz] = self.raw_axes.map(i32::from);
        proto::OperatorInput {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            stamps: stamps(self.stamps),
            tip_vel_in_view_m_per_s: vector3(self.tip_vel_in_view_m_per_s),
            tip_angular_vel_in_view_rad_per_s: vector3(self.tip_angular_vel_in_view_rad_per_s),
            raw_axes: Some(proto::RawAxes { x, y, z, rx, ry, rz }),
            flags: self.flags,
            buttons: self.buttons,
            device_state: self.device_state.cast_signed(),
            scale_permille: self.scale_permille,
            n_reports: self.n_reports,
            n_drained: self.n_drained,
            n_refused: self.n_refused,
        }
    }

    fn restore(mirror: &proto::OperatorInput) -> Result<Self, String> {
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            stamps: from_stamps(mirror.stamps),
            tip_vel_in_view_m_per_s: from_vector3(mirror.tip_vel_in_view_m_per_s),
            tip_angular_vel_in_view_rad_per_s: from_vector3(mirror.tip_angular_vel_in_view_rad_per_s),
            raw_axes: from_raw_axes(mirror.raw_axes)?,
            flags: mirror.flags,
            buttons: mirror.buttons,
            device_state: mirror.device_state.cast_unsigned(),
            scale_permille: mirror.scale_permille,
            n_reports: mirror.n_reports,
            n_drained: mirror.n_drained,
            n_refused: mirror.n_refused,
        })
    }
}

impl Mirrored for Setpoint {
    type Mirror = proto::Setpoint;

    fn mirror(&self) -> proto::Setpoint {
        proto::Setpoint {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            stamps: stamps(self.stamps),
            input_sequence: self.input_sequence,
            state_sequence: self.state_sequence,
            bend_rad: bend(self.bend_rad),
            bend_vel_rad_per_s: bend(self.bend_vel_rad_per_s),
            q_tilde_vel_m_per_s: lines(self.q_tilde_vel_m_per_s),
            tip_pos_in_base_m: vector3(self.tip_pos_in_base_m),
            motion_scale: self.motion_scale,
            model_hash: self.model_hash,
            phase: self.phase.cast_signed(),
            reserved: self.reserved,
            joints_rad: wanted_joints(self.joints_rad),
            joints_vel_rad_per_s: wanted_joints(self.joints_vel_rad_per_s),
            n_actuators: self.n_actuators,
            n_joints: self.n_joints,
            reasons: self.reasons,
        }
    }

    fn restore(mirror: &proto::Setpoint) -> Result<Self, String> {
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            stamps: from_stamps(mirror.stamps),
            input_sequence: mirror.input_sequence,
            state_sequence: mirror.state_sequence,
            bend_rad: from_bend(mirror.bend_rad),
            bend_vel_rad_per_s: from_bend(mirror.bend_vel_rad_per_s),
            q_tilde_vel_m_per_s: from_lines(mirror.q_tilde_vel_m_per_s),
            tip_pos_in_base_m: from_vector3(mirror.tip_pos_in_base_m),
            motion_scale: mirror.motion_scale,
            model_hash: mirror.model_hash,
            phase: mirror.phase.cast_unsigned(),
            reserved: mirror.reserved,
            joints_rad: from_wanted_joints(mirror.joints_rad),
            joints_vel_rad_per_s: from_wanted_joints(mirror.joints_vel_rad_per_s),
            n_actuators: mirror.n_actuators,
            n_joints: mirror.n_joints,
            reasons: mirror.reasons,
        })
    }
}

impl Mirrored for Command {
    type Mirror = proto::Command;

    fn mirror(&self) -> proto::Command {
        proto::Command {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            stamps: stamps(self.stamps),
            setpoint_sequence: self.setpoint_sequence,
            input_sequence: self.input_sequence,
            state_sequence: self.state_sequence,
            model_update_sequence: self.model_update_sequence,
            bend_rad: bend(self.bend_rad),
            joints_rad: wanted_joints(self.joints_rad),
            n_actuators: self.n_actuators,
            n_joints: self.n_joints,
            q_uncompensated_m: lines(self.q_uncompensated_m),
            q_tilde_m: lines(self.q_tilde_m),
            q_tilde_vel_m_per_s: lines(self.q_tilde_vel_m_per_s),
            model_hash: self.model_hash,
            learnt: self.learnt().to_vec(),
            phase: self.phase.cast_signed(),
            reasons: self.reasons,
        }
    }

    fn restore(mirror: &proto::Command) -> Result<Self, String> {
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            stamps: from_stamps(mirror.stamps),
            setpoint_sequence: mirror.setpoint_sequence,
            input_sequence: mirror.input_sequence,
            state_sequence: mirror.state_sequence,
            model_update_sequence: mirror.model_update_sequence,
            bend_rad: from_bend(mirror.bend_rad),
            joints_rad: from_wanted_joints(mirror.joints_rad),
            n_actuators: mirror.n_actuators,
            n_joints: mirror.n_joints,
            q_uncompensated_m: from_lines(mirror.q_uncompensated_m),
            q_tilde_m: from_lines(mirror.q_tilde_m),
            q_tilde_vel_m_per_s: from_lines(mirror.q_tilde_vel_m_per_s),
            model_hash: mirror.model_hash,
            learnt: padded(&mirror.learnt, f64::NAN)?,
            n_learnt: mirror.learnt.len() as u32,
            phase: mirror.phase.cast_unsigned(),
            reasons: mirror.reasons,
        })
    }
}

impl Mirrored for SlaveState {
    type Mirror = proto::SlaveState;

    fn mirror(&self) -> proto::SlaveState {
        proto::SlaveState {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            stamps: stamps(self.stamps),
            command_sequence: self.command_sequence,
            operating_state: self.operating_state.cast_signed(),
            flags: self.flags,
            desired_state: self.desired_state.cast_signed(),
            n_stops: self.n_stops,
            state_command_sequence: self.state_command_sequence,
            setpoint_ns: self.setpoint_ns,
            setpoint_q_m: lines(self.setpoint_q_m),
            setpoint_bend_rad: bend(self.setpoint_bend_rad),
            setpoint_joints_rad: wanted_joints(self.setpoint_joints_rad),
            n_actuators: self.n_actuators,
            n_joints: self.n_joints,
            measured_q_m: lines(self.measured_q_m),
            measured_tau_n: lines(self.measured_tau_n),
            reasons: self.reasons,
            n_commands: self.n_commands,
            n_refused: self.n_refused,
        }
    }

    fn restore(mirror: &proto::SlaveState) -> Result<Self, String> {
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            stamps: from_stamps(mirror.stamps),
            command_sequence: mirror.command_sequence,
            operating_state: mirror.operating_state.cast_unsigned(),
            flags: mirror.flags,
            desired_state: mirror.desired_state.cast_unsigned(),
            n_stops: mirror.n_stops,
            state_command_sequence: mirror.state_command_sequence,
            setpoint_ns: mirror.setpoint_ns,
            setpoint_q_m: from_lines(mirror.setpoint_q_m),
            setpoint_bend_rad: from_bend(mirror.setpoint_bend_rad),
            setpoint_joints_rad: from_wanted_joints(mirror.setpoint_joints_rad),
            n_actuators: mirror.n_actuators,
            n_joints: mirror.n_joints,
            measured_q_m: from_lines(mirror.measured_q_m),
            measured_tau_n: from_lines(mirror.measured_tau_n),
            reasons: mirror.reasons,
            n_commands: mirror.n_commands,
            n_refused: mirror.n_refused,
        })
    }
}

impl Mirrored for StateCommand {
    type Mirror = proto::StateCommand;

    fn mirror(&self) -> proto::StateCommand {
        proto::StateCommand {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            transition: self.transition.cast_signed(),
            sender_pid: self.sender_pid,
        }
    }

    fn restore(mirror: &proto::StateCommand) -> Result<Self, String> {
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            transition: mirror.transition.cast_unsigned(),
            sender_pid: mirror.sender_pid,
        })
    }
}

impl Mirrored for Shape {
    type Mirror = proto::Shape;

    fn mirror(&self) -> proto::Shape {
        proto::Shape {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            available_ns: self.available_ns,
            bend_rad: bend(self.bend_rad),
            theta_l_rad: self.theta_l_rad,
            delta_rad: self.delta_rad,
            bend_covariance_rad2: covariance(self.bend_covariance_rad2),
            q_tilde_m: three_lines(self.q_tilde_m),
            joints_rad: joints(self.joints_rad),
            joint_variances_rad2: joints(self.joint_variances_rad2),
            n_joints: self.n_joints,
            validity: self.validity.cast_signed(),
        }
    }

    fn restore(mirror: &proto::Shape) -> Result<Self, String> {
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            available_ns: mirror.available_ns,
            bend_rad: from_bend(mirror.bend_rad),
            theta_l_rad: mirror.theta_l_rad,
            delta_rad: mirror.delta_rad,
            bend_covariance_rad2: from_covariance(mirror.bend_covariance_rad2),
            q_tilde_m: from_three_lines(mirror.q_tilde_m),
            joints_rad: from_joints(mirror.joints_rad),
            joint_variances_rad2: from_joints(mirror.joint_variances_rad2),
            n_joints: mirror.n_joints,
            validity: mirror.validity.cast_unsigned(),
        })
    }
}

impl Mirrored for ModelUpdate {
    type Mirror = proto::ModelUpdate;

    fn mirror(&self) -> proto::ModelUpdate {
        let learnt = |own: &LearntValue| proto::LearntValue {
            value: own.value,
            sd: own.sd,
            effect: own.effect.into(),
            parameter: own.parameter.into(),
            state: own.state.into(),
            tied_to: own.tied_to.into(),
        };
        proto::ModelUpdate {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            shape_sequence: self.shape_sequence,
            state_sequence: self.state_sequence,
            n_states: self.n_states,
            model_hash: self.model_hash,
            innovation_rms_rad: self.innovation_rms_rad,
            n_used: self.n_used,
            n_left_out: self.n_left_out,
            n_changes: self.n_changes,
            changed_ns: self.changed_ns,
            change_kind: self.change_kind,
            is_watching: self.is_watching,
            learnt: self.learnt().iter().map(learnt).collect(),
            changed_segment: self.changed_segment,
        }
    }

    fn restore(mirror: &proto::ModelUpdate) -> Result<Self, String> {
        let small = |name, found: u32| {
            u16::try_from(found)
                .map_err(|_too_large| format!("{name} of a learnt parameter is {found}, expected 0 to 65535"))
        };
        let learnt = |own: &proto::LearntValue| {
            Ok(LearntValue {
                value: own.value,
                sd: own.sd,
                effect: small("effect", own.effect)?,
                parameter: small("parameter", own.parameter)?,
                state: small("state", own.state.cast_unsigned())?,
                tied_to: small("tied_to", own.tied_to)?,
            })
        };
        let values: Vec<LearntValue> = mirror.learnt.iter().map(learnt).collect::<Result<_, String>>()?;
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            shape_sequence: mirror.shape_sequence,
            state_sequence: mirror.state_sequence,
            n_states: mirror.n_states,
            model_hash: mirror.model_hash,
            innovation_rms_rad: mirror.innovation_rms_rad,
            n_used: mirror.n_used,
            n_left_out: mirror.n_left_out,
            n_changes: mirror.n_changes,
            changed_ns: mirror.changed_ns,
            change_kind: mirror.change_kind,
            is_watching: mirror.is_watching,
            n_learnt: values.len() as u32,
            changed_segment: mirror.changed_segment,
            learnt: padded(&values, LearntValue::default())?,
        })
    }
}

/// A list of at most [`MAX_LEARNT`] as the message holds it.
fn padded<T: Copy>(given: &[T], rest: T) -> Result<[T; MAX_LEARNT], String> {
    let mut padded = [rest; MAX_LEARNT];
    match padded.get_mut(..given.len()) {
        Some(own) => own.copy_from_slice(given),
        None => return Err(format!("{} learnt parameters, expected at most {MAX_LEARNT}", given.len())),
    }
    Ok(padded)
}

fn stamps(stamps: HopStamps) -> Option<proto::HopStamps> {
    Some(proto::HopStamps {
        device_ns: stamps.device_ns,
        input_sent_ns: stamps.input_sent_ns,
        resolve_begun_ns: stamps.resolve_begun_ns,
        setpoint_sent_ns: stamps.setpoint_sent_ns,
        compensate_begun_ns: stamps.compensate_begun_ns,
        command_sent_ns: stamps.command_sent_ns,
        slave_begun_ns: stamps.slave_begun_ns,
        drive_written_ns: stamps.drive_written_ns,
    })
}

fn from_stamps(stamps: Option<proto::HopStamps>) -> HopStamps {
    let stamps = stamps.unwrap_or_default();
    HopStamps {
        device_ns: stamps.device_ns,
        input_sent_ns: stamps.input_sent_ns,
        resolve_begun_ns: stamps.resolve_begun_ns,
        setpoint_sent_ns: stamps.setpoint_sent_ns,
        compensate_begun_ns: stamps.compensate_begun_ns,
        command_sent_ns: stamps.command_sent_ns,
        slave_begun_ns: stamps.slave_begun_ns,
        drive_written_ns: stamps.drive_written_ns,
    }
}

fn from_raw_axes(axes: Option<proto::RawAxes>) -> Result<[i16; 6], String> {
    let axes = axes.unwrap_or_default();
    let mut raw = [0; 6];
    for (to, from) in raw.iter_mut().zip([axes.x, axes.y, axes.z, axes.rx, axes.ry, axes.rz]) {
        *to =
            i16::try_from(from).map_err(|error| format!("raw_axes holds {from}, expected -32768 to 32767: {error}"))?;
    }
    Ok(raw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raw_axis_beyond_16_bits_is_refused_with_its_value() {
        let raw_axes = Some(proto::RawAxes { ry: 40_000, ..proto::RawAxes::default() });
        let mirror = proto::OperatorInput { raw_axes, ..proto::OperatorInput::default() };
        let error = OperatorInput::restore(&mirror).expect_err("too large for i16");
        assert!(error.contains("40000"), "{error}");
    }
}
