//! Where to look for each effect of joints: what is free in a fit, and the grid that screening tries, sized by the data's range.

use super::Candidate;
use crate::Measurements;
use crate::noise::bounds;
use core::f64::consts::FRAC_PI_2;
use krait_model::joints::JointEffect;

/// How to look for an effect: values by name, the rest at their defaults.
struct Search {
    /// Amplitudes: name, neutral value, size to look at.
    amplitudes: Vec<(&'static str, f64, f64)>,
    /// Further free parameters.
    shapes: Vec<&'static str>,
    /// Cells of the grid: values by name, which replace amplitudes' sizes too.
    cells: Vec<Vec<(&'static str, f64)>>,
}

/// Largest ranges of the data, in their units.
struct Ranges {
    u: f64,
    u_max: f64,
    y: f64,
}

/// Every effect that may be missing from a model of joints, in the catalogue's order.
pub(super) fn all(data: &Measurements) -> Vec<Candidate> {
    let ranges = Ranges {
        u: range(&data.inputs, data.n_inputs),
        u_max: data.inputs.iter().fold(0.0, |max, u| u.abs().max(max)),
        y: range(&data.outputs, data.n_outputs),
    };
    JointEffect::ALL.into_iter().map(|effect| candidate(effect, search(effect, &ranges), data.n_inputs)).collect()
}

fn range(values: &[f64], width: usize) -> f64 {
    let column = |k: usize| values.iter().skip(k).step_by(width.max(1)).filter(|v| v.is_finite());
    let of = |k| bounds(column(k).copied());
    let largest = (0..width).map(|k| of(k).1 - of(k).0).filter(|r| r.is_finite()).fold(0.0, f64::max);
    // The reader refuses measurements without any range; other callers get an arbitrary one.
    if largest > 0.0 { largest } else { 1.0 }
}

/// Cells with one value each of one parameter.
fn each<const N: usize>(name: &'static str, values: [f64; N]) -> Vec<Vec<(&'static str, f64)>> {
    values.iter().map(|&value| vec![(name, value)]).collect()
}

fn search(effect: JointEffect, ranges: &Ranges) -> Search {
    let one = |name, neutral, size| Search {
        amplitudes: vec![(name, neutral, size)],
        shapes: Vec::new(),
        cells: vec![Vec::new()],
    };
    let with = |shapes: &[&'static str], cells, search: Search| Search { shapes: shapes.to_vec(), cells, ..search };
    let (u, y) = (ranges.u, ranges.y);
    match effect {
        JointEffect::Scale => one("scale", 0.0, 0.02),
        JointEffect::Offset => one("offset", 0.0, 0.01 * y),
        JointEffect::Backlash => {
            let cells = each("half_width", [0.005, 0.02, 0.08].map(|share| share * u));
            with(&[], cells, one("half_width", 0.0, 0.02 * u))
        }
        JointEffect::BoucWen => {
            let cells = each("travel", [0.01, 0.05, 0.2].map(|share| share * u));
            with(&["travel"], cells, one("amplitude", 0.0, 0.02 * u))
        }
        JointEffect::PrandtlIshlinskii => Search {
            amplitudes: vec![("weight1", 0.0, 0.2), ("weight2", 0.0, 0.2), ("weight3", 0.0, 0.2)],
            shapes: Vec::new(),
            cells: vec![vec![("half_width1", 0.01 * u), ("half_width2", 0.04 * u), ("half_width3", 0.16 * u)]],
        },
        JointEffect::ConeFriction => with(&[], each("friction", [0.03, 0.1, 0.3]), one("friction", 0.0, 0.1)),
        JointEffect::Creep => with(&["t1_s"], each("t1_s", [2.0, 7.0, 25.0, 90.0]), one("a1", 0.0, 0.05)),
        JointEffect::Latency => with(&[], each("delay_s", [0.02, 0.1, 0.3]), one("delay_s", 0.0, 0.05)),
        JointEffect::FirstOrderLag => with(&[], each("time_s", [0.02, 0.1, 0.5]), one("time_s", 0.0, 0.1)),
        JointEffect::Cubic => one("cubic", 0.0, 0.1 / (u * u)),
        JointEffect::DeadZone => {
            let cells = each("half_width", [0.01, 0.05].map(|share| share * u));
            with(&[], cells, one("half_width", 0.0, 0.02 * u))
        }
        JointEffect::PeriodicError => {
            let period = |share: f64| [0.0, FRAC_PI_2].map(|phase| vec![("period", share * u), ("phase_rad", phase)]);
            let cells = [0.02, 0.05, 0.1, 0.2, 0.5].into_iter().flat_map(period).collect();
            with(&["period", "phase_rad"], cells, one("amplitude", 0.0, 0.005 * u))
        }
        JointEffect::CrossCoupling => one("k", 0.0, 0.02),
        JointEffect::Drift => with(&["rise_time_s"], each("rise_time_s", [30.0, 300.0]), one("size", 0.0, 0.02 * y)),
        JointEffect::SecondOrder => {
            let pair = |frequency: f64| [0.4, 1.0].map(|z| vec![("frequency_rad_per_s", frequency), ("damping", z)]);
            let cells = [3.0, 10.0, 30.0].into_iter().flat_map(pair).collect();
            with(&["damping"], cells, one("frequency_rad_per_s", 0.0, 10.0))
        }
        JointEffect::RateLimit => with(&[], each("rate", [0.1, 0.3, 1.0].map(|share| share * u)), one("rate", 1e9, u)),
        JointEffect::LoadFriction => with(&["friction"], each("friction", [0.05, 0.2]), one("share", 0.0, 0.3)),
        JointEffect::GeneralisedPrandtlIshlinskii => Search {
            amplitudes: vec![
                ("weight1", 0.0, 0.2),
                ("weight2", 0.0, 0.2),
                ("weight3", 0.0, 0.2),
                ("weight4", 0.0, 0.2),
            ],
            shapes: vec!["reach"],
            cells: each("reach", [0.05, 0.2].map(|share| share * u)),
        },
        JointEffect::Quadratic => one("quadratic", 0.0, 0.1 / u),
        JointEffect::LinearDrift => one("rate", 0.0, 1e-4 * y),
        JointEffect::Saturation => {
            let cells = each("limit", [0.6, 0.8, 0.95].map(|share| share * ranges.u_max));
            with(&[], cells, one("limit", 1e9, 0.8 * ranges.u_max))
        }
    }
}

fn candidate(effect: JointEffect, search: Search, n: usize) -> Candidate {
    let definition = effect.definition();
    let place = |name: &str| {
        let found = definition.parameters.iter().position(|p| p.name == name);
        found.unwrap_or_else(|| unreachable!("{name} is a parameter of {}", definition.name))
    };
    let mut neutral: Vec<f64> = definition.parameters.iter().map(|p| p.default).collect();
    let mut away = neutral.clone();
    let mut amplitudes = Vec::new();
    for &(name, nothing, size) in &search.amplitudes {
        (neutral[place(name)], away[place(name)]) = (nothing, size);
        amplitudes.push(place(name));
    }
    let mut starts = Vec::new();
    for whom in whom(effect, n) {
        for cell in &search.cells {
            let mut start = away.clone();
            whom.iter().chain(cell).for_each(|&(name, value)| start[place(name)] = value);
            starts.push(start);
        }
    }
    let bound = |k: usize| [definition.parameters[k].low, definition.parameters[k].high].contains(&neutral[k]);
    let needs_another = effect == JointEffect::CrossCoupling && n < 2;
    Candidate {
        name: definition.name,
        class: definition.class.label(),
        cannot: needs_another.then(|| "needs a second joint".to_owned()),
        free: amplitudes.iter().copied().chain(search.shapes.iter().map(|name| place(name))).collect(),
        one_sided: matches!(amplitudes.as_slice(), [only] if bound(*only)),
        amplitudes,
        neutral,
        starts,
        highest: None,
        periodic: None,
        formula: None,
    }
}

/// Which joints have it: all alike, or one alone; for a coupling each pair.
fn whom(effect: JointEffect, n: usize) -> Vec<Vec<(&'static str, f64)>> {
    let number = |k: usize| k as f64 + 1.0;
    if effect == JointEffect::CrossCoupling {
        let pairs = (0..n).flat_map(|joint| (0..n).filter(move |from| *from != joint).map(move |from| (joint, from)));
        return pairs.map(|(joint, from)| vec![("joint", number(joint)), ("from", number(from))]).collect();
    }
    let alone = (0..n).filter(|_| n > 1).map(|joint| vec![("joint", number(joint))]);
    [Vec::new()].into_iter().chain(alone).collect()
}
