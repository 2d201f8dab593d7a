//! A cone whose friction is spread along its two bends: points of friction joined by springs, each with stick and slip of its own.
//!
//! ```text
//! disk y ==holder, load τ== x_0 ==spring, load U_0== x_1 ==spring, load U_1== ... x_n ==spring, load U_n = τ~== p
//!
//! point j   lo_j(U_{j-1}) <= U_j <= hi_j(U_{j-1});  x_j moves in push direction only at hi_j, in pull direction only at lo_j
//! ```
//!
//! where: x_0 is the cone's end at the snake, where the bent-in wire rubs with f_s; the others lie along the arcs, each a capstan
//! of an equal part of the angle. Springs are trapezoid weights: with [`PER_ARC`] points to an arc the mean load is right to 1e-4.
//!
//! Solution: for a load τ and the place y of the line's end the points can be walked from the snake to the actuator: one that has
//! left its place in push direction carries hi, in pull direction lo. Where that walk ends rises with τ and jumps where a point is
//! exactly at its place: there it sticks. So τ is found by bisection, and the first point that sticks is the first one that the
//! two ends of the last interval put on different sides of its place. Points behind it do not feel the snake; they are found in the
//! same way from there, with the load behind that point as the unknown.

use crate::line::Compliance;

/// Points of friction in each of the two arcs.
const PER_ARC: usize = 4;
/// All points of friction of a line.
pub(crate) const N_POINTS: usize = 1 + 2 * PER_ARC;
/// What a limit of friction is missed by at most, relative to the load.
const HAIR: f64 = 1e-9;
/// A load is known once its interval is this small, relative to the load.
const KNOWN: f64 = 1e-13;
/// Doublings of an interval until it holds a load: from 1 N to more than any.
const DOUBLINGS: usize = 20;
/// Halvings of an interval of loads at most.
const HALVINGS: usize = 80;

/// A point of friction and the spring behind it, towards the actuator.
#[derive(Clone, Copy, Debug)]
struct Point {
    force_n: f64,
    capstan: f64,
    spring: Compliance,
}

/// All points of a line, from the snake to the actuator.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpreadCone {
    points: [Point; N_POINTS],
}

/// What the snake feels of a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Felt {
    /// τ.
    pub(crate) load_n: f64,
    /// How far the line gives up to the first point that sticks, m/N.
    pub(crate) give_m_per_n: f64,
}

/// A walk's first step: the load with which it begins, and where the first point then is.
type Start<'a> = &'a dyn Fn(f64) -> f64;

impl SpreadCone {
    /// A cone of two arcs with capstans of `capstan` in all. `compliance` gives that of a piece of line of this length, m;
    /// `before_m` is the length of line between the point of static friction and the cone, `actuator_m_per_n` what gives behind.
    pub(crate) fn new(
        (arc_m, straight_m, before_m): (f64, f64, f64),
        capstan: f64,
        force_n: f64,
        actuator_m_per_n: f64,
        compliance: impl Fn(f64, f64) -> Compliance,
    ) -> Self {
        let piece_m = arc_m / PER_ARC as f64;
        let own = capstan.powf(1.0 / (2 * PER_ARC) as f64);
        let point = |k: usize| {
            let (mut length_m, mut behind) = (piece_m, 0.0);
            match k {
                0 => length_m = before_m + 0.5 * piece_m,
                PER_ARC => length_m = piece_m + straight_m,
                last if last == N_POINTS - 1 => (length_m, behind) = (0.5 * piece_m, actuator_m_per_n),
                _ => {}
            }
            let (force_n, capstan) = if k == 0 { (force_n, 1.0) } else { (0.0, own) };
            Point { force_n, capstan, spring: compliance(length_m, behind) }
        };
        Self { points: core::array::from_fn(point) }
    }

    /// The capstan of what rubs where static friction does: the spacer disks.
    pub(crate) fn set_first_capstan(&mut self, capstan: f64) {
        self.points[0].capstan = capstan;
    }

    /// What the snake feels with the line's end at `end_m` behind a holder that gives so much, its actuator at `play_m`.
    pub(crate) fn felt(&self, places_m: &[f64; N_POINTS], holder: Compliance, end_m: f64, play_m: f64) -> Felt {
        let start = |load_n: f64| end_m + holder.at(load_n) * load_n;
        let around = self.around(places_m, holder, end_m, play_m);
        let (load_n, sticks) = self.search(places_m, 0, &start, around, play_m);
        let mut give_m_per_n = holder.at(load_n);
        let (mut x, mut load, mut slope) = (start(load_n), load_n, 1.0);
        for (point, place_m) in self.points.iter().zip(places_m).take(sticks) {
            let next = point.slid(x > *place_m, load);
            slope *= point.slope(x > *place_m, load);
            let spring_m_per_n = point.spring.at(next);
            (x, load) = (x + spring_m_per_n * next, next);
            give_m_per_n += spring_m_per_n * slope;
        }
        Felt { load_n, give_m_per_n }
    }

    /// Where all points are then, from where they were.
    pub(crate) fn settled(
        &self,
        places_m: &[f64; N_POINTS],
        holder: Compliance,
        end_m: f64,
        play_m: f64,
    ) -> [f64; N_POINTS] {
        let mut settled = *places_m;
        let from_snake = |load_n: f64| end_m + holder.at(load_n) * load_n;
        let around = self.around(places_m, holder, end_m, play_m);
        let (mut load, mut first) = self.search(places_m, 0, &from_snake, around, play_m);
        let mut x = from_snake(load);
        let mut begin = 0;
        loop {
            for k in begin..first {
                settled[k] = x;
                load = self.points[k].slid(x > places_m[k], load);
                x += self.points[k].spring.at(load) * load;
            }
            if first >= N_POINTS {
                return settled;
            }
            // This one sticks, and any load between its limits is behind it.
            let stuck = &self.points[first];
            // A hair more, so that a point behind it that is about to move lies inside.
            let hair_n = HAIR * (1.0 + load.abs());
            let limits = (stuck.slid(false, load) - hair_n, stuck.slid(true, load) + hair_n);
            let place_m = places_m[first];
            let from_stuck = |load_n: f64| place_m + stuck.spring.at(load_n) * load_n;
            begin = first + 1;
            (load, first) = self.search(places_m, begin, &from_stuck, limits, play_m);
            x = from_stuck(load);
        }
    }

    /// τ~ of a line that has settled.
    pub(crate) fn actuator_n(&self, places_m: &[f64; N_POINTS], play_m: f64) -> f64 {
        let squeeze_m = play_m - places_m[N_POINTS - 1];
        squeeze_m / self.points[N_POINTS - 1].spring.at(squeeze_m)
    }

    /// Loads at the snake between which the one that it feels is: around the one with which the first point sticks.
    fn around(&self, places_m: &[f64; N_POINTS], holder: Compliance, end_m: f64, play_m: f64) -> (f64, f64) {
        let stretch_m = places_m[0] - end_m;
        let guess = stretch_m / holder.at(stretch_m);
        let is_beyond = |load: f64| self.walk(places_m, 0, end_m + holder.at(load) * load, load, |_| {}) > play_m;
        let (mut low, mut high, mut reach) = (guess - 1.0, guess + 1.0, 1.0);
        for _ in 0..DOUBLINGS {
            match (is_beyond(low), is_beyond(high)) {
                (true, _) => low -= reach,
                (_, false) => high += reach,
                _ => break,
            }
            reach *= 2.0;
        }
        (low, high)
    }

    /// The load at which a walk from point `first` ends at the actuator, and the first point that sticks; [`N_POINTS`] if none does.
    fn search(
        &self,
        places_m: &[f64; N_POINTS],
        first: usize,
        start: Start<'_>,
        (mut low, mut high): (f64, f64),
        play_m: f64,
    ) -> (f64, usize) {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if high - low <= KNOWN * (1.0 + middle.abs()) {
                break;
            }
            if self.walk(places_m, first, start(middle), middle, |_| {}) > play_m {
                high = middle
            } else {
                low = middle
            }
        }
        let mut sides = [[false; N_POINTS]; 2];
        for (side, load) in sides.iter_mut().zip([low, high]) {
            let mut k = first;
            self.walk(places_m, first, start(load), load, |is_up| {
                side[k] = is_up;
                k += 1;
            });
        }
        let sticks =
            (first..N_POINTS).find(|&k| sides[0][k] != sides[1][k] && self.points[k].rubs()).unwrap_or(N_POINTS);
        (0.5 * (low + high), sticks)
    }

    /// Walks from a point to the actuator; gives where it ends, m, and tells on which side of its place each point is.
    fn walk(
        &self,
        places_m: &[f64; N_POINTS],
        first: usize,
        mut x: f64,
        mut load: f64,
        mut tell: impl FnMut(bool),
    ) -> f64 {
        for (point, place) in self.points[first..].iter().zip(&places_m[first..]) {
            let is_up = x > *place;
            tell(is_up);
            load = point.slid(is_up, load);
            x += point.spring.at(load) * load;
        }
        x
    }
}

impl Point {
    /// Whether it can stick at all.
    fn rubs(&self) -> bool {
        self.force_n > 0.0 || self.capstan > 1.0
    }

    /// The load behind it while it slides: hi or lo.
    fn slid(&self, is_up: bool, load_n: f64) -> f64 {
        let side = if is_up { 1.0 } else { -1.0 };
        let x = side * load_n + self.force_n;
        side * (x * self.capstan).max(x / self.capstan)
    }

    /// Its slope.
    fn slope(&self, is_up: bool, load_n: f64) -> f64 {
        let side = if is_up { 1.0 } else { -1.0 };
        if side * load_n + self.force_n >= 0.0 { self.capstan } else { 1.0 / self.capstan }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EA_N: f64 = 7871.0;
    const ARC_M: f64 = 14.3117e-3;
    const STRAIGHT_M: f64 = 29.3766e-3;
    /// μ φ.
    const X: f64 = 0.123582;
    const HOLDER: Compliance = Compliance { pushed_m_per_n: 0.48 / EA_N, pulled_m_per_n: 0.48 / EA_N };

    fn cone(force_n: f64) -> SpreadCone {
        let compliance = |length_m: f64, behind: f64| {
            let c = length_m / EA_N + behind;
            Compliance { pushed_m_per_n: c, pulled_m_per_n: c }
        };
        SpreadCone::new((ARC_M, STRAIGHT_M, 0.0), (2.0 * X).exp(), force_n, 0.0, compliance)
    }

    /// What the cone gives per newton at its end at the snake where the load grows by e^u over each bend.
    fn mean_m_per_n(u: f64) -> f64 {
        (ARC_M * (u.exp() - 1.0) / u * (1.0 + u.exp()) + STRAIGHT_M * u.exp()) / EA_N
    }

    /// A line whose end is held, after its actuator has gone to `play_m` in steps.
    fn gone(cone: &SpreadCone, places_m: &mut [f64; N_POINTS], from_m: f64, to_m: f64) -> Felt {
        for k in 1..=400 {
            let play_m = from_m + (to_m - from_m) * f64::from(k) / 400.0;
            *places_m = cone.settled(places_m, HOLDER, 0.0, play_m);
        }
        cone.felt(places_m, HOLDER, 0.0, to_m)
    }

    #[test]
    fn a_line_that_slides_all_along_gives_by_the_mean_load_of_its_arcs() {
        let cone = cone(1.959);
        for (to_m, side) in [(1.2e-3, 1.0), (-1.2e-3, -1.0)] {
            let mut places_m = [0.0; N_POINTS];
            let felt = gone(&cone, &mut places_m, 0.0, to_m);
            let rubbed = felt.load_n + side * 1.959;
            let expected = HOLDER.pushed_m_per_n * felt.load_n + mean_m_per_n(X) * rubbed;
            assert!((to_m / expected - 1.0).abs() < 1e-5, "{to_m} {expected}");
            assert!((cone.actuator_n(&places_m, to_m) / ((2.0 * X).exp() * rubbed) - 1.0).abs() < 1e-9);
            let further = cone.felt(&places_m, HOLDER, 0.0, to_m + side * 1e-6);
            assert!((further.give_m_per_n / (HOLDER.pushed_m_per_n + mean_m_per_n(X)) - 1.0).abs() < 1e-4);
        }
    }

    /// The front of a reversal comes from the actuator: how much less the cone gives (mm) and what the actuator carries (N) where it
    /// has come a quarter, half, three quarters and all of the way, for 16.17 N at the snake, from a bench with the exact profile.
    const FRONT: [(f64, f64); 4] = [(0.001093, 18.297), (0.004116, 16.17), (0.016659, 14.2902), (0.029560, 12.629)];

    #[test]
    fn a_reversal_runs_from_the_actuator_to_the_snake_and_turns_the_load_along_the_bench_s_curve() {
        let cone = cone(0.0);
        let mut places_m = [0.0; N_POINTS];
        let top_m = 16.17 * (HOLDER.pushed_m_per_n + mean_m_per_n(X));
        let held_n = gone(&cone, &mut places_m, 0.0, top_m).load_n;
        let mut from_m = top_m;
        for (travel_mm, expected_n) in FRONT {
            // A hair short of the end of the stick.
            let to_m = top_m - 0.999e-3 * travel_mm;
            let felt = gone(&cone, &mut places_m, from_m, to_m);
            let found_n = cone.actuator_n(&places_m, to_m);
            assert!((found_n / expected_n - 1.0).abs() < 0.02, "{travel_mm} mm: {found_n} N, expected {expected_n} N");
            assert!((felt.load_n - held_n).abs() < 1e-9, "the snake feels nothing yet");
            from_m = to_m;
        }
        let felt = gone(&cone, &mut places_m, from_m, top_m - 1.01 * 0.029560e-3);
        assert!(felt.load_n < held_n - 1e-3, "and now it does");
    }

    #[test]
    fn every_point_stays_within_its_limits_and_moves_only_at_one_of_them() {
        let cone = cone(1.0);
        let mut places_m = [0.0; N_POINTS];
        let mut n_stuck = 0;
        for k in 0..3000 {
            let t = f64::from(k) * 0.01;
            let (end_m, play_m) = (0.4e-3 * (0.7 * t).sin(), 1.5e-3 * t.sin() + 0.2e-3 * (3.1 * t).cos());
            let before = places_m;
            places_m = cone.settled(&places_m, HOLDER, end_m, play_m);
            let mut load_n = (places_m[0] - end_m) / HOLDER.pushed_m_per_n;
            assert!((load_n - cone.felt(&before, HOLDER, end_m, play_m).load_n).abs() < 1e-6);
            for (j, point) in cone.points.iter().enumerate() {
                let next_m = places_m.get(j + 1).copied().unwrap_or(play_m);
                let behind_n = (next_m - places_m[j]) / point.spring.pushed_m_per_n;
                let (low, high) = (point.slid(false, load_n), point.slid(true, load_n));
                assert!(behind_n > low - 1e-6 && behind_n < high + 1e-6, "{k} {j}: {low} {behind_n} {high}");
                let moved_m = places_m[j] - before[j];
                assert!(moved_m <= 0.0 || (behind_n - high).abs() < 1e-6, "{k} {j}");
                assert!(moved_m >= 0.0 || (behind_n - low).abs() < 1e-6, "{k} {j}");
                n_stuck += u32::from(moved_m == 0.0);
                load_n = behind_n;
            }
        }
        assert!(n_stuck > 300, "{n_stuck}");
    }
}
