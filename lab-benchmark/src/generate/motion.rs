//! Motions for measurements: what the operator wants, as a bend vector over time.

use super::random::{Purpose, Random};
use core::f64::consts::{PI, TAU};

/// Largest bend of any motion, rad.
const MOST_BEND_RAD: f64 = 75.0 * PI / 180.0;
const DEG: f64 = PI / 180.0;

/// A kind of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Planes up and down, rotations both ways, nested loops, three speeds, rests: what a calibration should do.
    Rich,
    /// Reaches to random places with rests between, as a surgeon moves.
    Teleop,
    /// One way from straight to bent in one plane: the paper's own kind of data, which can tell almost nothing.
    Ramp,
    /// Up and down at one speed in three planes.
    Triangle,
    /// Sums of sines in both axes.
    Multisine,
    /// Steps of ten degrees with rests, up and down.
    Staircase,
}

impl Motion {
    /// Every kind.
    pub const ALL: [Self; 6] = [Self::Rich, Self::Teleop, Self::Ramp, Self::Triangle, Self::Multisine, Self::Staircase];

    /// Its name on the command line and in answers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rich => "rich",
            Self::Teleop => "teleop",
            Self::Ramp => "ramp",
            Self::Triangle => "triangle",
            Self::Multisine => "multisine",
            Self::Staircase => "staircase",
        }
    }

    /// The bend vector of `n` samples, rad, beginning straight.
    pub(crate) fn path_rad(self, n: usize, period_s: f64, seed: u64) -> Vec<[f64; 2]> {
        let mut random = Random::new(seed, Purpose::Motion);
        let mut pen = Pen { period_s, n, path: vec![[0.0; 2]], bend: 0.0, delta: 0.0 };
        match self {
            Self::Multisine => return multisine(n, period_s, &mut random),
            Self::Ramp => pen.ramp(MOST_BEND_RAD, n as f64 * period_s),
            Self::Rich => rich(&mut pen, &mut random),
            Self::Teleop => teleop(&mut pen, &mut random),
            Self::Triangle => triangle(&mut pen),
            Self::Staircase => staircase(&mut pen),
        }
        pen.path.truncate(n);
        pen.path
    }
}

/// Draws a path until it has `n` samples.
struct Pen {
    period_s: f64,
    n: usize,
    path: Vec<[f64; 2]>,
    bend: f64,
    delta: f64,
}

impl Pen {
    fn is_full(&self) -> bool {
        self.path.len() >= self.n
    }

    /// Goes to a bend and plane in polar coordinates, with soft ends.
    fn to(&mut self, bend: f64, delta: f64, seconds: f64) {
        let (from, turned) = (self.bend, self.delta);
        self.draw(seconds, |part| {
            let s = part * part * (3.0 - 2.0 * part);
            polar(from + s * (bend - from), turned + s * (delta - turned))
        });
        (self.bend, self.delta) = (bend, delta);
    }

    /// Goes in a straight line of the bend vector.
    fn reach(&mut self, bend: f64, delta: f64, seconds: f64) {
        let (from, to) = (polar(self.bend, self.delta), polar(bend, delta));
        self.draw(seconds, |part| {
            let s = part.powi(3) * (10.0 - 15.0 * part + 6.0 * part * part);
            core::array::from_fn(|k| from[k] + s * (to[k] - from[k]))
        });
        (self.bend, self.delta) = (bend, delta);
    }

    /// Goes up at one speed.
    fn ramp(&mut self, bend: f64, seconds: f64) {
        self.draw(seconds, |part| polar(part * bend, 0.0));
    }

    fn rest(&mut self, seconds: f64) {
        let at = polar(self.bend, self.delta);
        self.draw(seconds, |_| at);
    }

    fn draw(&mut self, seconds: f64, at: impl Fn(f64) -> [f64; 2]) {
        let n = (seconds / self.period_s).round().max(1.0) as usize;
        self.path.extend((1..=n).map(|k| at(k as f64 / n as f64)));
    }
}

fn polar(bend: f64, delta: f64) -> [f64; 2] {
    [bend * delta.cos(), bend * delta.sin()]
}

fn rich(pen: &mut Pen, random: &mut Random) {
    let speeds = [12.0 * DEG, 25.0 * DEG, 50.0 * DEG];
    let mut round = 0;
    while !pen.is_full() {
        let first = random.between(-PI, PI);
        for plane in 0..6 {
            let delta = first + f64::from(plane) * PI / 3.0;
            let speed = speeds[(plane as usize + round) % 3];
            let top = random.between(0.75, 1.0) * MOST_BEND_RAD;
            pen.to(2.0 * DEG, delta, 0.6);
            pen.to(top, delta, 1.5 * top / speed);
            if plane % 2 == 0 {
                pen.rest(3.0);
            }
            pen.to(2.0 * DEG, delta, 1.5 * top / speed);
        }
        for (bend, speed) in [(45.0 * DEG, 45.0 * DEG), (25.0 * DEG, 90.0 * DEG)] {
            let delta = pen.delta;
            pen.to(bend, delta, 2.0);
            for turned in [TAU, 0.0] {
                pen.to(bend, delta + turned, 1.5 * TAU / speed);
                pen.rest(1.0);
            }
        }
        let delta = random.between(-PI, PI);
        pen.reach(20.0 * DEG, delta, 2.0);
        for (top, low) in [(70.0, 22.0), (62.0, 30.0), (56.0, 36.0), (50.0, 42.0)] {
            pen.to(top * DEG, delta, (top - low) / 20.0 + 0.4);
            pen.to(low * DEG, delta, (top - low) / 20.0 + 0.4);
        }
        pen.rest(5.0);
        pen.reach(2.0 * DEG, delta, 2.0);
        round += 1;
    }
}

fn teleop(pen: &mut Pen, random: &mut Random) {
    pen.reach(20.0 * DEG, random.between(-PI, PI), 2.0);
    while !pen.is_full() {
        let before = polar(pen.bend, pen.delta);
        let bend = MOST_BEND_RAD * random.between(0.0, 0.81).sqrt();
        let delta = pen.delta + random.between(-1.2, 1.2);
        let after = polar(bend, delta);
        let way = (after[0] - before[0]).hypot(after[1] - before[1]);
        pen.reach(bend, delta, (way / random.between_log(8.0 * DEG, 45.0 * DEG)).max(0.4));
        if random.between(0.0, 1.0) < 0.35 {
            pen.rest(random.between(0.3, 4.0));
        }
    }
}

fn triangle(pen: &mut Pen) {
    for plane in 0.. {
        if pen.is_full() {
            return;
        }
        let delta = f64::from(plane % 3) * TAU / 3.0;
        let (from, turned) = (pen.bend, delta);
        pen.delta = turned;
        for (start, end) in [(from, MOST_BEND_RAD), (MOST_BEND_RAD, 0.0)] {
            pen.draw((end - start).abs() / (15.0 * DEG), |part| polar(start + part * (end - start), delta));
        }
        pen.bend = 0.0;
    }
}

fn staircase(pen: &mut Pen) {
    for plane in 0.. {
        if pen.is_full() {
            return;
        }
        let delta = f64::from(plane % 4) * PI / 2.0;
        pen.delta = delta;
        for step in (1..=7).chain((0..7).rev()) {
            pen.to(10.0 * DEG * f64::from(step), delta, 0.8);
            pen.rest(2.0);
        }
    }
}

fn multisine(n: usize, period_s: f64, random: &mut Random) -> Vec<[f64; 2]> {
    let mut axis = || -> Vec<f64> {
        let lines: Vec<(f64, f64)> =
            (0..8).map(|_| (random.between_log(0.02, 0.25), random.between(0.0, TAU))).collect();
        let at = |t: f64| lines.iter().map(|(f, phase)| (TAU * f * t + phase).sin() - phase.sin()).sum::<f64>();
        (0..n).map(|k| at(k as f64 * period_s)).collect()
    };
    let (x, y) = (axis(), axis());
    let most = x.iter().zip(&y).map(|(x, y)| x.hypot(*y)).fold(1e-9, f64::max);
    x.iter().zip(&y).map(|(x, y)| [x / most * MOST_BEND_RAD, y / most * MOST_BEND_RAD]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_motion_begins_straight_stays_in_bounds_and_does_not_jump() {
        for motion in Motion::ALL {
            for seed in 0..5 {
                let path = motion.path_rad(10_000, 0.02, seed);
                assert_eq!(path.len(), 10_000, "{motion:?}");
                assert!(path[0][0].hypot(path[0][1]) < 1e-9, "{motion:?}");
                let fastest = path.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]) / 0.02);
                let fastest = fastest.fold(0.0, f64::max);
                assert!(fastest < 130.0 * DEG, "{motion:?}: {} deg/s", fastest / DEG);
                assert!(path.iter().all(|b| b[0].hypot(b[1]) < MOST_BEND_RAD + 1e-9), "{motion:?}");
            }
        }
    }

    #[test]
    fn a_ramp_never_turns_back_and_a_rich_motion_goes_through_all_planes_both_ways() {
        let ramp = Motion::Ramp.path_rad(2000, 0.02, 3);
        assert!(ramp.windows(2).all(|w| w[1][0] > w[0][0] && w[1][1] == 0.0));
        let rich = Motion::Rich.path_rad(10_000, 0.02, 3);
        for sector in 0..12 {
            let middle = (f64::from(sector) + 0.5) * TAU / 12.0 - PI;
            let here = |b: &&[f64; 2]| (b[1].atan2(b[0]) - middle).abs() < TAU / 24.0 && b[0].hypot(b[1]) > 0.4;
            assert!(rich.iter().filter(here).count() > 50, "sector {sector}");
        }
    }
}
