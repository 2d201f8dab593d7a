//! A guide takes the operator's place in an experiment: it leads the setpoint along a plan, waits until the actuators rest
//! at each stop, and says in marks what stood still when.
//!
//! It closes the loop over the setpoint, never over what was measured: what is wanted is where the setpoint goes, and the
//! error of the machine is left to be seen. Everything between the hand and the drives is as for any hand.

use crate::guide_order::GuideOrder;
use crate::guide_plan::{GuideLeg, GuidePlan};
use crate::script::ScriptSample;
use krait_ipc::message::{Phase, Setpoint, SlaveState, three};
use krait_ipc::{ExperimentMark, Reason, Reasons};

/// Rate at which the setpoint's distance from its place on the way is made up for, 1/s.
const GAIN_PER_S: f64 = 12.0;
/// Time in which the full speed is reached, s.
const GATHER_S: f64 = 0.15;
/// The setpoint has arrived when it is as near as this in the view's plane, m: 0.01 deg at small bends.
const ARRIVED_M: f64 = 2e-6;
/// The place on the way waits for a setpoint that is further behind than this, m.
const LEASH_M: f64 = 1e-3;
/// Nobody is present for so long first, s: the slave must see the operator take hold.
const ABSENT_S: f64 = 0.1;
/// A setpoint or state older than this is not steered by, ns.
const STALE_NS: i64 = 60_000_000;
/// Longest step that counts, s.
const LONGEST_STEP_S: f64 = 0.01;

/// What one step says.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideStep {
    /// What the operator asks for; `None` once all is over.
    pub sample: Option<ScriptSample>,
    /// What there is to mark at this instant.
    pub mark: Option<ExperimentMark>,
}

/// Follows a plan.
#[derive(Clone, Debug)]
pub struct Guide {
    plan: GuidePlan,
    begun_ns: Option<i64>,
    before_ns: i64,
    /// Since when nothing moves that should, ns.
    held_since_ns: Option<i64>,
    leg_idx: usize,
    /// The next place of the leg.
    place_idx: usize,
    /// Where the setpoint shall be now, base frame, m.
    reference_m: Option<[f64; 3]>,
    speed_m_per_s: f64,
    doing: Doing,
    /// The newest order that was taken.
    ordered: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Doing {
    /// Waiting for an operator who is not yet present.
    Waiting,
    /// Holding where it is until it is told where to go next.
    Awaiting,
    /// Under way on a leg, and until when that may take, ns.
    Moving { until_ns: i64 },
    /// At a stop: since when the actuators are where they are, and until when they may take to come to rest, ns.
    Resting { q_tilde_m: [f64; 3], since_ns: i64, until_ns: i64 },
    /// Over, well or not.
    Over,
}

impl Guide {
    /// A guide before its first step.
    pub fn new(plan: GuidePlan) -> Self {
        Self {
            plan,
            begun_ns: None,
            before_ns: 0,
            held_since_ns: None,
            leg_idx: 0,
            place_idx: 0,
            reference_m: None,
            speed_m_per_s: 0.0,
            doing: Doing::Waiting,
            ordered: 0,
        }
    }

    /// Takes an order, where the plan awaits any.
    pub fn order(&mut self, order: GuideOrder) {
        if !self.plan.awaits_orders {
            return;
        }
        match order {
            GuideOrder::Go { number, tip_pos_in_base_m } if number > self.ordered => {
                self.ordered = number;
                self.plan.leg.push(GuideLeg { pose: number, tip_pos_in_base_m: vec![tip_pos_in_base_m] });
            }
            GuideOrder::Go { .. } => {}
            GuideOrder::End => self.plan.awaits_orders = false,
        }
    }

    /// What the operator asks for at an instant, ns, given the newest setpoint and state.
    pub fn step(&mut self, now_ns: i64, setpoint: Option<&Setpoint>, state: Option<&SlaveState>) -> GuideStep {
        let begun_ns = *self.begun_ns.get_or_insert(now_ns);
        let step_s = (seconds(self.before_ns, now_ns)).clamp(0.0, LONGEST_STEP_S);
        self.before_ns = now_ns;
        if self.doing == Doing::Over {
            return GuideStep { sample: None, mark: None };
        }
        if seconds(begun_ns, now_ns) < ABSENT_S {
            return GuideStep { sample: Some(sample([0.0; 3], false)), mark: None };
        }
        let seen = setpoint.zip(state).filter(|(setpoint, state)| follows(now_ns, setpoint, state));
        let Some((setpoint, state)) = seen else { return self.hold(now_ns, state) };
        self.held_since_ns = None;
        let tip_m = setpoint.tip_pos_in_base_m;
        if self.doing == Doing::Waiting {
            self.reference_m = Some(tip_m);
            self.set_out(now_ns);
            return GuideStep { sample: Some(sample([0.0; 3], true)), mark: Some(ExperimentMark::Begins) };
        }
        match self.doing {
            Doing::Resting { q_tilde_m, since_ns, until_ns } => {
                self.rest(now_ns, three(&state.measured_q_m), (q_tilde_m, since_ns, until_ns))
            }
            _ => self.go_on(now_ns, tip_m, state, step_s),
        }
    }

    /// The setpoint does not follow: asks for nothing, and waits.
    fn hold(&mut self, now_ns: i64, state: Option<&SlaveState>) -> GuideStep {
        let since_ns = *self.held_since_ns.get_or_insert(now_ns);
        self.speed_m_per_s = 0.0;
        if self.doing != Doing::Waiting {
            self.doing = self.moving(now_ns);
        }
        if seconds(since_ns, now_ns) <= self.plan.patience_s {
            return GuideStep { sample: Some(sample([0.0; 3], true)), mark: None };
        }
        let reasons = state.map_or(Reasons::NONE, |state| Reasons::from_bits(state.reasons));
        let why = reasons.iter().map(Reason::sentence).next().unwrap_or("no setpoint follows");
        self.fail(&format!("the slave did not follow for {} s: {why}", self.plan.patience_s))
    }

    fn go_on(&mut self, now_ns: i64, tip_m: [f64; 3], state: &SlaveState, step_s: f64) -> GuideStep {
        if self.doing == Doing::Awaiting && self.leg_idx < self.plan.leg.len() {
            self.set_out(now_ns);
        }
        let Some(leg) = self.plan.leg.get(self.leg_idx) else {
            if self.plan.awaits_orders {
                self.doing = Doing::Awaiting;
                return GuideStep { sample: Some(sample([0.0; 3], true)), mark: None };
            }
            self.doing = Doing::Over;
            return GuideStep { sample: Some(sample([0.0; 3], true)), mark: Some(ExperimentMark::Ends) };
        };
        let reference_m = self.reference_m.unwrap_or(tip_m);
        let behind_m = minus(reference_m, tip_m);
        let left_m = self.left_m(leg, reference_m);
        if left_m == 0.0 && behind_m[0].hypot(behind_m[1]) <= ARRIVED_M {
            let (pose, q_tilde_m) = (leg.pose, three(&state.measured_q_m));
            if pose == 0 {
                self.next_leg(now_ns);
            } else {
                let until_ns = now_ns + nanoseconds(self.plan.patience_s + self.plan.settle_s + self.plan.measure_s);
                self.doing = Doing::Resting { q_tilde_m, since_ns: now_ns, until_ns };
            }
            return GuideStep { sample: Some(sample([0.0; 3], true)), mark: None };
        }
        if let Doing::Moving { until_ns } = self.doing
            && now_ns > until_ns
        {
            let off_mm = length(behind_m) * 1e3;
            return self.fail(&format!("the setpoint did not arrive in time and is {off_mm:.3} mm away"));
        }
        let tangent = if length(behind_m) > LEASH_M { [0.0; 3] } else { self.advance(left_m, step_s) };
        // What this step goes is in the tangent; the rest is how far the setpoint was behind before it.
        let velocity = core::array::from_fn(|k| tangent[k] * self.speed_m_per_s + GAIN_PER_S * behind_m[k]);
        GuideStep {
            sample: Some(sample(self.in_view(limited(velocity, 2.0 * self.plan.speed_m_per_s)), true)),
            mark: None,
        }
    }

    /// Moves the reference on along the leg, and returns in which direction.
    fn advance(&mut self, left_m: f64, step_s: f64) -> [f64; 3] {
        let (top, gather) = (self.plan.speed_m_per_s, self.plan.speed_m_per_s / GATHER_S);
        self.speed_m_per_s = (self.speed_m_per_s + gather * step_s).min(top).min((2.0 * gather * left_m).sqrt());
        // The last tenth of a micrometre would take for ever.
        let mut go_m = (self.speed_m_per_s * step_s).max(1e-7 * step_s * 1e3);
        let (Some(leg), Some(mut at)) = (self.plan.leg.get(self.leg_idx), self.reference_m) else { return [0.0; 3] };
        let mut tangent = [0.0; 3];
        while let Some(place) = leg.tip_pos_in_base_m.get(self.place_idx) {
            let way = minus(*place, at);
            let way_m = length(way);
            if way_m > go_m {
                tangent = way.map(|w| w / way_m);
                at = core::array::from_fn(|k| at[k] + tangent[k] * go_m);
                break;
            }
            (at, go_m) = (*place, go_m - way_m);
            self.place_idx += 1;
        }
        self.reference_m = Some(at);
        tangent
    }

    fn rest(&mut self, now_ns: i64, q_m: [f64; 3], rested: ([f64; 3], i64, i64)) -> GuideStep {
        let (q_tilde_m, since_ns, until_ns) = rested;
        let sample = Some(sample([0.0; 3], true));
        let stays = q_m.iter().zip(q_tilde_m).all(|(now, then)| (now - then).abs() <= self.plan.rest_m);
        if !stays {
            if now_ns > until_ns {
                return self.fail("the actuators did not come to rest in time");
            }
            self.doing = Doing::Resting { q_tilde_m: q_m, since_ns: now_ns, until_ns };
            return GuideStep { sample, mark: None };
        }
        if seconds(since_ns, now_ns) < self.plan.settle_s + self.plan.measure_s {
            return GuideStep { sample, mark: None };
        }
        let pose = self.plan.leg.get(self.leg_idx).map_or(0, |leg| leg.pose);
        self.next_leg(now_ns);
        GuideStep { sample, mark: Some(ExperimentMark::AtRest { pose, for_ns: nanoseconds(self.plan.measure_s) }) }
    }

    fn next_leg(&mut self, now_ns: i64) {
        self.leg_idx += 1;
        self.set_out(now_ns);
    }

    fn set_out(&mut self, now_ns: i64) {
        (self.place_idx, self.speed_m_per_s) = (0, 0.0);
        self.doing = self.moving(now_ns);
    }

    /// Under way, with the leg's own time and the patience for it.
    fn moving(&self, now_ns: i64) -> Doing {
        let way_m = match (self.plan.leg.get(self.leg_idx), self.reference_m) {
            (Some(leg), Some(at)) => self.left_m(leg, at),
            _ => 0.0,
        };
        let own_s = way_m / self.plan.speed_m_per_s + 2.0 * GATHER_S;
        Doing::Moving { until_ns: now_ns + nanoseconds(own_s + self.plan.patience_s) }
    }

    /// The rest of a leg, m.
    fn left_m(&self, leg: &GuideLeg, at_m: [f64; 3]) -> f64 {
        let (mut at, mut left_m) = (at_m, 0.0);
        for place in leg.tip_pos_in_base_m.iter().skip(self.place_idx) {
            left_m += length(minus(*place, at));
            at = *place;
        }
        left_m
    }

    fn fail(&mut self, why: &str) -> GuideStep {
        self.doing = Doing::Over;
        let leg = self.plan.leg.get(self.leg_idx..).and_then(|legs| legs.iter().find(|leg| leg.pose > 0));
        let place = leg.map_or_else(|| "on the way back".to_owned(), |leg| format!("before or at pose {}", leg.pose));
        let mark = ExperimentMark::Failed(format!("{place}, {why}"));
        GuideStep { sample: Some(sample([0.0; 3], false)), mark: Some(mark) }
    }

    /// From the base frame to the view.
    fn in_view(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = self.plan.view_roll_rad.sin_cos();
        [cos * x + sin * y, cos * y - sin * x, z]
    }
}

/// Whether the setpoint follows this operator, and both are of now.
fn follows(now_ns: i64, setpoint: &Setpoint, state: &SlaveState) -> bool {
    let is_new = |sample_ns: i64| now_ns.saturating_sub(sample_ns) <= STALE_NS;
    is_new(setpoint.sample_ns)
        && is_new(state.sample_ns)
        && state.is_engaged()
        && setpoint.phase() == Some(Phase::Following)
        && setpoint.tip_pos_in_base_m.iter().all(|x| x.is_finite())
}

fn sample(tip_vel_in_view_m_per_s: [f64; 3], is_present: bool) -> ScriptSample {
    ScriptSample {
        tip_vel_in_view_m_per_s,
        tip_angular_vel_in_view_rad_per_s: [0.0; 3],
        is_present,
        is_clutched: false,
        jaw: 0,
    }
}

fn limited(velocity: [f64; 3], most: f64) -> [f64; 3] {
    let speed = length(velocity);
    if speed > most { velocity.map(|v| v * most / speed) } else { velocity }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|k| a[k] - b[k])
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

fn nanoseconds(s: f64) -> i64 {
    (s * 1e9).round() as i64
}

#[cfg(test)]
mod tests;
