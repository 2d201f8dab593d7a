//! What a formula can look at: its variables, where each is known, and their values at a step.

use super::Hook;
use super::force_formula::AtForce;
use super::operators::play;
use super::prepared::{Now, Prepared};
use super::real::{Real, Scalar};
use super::varying::MAX_COLUMNS;
use crate::Circumstances;

/// Travel of q over which the variable `direction` turns, m.
const DIRECTION_TRAVEL_M: f64 = 20e-6;

/// A variable that a formula can use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FormulaVariable {
    /// Name.
    pub name: &'static str,
    /// Unit and meaning.
    pub meaning: &'static str,
    /// At which hooks it is known.
    pub hooks: &'static [Hook],
}

const LINE: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo];
const SHAPE: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Meas];
pub(super) const ALL_HOOKS: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Meas, Hook::Enc];

pub(super) const JOINT: &[Hook] = &[Hook::Joint];
pub(super) const FORCE: &[Hook] = &[Hook::Force];
const OF_JOINTS: &[Hook] = &[Hook::Joint, Hook::Force];
const BUT_FORCE: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Meas, Hook::Enc, Hook::Joint];
const EVERYWHERE: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Meas, Hook::Enc, Hook::Joint, Hook::Force];

const fn variable(name: &'static str, meaning: &'static str, hooks: &'static [Hook]) -> FormulaVariable {
    FormulaVariable { name, meaning, hooks }
}

/// Every variable, in the order of their values.
pub const FORMULA_VARIABLES: [FormulaVariable; 25] = [
    variable("bend", "rad: bend from straight", SHAPE),
    variable("delta", "rad: plane of bending, 0 at the straight pose", SHAPE),
    variable("bend_x", "rad: first component of the bend vector", SHAPE),
    variable("bend_y", "rad: second component of the bend vector", SHAPE),
    variable("q1", "m: displacement of line 1 at the snake", LINE),
    variable("q2", "m: displacement of line 2 at the snake", LINE),
    variable("q3", "m: displacement of line 3 at the snake", LINE),
    variable("q_i", "m: displacement of this line at the snake", LINE),
    variable("tau_i", "N: load of this line at the snake, push positive", LINE),
    variable("direction", "-1 to 1: sign of motion of this line, turning over 20 um of q_i", LINE),
    variable("q_tilde_i", "m: position of this line's actuator", &[Hook::Enc]),
    variable("axis", "0 for bend_x, 1 for bend_y: what the value is added to", &[Hook::Meas]),
    variable("line", "1, 2 or 3", &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Enc]),
    variable("segment", "1, 2 or 3: the segment whose bend it is, from the base; 1 of a snake", &[Hook::Meas]),
    variable("time_s", "s", EVERYWHERE),
    variable("stem_angle_rad", "rad: needs the column", ALL_HOOKS),
    variable("temperature_c", "deg C: needs the column", BUT_FORCE),
    variable("u_i", "the command of this joint, in its unit", JOINT),
    variable("y_i", "the position of this joint without the formula, in its unit", JOINT),
    variable("motion_i", "-1, 0 or 1: sign of the last change of u_i, of force that of the speed", OF_JOINTS),
    variable("joint", "number of this joint, from 1", OF_JOINTS),
    variable("angle_i", "rad: angle of this joint", FORCE),
    variable("speed_i", "rad/s: its speed", FORCE),
    variable("acceleration_i", "rad/s^2: its acceleration", FORCE),
    variable("load_i", "load of its gear as recorded, else the model's gravity, in Nm or A", FORCE),
];

const SEGMENT: usize = 13;
pub(super) const TIME: usize = 14;
pub(super) const STEM_ANGLE: usize = 15;
pub(super) const TEMPERATURE: usize = 16;
const COMMAND: usize = 17;
const MOTION: usize = 19;
const NUMBER: usize = 20;
const ANGLE: usize = 21;

/// Where the columns with names of their own begin among the values.
pub(super) const COLUMNS: usize = FORMULA_VARIABLES.len();
const N_VALUES: usize = COLUMNS + MAX_COLUMNS;

/// The variables' values, and behind them those of the columns.
pub(crate) type Values<S> = [S; N_VALUES];

/// The variables at a line, from shape, displacements and loads; `direction` keeps its memory in the effect's state.
pub(crate) fn line_values<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    state: &mut [P],
    b: [S; 2],
    q: [S; 3],
    tau: S,
    i: usize,
    now: &Now,
) -> Values<S> {
    let half = P::constant(0.5 * DIRECTION_TRAVEL_M);
    let p = play(state[e.state + i], q[i], half, now.fresh);
    if now.commit {
        state[e.state + i] = p.settle();
    }
    let direction = (q[i] - p) * (P::constant(1.0) / half);
    let mut values = shape_values(b, now);
    values[4..8].copy_from_slice(&[q[0], q[1], q[2], q[i]]);
    (values[8], values[9]) = (tau, direction);
    values[12] = S::constant([1.0, 2.0, 3.0][i]);
    values
}

/// The variables that a shape has.
pub(crate) fn shape_values<S: Real>(b: [S; 2], now: &Now) -> Values<S> {
    let mut values = [S::constant(0.0); N_VALUES];
    let square = b[0] * b[0] + b[1] * b[1];
    values[0] = square.sqrt();
    values[1] = plane(b, square.value());
    (values[2], values[3]) = (b[0], b[1]);
    (values[SEGMENT], values[TIME]) = (S::constant(1.0), S::constant(now.time_s));
    values[STEM_ANGLE] = S::constant(now.stem_angle_rad().unwrap_or(f64::NAN));
    values[TEMPERATURE] = S::constant(now.temperature_c().unwrap_or(f64::NAN));
    values
}

/// The variables at a joint.
pub(crate) fn joint_values(
    u: f64,
    y: f64,
    motion: f64,
    joint: usize,
    at: &Circumstances,
    columns: &[f64; MAX_COLUMNS],
) -> Values<f64> {
    let mut values = [0.0; N_VALUES];
    (values[TIME], values[TEMPERATURE]) = (at.time_s, at.temperature_c);
    values[COMMAND..=NUMBER].copy_from_slice(&[u, y, motion, joint as f64 + 1.0]);
    values[COLUMNS..].copy_from_slice(columns);
    values
}

/// The variables at a joint's torque or current.
pub(super) fn force_values(here: &AtForce) -> Values<f64> {
    let mut values = [0.0; N_VALUES];
    (values[TIME], values[MOTION], values[NUMBER]) = (here.time_s, here.motion, here.joint as f64 + 1.0);
    let own = [here.angle_rad, here.speed_rad_per_s, here.acceleration_rad_per_s2, here.load];
    values[ANGLE..COLUMNS].copy_from_slice(&own);
    values
}

/// The variables at an encoder.
pub(crate) fn encoder_values<S: Real>(q_tilde: S, i: usize, now: &Now) -> Values<S> {
    let mut values = shape_values([S::constant(0.0); 2], now);
    values[10] = q_tilde;
    values[12] = S::constant([1.0, 2.0, 3.0][i]);
    values
}

/// Sets which component of the bend vector is asked for.
pub(crate) fn set_axis<S: Real>(values: &mut Values<S>, axis: f64) {
    values[11] = S::constant(axis);
}

/// Sets which segment's bend it is, from 0.
pub(crate) fn set_segment<S: Real>(values: &mut Values<S>, segment: usize) {
    values[SEGMENT] = S::constant(segment as f64 + 1.0);
}

/// The same variables at another joint and another component of the bend vector: a formula may be of one of them alone. Numbers of
/// joints go round the segments too.
pub(super) fn of_part(mut values: Values<f64>, joint: f64, axis: f64) -> Values<f64> {
    (values[11], values[SEGMENT], values[NUMBER]) = (axis, (joint - 1.0) % 3.0 + 1.0, joint);
    values
}

/// delta with its tangents, which count as zero where delta has no meaning.
fn plane<S: Real>(b: [S; 2], square: f64) -> S {
    let delta = b[1].value().atan2(b[0].value());
    if square < 1e-18 {
        return S::constant(if square > 0.0 { delta } else { 0.0 });
    }
    let (by_x, by_y) = (-b[1].value() / square, b[0].value() / square);
    let turned =
        (b[0] - S::constant(b[0].value())) * S::constant(by_x) + (b[1] - S::constant(b[1].value())) * S::constant(by_y);
    turned + S::constant(delta)
}
