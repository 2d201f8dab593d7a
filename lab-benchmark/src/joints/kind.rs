//! What can be hidden in a joint: each kind with its law in the plant, and the names that count as right.

use super::plant::Plant;
use crate::generate::Random;
use core::f64::consts::TAU;

const LATE: &[&str] = &["latency", "first-order-lag", "second-order", "rate-limit"];
const PLAY: &[&str] = &["backlash", "bouc-wen", "prandtl-ishlinskii", "generalised-prandtl-ishlinskii"];
const CURVE: &[&str] = &["quadratic", "cubic"];
const DRIFT: &[&str] = &["linear-drift", "drift"];
const LOAD: &[&str] = &["load-friction", "cone-friction"];
const UNKNOWN: &[&str] = &["unknown"];

/// An effect that can be hidden in a joint.
#[derive(Clone, Copy, Debug)]
pub struct JointKind {
    /// Its name; those that no known effect explains begin with `x_`.
    pub name: &'static str,
    /// Names that count as right.
    pub right: &'static [&'static str],
    /// Size in radians of a joint that moves by one radian to each side, or in its own unit, where the search begins.
    pub(super) typical: f64,
    pub(super) apply: fn(&mut Plant, f64, &Draw),
    /// Parameters of the lab's effect that the plant fixes.
    pub(super) known: fn(&Plant) -> Vec<(&'static str, &'static str, f64)>,
}

/// Signs, places and times, drawn once for each hidden effect.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    pub sign: f64,
    pub part: [f64; 3],
    pub seconds: f64,
}

impl Draw {
    pub(super) fn new(random: &mut Random, seconds: f64) -> Self {
        Self { sign: random.sign(), part: core::array::from_fn(|_| random.between(0.0, 1.0)), seconds }
    }

    fn between(&self, k: usize, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part[k]
    }
}

impl JointKind {
    /// The kind of that name; `None` if there is none.
    pub fn from_name(name: &str) -> Option<&'static Self> {
        JOINT_KINDS.iter().find(|kind| kind.name == name)
    }

    /// Whether an effect of the lab explains it.
    pub fn is_known(&self) -> bool {
        self.right != UNKNOWN
    }

    /// Whether both explain the same.
    pub fn is_like(&self, other: &Self) -> bool {
        self.name == other.name || self.is_known() && self.right == other.right
    }
}

fn nothing(_: &Plant) -> Vec<(&'static str, &'static str, f64)> {
    Vec::new()
}

/// Every kind, the lab's own first.
#[rustfmt::skip]
pub const JOINT_KINDS: &[JointKind] = &[
    JointKind { name: "play", right: PLAY, typical: 0.03, apply: |p, a, _| p.play = a,
        known: |p| vec![("backlash", "half_width", p.play)] },
    JointKind { name: "rubbing", right: PLAY, typical: 0.03,
        apply: |p, a, d| p.rubbing = [a, d.between(0, 0.03, 0.25)],
        known: |p| vec![("bouc-wen", "amplitude", p.rubbing[0]), ("bouc-wen", "travel", p.rubbing[1])] },
    JointKind { name: "delay", right: LATE, typical: 0.1, apply: |p, a, _| p.delay_s = a,
        known: |p| vec![("latency", "delay_s", p.delay_s)] },
    JointKind { name: "lag", right: LATE, typical: 0.1, apply: |p, a, _| p.lag_s = a,
        known: |p| vec![("first-order-lag", "time_s", p.lag_s)] },
    JointKind { name: "second-order", right: LATE, typical: 0.1,
        apply: |p, a, d| p.second_order = [1.0 / a, d.between(0, 0.3, 1.0)],
        known: |p| vec![("second-order", "frequency_rad_per_s", p.second_order[0]), ("second-order", "damping", p.second_order[1])] },
    JointKind { name: "guide", right: LOAD, typical: 0.2, apply: |p, a, d| p.guide = [a, d.between(0, 0.05, 0.3)], known: nothing },
    JointKind { name: "dead-zone", right: &["dead-zone"], typical: 0.05,
        apply: |p, a, d| p.dead = [a, d.between(0, -0.3, 0.3)],
        known: |p| vec![("dead-zone", "half_width", p.dead[0]), ("dead-zone", "centre", p.dead[1])] },
    JointKind { name: "quadratic", right: CURVE, typical: 0.05, apply: |p, a, d| p.quadratic = d.sign * a, known: nothing },
    JointKind { name: "cubic", right: CURVE, typical: 0.1, apply: |p, a, d| p.cubic = d.sign * a, known: nothing },
    JointKind { name: "creep", right: &["creep"], typical: 0.1, apply: |p, a, d| p.creep = [a, d.between(0, 3.0, 15.0)],
        known: |p| vec![("creep", "a1", p.creep[0]), ("creep", "t1_s", p.creep[1])] },
    JointKind { name: "drift", right: DRIFT, typical: 0.05, apply: |p, a, d| p.drift = d.sign * a, known: nothing },
    JointKind { name: "warm-up", right: DRIFT, typical: 0.05,
        apply: |p, a, d| p.warm_up = [d.sign * a, d.seconds * d.between(0, 0.2, 0.5)], known: nothing },
    JointKind { name: "coupling", right: &["cross-coupling"], typical: 0.05, apply: |p, a, d| p.coupling = d.sign * a,
        known: |p| vec![("cross-coupling", "k", p.coupling)] },
    JointKind { name: "periodic", right: &["periodic-error"], typical: 0.02,
        apply: |p, a, d| p.periodic = [a, d.between(0, 0.1, 0.5), TAU * d.part[1]],
        known: |p| vec![("periodic-error", "amplitude", p.periodic[0]), ("periodic-error", "period", p.periodic[1])] },
    JointKind { name: "x_sway", right: UNKNOWN, typical: 0.02, apply: |p, a, d| p.sway = [a, d.between(0, 0.15, 0.4)], known: nothing },
    JointKind { name: "x_product", right: UNKNOWN, typical: 0.05, apply: |p, a, d| p.product = d.sign * a, known: nothing },
    JointKind { name: "x_collision", right: UNKNOWN, typical: 0.05,
        apply: |p, a, d| p.collision = [d.sign * a, d.seconds * d.between(0, 0.3, 0.7)], known: nothing },
    JointKind { name: "x_kink", right: UNKNOWN, typical: 0.1,
        apply: |p, a, d| p.kink = [d.sign * a, d.between(0, -0.4, 0.4)], known: nothing },
    JointKind { name: "x_root_drag", right: UNKNOWN, typical: 0.05, apply: |p, a, _| p.root_drag = a, known: nothing },
    JointKind { name: "x_slip", right: UNKNOWN, typical: 0.02, apply: |p, a, d| p.slip = d.sign * a, known: nothing },
    JointKind { name: "x_fading", right: UNKNOWN, typical: 0.1, apply: |p, a, d| p.fading = d.sign * a, known: nothing },
    JointKind { name: "x_other_play", right: UNKNOWN, typical: 0.05, apply: |p, a, _| p.other_play = a, known: nothing },
];
