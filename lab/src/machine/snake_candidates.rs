//! Where to look for each effect of a snake: what is free in a fit, and the grid that screening tries.

use super::{Candidate, Periodic};
use crate::noise::largest_range;
use crate::{Measurements, tip};
use krait_model::effects::{Definition, EffectKind, Needs};

/// Every effect that may be missing from a snake's model, in the catalogue's order.
pub(super) fn all(data: &Measurements) -> Vec<Candidate> {
    EffectKind::ALL.into_iter().filter_map(|kind| of_kind(kind, data)).collect()
}

/// An effect by its kind; `None` for one that no search looks for.
pub(super) fn of_kind(kind: EffectKind, data: &Measurements) -> Option<Candidate> {
    search(kind).map(|search| candidate(kind, &search, data))
}

/// How to look for an effect: values by name, the rest at their defaults.
struct Search {
    /// Amplitudes: name, neutral value, size to look at.
    amplitudes: &'static [(&'static str, f64, f64)],
    /// Further free parameters.
    shapes: &'static [&'static str],
    /// Cells of the grid: values by name, which replace amplitudes' sizes too.
    cells: &'static [&'static [(&'static str, f64)]],
}

const ONE: &[&[(&str, f64)]] = &[&[]];

#[rustfmt::skip]
fn search(kind: EffectKind) -> Option<Search> {
    let plain = |amplitudes| Search { amplitudes, shapes: &[], cells: ONE };
    Some(match kind {
        EffectKind::StiffnessScale => plain(&[("eta", 1.0, 1.05)]),
        EffectKind::ActuatorCompliance => plain(&[("compliance_m_per_n", 0.0, 2e-6)]),
        EffectKind::RadiusError => plain(&[("relative", 0.0, 0.02)]),
        EffectKind::CameraScale => plain(&[("relative", 0.0, 0.02)]),
        EffectKind::InsideExtension => plain(&[("share", 0.0, 1.0)]),
        EffectKind::Backlash => Search { cells: &[&[("half_width_m", 2e-5)], &[("half_width_m", 5e-5)], &[("half_width_m", 1e-4)], &[("half_width_m", 2e-4)]], ..plain(&[("half_width_m", 0.0, 5e-5)]) },
        EffectKind::StaticFriction => Search { cells: &[&[("f_s_n", 0.5)], &[("f_s_n", 2.0)], &[("f_s_n", 6.0)]], ..plain(&[("f_s_n", 0.0, 2.0)]) },
        EffectKind::BoucWen => Search { shapes: &["transition_m"], cells: &[&[("transition_m", 3e-5)], &[("transition_m", 1e-4)], &[("transition_m", 4e-4)]], ..plain(&[("amplitude_m", 0.0, 6e-5)]) },
        EffectKind::PrandtlIshlinskii => Search { shapes: &["reach_m"], cells: &[&[("reach_m", 2e-4)], &[("reach_m", 6e-4)], &[("reach_m", 2e-3)]], ..plain(&[("w1", 0.0, 0.05), ("w3", 0.0, 0.05), ("w8", 0.0, 0.05)]) },
        EffectKind::ConeFriction => Search { cells: &[&[("mu", 0.05)], &[("mu", 0.2)]], ..plain(&[("mu", 0.0, 0.1)]) },
        EffectKind::DistributedCapstan => Search { cells: &[&[("mu", 0.05)], &[("mu", 0.2)]], ..plain(&[("mu", 0.0, 0.1)]) },
        EffectKind::DiskFriction => Search { cells: &[&[("mu", 0.03)], &[("mu", 0.1)]], ..plain(&[("mu", 0.0, 0.1)]) },
        EffectKind::BendFriction => Search { cells: &[&[("moment_nm", 2e-4)], &[("moment_nm", 7e-4)], &[("moment_nm", 2e-3)], &[("moment_nm", 5e-3)]], ..plain(&[("moment_nm", 0.0, 5e-4)]) },
        EffectKind::HoleClearance => Search { shapes: &["load_n"], cells: &[&[("load_n", 0.3)], &[("load_n", 3.0)]], ..plain(&[("clearance_m", 0.0, 2e-5)]) },
        EffectKind::SuperelasticSoftening => Search { shapes: &["strain"], cells: &[&[("strain", 0.005)], &[("strain", 0.008)], &[("strain", 0.012)]], ..plain(&[("a", 0.0, 0.5)]) },
        EffectKind::NonConstantCurvature => plain(&[("cubic_per_rad2", 0.0, 0.01)]),
        EffectKind::AxialTipForce => plain(&[("force_n", 0.0, 0.2)]),
        EffectKind::TensionCompressionAsymmetry => plain(&[("a", 0.0, 0.05)]),
        EffectKind::LineBuckling => Search { cells: &[&[("clearance_m", 1e-4)]], ..plain(&[("clearance_m", 0.0, 1e-4)]) },
        EffectKind::ViscousFriction => Search { cells: &[&[("coefficient_n_s_per_m", 300.0)], &[("coefficient_n_s_per_m", 3000.0)]], ..plain(&[("coefficient_n_s_per_m", 0.0, 300.0)]) },
        EffectKind::Latency => Search { cells: &[&[("delay_s", 0.02)], &[("delay_s", 0.1)], &[("delay_s", 0.3)]], ..plain(&[("delay_s", 0.0, 0.05)]) },
        EffectKind::StribeckFriction => Search { shapes: &["breakaway", "presliding_m", "v_s_m_per_s"], cells: &[&[("presliding_m", 3e-5)], &[("presliding_m", 1.5e-4)]], ..plain(&[("f_c_n", 0.0, 1.0)]) },
        EffectKind::PlaneOffset => plain(&[("angle_rad", 0.0, 0.03)]),
        EffectKind::Twist => plain(&[("rad_per_rad", 0.0, 0.03)]),
        EffectKind::LateralTipForce => plain(&[("force_x_n", 0.0, 0.05), ("force_y_n", 0.0, 0.05)]),
        EffectKind::EncoderZero => plain(&[("zero1_m", 0.0, 2e-5), ("zero2_m", 0.0, 2e-5)]),
        EffectKind::CameraOffset => plain(&[("offset_x_rad", 0.0, 0.01), ("offset_y_rad", 0.0, 0.01)]),
        EffectKind::EncoderScale => plain(&[("scale1", 0.0, 0.005), ("scale2", 0.0, 0.005), ("scale3", 0.0, 0.005)]),
        EffectKind::UnequalLines => plain(&[("angle2_rad", 0.0, 0.02), ("angle3_rad", 0.0, 0.02), ("radius2", 0.0, 0.02), ("radius3", 0.0, 0.02)]),
        EffectKind::LeadScrewError => Search { shapes: &["pitch_m", "phase1_rad", "phase2_rad", "phase3_rad"], ..plain(&[("amplitude_m", 0.0, 1e-5)]) },
        EffectKind::Creep => Search { shapes: &["t1_s"], cells: &[&[("t1_s", 2.0)], &[("t1_s", 7.0)], &[("t1_s", 25.0)], &[("t1_s", 90.0)]], ..plain(&[("a1", 0.0, 0.05)]) },
        EffectKind::ThermalDrift => Search { shapes: &["rise_time_s"], cells: &[&[("rise_time_s", 30.0)], &[("rise_time_s", 300.0)]], ..plain(&[("modulus_per_k", 0.0, 0.001), ("line1_m_per_k", 0.0, 1e-6), ("line2_m_per_k", 0.0, 1e-6)]) },
        EffectKind::StemCoupling => Search { shapes: &["azimuth_rad"], cells: &[&[("azimuth_rad", 0.0)], &[("azimuth_rad", 1.57)], &[("azimuth_rad", -1.57)], &[("azimuth_rad", 3.1)]], ..plain(&[("mu", 0.0, 0.1), ("radius_m", 0.0, 5e-4)]) },
        EffectKind::Saturation => Search { cells: &[&[("limit_n", 8.0)], &[("limit_n", 15.0)], &[("limit_n", 25.0)]], ..plain(&[("limit_n", 1000.0, 15.0)]) },
        EffectKind::CrossCoupling => plain(&[("k12", 0.0, 0.01), ("k13", 0.0, 0.01), ("k21", 0.0, 0.01), ("k23", 0.0, 0.01), ("k31", 0.0, 0.01), ("k32", 0.0, 0.01)]),
        EffectKind::OfSegment(own) => return search(own.law.of_all()),
        // A preload bends nothing by itself, and a formula is the user's to write.
        EffectKind::Preload | EffectKind::Formula | EffectKind::Joint(_) | EffectKind::Force(_) => return None,
    })
}

fn candidate(kind: EffectKind, search: &Search, data: &Measurements) -> Candidate {
    let definition = kind.definition();
    let place = |name: &str| {
        let found = definition.parameters.iter().position(|p| p.name == name);
        found.unwrap_or_else(|| unreachable!("{name} is a parameter of {}", definition.name))
    };
    let mut neutral: Vec<f64> = definition.parameters.iter().map(|p| p.default).collect();
    let mut away = neutral.clone();
    let mut amplitudes = Vec::new();
    for &(name, nothing, size) in search.amplitudes {
        neutral[place(name)] = nothing;
        away[place(name)] = size;
        amplitudes.push(place(name));
    }
    silence(kind, &mut neutral);
    silence(kind, &mut away);
    for &(name, nothing, size) in search.amplitudes {
        neutral[place(name)] = nothing;
        away[place(name)] = size;
    }
    let start = |cell: &[(&str, f64)]| {
        let mut start = away.clone();
        cell.iter().for_each(|&(name, value)| start[place(name)] = value);
        start
    };
    let periodic = (kind == EffectKind::LeadScrewError).then(|| Periodic {
        amplitude: place("amplitude_m"),
        period: place("pitch_m"),
        phases: ["phase1_rad", "phase2_rad", "phase3_rad"].map(place).to_vec(),
    });
    let starts = match &periodic {
        // One radian in each phase: the scale on which a fit moves it.
        Some(_) => pitches_m(data)
            .into_iter()
            .map(|pitch| start(&[("pitch_m", pitch), ("phase1_rad", 1.0), ("phase2_rad", 1.0), ("phase3_rad", 1.0)]))
            .collect(),
        None => search.cells.iter().map(|cell| start(cell)).collect(),
    };
    let on_bound = |k: usize| definition.parameters.get(k).is_some_and(|p| neutral[k] <= p.low || neutral[k] >= p.high);
    Candidate {
        name: definition.name,
        one_sided: amplitudes.len() == 1 && amplitudes.iter().all(|&k| on_bound(k)),
        class: definition.class.label(),
        cannot: cannot(definition, data).or_else(|| tip::cannot(kind, data)),
        starts,
        highest: None,
        periodic,
        formula: None,
        free: amplitudes.iter().copied().chain(search.shapes.iter().map(|name| place(name))).collect(),
        amplitudes,
        neutral,
    }
}

/// Pitches from half a millimetre on, so close that neighbours are half a turn apart over the whole travel; at least
/// three turns fit into it: what has fewer is a curve.
fn pitches_m(data: &Measurements) -> Vec<f64> {
    const FINEST_M: f64 = 5e-4;
    let travel_m = largest_range(data);
    let turns = (FEWEST_TURNS, (travel_m / FINEST_M).clamp(FEWEST_TURNS, MOST_TURNS));
    let n = ((turns.1 - turns.0) / TURNS_APART).ceil() as usize;
    (0..=n).map(|k| travel_m / (turns.1 - k as f64 * TURNS_APART).max(turns.0)).filter(|p| *p > 0.0).collect()
}

const FEWEST_TURNS: f64 = 3.0;
/// More turns of a screw than this in the whole travel are not looked for.
const MOST_TURNS: f64 = 40.0;
/// Turns in the whole travel by which neighbouring pitches differ.
const TURNS_APART: f64 = 0.5;

/// Amplitudes that a fit does not free start at zero, not at the catalogue's typical size.
fn silence(kind: EffectKind, values: &mut [f64]) {
    let silent: &[usize] = match kind {
        EffectKind::PrandtlIshlinskii => &[1, 2, 3, 4, 5, 6, 7, 8],
        EffectKind::ThermalDrift => &[0, 1, 2, 3],
        EffectKind::Creep => &[0, 2, 4],
        _ => &[],
    };
    silent.iter().for_each(|&k| values[k] = 0.0);
}

fn cannot(definition: &Definition, data: &Measurements) -> Option<String> {
    (definition.needs == Needs::StemAngle && data.stem_angle_rad.is_none())
        .then(|| "needs the column stem_angle_rad".to_owned())
}
