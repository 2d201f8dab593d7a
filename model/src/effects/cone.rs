//! Friction behind the holder as a program: what it makes of any load, found once for a line and then used for values and slopes.
//!
//! Every friction there is a constant force, then a capstan: a load T becomes (T +- f_s) g, with g above one where the line moves
//! against its load and below one where it moves with it. For one line these compose to T times a factor plus an offset, one
//! pair for a line about to be drawn back and one for a line about to be pushed.
//!
//! Where a capstan is spread along the cone, the cone gives by the mean load along it: the same program with the capstan's means.

use super::EffectKind;
use super::friction::Limits;
use super::prepared::{Now, Prepared};
use super::real::{Real, Scalar};

/// One friction: (T +- force) times `more` against the load, `less` with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rub<P> {
    /// N.
    force: P,
    more: P,
    less: P,
    /// What the cone's spring feels in place of `more` and `less`.
    mean: [P; 2],
    /// Exponent of a capstan in the stem per radian of its angle; zero elsewhere.
    per_stem_rad: P,
}

/// The frictions of a list of effects, in order; a force and the capstan behind it are one.
pub(crate) fn program<P: Real>(effects: &[Prepared<P>]) -> Vec<Rub<P>> {
    let mut program = Vec::with_capacity(effects.len());
    write_program(effects, &mut program);
    program
}

/// The same into a list that has room for all of them.
pub(crate) fn write_program<P: Real>(effects: &[Prepared<P>], program: &mut Vec<Rub<P>>) {
    let (zero, one) = (P::constant(0.0), P::constant(1.0));
    program.clear();
    for e in effects {
        let own = Rub { force: zero, more: one, less: one, mean: [one; 2], per_stem_rad: zero };
        let own = match e.kind {
            EffectKind::ConeFriction => Rub { more: e.c[0], less: e.c[1], mean: [e.c[0], e.c[1]], ..own },
            EffectKind::DistributedCapstan => Rub { more: e.c[0], less: e.c[1], mean: [e.c[2], e.c[3]], ..own },
            EffectKind::StaticFriction => Rub { force: e.c[0], ..own },
            EffectKind::StemCoupling => Rub { per_stem_rad: e.c[0], ..own },
            _ => continue,
        };
        match program.last_mut().filter(|last| last.more == one && last.less == one && last.per_stem_rad == zero) {
            Some(last) => *last = Rub { force: last.force + own.force, ..own },
            None => program.push(own),
        }
    }
}

/// The passages of one line through all frictions, for its loads in the holder.
#[inline(always)]
pub(crate) fn pass<const FULL: bool, P: Real>(program: &[Rub<P>], holder: &Span<f64>, now: &Now) -> Passage<P> {
    let free = (P::constant(1.0), P::constant(0.0));
    let (mut low, mut high) = (free, free);
    for rub in program {
        let capstan = if FULL { rub.capstan(now) } else { [rub.more, rub.less] };
        low = rub.behind(low, capstan, -1.0, holder.low());
        high = rub.behind(high, capstan, 1.0, holder.high());
    }
    Passage { factor: Span::between(low.0, high.0), offset: Span::between(low.1, high.1) }
}

/// The same for the load that the cone's spring feels. Which side each friction is on follows from the load itself.
pub(crate) fn pass_spring<P: Real>(program: &[Rub<P>], holder: &Span<f64>, now: &Now) -> Passage<P> {
    let free = (P::constant(1.0), P::constant(0.0));
    let [low, high] = [(-1.0, holder.low()), (1.0, holder.high())].map(|(side, holder)| {
        program.iter().fold((free, free), |(load, spring), rub| {
            let capstan = rub.capstan(now);
            let mean = if rub.per_stem_rad == P::constant(0.0) { rub.mean } else { capstan };
            (rub.behind(load, capstan, side, holder), rub.on_spring(load, spring, mean, side, holder))
        })
    });
    let (low, high) = (low.1, high.1);
    Passage { factor: Span::between(low.0, high.0), offset: Span::between(low.1, high.1) }
}

impl<P: Real> Rub<P> {
    /// Factor and offset with this friction behind others, for a line that is pushed (`side` 1) or drawn back (-1) by a load in
    /// the holder of `holder`.
    #[inline(always)]
    fn behind(&self, (factor, offset): (P, P), [more, less]: [P; 2], side: f64, holder: f64) -> (P, P) {
        let offset = offset + self.force.chain(side * self.force.value(), side);
        let against = side * (holder * factor.value() + offset.value()) >= 0.0;
        let g = if against { more } else { less };
        (factor * g, offset * g)
    }

    /// The same for what the spring feels, where `load` is the load before this friction and `spring` what of it is felt.
    fn on_spring(&self, load: (P, P), spring: (P, P), [more, less]: [P; 2], side: f64, holder: f64) -> (P, P) {
        let force = self.force.chain(side * self.force.value(), side);
        let against = side * (holder * load.0.value() + (load.1 + force).value()) >= 0.0;
        let g = if against { more } else { less };
        (spring.0 * g, (spring.1 + force) * g)
    }

    /// Without an angle nothing is known of the stem.
    fn capstan(&self, now: &Now) -> [P; 2] {
        match now.stem_angle_rad() {
            Some(angle_rad) if self.per_stem_rad != P::constant(0.0) => {
                let exponent = self.per_stem_rad * P::constant(angle_rad.abs());
                [exponent.exp(), (-exponent).exp()]
            }
            _ => [self.more, self.less],
        }
    }
}

/// What a load becomes on its way through the cone: a factor times it plus an offset, between the limits of friction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage<P> {
    factor: Span<P>,
    offset: Span<P>,
}

impl<P: Real> Passage<P> {
    /// The loads behind, N, where the limits before are one.
    #[inline(always)]
    pub(crate) fn of<S: Scalar<P>>(&self, load: S) -> Span<S> {
        Span {
            middle: load * self.factor.middle + self.offset.middle,
            half: load * self.factor.half + self.offset.half,
        }
    }

    /// The loads behind, N.
    #[inline(always)]
    pub(crate) fn of_span<S: Scalar<P>>(&self, load: &Span<S>) -> Span<S> {
        Span {
            middle: load.middle * self.factor.middle + load.half * self.factor.half + self.offset.middle,
            half: load.middle * self.factor.half + load.half * self.factor.middle + self.offset.half,
        }
    }

    /// Factor and offset at a sign of motion.
    #[inline(always)]
    pub(crate) fn at(&self, sign: f64) -> (P, P) {
        (self.factor.at(sign), self.offset.at(sign))
    }
}

/// What lies between two limits of friction: a line that is drawn back is at `middle - half`, one that is pushed at
/// `middle + half`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span<S> {
    pub middle: S,
    pub half: S,
}

impl<S: Real> Span<S> {
    /// No friction.
    #[inline(always)]
    pub(crate) fn point(at: S) -> Self {
        Self { middle: at, half: S::constant(0.0) }
    }

    #[inline(always)]
    pub(crate) fn of(limits: &Limits<S>) -> Self {
        Self::between(limits.low, limits.high)
    }

    #[inline(always)]
    pub(crate) fn limits(&self) -> Limits<S> {
        Limits { low: self.low(), high: self.high() }
    }

    #[inline(always)]
    pub(crate) fn between(low: S, high: S) -> Self {
        let halved = |x: S| x.chain(0.5 * x.value(), 0.5);
        Self { middle: halved(high + low), half: halved(high - low) }
    }

    /// Drawn back.
    #[inline(always)]
    pub(crate) fn low(&self) -> S {
        self.middle - self.half
    }

    /// Pushed.
    #[inline(always)]
    pub(crate) fn high(&self) -> S {
        self.middle + self.half
    }

    /// In between, for a sign of motion, -1 to 1.
    #[inline(always)]
    pub(crate) fn at(&self, sign: f64) -> S {
        self.middle + self.half.chain(sign * self.half.value(), sign)
    }
}

#[cfg(test)]
mod tests {
    use super::super::prepared::{Constants, MAX_PARAMETERS};
    use super::*;

    const MU: f64 = 0.2;
    const F_S_N: f64 = 2.0;
    const STEM_RAD: f64 = -0.7;

    fn passage(kinds: &[EffectKind], load_n: f64) -> (usize, Limits<f64>) {
        let machine = Constants {
            l_m: 0.026,
            r_m: 1.684e-3,
            bending_stiffness_nm2: 3.4e-4,
            c_d_m_per_n: 6e-5,
            c_c_m_per_n: 7e-6,
            axial_m_per_n: 1e-5,
            l_d_m: 0.48,
            phi_rad: 0.7,
            d_outer_m: 6.6e-4,
        };
        let prepared = |kind: &EffectKind| {
            let mut values = [0.0; MAX_PARAMETERS];
            values[0] = if *kind == EffectKind::StaticFriction { F_S_N } else { MU };
            Prepared::new(*kind, 0, &values, &machine, 0, 0)
        };
        let program = program(&kinds.iter().map(prepared).collect::<Vec<_>>());
        let now = Now {
            time_s: 0.0,
            dt_s: 0.0,
            stem_column_rad: STEM_RAD,
            temperature_column_c: f64::NAN,
            commit: false,
            fresh: false,
        };
        (program.len(), pass::<true, f64>(&program, &Span::point(load_n), &now).of(load_n).limits())
    }

    /// Effects, how many frictions they come to, and the load behind them by the side.
    type Case<'a> = (&'a [EffectKind], usize, &'a dyn Fn(f64) -> f64);

    #[test]
    fn a_passage_is_its_effects_one_after_the_other() {
        use EffectKind as K;
        let g = (2.0 * MU * 0.7_f64).exp();
        let stem = (MU * STEM_RAD.abs()).exp();
        let capstan = |load: f64, side: f64, g: f64| if load * side >= 0.0 { load * g } else { load / g };
        for load_n in [-30.0, -1.9, -0.1, 0.0, 0.5, 1.9, 12.0] {
            let cases: [Case<'_>; 5] = [
                (&[], 0, &|_| load_n),
                (&[K::ConeFriction], 1, &|side| capstan(load_n, side, g)),
                (&[K::StaticFriction, K::ConeFriction], 1, &|side| capstan(load_n + side * F_S_N, side, g)),
                (&[K::ConeFriction, K::StaticFriction], 2, &|side| capstan(load_n, side, g) + side * F_S_N),
                (&[K::StaticFriction, K::StemCoupling, K::ConeFriction], 2, &|side| {
                    capstan(capstan(load_n + side * F_S_N, side, stem), side, g)
                }),
            ];
            for (kinds, n, expected) in cases {
                let (length, found) = passage(kinds, load_n);
                assert_eq!(length, n, "{kinds:?}");
                for (found, side) in [(found.low, -1.0), (found.high, 1.0)] {
                    assert!((found - expected(side)).abs() < 1e-13, "{kinds:?} {load_n} {side}: {found}");
                }
            }
        }
    }
}
