//! What sits between a line and the end disk beyond the line's own springs and friction: sliders, drag, creep, slow shifts.
//!
//! - Rubbing along the bent part (Iwan): N sliders in parallel, each a spring to ground that slips at f/N; slider j slips
//!   after a travel of (j + 1/2) w / N. Together they build a force up to f over the travel w and keep it until a reversal.
//!   At rest f is larger by the breakaway part, which falls with the speed as e^(-(v/v_s)²).
//! - Drag: c v with v the speed of the line's end over the step.
//! - Creep (standard linear solid): a slow stretch x, dx/dt = (a C τ - x) / T, solved exactly for a load held over the step.
//! - Slow: a shift that grows as 1 - e^(-t/T), and others that come at once at a time.

use crate::hidden::{LinesTruth, SlowTruth};

/// Sliders of one line: enough that their corners are finer than any camera sees.
const N_SLIDERS: usize = 24;

/// The ends of all three lines.
#[derive(Clone, Debug)]
pub(crate) struct Ends {
    lines: LinesTruth,
    slow: SlowTruth,
    /// Compliance of a whole line, m/N.
    compliance_m_per_n: f64,
    state: [End; 3],
    time_s: f64,
    /// 1 - e^(-t/T) of the slow changes.
    risen: f64,
    /// 1/dt of the step under way, 0 while no time passes.
    per_step_hz: f64,
}

/// What one end remembers.
#[derive(Clone, Debug, Default)]
struct End {
    /// Where each slider's spring is without force, m; empty without rubbing.
    sliders_m: Vec<f64>,
    creep_m: f64,
    before_m: f64,
    speed_m_per_s: f64,
}

impl Ends {
    pub(crate) fn new(lines: &LinesTruth, slow: &SlowTruth, compliance_m_per_n: f64) -> Self {
        let n = if lines.rub_n > 0.0 { N_SLIDERS } else { 0 };
        let state = core::array::from_fn(|_| End { sliders_m: vec![0.0; n], ..End::default() });
        Self {
            lines: lines.clone(),
            slow: slow.clone(),
            compliance_m_per_n,
            state,
            time_s: 0.0,
            risen: 0.0,
            per_step_hz: 0.0,
        }
    }

    /// Whether anything changes while the actuators stand still.
    pub(crate) fn depend_on_time(&self) -> bool {
        let breakaway = self.lines.rub_n > 0.0 && self.lines.rub_breakaway > 0.0;
        self.lines.creep_part > 0.0 || self.lines.drag_n_s_per_m > 0.0 || breakaway || self.slow != SlowTruth::default()
    }

    /// Begins a step of this length.
    pub(crate) fn begin(&mut self, step_s: f64) {
        self.time_s += step_s;
        self.risen = -(-self.time_s / self.slow.time_s).exp_m1();
        self.per_step_hz = if step_s > 0.0 { 1.0 / step_s } else { 0.0 };
    }

    /// By how much line i is longer between its spring and the disk than without all this, m.
    pub(crate) fn stretch_m(&self, i: usize) -> f64 {
        let jump = if self.time_s >= self.slow.collision_time_s { self.slow.collision_m[i] } else { 0.0 };
        self.state[i].creep_m - self.slow.line_m[i] * self.risen + jump
    }

    /// The factor on the snake's stiffness.
    pub(crate) fn stiffness(&self) -> f64 {
        1.0 + self.slow.stiffness * self.risen + if self.has_changed() { self.slow.change_stiffness } else { 0.0 }
    }

    /// Half of the play that came at an instant, m.
    pub(crate) fn more_half_play_m(&self) -> f64 {
        if self.has_changed() { 0.5 * self.slow.change_play_m } else { 0.0 }
    }

    fn has_changed(&self) -> bool {
        self.time_s >= self.slow.change_time_s
    }

    /// The force against the motion of line i's end when it stands at `end_m`, N, and its slope, N/m.
    pub(crate) fn resistance(&self, i: usize, end_m: f64) -> (f64, f64) {
        let end = &self.state[i];
        let drag = self.lines.drag_n_s_per_m * self.per_step_hz;
        let (mut force, mut slope) = (drag * (end_m - end.before_m), drag);
        if end.sliders_m.is_empty() {
            return (force, slope);
        }
        let limit = self.slip_n(end);
        for (j, place) in end.sliders_m.iter().enumerate() {
            let stiffness = limit / self.slip_m(j);
            let free = stiffness * (end_m - place);
            force += free.clamp(-limit, limit);
            if free.abs() < limit {
                slope += stiffness;
            }
        }
        (force, slope)
    }

    /// Ends a step: line i's end stands at `end_m` under this load of the line.
    pub(crate) fn end(&mut self, i: usize, end_m: f64, load_n: f64) {
        for j in 0..self.state[i].sliders_m.len() {
            let travel = self.slip_m(j);
            let place = &mut self.state[i].sliders_m[j];
            *place = place.clamp(end_m - travel, end_m + travel);
        }
        let end = &mut self.state[i];
        if self.per_step_hz > 0.0 {
            let rest = self.lines.creep_part * self.compliance_m_per_n * load_n;
            end.creep_m += (rest - end.creep_m) * -(-1.0 / (self.per_step_hz * self.lines.creep_time_s)).exp_m1();
            end.speed_m_per_s = (end_m - end.before_m) * self.per_step_hz;
        }
        end.before_m = end_m;
    }

    /// Force at which one slider of this end slips, N.
    fn slip_n(&self, end: &End) -> f64 {
        let speed = end.speed_m_per_s / self.lines.rub_speed_m_per_s;
        self.lines.rub_n / N_SLIDERS as f64 * (1.0 + self.lines.rub_breakaway * (-speed * speed).exp())
    }

    fn slip_m(&self, j: usize) -> f64 {
        self.lines.rub_travel_m * (j as f64 + 0.5) / N_SLIDERS as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(lines: LinesTruth) -> Ends {
        Ends::new(&lines, &SlowTruth::default(), 7e-5)
    }

    #[test]
    fn sliders_build_their_force_over_their_travel_keep_it_and_lose_it_twice_as_slowly_back() {
        let mut ends = ends(LinesTruth { rub_n: 2.0, rub_travel_m: 1e-4, ..LinesTruth::default() });
        let mut go = |y: f64| {
            let (force, _) = ends.resistance(0, y);
            ends.end(0, y, 0.0);
            force
        };
        (0..=100).for_each(|k| {
            go(f64::from(k) * 1e-6);
        });
        assert!((go(3e-4) - 2.0).abs() < 1e-12);
        assert!((go(3e-4) - 2.0).abs() < 1e-12, "standing still keeps it");
        let halfway = go(3e-4 - 1e-4);
        assert!(halfway.abs() < 1.4 && halfway > -1.4, "{halfway}");
        assert!((go(3e-4 - 2.1e-4) + 2.0).abs() < 1e-12);
    }

    #[test]
    fn creep_reaches_its_share_with_its_time_whatever_the_step() {
        for n in [1, 10, 1000] {
            let mut ends = ends(LinesTruth { creep_part: 0.1, creep_time_s: 5.0, ..LinesTruth::default() });
            for _ in 0..n {
                ends.begin(5.0 / f64::from(n));
                ends.end(1, 0.0, 10.0);
            }
            let expected = 0.1 * 7e-5 * 10.0 * (1.0 - (-1.0_f64).exp());
            assert!((ends.stretch_m(1) / expected - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_collision_shifts_a_line_at_its_time_and_drift_comes_slowly() {
        let slow = SlowTruth {
            stiffness: 0.1,
            time_s: 10.0,
            collision_m: [1e-4, 0.0, 0.0],
            collision_time_s: 3.0,
            ..SlowTruth::default()
        };
        let mut ends = Ends::new(&LinesTruth::default(), &slow, 7e-5);
        assert!(ends.depend_on_time());
        ends.begin(2.9);
        assert_eq!(ends.stretch_m(0), 0.0);
        ends.begin(0.1);
        assert_eq!(ends.stretch_m(0), 1e-4);
        ends.begin(1000.0);
        assert!((ends.stiffness() - 1.1).abs() < 1e-9);
    }

    #[test]
    fn play_and_stiffness_appear_at_their_instant() {
        let slow = SlowTruth { change_play_m: 2e-4, change_stiffness: 0.3, change_time_s: 5.0, ..SlowTruth::default() };
        let mut ends = Ends::new(&LinesTruth::default(), &slow, 7e-5);
        ends.begin(4.99);
        assert_eq!((ends.stiffness(), ends.more_half_play_m()), (1.0, 0.0));
        ends.begin(0.02);
        assert_eq!((ends.stiffness(), ends.more_half_play_m()), (1.3, 1e-4));
    }
}
