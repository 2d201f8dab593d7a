//! The simulated joint: what a sensor without noise would see of a cable-driven joint, stepped finer than the rows.
//!
//! It shares no code with `krait-model`: lags are implicit Euler steps, friction is integrated, and everything is sampled afterwards.

use core::f64::consts::TAU;

/// Steps between two rows.
pub(super) const FINE: usize = 10;

/// What holds a joint back. Zero is nothing; positions in the command's unit where nothing else is said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Plant {
    pub delay_s: f64,
    pub lag_s: f64,
    /// Natural frequency, rad/s, and damping.
    pub second_order: [f64; 2],
    /// Fastest motion, per second.
    pub rate: f64,
    /// Half of the gap.
    pub play: f64,
    /// Largest displacement by rubbing, and the travel that builds it up.
    pub rubbing: [f64; 2],
    /// Share that goes through a loaded guide, and its friction.
    pub guide: [f64; 2],
    /// Half of a zone without motion, and its middle.
    pub dead: [f64; 2],
    pub limit: f64,
    pub quadratic: f64,
    pub cubic: f64,
    /// Share that comes late, and how late, s.
    pub creep: [f64; 2],
    /// At the end of the record.
    pub drift: f64,
    /// Size, and rise time in s.
    pub warm_up: [f64; 2],
    /// Share of the other joint's command.
    pub coupling: f64,
    /// Amplitude, period, phase in rad.
    pub periodic: [f64; 3],
    // Outside the lab's library.
    /// Size, and rhythm in Hz.
    pub sway: [f64; 2],
    /// Product of both commands over the other's range.
    pub product: f64,
    /// Step, and when, s.
    pub collision: [f64; 2],
    /// Change of slope, and where.
    pub kink: [f64; 2],
    /// Drag that grows with the root of speed.
    pub root_drag: f64,
    /// Slips at each reversal, by this much times the turn's number, folded.
    pub slip: f64,
    /// Change of the gain from beginning to end.
    pub fading: f64,
    /// Play of the other joint that shows here.
    pub other_play: f64,
}

impl Plant {
    /// Positions at every row for the commands of the joint and of its neighbour, rows `period_s` apart, before gain and offset.
    pub(super) fn run(&self, own: &[f64], other: &[f64], period_s: f64) -> Vec<f64> {
        let (middle, half) = middle_and_half(own);
        let mut state = State::new(own, other, half);
        let h = period_s / FINE as f64;
        let late = self.delay_s / h;
        let end_s = own.len() as f64 * period_s;
        let mut seen = Vec::with_capacity(own.len());
        for row in 0..own.len() {
            // A row is seen at its own command: the finer steps lead up to it.
            for k in 1..=FINE {
                let fine = (row as f64 - 1.0) * FINE as f64 + k as f64;
                let command = at(own, (fine - late) / FINE as f64);
                state.step(self, command, at(other, fine / FINE as f64), h);
            }
            let t = row as f64 * period_s;
            let x = state.behind;
            let unit = (x - middle) / half;
            let mut y = x + half * (self.quadratic * unit * unit + self.cubic * unit.powi(3));
            y -= self.rubbing[0] * state.rubbed;
            y += self.guide[0] * (state.guided - x);
            y -= self.creep[0] * state.crept;
            y += self.drift * t / end_s;
            if self.warm_up[1] > 0.0 {
                y += self.warm_up[0] * (1.0 - (-t / self.warm_up[1]).exp());
            }
            y += self.coupling * other[row];
            if self.periodic[1] > 0.0 {
                y += self.periodic[0] * (TAU * own[row] / self.periodic[1] + self.periodic[2]).sin();
            }
            y += self.sway[0] * (TAU * self.sway[1] * t).sin();
            y += self.product * unit * other[row];
            y += if t > self.collision[1] { self.collision[0] } else { 0.0 };
            y += self.kink[0] * (x - self.kink[1]).max(0.0);
            y -= self.root_drag * state.speed.signum() * state.speed.abs().sqrt();
            y += self.slip * fold(state.turns);
            y += self.fading * (x - middle) * t / end_s;
            y += if self.other_play > 0.0 { other[row] - state.other_behind } else { 0.0 };
            seen.push(y);
        }
        seen
    }
}

/// Memories.
struct State {
    driven: f64,
    speed_driven: f64,
    played: f64,
    behind: f64,
    rubbed: f64,
    guided: f64,
    crept: f64,
    other_behind: f64,
    speed: f64,
    extreme: f64,
    direction: f64,
    turns: u32,
    /// A motion that is shorter is no turn.
    reach: f64,
}

impl State {
    fn new(own: &[f64], other: &[f64], half: f64) -> Self {
        Self {
            driven: own[0],
            speed_driven: 0.0,
            played: own[0],
            behind: own[0],
            rubbed: 0.0,
            guided: own[0],
            crept: own[0],
            other_behind: other[0],
            speed: 0.0,
            extreme: own[0],
            direction: 0.0,
            turns: 0,
            reach: 0.1 * half,
        }
    }

    fn step(&mut self, plant: &Plant, command: f64, other: f64, h: f64) {
        let off = command - self.driven;
        if plant.second_order[0] > 0.0 {
            let [w, z] = plant.second_order;
            self.speed_driven = (self.speed_driven + h * w * w * off) / (1.0 + 2.0 * z * w * h);
            self.driven += h * self.speed_driven;
        } else if plant.rate > 0.0 {
            self.driven += off.clamp(-plant.rate * h, plant.rate * h);
        } else {
            self.driven += off * h / (plant.lag_s + h);
        }
        // Without a lag nothing is late, not even by a step.
        let driven = if plant.lag_s + plant.rate + plant.second_order[0] > 0.0 { self.driven } else { command };
        self.played = self.played.clamp(driven - plant.play, driven + plant.play);
        let [dead, centre] = plant.dead;
        let through = self.played - (self.played - centre).clamp(-dead, dead);
        let through = if plant.limit > 0.0 { through.clamp(-plant.limit, plant.limit) } else { through };
        let moved = through - self.behind;
        self.behind = through;
        self.speed += (moved / h - self.speed) * h / (0.02 + h);
        if plant.rubbing[1] > 0.0 {
            // Dahl: it builds up with the travel, in the direction of motion.
            self.rubbed = (self.rubbed + (moved - moved.abs() * self.rubbed) / plant.rubbing[1]).clamp(-1.0, 1.0);
        }
        let rub = plant.guide[1] * through.abs();
        self.guided = self.guided.clamp(through - rub, through + rub);
        if plant.creep[1] > 0.0 {
            self.crept += (through - self.crept) * h / (plant.creep[1] + h);
        }
        self.other_behind = self.other_behind.clamp(other - plant.other_play, other + plant.other_play);
        self.count_turns(through);
    }

    fn count_turns(&mut self, x: f64) {
        let away = x - self.extreme;
        if self.direction == 0.0 {
            if away.abs() > self.reach {
                (self.extreme, self.direction) = (x, away.signum());
            }
        } else if away * self.direction > 0.0 {
            self.extreme = x;
        } else if away.abs() > self.reach {
            (self.extreme, self.direction) = (x, -self.direction);
            self.turns += 1;
        }
    }
}

/// 0, 1, 2, 3, 2, 1, 0 ... with the number of turns: a cable that slips and creeps back.
fn fold(turns: u32) -> f64 {
    let k = turns / 3 % 6;
    f64::from(if k > 3 { 6 - k } else { k })
}

/// A command between rows; before the first row the first one.
fn at(commands: &[f64], row: f64) -> f64 {
    let last = commands.len() - 1;
    let row = row.clamp(0.0, last as f64);
    let before = (row as usize).min(last);
    let after = (before + 1).min(last);
    commands[before] + (commands[after] - commands[before]) * (row - before as f64)
}

/// Middle and half of the range.
pub(super) fn middle_and_half(commands: &[f64]) -> (f64, f64) {
    let (low, high) = commands.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), u| (l.min(*u), h.max(*u)));
    (0.5 * (low + high), (0.5 * (high - low)).max(1e-12))
}
