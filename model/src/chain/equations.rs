//! The equations of the forward model: for each line, it slides up, slides back, rests, or its actuator stalls.
//!
//! clamp(x - x', A- - p, A+ - p) = 0, with x where friction begins, x' that of the step before, A- and A+ the positions that draw
//! the line back and push it, and p where its end is. With stalling actuators, that within the limits of their force. Which of
//! the cases a line is in is chosen by values alone, so that numbers with tangents can be made to follow the same choice.

use super::model::{ChainModel, Memory};
use super::stages::Stage;
use crate::effects::cone::Span;
use crate::effects::friction::Limits;
use crate::effects::prepared::Now;
use crate::effects::{Real, Scalar, play, three};

/// What decides about a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Case {
    /// It sticks.
    Rests,
    /// It slides back.
    Drawn,
    /// It slides up.
    Pushed,
    /// Its actuator stalls while pushing.
    StallsPushing,
    /// Its actuator stalls while drawing.
    StallsDrawing,
}

/// The lines at a shape and an internal load, as far as the equations look at them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends<S> {
    /// Loads at the snake, N.
    pub tau_n: [f64; 3],
    /// Loads at the actuators that draw the line back and push it, N.
    load_n: [Span<f64>; 3],
    /// Where friction begins, m.
    pub seat: [S; 3],
    /// Positions that draw the line back and push it, m.
    position: [Span<S>; 3],
    /// How far an actuator stays behind whose force is at its limit, m: while it draws and while it pushes.
    stalled: Option<[Limits<S>; 3]>,
}

impl<S: Real> Ends<S> {
    /// At y = (b_x, b_y, tau_m).
    #[inline(always)]
    pub(super) fn of<const FULL: bool, P: Real>(
        model: &ChainModel<P>,
        memory: &mut Memory<P>,
        y: [S; 3],
        now: &Now,
    ) -> Self
    where
        S: Scalar<P>,
    {
        let lines = model.lines::<FULL, S, S>(memory, [y[0], y[1]], y[2], now);
        let stalled = model.stall.map(|stall| {
            let c = P::constant(model.constants.c_d_m_per_n);
            three(|i| {
                let load = model.load::<FULL, S>(&lines, i);
                Limits { low: (load.high() - stall) * c, high: (load.low() + stall) * c }
            })
        });
        let position = three(|i| {
            let extension = model.extension::<FULL, S>(&lines, i);
            Span { middle: lines.q[i] + extension.middle, half: extension.half }
        });
        let seat = three(|i| model.seat::<FULL, S>(&lines, i));
        let load_n = three(|i| {
            let load = model.load::<FULL, S>(&lines, i);
            Span { middle: load.middle.value(), half: load.half.value() }
        });
        Self { tau_n: three(|i| lines.tau[i].value()), load_n, seat, position, stalled }
    }

    /// Loads at the actuators, N, for lines in these cases whose ends are at p.
    ///
    /// A line that slides is at a limit of friction. One that rests is between the two, as far as its end is between the positions
    /// that would draw it back and push it: position and load are stretched by the same spring behind the friction, so that crossing
    /// a play (p stays) changes no load, and a reversal changes it over the travel by which that spring is turned round.
    #[inline(always)]
    pub(super) fn actuator_loads_n<P: Real>(&self, cases: &[Case; 3], p: &[P; 3]) -> [f64; 3] {
        three(|i| {
            let (middle, half) = (self.position[i].middle.value(), self.position[i].half.value());
            let sign = match cases[i] {
                Case::Drawn | Case::StallsDrawing => -1.0,
                Case::Pushed | Case::StallsPushing => 1.0,
                // Between limits that are one there is nothing.
                Case::Rests if half > 0.0 => ((p[i].value() - middle) / half).clamp(-1.0, 1.0),
                Case::Rests => 0.0,
            };
            self.load_n[i].at(sign)
        })
    }

    /// Which case each line is in.
    ///
    /// Where the limits are one there is nothing in between, whatever rounding says: a line without friction never rests.
    #[inline(always)]
    pub(super) fn cases<P: Real>(&self, seat: &[P; 3], p: &[P; 3]) -> [Case; 3] {
        three(|i| {
            let p = p[i].value();
            let (low, high) = (self.position[i].low().value() - p, self.position[i].high().value() - p);
            let x = self.seat[i].value() - seat[i].value();
            let (case, free) = match () {
                () if x <= low => (Case::Drawn, low),
                () if x >= high => (Case::Pushed, high),
                () => (Case::Rests, x),
            };
            let Some(stalled) = &self.stalled else { return case };
            match () {
                () if free < stalled[i].low.value() => Case::StallsPushing,
                () if free > stalled[i].high.value() => Case::StallsDrawing,
                () => case,
            }
        })
    }

    /// What is left of the equations, m.
    #[inline(always)]
    pub(super) fn residual<P: Real>(&self, cases: &[Case; 3], seat: &[P; 3], p: &[P; 3]) -> [S; 3]
    where
        S: Scalar<P>,
    {
        three(|i| match (cases[i], &self.stalled) {
            (Case::StallsPushing, Some(stalled)) => stalled[i].low,
            (Case::StallsDrawing, Some(stalled)) => stalled[i].high,
            (Case::Drawn, _) => self.position[i].low() - p[i],
            (Case::Pushed, _) => self.position[i].high() - p[i],
            _ => self.seat[i] - seat[i],
        })
    }

    /// Half-way between the limits of friction: where the lines' ends are at the start.
    pub(super) fn middle(&self) -> [S; 3] {
        self.position.map(|position| position.middle)
    }
}

/// Positions behind the plays for readings of the encoders, m.
pub(super) fn actuators<P: Scalar<P>>(
    model: &ChainModel<P>,
    memory: &mut Memory<P>,
    reading: [P; 3],
    p: &[P; 3],
    now: &Now,
) -> [P; 3] {
    let q_tilde = decode(model, memory, reading, now);
    three(|i| play(p[i], q_tilde[i] + model.preload_m, model.half_width, now.fresh))
}

/// True positions from readings: each encoder effect inverted, last first, by Newton's method on a monotone function.
fn decode<P: Scalar<P>>(model: &ChainModel<P>, memory: &mut Memory<P>, reading: [P; 3], now: &Now) -> [P; 3] {
    let mut x = reading;
    for e in model.stages.of(Stage::Encoder).iter().rev() {
        for (i, own) in x.iter_mut().enumerate() {
            let target = *own;
            for _ in 0..DECODE_STEPS {
                let h = 1e-9;
                let here = model.encode(e, memory, i, *own, now);
                let above = model.encode(e, memory, i, *own + P::constant(h), now);
                let slope = ((above.value() - here.value()) / h).clamp(0.1, 10.0);
                *own = *own - (here - target) * P::constant(1.0 / slope);
            }
        }
    }
    x
}

/// The slope's difference quotient costs convergence a digit or so a step, and the last one is below rounding.
const DECODE_STEPS: u32 = 12;
