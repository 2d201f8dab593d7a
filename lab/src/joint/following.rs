//! Whether a joint's measurement follows its command at all: a cable that is off leaves nothing but the sensor's noise, which looks like
//! a perfect model whose gain is zero.

use super::signal::Signal;
use crate::machine::JointsLab;
use crate::noise::bounds;

/// More than this of the measurement's variance is left of one that does not follow.
const ALL: f64 = 0.9;
/// A command that varies by so many times as much as the measurement, in the same unit, would be seen at a tenth of its size.
const WOULD_BE_SEEN: f64 = 3.0;
/// A gain within so many standard errors of zero is chance.
const ERRORS: f64 = 5.0;
/// A command that moves less than this part of the way of the joint that moves most is at rest, whatever its encoder's last digit does.
const AT_REST: f64 = 0.01;
/// Mean square of a command's steps from row to row over its variance: 2 of what is new in every row, next to nothing of a motion.
const JITTER: f64 = 0.5;

/// Whether the measurement follows the command, or nobody can say so: `left` is the mean square that the model leaves at best, `times`
/// the rows that tell something of their own.
pub(super) fn follows(machine: &JointsLab, signal: &Signal, left: f64, times: f64) -> bool {
    let pairs: Vec<(f64, f64)> = signal.rows.iter().map(|&row| (signal.base[row], signal.measured[row])).collect();
    let n = pairs.len() as f64;
    let (mx, my) = pairs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (xx, xy, yy) = pairs.iter().fold((0.0, 0.0, 0.0), |(xx, xy, yy), (x, y)| {
        let (x, y) = (x - mx, y - my);
        (xx + x * x / n, xy + x * y / n, yy + y * y / n)
    });
    if pairs.is_empty() || left < ALL * yy || !is_told_to_move(signal, xx) {
        return true;
    }
    let own = machine.joints();
    let share = if yy > 0.0 { xy * xy / (xx * yy) } else { 0.0 };
    // In another unit nobody knows how large the motion should be.
    let would_be_seen = own.u_unit != own.y_unit || xx > WOULD_BE_SEEN * WOULD_BE_SEEN * yy;
    !would_be_seen || share * times > ERRORS * ERRORS
}

/// Whether the command of this variance moves, and not only its last digit.
fn is_told_to_move(signal: &Signal, variance: f64) -> bool {
    let most = (0..signal.inputs.len()).map(|k| signal.range_of(k)).fold(0.0, f64::max);
    let (low, high) = bounds(signal.base.iter().copied());
    let steps = (1..signal.n()).filter(|row| !signal.fresh[*row]);
    let (sum, n) =
        steps.fold((0.0, 0.0_f64), |(sum, n), row| (sum + (signal.base[row] - signal.base[row - 1]).powi(2), n + 1.0));
    let is_smooth = sum / n.max(1.0) < JITTER * variance;
    is_smooth && high - low > AT_REST * most
}
