//! The effects that may be missing from a joint, each with few parameters: where in the chain, what is nonlinear, where to look.

use super::signal::Signal;
use crate::Offered;
use crate::noise::bounds;

/// One effect, parameter-poor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Kind {
    Coupling(usize),
    Periodic,
    Latency,
    RateLimit,
    Lag,
    SecondOrder,
    Backlash,
    BoucWen,
    Plays,
    UnevenPlays,
    LoadFriction,
    DeadZone,
    Saturation,
    Quadratic,
    Cubic,
    Curve,
    Creep,
    LinearDrift,
    WarmUp,
    Scale,
    Offset,
    /// A formula of the user's.
    Own(Offered),
    // Shapes that no effect of the library makes: what is left may look like one of them.
    Kink,
    Drag,
    Jump,
    Wander,
    Rhythm,
    Fading,
    Product(usize),
    OtherSquare(usize),
    OtherPlay(usize),
}

/// Of one class a list holds at most one member: they explain the same; but for [`Kind::stands_beside`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    Rate,
    Play,
    Load,
    DeadZone,
    Clipped,
    Curve,
    Creep,
    Drift,
    Periodic,
    Coupling(usize),
    Proportional,
    Constant,
    Own(Offered),
    /// Shapes are each of their own class.
    Shape(Kind),
}

/// How a nonlinear parameter is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
    pub scale: Coordinates,
    /// Whether its end is the edge of what is physical: an effect that ends there imitates another.
    pub ends_matter: bool,
}

/// The coordinate in which a parameter is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coordinates {
    Log,
    Linear(f64),
    /// Signed and logarithmic on both sides of this size.
    Signed(f64),
}

impl Range {
    pub fn coordinate(&self, value: f64) -> f64 {
        match self.scale {
            Coordinates::Log => value.ln(),
            Coordinates::Linear(size) => value / size,
            Coordinates::Signed(size) => (value / size).asinh(),
        }
    }

    pub fn value(&self, coordinate: f64) -> f64 {
        let value = match self.scale {
            Coordinates::Log => coordinate.exp(),
            Coordinates::Linear(size) => coordinate * size,
            Coordinates::Signed(size) => coordinate.sinh() * size,
        };
        value.clamp(self.low, self.high)
    }

    /// Whether a value lies at an end that matters.
    pub fn at_end(&self, value: f64) -> bool {
        let near = |end: f64| (self.coordinate(value) - self.coordinate(end)).abs() < 0.02;
        self.ends_matter && (near(self.low) || near(self.high))
    }
}

/// Half-width of the widest play, as a part of the range: a wider one leaves less than a twentieth of the motion.
const WIDEST_PLAY: f64 = 0.475;
/// The same of hysteresis that also has weights: they and a wide one together imitate a creep.
const WIDEST_WEIGHTED: f64 = 0.45;
/// The bend of uneven hysteresis over half the range: from a half on its curve turns back at one end ...
const MOST_UNEVEN: f64 = 0.48;
/// ... and below this its loops are as wide on both sides: it is hysteresis of plain plays.
const LEAST_UNEVEN: f64 = 0.08;
/// Half waves over the record that make a slow wandering: the shortest lasts a fifth of the record.
pub(super) const WAVES: usize = 10;
/// An error with fewer periods in the whole range is a curve.
const FEWEST_TURNS: f64 = 3.0;

/// A parameter of a formula is looked for so far from the value that is given, in both directions.
const FAR_FROM_GIVEN: f64 = 30.0;

/// The range of a formula's parameter: one that is given positive stays so, of the others nothing is known.
fn around(given: f64) -> Range {
    let (low, high, scale) = if given > 0.0 {
        (given / FAR_FROM_GIVEN, given * FAR_FROM_GIVEN, Coordinates::Log)
    } else {
        let size = if given == 0.0 { 1.0 } else { -given };
        (-FAR_FROM_GIVEN * size, FAR_FROM_GIVEN * size, Coordinates::Linear(size))
    };
    Range { low, high, scale, ends_matter: false }
}

impl Kind {
    /// All that a joint can have.
    pub fn all(signal: &Signal) -> Vec<Self> {
        let mut all = vec![
            Self::Latency,
            Self::Lag,
            Self::SecondOrder,
            Self::RateLimit,
            Self::Backlash,
            Self::BoucWen,
            Self::Plays,
            Self::UnevenPlays,
            Self::LoadFriction,
            Self::DeadZone,
            Self::Saturation,
            Self::Cubic,
            Self::Quadratic,
            Self::Curve,
            Self::Creep,
            Self::LinearDrift,
            Self::WarmUp,
            Self::Periodic,
        ];
        // A joint that does not move bends nothing else.
        let moves = |k: &usize| {
            let (low, high) = bounds(signal.inputs[*k].iter().copied());
            *k != signal.joint && high - low > 1e-9 * high.abs().max(low.abs()).max(1e-12)
        };
        all.extend((0..signal.inputs.len()).filter(moves).map(Self::Coupling));
        all
    }

    /// Its class.
    pub fn class(self) -> Class {
        match self {
            Self::Latency | Self::RateLimit | Self::Lag | Self::SecondOrder => Class::Rate,
            Self::Backlash | Self::BoucWen | Self::Plays | Self::UnevenPlays => Class::Play,
            Self::LoadFriction => Class::Load,
            Self::DeadZone => Class::DeadZone,
            Self::Saturation => Class::Clipped,
            Self::Quadratic | Self::Cubic | Self::Curve => Class::Curve,
            Self::Creep => Class::Creep,
            Self::LinearDrift | Self::WarmUp | Self::Wander => Class::Drift,
            Self::Scale => Class::Proportional,
            Self::Offset => Class::Constant,
            Self::Periodic => Class::Periodic,
            Self::Coupling(from) => Class::Coupling(from),
            Self::Own(own) => Class::Own(own),
            own => Class::Shape(own),
        }
    }

    /// Whether a list may hold both. A delay moves the motion in time and keeps its shape, which no lag does: a bus or a camera behind
    /// a slow joint makes both.
    pub fn stands_beside(self, other: Self) -> bool {
        let is_slow = |kind: Self| matches!(kind, Self::RateLimit | Self::Lag | Self::SecondOrder);
        self.class() != other.class()
            || self == Self::Latency && is_slow(other)
            || other == Self::Latency && is_slow(self)
    }

    /// Every shape that a joint's errors can have and no effect of the library makes.
    pub fn shapes(signal: &Signal) -> Vec<Self> {
        let mut all = vec![Self::Kink, Self::Drag, Self::Jump, Self::Wander, Self::Rhythm, Self::Fading];
        for kind in Self::all(signal) {
            if let Self::Coupling(k) = kind {
                all.extend([Self::Product(k), Self::OtherSquare(k), Self::OtherPlay(k)]);
            }
        }
        all
    }

    /// Whether it is a shape without a name in the library.
    pub fn is_shape(self) -> bool {
        self == Self::Wander || matches!(self.class(), Class::Shape(_))
    }

    /// Its name in answers and model files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Coupling(_) => "cross-coupling",
            Self::Periodic => "periodic-error",
            Self::Latency => "latency",
            Self::RateLimit => "rate-limit",
            Self::Lag => "first-order-lag",
            Self::SecondOrder => "second-order",
            Self::Backlash => "backlash",
            Self::BoucWen => "bouc-wen",
            Self::Plays => "prandtl-ishlinskii",
            Self::UnevenPlays => "generalised-prandtl-ishlinskii",
            Self::LoadFriction => "load-friction",
            Self::DeadZone => "dead-zone",
            Self::Saturation => "saturation",
            Self::Quadratic => "quadratic",
            Self::Cubic | Self::Curve => "cubic",
            Self::Creep => "creep",
            Self::LinearDrift => "linear-drift",
            Self::WarmUp => "drift",
            Self::Scale => "scale",
            Self::Offset => "offset",
            Self::Own(own) => own.name(),
            Self::Kink => "the position, with another slope beyond some place",
            Self::Drag => "speed, by a power of it",
            Self::Jump => "time, with a jump",
            Self::Wander => "time, as a slow wandering",
            Self::Rhythm => "a rhythm in time that the motion does not have",
            Self::Fading => "time, as a gain that changes",
            Self::Product(_) => "the product of two joints' positions",
            Self::OtherSquare(_) => "another joint's position, by its square",
            Self::OtherPlay(_) => "another joint's motion, with play",
        }
    }

    /// Whether it changes the position that the effects behind it see; else it adds columns.
    pub fn carries(self) -> bool {
        matches!(
            self,
            Self::Latency
                | Self::RateLimit
                | Self::Lag
                | Self::SecondOrder
                | Self::Backlash
                | Self::DeadZone
                | Self::Saturation
        )
    }

    /// Whether its memory may start anywhere.
    pub fn has_start(self) -> bool {
        matches!(self, Self::Backlash | Self::BoucWen | Self::Plays | Self::UnevenPlays)
    }

    /// Whether these values make it a plainer kind, which is a candidate too.
    pub fn is_plainer(self, values: &[f64], s: &Signal) -> bool {
        match (self, values) {
            (Self::UnevenPlays, [_, bend, ..]) => bend.abs() * 0.5 * s.range < LEAST_UNEVEN,
            // A swing that is damped so much is two lags, and one that is over within a row is where in the row the command came.
            (Self::SecondOrder, [frequency, damping]) if *damping > 1.0 => {
                let faster = frequency * (damping + (damping * damping - 1.0).sqrt());
                faster * s.typical_step_s > 1.0
            }
            _ => false,
        }
    }

    /// Whether it can only lose motion: what it does to the position has the sign of the gain.
    pub fn lags_behind(self) -> bool {
        matches!(self, Self::BoucWen | Self::Plays | Self::UnevenPlays | Self::LoadFriction)
    }

    /// Whether it depends on the position that those before it pass on.
    fn sees_position(self) -> bool {
        !matches!(
            self,
            Self::Coupling(_)
                | Self::Offset
                | Self::LinearDrift
                | Self::WarmUp
                | Self::Jump
                | Self::Wander
                | Self::Rhythm
                | Self::OtherSquare(_)
                | Self::OtherPlay(_)
        )
    }

    /// Whether it is one thing to stand before another effect and another to stand behind it. What adds goes around those behind it, so
    /// that two that add are the same both ways; a delay before what changes the position is the same as one behind it.
    pub fn has_order_with(self, other: Self) -> bool {
        match (self.carries(), other.carries()) {
            (false, false) => false,
            (true, true) => self != Self::Latency && other != Self::Latency,
            (true, false) => other.sees_position(),
            (false, true) => self.sees_position(),
        }
    }

    /// Amplitudes that are solved for.
    pub fn n_linear(self) -> usize {
        match self {
            Self::Periodic | Self::Plays | Self::UnevenPlays | Self::Curve | Self::Rhythm => 2,
            Self::Wander => WAVES,
            Self::Own(own) => own.amplitudes().len(),
            own if own.carries() => 0,
            _ => 1,
        }
    }

    /// Its nonlinear parameters.
    pub fn ranges(self, s: &Signal) -> Vec<Range> {
        let log =
            |low: f64, high: f64| Range { low, high: high.max(low * 1.5), scale: Coordinates::Log, ends_matter: true };
        let open = |range: Range| Range { ends_matter: false, ..range };
        let (r, dt) = (s.range, s.typical_step_s);
        match self {
            Self::Latency => {
                let most = 2.0_f64.min(s.longest_s / 8.0).max(dt);
                vec![Range { low: -most, high: most, scale: Coordinates::Signed(dt), ends_matter: true }]
            }
            Self::Lag => vec![log(0.3 * dt, 8.0_f64.min(s.longest_s / 8.0))],
            Self::SecondOrder => vec![log(0.5, 200.0_f64.min(1.0 / dt)), log(0.15, 3.0)],
            Self::RateLimit => vec![log(0.02 * s.fast, 1.2 * s.fast)],
            Self::Backlash => vec![log(2e-3 * r, WIDEST_PLAY * r)],
            Self::BoucWen => {
                let unloading = Range { low: 0.0, high: 0.5, scale: Coordinates::Linear(0.5), ends_matter: false };
                vec![log(2e-3 * r, WIDEST_WEIGHTED * r), unloading]
            }
            Self::Plays => vec![log(2e-3 * r, WIDEST_WEIGHTED * r)],
            Self::UnevenPlays => {
                let most = MOST_UNEVEN / (0.5 * r);
                let scale = Coordinates::Linear(most);
                vec![log(2e-3 * r, WIDEST_WEIGHTED * r), Range { low: -most, high: most, scale, ends_matter: true }]
            }
            Self::LoadFriction => vec![log(0.005, 0.6)],
            Self::DeadZone => {
                let scale = Coordinates::Linear(r);
                vec![log(2e-3 * r, 0.35 * r), Range { low: s.low, high: s.low + r, scale, ends_matter: true }]
            }
            Self::Saturation => {
                let most = s.low.abs().max((s.low + r).abs());
                vec![log(0.2 * most, 1.01 * most)]
            }
            Self::Creep => vec![log(1.0_f64.max(20.0 * dt), s.longest_s / 3.0)],
            Self::WarmUp => vec![open(log(s.longest_s / 8.0, s.longest_s * 0.7))],
            Self::Periodic => vec![open(log((r / 100.0).max(1e-4 * r), r / FEWEST_TURNS))],
            Self::Kink => {
                let (low, high) = (s.low + 0.08 * r, s.low + 0.92 * r);
                vec![open(Range { low, high, scale: Coordinates::Linear(0.2 * r), ends_matter: false })]
            }
            Self::Drag => vec![log(0.25, 4.0)],
            Self::Jump => vec![Range { low: 0.03, high: 0.97, scale: Coordinates::Linear(0.1), ends_matter: false }],
            Self::Rhythm => {
                let (low, high) = s.rhythms_hz();
                vec![Range { low, high, scale: Coordinates::Linear(1.0 / s.longest_s), ends_matter: false }]
            }
            Self::OtherPlay(k) => {
                let range = s.range_of(k);
                vec![log(0.01 * range, 0.4 * range)]
            }
            Self::Own(own) => own.shapes().map(|(_, given)| around(given)).collect(),
            Self::Quadratic
            | Self::Cubic
            | Self::Curve
            | Self::LinearDrift
            | Self::Coupling(_)
            | Self::Scale
            | Self::Offset
            | Self::Fading
            | Self::Wander
            | Self::Product(_)
            | Self::OtherSquare(_) => Vec::new(),
        }
    }

    /// Where a search starts: values of the nonlinear parameters.
    pub fn grid(self, s: &Signal) -> Vec<Vec<f64>> {
        let ranges = self.ranges(s);
        let steps = |k: usize, n: usize| -> Vec<f64> {
            let (low, high) =
                ((1.5 * ranges[k].low).ln(), (0.85 * ranges[k].high).ln().max((1.5 * ranges[k].low).ln()));
            (0..n).map(|i| (low + (high - low) * i as f64 / (n - 1) as f64).exp()).collect()
        };
        let one = |values: Vec<f64>| values.into_iter().map(|value| vec![value]).collect();
        let two = |a: Vec<f64>, b: Vec<f64>| a.iter().flat_map(|x| b.iter().map(move |y| vec![*x, *y])).collect();
        match self {
            Self::Latency => {
                let (low, high) = ((0.5 * s.typical_step_s).ln(), (0.85 * ranges[0].high).ln());
                let size = |i: usize| (low + (high - low).max(0.0) * i as f64 / 11.0).exp();
                one((0..12).map(size).chain((0..12).step_by(2).map(|i| -size(i))).collect())
            }
            Self::Lag => one(steps(0, 12)),
            Self::SecondOrder => two(steps(0, 9), steps(1, 5)),
            Self::RateLimit | Self::LoadFriction => one(steps(0, 9)),
            Self::Backlash | Self::Plays => one(steps(0, 14)),
            Self::BoucWen => two(steps(0, 14), vec![ranges[1].low, ranges[1].high]),
            Self::UnevenPlays => {
                let bends = [-0.5, 0.5].map(|part| part * ranges[1].high);
                two(steps(0, 8), bends.to_vec())
            }
            Self::DeadZone => {
                let centres = (1..=7).map(|k| s.low + s.range * (0.1 + 0.8 * (k - 1) as f64 / 6.0)).collect();
                two(steps(0, 9), centres)
            }
            Self::Saturation => {
                one([0.5, 0.6, 0.7, 0.8, 0.9, 0.95].iter().map(|part| part * ranges[0].high / 1.01).collect())
            }
            Self::Creep => one(steps(0, 6)),
            Self::WarmUp => one(steps(0, 5)),
            Self::Periodic => one((0..228).map(|k| s.range / (FEWEST_TURNS + 0.25 * f64::from(k))).collect()),
            Self::Kink => one((1..=9).map(|k| s.low + s.range * 0.1 * f64::from(k)).collect()),
            Self::Drag => one(vec![0.4, 0.6, 1.7, 2.5]),
            Self::Jump => one((1..48).map(|k| f64::from(k) / 48.0).collect()),
            Self::Rhythm => {
                let (low, high) = s.rhythms_hz();
                let all = (0..).map(|k| low + 0.5 * f64::from(k) / s.longest_s).take_while(|f| *f < high);
                one(all.filter(|hz| !s.is_of_motion(*hz)).collect())
            }
            Self::OtherPlay(_) => one(steps(0, 7)),
            Self::Own(own) => own.grid(),
            _ => vec![Vec::new()],
        }
    }
}
