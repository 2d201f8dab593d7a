//! What can be hidden in the force of a joint: each kind with its law in the plant, and the name that counts as right.

use super::plant::{Law, Moment};
use crate::generate::Random;
use core::f64::consts::TAU;

/// A part of the force that can be hidden.
#[derive(Clone, Copy, Debug)]
pub struct ForceKind {
    /// Its name; those that no known effect explains begin with `x_`.
    pub name: &'static str,
    /// The name that counts as right; `unknown` where no effect does.
    pub right: &'static str,
    /// Whether it is friction of the loaded gear, which shows nothing without a load.
    pub needs_load: bool,
    /// Force of one unit of it.
    pub(super) law: Law,
    /// Parameters of the lab's effect that the plant fixes, for an amplitude.
    pub(super) known: fn(f64, &Draw) -> Vec<(&'static str, f64)>,
}

/// Places, times and a sign, drawn once for each hidden part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw {
    pub sign: f64,
    pub part: [f64; 2],
}

impl Draw {
    pub(super) fn new(random: &mut Random) -> Self {
        Self { sign: random.sign(), part: core::array::from_fn(|_| random.between(0.0, 1.0)) }
    }

    /// A number between two, by the k-th of the parts.
    pub(super) fn between(&self, k: usize, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part[k]
    }

    /// Speed at which sticking has fallen to exp(-1), of a motion whose rms speed is 1.
    fn fallen(&self) -> f64 {
        self.between(0, 0.15, 0.5)
    }

    fn phase(&self) -> f64 {
        TAU * self.part[1]
    }
}

impl ForceKind {
    /// The kind of that name; `None` if there is none.
    pub fn from_name(name: &str) -> Option<&'static Self> {
        FORCE_KINDS.iter().find(|kind| kind.name == name)
    }

    /// Whether an effect of the lab explains it.
    pub fn is_known(&self) -> bool {
        self.right != "unknown"
    }
}

fn nothing(_: f64, _: &Draw) -> Vec<(&'static str, f64)> {
    Vec::new()
}

fn falls(now: &Moment, draw: &Draw) -> f64 {
    (-(now.speed / (draw.fallen() * now.usual_speed)).powi(2)).exp()
}

const PLAIN: ForceKind = ForceKind { name: "", right: "unknown", needs_load: false, law: |_, _| 0.0, known: nothing };

/// Every kind, the lab's own first. Amplitudes of what may have either sign carry it in the law.
#[rustfmt::skip]
pub const FORCE_KINDS: &[ForceKind] = &[
    ForceKind { name: "mass", right: "inertia", law: |now, _| now.acceleration, known: |a, _| vec![("inertia", a)], ..PLAIN },
    ForceKind { name: "weight", right: "gravity", law: |now, d| (now.angle + d.phase()).sin(),
        known: |a, d| vec![("sine", a * d.phase().cos()), ("cosine", a * d.phase().sin())], ..PLAIN },
    ForceKind { name: "dry", right: "coulomb", law: |now, _| now.way(), known: |a, _| vec![("torque", a)], ..PLAIN },
    ForceKind { name: "drag", right: "viscous", law: |now, _| now.speed, known: |a, _| vec![("drag", a)], ..PLAIN },
    ForceKind { name: "sticking", right: "stribeck", law: |now, d| now.way() * falls(now, d), known: |a, _| vec![("torque", a)], ..PLAIN },
    ForceKind { name: "gear", right: "load-coulomb", needs_load: true, law: |now, _| now.way() * now.load.abs(),
        known: |a, _| vec![("share", a)] },
    ForceKind { name: "sticking-gear", right: "load-stribeck", needs_load: true, law: |now, d| now.way() * now.load.abs() * falls(now, d),
        known: |a, _| vec![("share", a)] },
    ForceKind { name: "pressed-gear", right: "quadratic-load", needs_load: true, law: |now, _| now.way() * now.load.powi(2),
        known: |a, _| vec![("share", a)] },
    ForceKind { name: "one-way-drag", right: "direction-viscous", law: |now, d| d.sign * now.speed.abs(),
        known: |a, d| vec![("drag", d.sign * a)], ..PLAIN },
    ForceKind { name: "swirl", right: "quadratic-viscous", law: |now, _| now.speed * now.speed.abs(),
        known: |a, _| vec![("drag", a)], ..PLAIN },
    // Magnets and teeth: so many periods in a turn.
    ForceKind { name: "x_cogging", law: |now, d| (d.between(0, 6.0, 14.0).round() * now.angle + d.phase()).sin(), ..PLAIN },
    // A cable that is pushed together stiffens.
    ForceKind { name: "x_stiffening", law: |now, d| d.sign * now.angle.powi(3), ..PLAIN },
    ForceKind { name: "x_stop", law: |now, d| d.sign * (d.sign * now.angle - d.between(0, 0.2, 0.8)).max(0.0), ..PLAIN },
    // Friction that differs along the way.
    ForceKind { name: "x_rough-place", law: |now, d| now.way() * (-((now.angle - d.between(0, -0.6, 0.6)) / 0.3).powi(2)).exp(), ..PLAIN },
    ForceKind { name: "x_warming", law: |now, d| now.way() * (-now.part / d.between(0, 0.1, 0.3)).exp(), ..PLAIN },
    ForceKind { name: "x_hold", law: |now, d| if now.part > d.between(0, 0.3, 0.7) { d.sign } else { 0.0 }, ..PLAIN },
    ForceKind { name: "x_sway", law: |now, d| (TAU * d.between(0, 0.02, 0.08) * now.time_s + d.phase()).sin(), ..PLAIN },
];
