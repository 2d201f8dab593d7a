//! Real drives must be those of the model's machine: as many, the last a gripper's where the model has one, and groups of lines that
//! can hold each other.

use crate::antagonists;
use anyhow::{Context, bail, ensure};
use krait_bridge::LiveModel;
use krait_ipc::message::N_LINES;
use krait_model::gripper::Gripper;
use krait_slave::DriveConfig;

/// How far the wire of a radian may be off between model and configuration, part of it.
const SAME: f64 = 1e-9;

/// Checks that the drives of a configuration fit the machine of a model.
///
/// # Errors
/// One sentence that names what does not.
pub fn check(drive: &DriveConfig, machine: &LiveModel) -> anyhow::Result<()> {
    let (expected, gripper) = match machine {
        LiveModel::Snake(chain) => (N_LINES + usize::from(chain.gripper().is_some()), chain.gripper()),
        LiveModel::Joints(joints) => (joints.n(), None),
        LiveModel::Segments(segments) => (segments.chain().machine().n_lines(), None),
    };
    let found = drive.actuator.len();
    if found != expected {
        let what = if gripper.is_some() { " with its gripper's wire, the last" } else { "" };
        bail!(
            "[slave.drive] describes {found} actuators, and the machine of the model has {expected}{what}; describe as many, or name its model"
        );
    }
    antagonists::check(drive, machine)?;
    match (gripper, drive.jaw_m_per_rad()) {
        (Some(gripper), jaw_m_per_rad) => check_jaw(gripper, jaw_m_per_rad, drive),
        (None, Some(_)) => bail!(
            "[slave.drive] actuator {found}: jaw_m_per_rad says that it moves a gripper's jaw, and the model has none; leave the key out, or \
             name a model with a [gripper]"
        ),
        (None, None) => Ok(()),
    }
}

/// The last actuator moves the model's jaw, as far as it goes.
fn check_jaw(gripper: &Gripper, jaw_m_per_rad: Option<f64>, drive: &DriveConfig) -> anyhow::Result<()> {
    let n = drive.actuator.len();
    let wanted = gripper.numbers().wire_m_per_rad;
    let found = jaw_m_per_rad.with_context(|| {
        format!(
            "[slave.drive] actuator {n}: jaw_m_per_rad is missing, and the model has a [gripper]; if this one moves its wire, write \
             jaw_m_per_rad = {wanted}"
        )
    })?;
    ensure!(
        (found - wanted).abs() <= SAME * wanted,
        "[slave.drive] actuator {n}: jaw_m_per_rad = {found}, expected {wanted}, the model's wire_m_per_rad; measure which is right, and \
         write it into both"
    );
    let travel_m = drive.actuator.last().map_or(0.0, |last| last.travel_m);
    ensure!(
        gripper.travel_m() <= travel_m,
        "[slave.drive] actuator {n}: travel_m = {travel_m}, expected at least {:.5} m, the way of the model's jaw; give it more, or make \
         range_deg smaller",
        gripper.travel_m()
    );
    Ok(())
}
