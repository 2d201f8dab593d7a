//! The moves that an experiment may have, of a snake and of joints, each from rest and back to where it began.

use core::f64::consts::TAU;

/// A motion.
#[derive(Clone, Debug)]
pub(super) struct Move {
    /// What it does, for a person.
    pub words: String,
    /// Positions, row after row: the bend vector of a snake, rad, or every joint's command.
    pub path: Vec<Vec<f64>>,
}

const DEG: f64 = core::f64::consts::PI / 180.0;
/// Mean rates of a snake's moves, deg/s.
const SPEEDS_DEG: [f64; 3] = [10.0, 20.0, 40.0];
/// Parts of a joint's fastest speed at which it moves.
const SPEEDS: [(f64, &str); 3] = [(1.0, "fast"), (0.25, "at a quarter of that speed"), (0.06, "slowly")];
/// The longest way of one move, s: a slow one is cut rather than endless.
const LONGEST_S: f64 = 50.0;

/// Draws paths of one machine.
pub(super) struct Pen {
    home: Vec<f64>,
    path: Vec<Vec<f64>>,
    period_s: f64,
}

impl Pen {
    pub fn new(home: &[f64], period_s: f64) -> Self {
        Self { home: home.to_vec(), path: vec![home.to_vec()], period_s }
    }

    fn here(&self) -> Vec<f64> {
        self.path.last().unwrap_or(&self.home).clone()
    }

    pub fn rest(&mut self, seconds: f64) {
        let here = self.here();
        self.draw(seconds, |_| here.clone());
    }

    /// A straight line with soft ends in this time.
    fn to(&mut self, target: &[f64], seconds: f64) {
        let here = self.here();
        let at = |part: f64| {
            let soft = part * part * (3.0 - 2.0 * part);
            here.iter().zip(target).map(|(a, b)| a + (b - a) * soft).collect()
        };
        self.draw(seconds, at);
    }

    fn draw(&mut self, seconds: f64, at: impl Fn(f64) -> Vec<f64>) {
        let n = (seconds / self.period_s).round().max(1.0) as usize;
        self.path.extend((1..=n).map(|k| at(k as f64 / n as f64)));
    }

    /// Every row that was drawn.
    pub fn into_path(self) -> Vec<Vec<f64>> {
        self.path
    }

    fn ended(self, words: String) -> Move {
        Move { words, path: self.path }
    }
}

/// A snake's moves, from straight to straight.
pub(super) fn of_snake(period_s: f64) -> Vec<Move> {
    let polar = |bend_deg: f64, plane: f64| vec![bend_deg * DEG * plane.cos(), bend_deg * DEG * plane.sin()];
    let home = [0.0, 0.0];
    let to = |pen: &mut Pen, target: &[f64], speed_deg: f64| {
        let way = pen.here().iter().zip(target).map(|(a, b)| (b - a).powi(2)).sum::<f64>().sqrt();
        pen.to(target, (way / (speed_deg * DEG)).max(0.4));
    };
    let mut moves = Vec::new();
    for (plane_deg, speed) in [0.0, 60.0].into_iter().flat_map(|plane| SPEEDS_DEG.map(|speed| (plane, speed))) {
        let mut pen = Pen::new(&home, period_s);
        for (top, low) in [(60.0, 0.0), (50.0, 10.0), (40.0, 20.0), (33.0, 27.0)] {
            to(&mut pen, &polar(top, plane_deg * DEG), speed);
            to(&mut pen, &polar(low, plane_deg * DEG), speed);
        }
        to(&mut pen, &home, speed);
        moves.push(pen.ended(format!("nested loops up to 60 deg in the plane at {plane_deg} deg, at {speed} deg/s")));
    }
    for bend in [20.0, 40.0, 60.0] {
        let mut pen = Pen::new(&home, period_s);
        to(&mut pen, &polar(bend, 0.0), SPEEDS_DEG[1]);
        for turn in [TAU, -TAU] {
            // As fast as the tangent moves at 40 deg/s at most.
            let seconds = (1.5 * TAU * bend / 40.0).max(6.0);
            pen.draw(seconds, |part| polar(bend, turn * part * part * (3.0 - 2.0 * part)));
        }
        to(&mut pen, &home, SPEEDS_DEG[1]);
        moves.push(pen.ended(format!("the plane turned round at {bend} deg of bend, both ways")));
    }
    let mut pen = Pen::new(&home, period_s);
    for bend in [20.0, 40.0, 60.0, 50.0, 30.0, 10.0] {
        to(&mut pen, &polar(bend, 30.0 * DEG), SPEEDS_DEG[2]);
        pen.rest(3.0);
    }
    to(&mut pen, &home, SPEEDS_DEG[2]);
    moves.push(pen.ended("steps of 20 deg up and down, a hold of 3 s after each".to_owned()));
    let mut pen = Pen::new(&home, period_s);
    to(&mut pen, &polar(60.0, 0.0), SPEEDS_DEG[2]);
    pen.rest(LONGEST_S);
    to(&mut pen, &home, SPEEDS_DEG[2]);
    pen.rest(0.4 * LONGEST_S);
    moves.push(pen.ended("60 deg held for 50 s, straight for 20 s".to_owned()));
    let mut pen = Pen::new(&home, period_s);
    for bend in [15.0, 45.0] {
        for _ in 0..3 {
            to(&mut pen, &polar(bend + 2.0, 0.0), SPEEDS_DEG[0]);
            to(&mut pen, &polar(bend - 2.0, 0.0), SPEEDS_DEG[0]);
        }
    }
    to(&mut pen, &home, SPEEDS_DEG[1]);
    moves.push(pen.ended("loops of 2 deg at 15 and at 45 deg of bend".to_owned()));
    moves
}

/// Moves of one joint, the others at rest in the middle, and of another one while it rests. Ranges and fastest speeds are those of the
/// data, in the commands' unit.
pub(super) fn of_joint(joint: usize, ranges: &[[f64; 2]], fastest: &[f64], period_s: f64) -> Vec<Move> {
    let home: Vec<f64> = ranges.iter().map(|[low, high]| 0.5 * (low + high)).collect();
    let half = |k: usize| 0.5 * (ranges[k][1] - ranges[k][0]);
    // A place of one joint as a part of its half range.
    let at = |k: usize, part: f64| {
        let mut place = home.clone();
        place[k] += part * half(k);
        place
    };
    // The mean speed of a soft way is two thirds of its fastest. A slow way is as fast as LONGEST_S asks for, if the joint was.
    let speed = |k: usize, part: f64| (part * fastest[k]).max(f64::min(fastest[k], 6.0 * half(k) / LONGEST_S)) / 1.5;
    let to = |pen: &mut Pen, k: usize, part: f64, of_fastest: f64| {
        let way = (pen.here()[k] - at(k, part)[k]).abs();
        pen.to(&at(k, part), (way / speed(k, of_fastest)).max(4.0 * period_s));
    };
    let begin = || Pen::new(&home, period_s);
    let mut moves = Vec::new();
    for (of_fastest, words) in SPEEDS {
        let mut pen = begin();
        for part in [1.0, 0.6, 0.3, 0.1] {
            to(&mut pen, joint, part, of_fastest);
            to(&mut pen, joint, -part, of_fastest);
        }
        to(&mut pen, joint, 0.0, of_fastest);
        moves.push(
            pen.ended(format!("joint {}: nested loops from its whole range to a tenth of it, {words}", joint + 1)),
        );
    }
    let mut pen = begin();
    for part in [0.9, -0.9, 0.45, -0.45, 0.2, -0.2, 0.05, -0.05] {
        to(&mut pen, joint, part, SPEEDS[0].0);
        pen.rest(2.0);
    }
    to(&mut pen, joint, 0.0, SPEEDS[0].0);
    moves.push(pen.ended(format!("joint {}: fast steps of falling size, a hold of 2 s after each", joint + 1)));
    let mut pen = begin();
    to(&mut pen, joint, 1.0, SPEEDS[0].0);
    pen.rest(0.7 * LONGEST_S);
    to(&mut pen, joint, 0.0, SPEEDS[0].0);
    pen.rest(0.4 * LONGEST_S);
    moves.push(pen.ended(format!("joint {}: one end held for 35 s, the middle for 20 s", joint + 1)));
    let mut pen = begin();
    for place in [-0.7, 0.0, 0.7] {
        for _ in 0..3 {
            to(&mut pen, joint, place + 0.04, SPEEDS[1].0);
            to(&mut pen, joint, place - 0.04, SPEEDS[1].0);
        }
    }
    to(&mut pen, joint, 0.0, SPEEDS[1].0);
    moves.push(pen.ended(format!("joint {}: small loops at three places", joint + 1)));
    moves.push(sweep(begin(), joint, half(joint), fastest[joint]));
    if let Some(other) = (0..ranges.len()).find(|k| *k != joint && half(*k) > 0.0 && fastest[*k] > 0.0) {
        let mut pen = begin();
        for part in [1.0, -1.0, 0.5, -0.5] {
            to(&mut pen, other, part, SPEEDS[1].0);
        }
        to(&mut pen, other, 0.0, SPEEDS[1].0);
        moves.push(pen.ended(format!("joint {} rests while joint {} goes up and down", joint + 1, other + 1)));
    }
    moves
}

/// A sine that becomes faster until it is as fast as the joint was.
fn sweep(mut pen: Pen, joint: usize, half: f64, fastest: f64) -> Move {
    let (seconds, part) = (20.0, 0.15);
    let home = pen.here();
    // Amplitude times the last angular frequency is the fastest speed; rows must show the sine.
    let last_hz = (fastest / (part * half) / TAU).min(0.1 / pen.period_s);
    let first_hz = (0.1 * last_hz).max(0.1).min(last_hz);
    let phase = |s: f64| TAU * (first_hz * s + 0.5 * (last_hz - first_hz) / seconds * s * s);
    let fades = |s: f64| (s.min(seconds - s)).clamp(0.0, 1.0);
    pen.draw(seconds, |at| {
        let s = at * seconds;
        let mut place = home.clone();
        place[joint] += part * half * fades(s) * phase(s).sin();
        place
    });
    pen.ended(format!("joint {}: a small sine from {first_hz:.1} to {last_hz:.1} Hz", joint + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fastest(path: &[Vec<f64>], k: usize, period_s: f64) -> f64 {
        path.windows(2).map(|w| (w[1][k] - w[0][k]).abs() / period_s).fold(0.0, f64::max)
    }

    #[test]
    fn every_move_of_a_snake_stays_within_a_chain_s_default_limits_and_ends_straight() {
        for own in of_snake(0.05) {
            assert!(own.path.iter().all(|bend| bend[0].hypot(bend[1]) <= 62.0 * DEG), "{}", own.words);
            let speed = |w: &[Vec<f64>]| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]) / 0.05;
            let fastest = own.path.windows(2).map(speed).fold(0.0, f64::max);
            assert!(fastest < 1.1, "{}: {fastest} rad/s", own.words);
            let bend = |k: usize| own.path[k][0].hypot(own.path[k][1]);
            assert!(bend(0) < 1e-12 && bend(own.path.len() - 1) < 1e-9, "{}", own.words);
        }
    }

    #[test]
    fn every_move_of_a_joint_stays_within_what_the_data_show_of_it_and_ends_where_it_began() {
        let (ranges, speeds) = ([[-0.5, 1.5], [10.0, 11.0]], [0.8, 2.0]);
        for own in of_joint(0, &ranges, &speeds, 0.02) {
            for k in 0..2 {
                let inside = |row: &Vec<f64>| (ranges[k][0] - 1e-9..=ranges[k][1] + 1e-9).contains(&row[k]);
                assert!(own.path.iter().all(inside), "{} {k}", own.words);
                assert!(fastest(&own.path, k, 0.02) <= 1.05 * speeds[k], "{} {k}", own.words);
            }
            let (first, last) = (&own.path[0], &own.path[own.path.len() - 1]);
            assert!(first.iter().zip(last).all(|(a, b)| (a - b).abs() < 1e-9), "{}", own.words);
        }
        assert!(of_joint(0, &ranges[..1], &speeds[..1], 0.02).iter().all(|own| !own.words.contains("joint 2")));
    }
}
