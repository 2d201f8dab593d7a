//! What the synthetic operator has in mind: strokes, rests and a clutch, and the bend vector that they lead to over time.

/// What the hand does during a part of the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Moves the snake to the part's bend.
    Stroke,
    /// Lets go of the cap; the device falls silent.
    Rest,
    /// Presses the clutch and moves the cap; the snake stays.
    Clutch,
}

/// A part of the plan. Where it ends: signed bend in the plane at delta, degrees.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// What the hand does.
    pub act: Act,
    /// How long, s.
    pub duration_s: f64,
    /// Bend at its end, deg; negative is a bend to the other side of the same plane.
    pub bend_deg: f64,
    /// Delta at its end, deg.
    pub delta_deg: f64,
}

/// When the first part begins, s after the first report.
pub const BEGIN_S: f64 = 0.7;

/// The plan: bends up to 55 deg in several planes, reversals through the straight pose, plane rotations both ways, rests.
/// Whoever plays only the first 17 s gets each of these twice.
pub const PLAN: [Part; 22] = [
    stroke(1.3, 55.0, 0.0),
    stroke(1.9, 50.0, 80.0),
    stroke(2.0, -30.0, 80.0),
    stroke(1.6, -50.0, 20.0),
    stroke(1.3, -8.0, 20.0),
    rest(0.9, -8.0, 20.0),
    stroke(1.5, 45.0, -40.0),
    stroke(1.8, 50.0, -120.0),
    Part { act: Act::Clutch, duration_s: 0.5, bend_deg: 50.0, delta_deg: -120.0 },
    stroke(1.8, -20.0, -120.0),
    rest(0.8, -20.0, -120.0),
    stroke(1.6, -55.0, -70.0),
    stroke(2.4, 40.0, -70.0),
    stroke(2.0, 55.0, 10.0),
    rest(0.8, 55.0, 10.0),
    stroke(1.5, 10.0, 10.0),
    stroke(1.4, -45.0, 60.0),
    stroke(1.6, -45.0, 0.0),
    rest(0.7, -45.0, 0.0),
    stroke(1.4, 12.0, 0.0),
    stroke(1.0, 0.0, 0.0),
    rest(0.8, 0.0, 0.0),
];

/// The plan at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Planned {
    /// What the hand does.
    pub act: Act,
    /// How far its part has come, 0..=1.
    pub progress: f64,
    /// Bend vector b (cos delta, sin delta), rad.
    pub bend_rad: [f64; 2],
}

/// The plan at a time (s after the first report): minimum-jerk strokes between the parts' ends, in bend and delta.
pub fn plan_at(time_s: f64) -> Planned {
    let (mut begin_s, mut from_bend_deg, mut from_delta_deg) = (BEGIN_S, 0.0, 0.0);
    if time_s < BEGIN_S {
        return Planned { act: Act::Rest, progress: 1.0, bend_rad: [0.0; 2] };
    }
    for part in PLAN {
        let progress = ((time_s - begin_s) / part.duration_s).min(1.0);
        let shape = minimum_jerk(progress);
        let bend_deg = from_bend_deg + shape * (part.bend_deg - from_bend_deg);
        let delta_deg = from_delta_deg + shape * (part.delta_deg - from_delta_deg);
        if progress < 1.0 {
            return Planned { act: part.act, progress, bend_rad: bend_vector_rad(bend_deg, delta_deg) };
        }
        (begin_s, from_bend_deg, from_delta_deg) = (begin_s + part.duration_s, part.bend_deg, part.delta_deg);
    }
    Planned { act: Act::Rest, progress: 1.0, bend_rad: bend_vector_rad(from_bend_deg, from_delta_deg) }
}

/// When the last part ends, s after the first report.
pub fn end_s() -> f64 {
    BEGIN_S + PLAN.iter().map(|part| part.duration_s).sum::<f64>()
}

/// The way of a hand between two points, 0 to 1: the fifth-order polynomial that starts and ends without speed and
/// acceleration (Flash and Hogan 1985).
fn minimum_jerk(s: f64) -> f64 {
    s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
}

fn bend_vector_rad(bend_deg: f64, delta_deg: f64) -> [f64; 2] {
    let (bend_rad, delta_rad) = (bend_deg.to_radians(), delta_deg.to_radians());
    [bend_rad * delta_rad.cos(), bend_rad * delta_rad.sin()]
}

const fn stroke(duration_s: f64, bend_deg: f64, delta_deg: f64) -> Part {
    Part { act: Act::Stroke, duration_s, bend_deg, delta_deg }
}

const fn rest(duration_s: f64, bend_deg: f64, delta_deg: f64) -> Part {
    Part { act: Act::Rest, duration_s, bend_deg, delta_deg }
}
