//! Which axes of a hand the model's machine cannot use: named at the start, so that nobody pushes against nothing.

use crate::cli::MasterKind;
use crate::config::Config;
use krait_bridge::{JointMachine, LiveModel};
use krait_master::{AXIS_NAMES, JoinedHand};

/// What is said at the start; nothing where every axis that the hand has moves something.
///
/// # Errors
/// A model or a profile that cannot be read.
pub(super) fn sentence(config: &Config, master: MasterKind) -> anyhow::Result<Option<String>> {
    let model = config.model()?.machine;
    let used = used(config, &model)?;
    let has = of_hand(config, master)?;
    let unused: Vec<&str> = (0..6).filter(|axis| has[*axis] && !used[*axis]).map(|axis| AXIS_NAMES[axis]).collect();
    if unused.is_empty() {
        return Ok(None);
    }
    let why = match &model {
        LiveModel::Snake(chain) if chain.gripper().is_some() => {
            "a snake bends in two directions, and its gripper turns with what [gripper] open_per_turn names"
        }
        LiveModel::Snake(_) => "a snake of three lines bends in two directions, and cannot turn or stretch",
        LiveModel::Segments(_) => "segments stretch only with [resolve] axial_weight and turn only with turn_m_per_rad",
        LiveModel::Joints(_) => "no joint follows them ([joints] rates)",
    };
    let verb = if unused.len() == 1 { "moves" } else { "move" };
    Ok(Some(format!("of this hand {} {verb} nothing: {why}", unused.join(", "))))
}

/// Axes of the device that move something, through the axes of the view: x, y, z, then turning about them.
fn used(config: &Config, model: &LiveModel) -> anyhow::Result<[bool; 6]> {
    let is_axial = config.resolve.axial_weight > 0.0;
    let view = match model {
        LiveModel::Snake(chain) => {
            let opens = config.gripper.open_per_turn.map(|part| part != 0.0 && chain.gripper().is_some());
            [true, true, is_axial, opens[0], opens[1], opens[2]]
        }
        LiveModel::Segments(_) => {
            let turns = config.resolve.turn_m_per_rad > 0.0;
            [true, true, is_axial, turns, turns, turns]
        }
        LiveModel::Joints(joints) => {
            let machine = JointMachine::new(joints, &config.joints)?;
            core::array::from_fn(|axis| machine.rates().iter().take(machine.n()).any(|row| row[axis] != 0.0))
        }
    };
    let map = &config.master.axis_map;
    let mut used = [false; 6];
    for (axis, is_used) in map.axes().into_iter().chain(map.turns()).zip(view) {
        used[axis.axis_idx()] |= is_used;
    }
    Ok(used)
}

/// Axes that the hand has: those of its profiles, and all six of what needs none.
fn of_hand(config: &Config, master: MasterKind) -> anyhow::Result<[bool; 6]> {
    if master != MasterKind::Hid || config.master.profile.is_none() {
        return Ok([true; 6]);
    }
    let mut has = [false; 6];
    for axis in JoinedHand::read(&config.master)?.profiles().flat_map(|profile| &profile.axes) {
        has[axis.axis_idx] = true;
    }
    Ok(has)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn said(model: Option<&str>, edit: fn(&mut Config)) -> Option<String> {
        let file = |name| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name);
        let mut config = Config { model: model.map(file), ..Config::default() };
        edit(&mut config);
        sentence(&config, MasterKind::Hid).expect("a model and a hand")
    }

    #[test]
    fn axes_that_move_nothing_are_named_for_every_machine_and_only_where_the_hand_has_them() {
        let snake = said(None, |_| {}).expect("some");
        assert!(snake.starts_with("of this hand y, rx, ry, rz move nothing: a snake of three lines"), "{snake}");
        // The mouse has no axes for turning.
        let mouse = said(None, |config| {
            (config.master.profile, config.master.node) = (Some("mouse".into()), Some("/dev/null".into()));
        });
        let mouse = mouse.expect("some");
        assert!(mouse.starts_with("of this hand y moves nothing: a snake of three lines"), "{mouse}");
        // Turning about the view's z, which is the device's ry, opens a jaw.
        let turned = |config: &mut Config| config.gripper.open_per_turn = [0.0, 0.0, 1.0];
        let gripper = said(Some("gripper/snake.toml"), turned).expect("some");
        assert!(gripper.starts_with("of this hand y, rx, rz move nothing"), "{gripper}");
        assert!(said(None, turned).expect("some").contains("ry"), "without a gripper there is no jaw to open");
        let segments = said(Some("segments/two.toml"), |_| {}).expect("some");
        assert!(segments.starts_with("of this hand y moves nothing: segments"), "{segments}");
        let joints = said(Some("joints/wrist.toml"), |config| {
            config.joints.rates =
                vec![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0, 0.0], [25.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
        });
        // View y and z are the device's z and y, turning about view z is its ry.
        assert_eq!(
            joints.as_deref(),
            Some("of this hand y, z, ry move nothing: no joint follows them ([joints] rates)")
        );
    }
}
