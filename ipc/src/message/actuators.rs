//! One number for each actuator of a machine: three lines of a snake, or what drives up to twelve cables.

/// The most actuators that a machine has.
pub const MAX_ACTUATORS: usize = 12;
/// Lines of a snake.
pub const N_LINES: usize = 3;
/// The actuator of a gripper's wire, from 0: behind the three lines of a snake, the last.
pub const GRIPPER_WIRE: usize = N_LINES;
/// Actuators of a snake with a gripper.
pub const N_WITH_GRIPPER: usize = N_LINES + 1;
/// Actuators of a snake.
pub const fn n_of_snake(has_gripper: bool) -> usize {
    if has_gripper { N_WITH_GRIPPER } else { N_LINES }
}

/// The place of a snake's jaw among the positions of joints, of which a snake has none besides.
pub const JAW: usize = 0;
/// The most joints that a machine has.
pub const MAX_JOINTS: usize = 8;

/// One number for each actuator; zeros behind the last.
pub type Actuators = [f64; MAX_ACTUATORS];
/// One number for each joint; zeros behind the last.
pub type JointValues = [f64; MAX_JOINTS];

/// The three lines of a snake among the actuators.
pub const fn lines([line_1, line_2, line_3]: [f64; N_LINES]) -> Actuators {
    let mut actuators = [0.0; MAX_ACTUATORS];
    (actuators[0], actuators[1], actuators[2]) = (line_1, line_2, line_3);
    actuators
}

/// The first three actuators: the lines of a snake.
pub const fn three(actuators: &Actuators) -> [f64; N_LINES] {
    [actuators[0], actuators[1], actuators[2]]
}

/// How many actuators a message's `n_actuators` means: 0 is a snake's three lines.
pub const fn n_actuators(word: u32) -> usize {
    if word == 0 { N_LINES } else { word as usize }
}

/// Largest magnitude of all of them.
#[inline]
pub fn largest(actuators: Actuators) -> f64 {
    actuators.into_iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

/// The actuators that there are; a number of them that no machine has gives as many as a message holds.
pub fn used(actuators: &Actuators, word: u32) -> &[f64] {
    &actuators[..n_actuators(word).min(MAX_ACTUATORS)]
}
