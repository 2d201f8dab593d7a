//! Whether the machine has changed: sequential tests on whitened innovations, with a stated rate of false alarms.
//!
//! Problem: the innovations r_k (what a model does not explain of a measured shape, two components) were of one kind while
//! the watch learnt them; say when they are no longer, and be wrong at most as often as was asked for.
//!
//! 1. *Learn*, over the first `learn_s` seconds of motion: mean, size and correlation of the innovations in time (see `slow_noise`).
//! 2. *Whiten*: z = (r - its prediction) / its standard deviation, independent and normal as long as nothing changes.
//! 3. *Watch*: six sums (CUSUM), each reset to zero from below,
//!
//! ```text
//! g <- max(0, g + x - 1/2),   x = ±z·d for five directions d;        g <- max(0, g + (1 - 1/θ) |z|²/2 - ln θ)
//! ```
//!
//! with d the two axes of the base frame, the bend's own direction, the direction across it, and that of the motion;
//! the last one waits for a scatter θ times as large. An alarm is a sum that passes its limit h.
//!
//! where: h follows from the wanted rate by Siegmund's formula, ARL = (e^(2kb) - 2kb - 1) / (2k²), b = h + 1.166, k = 1/2
//! (Sequential Analysis, 1985, Eq. 2.56), with the rate shared by all eleven one-sided sums, and by ARL >= e^h for the
//! scatter's (Lorden 1971). The sums share their noise, so that the real rate is below the one that is asked for.
//!
//! Intuition: k = 1/2 looks for shifts of one standard deviation of the camera, found within half a second at 60 Hz;
//! shifts below a quarter of it pass. A prediction that was poor all along is learnt as noise: this asks what *changed*.
//!
//! Failure: a motion unlike the one that was learnt from may show more of what a poor model never explained, and alarms.

mod learning;
mod slow_noise;

use crate::ParameterError;
use crate::parameters::in_range;
use learning::Learning;
use nalgebra::Vector2;
use slow_noise::Whitener;

/// Settings of a [`ChangeWatch`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeParameters {
    /// Alarms per hour of motion without any change, at most: 1e-5 to 1000.
    pub false_alarms_per_hour: f64,
    /// Motion from which the innovations' own noise is learnt, s; 2 to 600.
    pub learn_s: f64,
}

/// What the model does not explain of one measured shape, and where the snake was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted, in any unit that stays the same, base frame.
    pub r: Vector2<f64>,
    /// The bend vector, rad: its direction counts.
    pub bend_rad: Vector2<f64>,
    /// Change of the bend vector since the innovation before, rad: its direction counts.
    pub motion_rad: Vector2<f64>,
    /// Time since the innovation before, s.
    pub dt_s: f64,
}

/// What an alarm looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeKind {
    /// Along the x axis of the base frame, wherever the snake is.
    AlongX,
    /// Along its y axis.
    AlongY,
    /// Along the bend: more or less bend than predicted.
    InPlane,
    /// Across the bend: its plane is turned.
    OutOfPlane,
    /// Along the motion: behind it or ahead of it.
    WithMotion,
    /// In no direction: more scatter.
    Scatter,
}

/// A sum that passed its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Which one.
    pub kind: ChangeKind,
    /// Its limit h, 1.
    pub limit: f64,
    /// Its value, 1; above the limit.
    pub statistic: f64,
}

/// Learns, watches, and learns anew after an alarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeWatch {
    parameters: ChangeParameters,
    learning: Learning,
    watching: Option<Watching>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Watching {
    mean: Vector2<f64>,
    whitener: [Whitener; 2],
    limit: f64,
    scatter_limit: f64,
    up: [f64; N_DIRECTIONS],
    down: [f64; N_DIRECTIONS],
    scatter: f64,
}

const N_DIRECTIONS: usize = 5;
const KINDS: [ChangeKind; N_DIRECTIONS] =
    [ChangeKind::AlongX, ChangeKind::AlongY, ChangeKind::InPlane, ChangeKind::OutOfPlane, ChangeKind::WithMotion];
/// One-sided sums that share the rate of false alarms.
const N_SUMS: f64 = 2.0 * N_DIRECTIONS as f64 + 1.0;
/// k of the sums, standard deviations: half the shift that is found fastest.
const SLACK: f64 = 0.5;
/// θ: the scatter that is found fastest, as a ratio of variances.
const SCATTER: f64 = 2.25;
/// Larger values count as this many standard deviations, so that no single glitch of a camera is an alarm.
const LARGEST: f64 = 4.0;
/// Below this bend the bending plane has no direction, rad.
const PLANE_FROM_RAD: f64 = 0.09;

impl ChangeWatch {
    /// A watch that has learnt nothing yet.
    ///
    /// # Errors
    /// [`ParameterError`] naming the first value that is not finite or out of range.
    pub fn new(parameters: ChangeParameters) -> Result<Self, ParameterError> {
        in_range("false_alarms_per_hour", parameters.false_alarms_per_hour, 1e-5, 1e3, "1/h")?;
        in_range("learn_s", parameters.learn_s, 2.0, 600.0, "s")?;
        Ok(Self { parameters, learning: Learning::new(), watching: None })
    }

    /// Whether it has learnt enough to see a change.
    pub fn is_watching(&self) -> bool {
        self.watching.is_some()
    }

    /// Takes the innovation of a snake that moves; at rest nothing is said about it. One that is not finite is left out.
    ///
    /// # Real-time
    /// No allocation; a look at 64 earlier innovations while learning, five sums afterwards. The limits are found by 60
    /// halvings at the one step at which learning ends.
    pub fn observe(&mut self, seen: &Innovation) -> Option<Change> {
        let is_finite = [seen.r, seen.bend_rad, seen.motion_rad].iter().all(|v| v.norm().is_finite());
        if !is_finite || !(0.0..=f64::MAX).contains(&seen.dt_s) {
            return None;
        }
        let Some(watching) = &mut self.watching else {
            self.learning.take(seen.r, seen.dt_s);
            if self.learning.seconds() >= self.parameters.learn_s {
                self.watching = self.learning.noise().map(|noise| {
                    let per_hour = self.parameters.false_alarms_per_hour;
                    let run_length = N_SUMS * 3600.0 / (per_hour * self.learning.period_s());
                    Watching::new(self.learning.mean(), Whitener::new(noise), run_length)
                });
                self.learning = Learning::new();
            }
            return None;
        };
        let change = watching.step(seen);
        if change.is_some() {
            self.watching = None;
        }
        change
    }
}

impl Watching {
    fn new(mean: Vector2<f64>, whitener: Whitener, run_length: f64) -> Self {
        Self {
            mean,
            whitener: [whitener; 2],
            limit: limit_for(run_length),
            scatter_limit: run_length.ln(),
            up: [0.0; N_DIRECTIONS],
            down: [0.0; N_DIRECTIONS],
            scatter: 0.0,
        }
    }

    fn step(&mut self, seen: &Innovation) -> Option<Change> {
        let [x, y] = &mut self.whitener;
        let r = seen.r - self.mean;
        let z = Vector2::new(x.whiten(r.x, seen.dt_s), y.whiten(r.y, seen.dt_s));
        let z = z.map(|value| value.clamp(-LARGEST, LARGEST));
        let radial = if seen.bend_rad.norm() < PLANE_FROM_RAD { Vector2::zeros() } else { unit(seen.bend_rad) };
        let across = Vector2::new(-radial.y, radial.x);
        let directions = [Vector2::x(), Vector2::y(), radial, across, unit(seen.motion_rad)];
        for (k, direction) in directions.iter().enumerate() {
            if direction.norm_squared() > 0.0 {
                let x = z.dot(direction);
                self.up[k] = (self.up[k] + x - SLACK).max(0.0);
                self.down[k] = (self.down[k] - x - SLACK).max(0.0);
            }
        }
        let ratio = (1.0 - 1.0 / SCATTER) * 0.5 * z.norm_squared() - SCATTER.ln();
        self.scatter = (self.scatter + ratio).max(0.0);
        self.alarm()
    }

    fn alarm(&self) -> Option<Change> {
        let sums = KINDS.into_iter().zip(self.up.iter().zip(&self.down)).map(|(kind, (up, down))| Change {
            kind,
            limit: self.limit,
            statistic: up.max(*down),
        });
        let scatter = Change { kind: ChangeKind::Scatter, limit: self.scatter_limit, statistic: self.scatter };
        let largest = sums.chain([scatter]).max_by(|a, b| (a.statistic / a.limit).total_cmp(&(b.statistic / b.limit)));
        largest.filter(|change| change.statistic > change.limit)
    }
}

/// The limit at which a one-sided sum of independent normal values takes this many steps to a false alarm, on average.
fn limit_for(run_length: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..60 {
        let h = 0.5 * (low + high);
        let x = 2.0 * SLACK * (h + 1.166);
        if (x.exp_m1() - x) / (2.0 * SLACK * SLACK) < run_length {
            low = h;
        } else {
            high = h;
        }
    }
    high
}

fn unit(v: Vector2<f64>) -> Vector2<f64> {
    v.try_normalize(0.0).unwrap_or_else(Vector2::zeros)
}

impl ChangeKind {
    /// What was seen, for a sentence that begins with "the snake".
    pub fn sentence(self) -> &'static str {
        match self {
            Self::AlongX => "it stands off to one side along the base's x axis",
            Self::AlongY => "it stands off to one side along the base's y axis",
            Self::InPlane => "it bends more or less than the model says",
            Self::OutOfPlane => "its bending plane is turned against the model's",
            Self::WithMotion => "it lags behind the model or runs ahead of it",
            Self::Scatter => "its measured shape scatters more",
        }
    }

    /// The number that messages carry for it, from 1; 0 is no change.
    pub fn number(self) -> u32 {
        Self::ALL.into_iter().position(|other| other == self).map_or(0, |place| place as u32 + 1)
    }

    /// The kind with a number; `None` for 0 and for one that this version does not know.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.get((number as usize).checked_sub(1)?).copied()
    }

    /// All kinds, in the order of their numbers.
    pub const ALL: [Self; N_DIRECTIONS + 1] =
        [Self::AlongX, Self::AlongY, Self::InPlane, Self::OutOfPlane, Self::WithMotion, Self::Scatter];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_found_by_its_number_and_others_are_none() {
        for kind in ChangeKind::ALL {
            assert_eq!(ChangeKind::from_number(kind.number()), Some(kind));
        }
        assert_eq!((ChangeKind::from_number(0), ChangeKind::from_number(7)), (None, None));
    }

    #[test]
    fn the_limit_gives_the_run_length_of_siegmund_s_formula() {
        // k = 0.5 and h = 9: 2 (e^10.166 - 10.166 - 1) = 51,994 steps for one side.
        let one_sided = 2.0 * (10.166_f64.exp_m1() - 10.166);
        assert!((limit_for(one_sided) - 9.0).abs() < 1e-9);
    }
}
