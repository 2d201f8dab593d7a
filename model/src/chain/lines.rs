//! The lines of a chain at one shape: displacement, loads, and the actuator positions between which each line sticks.
//!
//! One code for values, shape derivatives and parameter derivatives. `FULL` false leaves out the stages that a chain without
//! effects there need not look at ([`ChainModel::short`]): the same lines of code, compiled without them.

use super::model::{ChainModel, Memory};
use super::stages::Stage;
use crate::effects::cone::{self, Passage, Span};
use crate::effects::friction::Limits;
use crate::effects::prepared::Now;
use crate::effects::{Real, Scalar, extension, friction, geometry, moment, three};
use core::ops::{Add, Mul};

/// The three lines at one shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lines<P, S> {
    /// Displacements at the snake, m: J_q b.
    pub q: [S; 3],
    /// What clearance, extension inside the snake and the snake's length along its axis add to them, m.
    shift: [S; 3],
    /// Loads at the snake, N.
    pub tau: [S; 3],
    /// Loads in the holder, N.
    holder: [Span<S>; 3],
    /// What the cone makes of them.
    cone: [Passage<P>; 3],
    /// What of them the cone's spring feels: the same, unless friction is spread along the cone.
    spring: [Passage<P>; 3],
    /// What the effects on the extension add, m.
    added: [Span<S>; 3],
}

impl<P: Real> ChainModel<P> {
    /// The lines at a bend (rad) with an internal load (N) that all three share, which is a variable or a parameter.
    #[inline(always)]
    pub(crate) fn lines<const FULL: bool, S, T>(
        &self,
        memory: &mut Memory<P>,
        b: [S; 2],
        tau_common: T,
        now: &Now,
    ) -> Lines<P, S>
    where
        S: Scalar<P> + Add<T, Output = S>,
        T: Copy + Mul<P, Output = T>,
    {
        let j = &self.backbones.j;
        let q = three(|i| b[0] * j[i][0] + b[1] * j[i][1]);
        let mut m = self.backbones.moment(b, &q);
        if FULL {
            for e in self.stages.of(Stage::Moment) {
                m = moment::apply(e, &mut memory.states, &self.constants, b, now, m, |m| self.loads(m));
            }
        }
        let tau = self.loads(m);
        let tau = three(|i| tau[i] + tau_common);
        let axial = tau_common * P::constant(self.constants.axial_m_per_n);
        let (mut moved, mut shift) = (q, [S::constant(0.0) + axial; 3]);
        if FULL && self.stages.has_any(Stage::Geometry) {
            moved = self.at_base(memory, b, q, tau, now);
            shift = three(|i| moved[i] - q[i] + axial);
        }
        let mut holder = tau.map(Span::point);
        if FULL && self.stages.has_any(Stage::Snake) {
            holder = self.rub_at_snake(memory, b, moved, tau, now);
        }
        let cone = three(|i| {
            let half = if FULL { holder[i].half.value() } else { 0.0 };
            cone::pass::<FULL, P>(&self.cone, &Span { middle: holder[i].middle.value(), half }, now)
        });
        let mut spring = cone;
        if FULL && self.is_spread {
            let loads = holder.map(|load| Span { middle: load.middle.value(), half: load.half.value() });
            spring = loads.map(|load| cone::pass_spring(&self.cone, &load, now));
        }
        let mut lines = Lines { q, shift, tau, holder, cone, spring, added: [Span::point(S::constant(0.0)); 3] };
        if FULL && self.stages.has_any(Stage::Extension) {
            lines.added = self.extend(memory, b, moved, &lines, now);
        }
        lines
    }

    /// Position of line i where friction begins, m: what stays where it is while a line sticks.
    #[inline(always)]
    pub(crate) fn seat<const FULL: bool, S: Scalar<P>>(&self, lines: &Lines<P, S>, i: usize) -> S {
        let base = lines.q[i] + lines.shift[i];
        // Without friction before the holder its two limits are one, and friction begins behind it.
        if FULL && self.friction_at_snake { base } else { base + lines.holder[i].middle * self.c_d[i] }
    }

    /// Loads of line i at the actuator, N.
    #[inline(always)]
    pub(crate) fn load<const FULL: bool, S: Scalar<P>>(&self, lines: &Lines<P, S>, i: usize) -> Span<S> {
        if FULL { lines.cone[i].of_span(&lines.holder[i]) } else { lines.cone[i].of(lines.tau[i]) }
    }

    /// Mean loads of line i along the cone, N.
    #[inline(always)]
    fn spring<const FULL: bool, S: Scalar<P>>(&self, lines: &Lines<P, S>, i: usize) -> Span<S> {
        if FULL { lines.spring[i].of_span(&lines.holder[i]) } else { self.load::<FULL, S>(lines, i) }
    }

    /// Extensions of line i without play and preload, m: what the positions that draw it back and push it are more than q.
    #[inline(always)]
    pub(crate) fn extension<const FULL: bool, S: Scalar<P>>(&self, lines: &Lines<P, S>, i: usize) -> Span<S> {
        let (load, c_d, c_c) = (self.spring::<FULL, S>(lines, i), self.c_d[i], self.c_c[i]);
        let holder = &lines.holder[i];
        let (mut middle, mut half) = (lines.shift[i] + holder.middle * c_d + load.middle * c_c, load.half * c_c);
        if FULL {
            middle += lines.added[i].middle;
            half += holder.half * c_d + lines.added[i].half;
        }
        Span { middle, half }
    }

    /// The extension between those two for a sign of motion, -1 to 1, m, of a chain with friction in the cone only.
    #[inline(always)]
    pub(crate) fn short_extension_at<S: Scalar<P>>(&self, lines: &Lines<P, S>, i: usize, sign: f64) -> S {
        // One load in the holder: the springs can be added up before they are loaded.
        let (factor, offset) = lines.cone[i].at(sign);
        lines.shift[i] + lines.tau[i] * (self.c_d[i] + factor * self.c_c[i]) + offset * self.c_c[i]
    }

    #[inline(always)]
    fn loads<S: Scalar<P>>(&self, m: [S; 2]) -> [S; 3] {
        three(|i| m[0] * self.divide[i][0] + m[1] * self.divide[i][1])
    }

    /// Displacements where the lines leave the snake, m.
    #[inline(never)]
    fn at_base<S: Scalar<P>>(
        &self,
        memory: &mut Memory<P>,
        b: [S; 2],
        shape: [S; 3],
        tau: [S; 3],
        now: &Now,
    ) -> [S; 3] {
        let mut q = shape;
        for e in self.stages.of(Stage::Geometry) {
            geometry::apply(e, &mut memory.states, self.constants.r_m, tau, now, &mut q);
            extension::apply_inside(e, &self.constants, &self.c_d, &shape, &tau, &mut q);
            self.add_formula(e, memory, b, q, tau, now, |i, value| q[i] += value);
        }
        q
    }

    #[inline(never)]
    fn rub_at_snake<S: Scalar<P>>(
        &self,
        memory: &mut Memory<P>,
        b: [S; 2],
        q: [S; 3],
        tau: [S; 3],
        now: &Now,
    ) -> [Span<S>; 3] {
        let mut load = three(|i| Limits { low: tau[i], high: tau[i] });
        for e in self.stages.of(Stage::Snake) {
            friction::apply_at_snake(e, &mut memory.states, b, q, now, &mut load);
            self.add_formula(e, memory, b, q, tau, now, |i, value| friction::add(&mut load[i], value));
        }
        three(|i| Span::of(&load[i]))
    }

    #[inline(never)]
    fn extend<S: Scalar<P>>(
        &self,
        memory: &mut Memory<P>,
        b: [S; 2],
        q: [S; 3],
        lines: &Lines<P, S>,
        now: &Now,
    ) -> [Span<S>; 3] {
        let holder = three(|i| lines.holder[i].limits());
        let cone = three(|i| self.spring::<true, S>(lines, i).limits());
        let actuator = three(|i| self.load::<true, S>(lines, i).limits());
        let mut added = [Limits { low: S::constant(0.0), high: S::constant(0.0) }; 3];
        for e in self.stages.of(Stage::Extension) {
            let looked_at = extension::Lines { q, tau: lines.tau, holder: &holder, cone: &cone, actuator: &actuator };
            extension::apply(e, &mut memory.states, &self.constants, &looked_at, now, &mut added);
            self.add_formula(e, memory, b, q, lines.tau, now, |i, value| friction::add(&mut added[i], value));
        }
        three(|i| Span::of(&added[i]))
    }
}
