//! What a column can stand for: its name without a unit, its quantity, and the values that it can have.

use super::unit::{Dimension, Unit};
use krait_model::model_file::{ForceMachine, ForceUnit};
use std::f64::consts::PI;

/// What a column stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    Trial,
    Input(usize),
    Output(usize),
    ThetaL,
    Delta,
    /// A component of the tip's position, in a frame of the tracker's own.
    TipPos(usize),
    Load(usize),
    StemAngle,
    Temperature,
    Sigma,
    Weight,
    Extra,
}

impl Role {
    /// Whether it is a part of what was measured of the shape.
    pub(super) fn is_of_shape(self) -> bool {
        matches!(self, Self::Output(_) | Self::ThetaL | Self::Delta | Self::TipPos(_))
    }
}

/// A column of the lab before it is found in a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wanted {
    pub role: Role,
    /// Name without its unit.
    pub base: String,
    /// `None`: the name has no unit.
    pub dimension: Option<Dimension>,
    /// The unit that sentences name.
    pub unit: String,
    /// Largest magnitude that it can have, in SI units, and what anything larger is.
    pub limit: Option<(f64, &'static str)>,
}

impl Wanted {
    /// The column's name with the unit that sentences name.
    pub(super) fn name(&self) -> String {
        if self.dimension.is_none() { self.base.clone() } else { format!("{}_{}", self.base, self.unit) }
    }

    /// A smaller unit of the same quantity: what values beyond the limit are probably in.
    pub(super) fn suggestion(&self) -> Option<&'static str> {
        match self.dimension {
            Some(Dimension::Angle) => Some("deg"),
            Some(Dimension::Length) => Some("mm"),
            Some(Dimension::Force) => Some("mn"),
            _ => None,
        }
    }
}

/// Lines of a snake.
pub(crate) const N_LINES: usize = 3;

/// The columns of a snake.
pub(super) fn snake() -> Vec<Wanted> {
    let mut wanted = vec![time(), trial()];
    for i in 0..N_LINES {
        let limit = (0.1, "no travel that a line of a snake can make");
        wanted.push(length(Role::Input(i), format!("q{}", i + 1), limit));
    }
    let bend = Some((2.0 * PI, "no angle of a snake"));
    wanted.push(angle(Role::Output(0), "bend_x", bend));
    wanted.push(angle(Role::Output(1), "bend_y", bend));
    wanted.push(angle(Role::ThetaL, "theta_l", bend));
    // Azimuths may be unwrapped over a few turns.
    wanted.push(angle(Role::Delta, "delta", Some((10.0 * PI, "no azimuth"))));
    let tip = |(k, axis)| length(Role::TipPos(k), format!("tip_{axis}"), (10.0, "no position of a tip"));
    wanted.extend(["x", "y", "z"].into_iter().enumerate().map(tip));
    wanted.extend((0..N_LINES).map(load));
    wanted.extend(circumstances());
    wanted.push(angle(Role::Sigma, "sigma_bend", Some((PI, "no standard deviation of a bend"))));
    wanted
}

/// The columns of `n` joints in these units.
pub(super) fn joints(n: usize, u_unit: &str, y_unit: &str) -> Vec<Wanted> {
    // Two turns: an instrument's roll makes more than one.
    let y_limit = match y_unit {
        "rad" => Some((4.0 * PI, "no angle of a joint")),
        "m" => Some((2.0, "no travel of a joint")),
        _ => None,
    };
    let mut wanted = vec![time(), trial()];
    wanted.extend((0..n).map(|i| column(Role::Input(i), format!("u{}", i + 1), u_unit, None)));
    wanted.extend((0..n).map(|i| column(Role::Output(i), format!("y{}", i + 1), y_unit, y_limit)));
    wanted.extend(circumstances());
    wanted.push(column(Role::Sigma, "sigma_y".to_owned(), y_unit, None));
    wanted
}

/// The columns of segments in series: what `krait export` writes of them.
pub(super) fn segments(n_lines: usize, n_bends: usize) -> Vec<Wanted> {
    let mut wanted = vec![time(), trial()];
    let travel = (0.1, "no travel that a line can make");
    wanted.extend((0..n_lines).map(|i| length(Role::Input(i), format!("u{}", i + 1), travel)));
    let bend = Some((2.0 * PI, "no angle of a segment"));
    wanted.extend((0..n_bends).map(|i| angle(Role::Output(i), &format!("y{}", i + 1), bend)));
    wanted.extend((0..n_lines).map(load));
    wanted.push(angle(Role::Sigma, "sigma_y", Some((PI, "no standard deviation of a bend"))));
    wanted.push(plain(Role::Weight, "weight"));
    wanted
}

/// A column in a unit of the user's, which need not be one that can be converted.
fn column(role: Role, base: String, unit: &str, limit: Option<(f64, &'static str)>) -> Wanted {
    let dimension = Unit::from_suffix(unit).map(|unit| unit.dimension).or(Some(Dimension::Number));
    Wanted { role, base, dimension, unit: unit.to_ascii_lowercase(), limit }
}

/// How the columns of a force begin, and their unit: `tau1_nm`, `i1_a`.
pub(crate) fn force_names(unit: ForceUnit) -> (&'static str, &'static str) {
    match unit {
        ForceUnit::NewtonMetre => ("tau", "nm"),
        ForceUnit::Ampere => ("i", "a"),
    }
}

/// The columns of joints with a force.
pub(super) fn force(machine: &ForceMachine) -> Vec<Wanted> {
    let mut wanted = vec![time(), trial()];
    // An arm's wrist may make a few turns.
    let limit = Some((16.0 * PI, "no angle of a joint"));
    wanted.extend((0..machine.n).map(|i| angle(Role::Input(i), &format!("q{}", i + 1), limit)));
    let (base, unit) = force_names(machine.unit);
    wanted.extend((0..machine.n).map(|i| Wanted {
        role: Role::Output(i),
        base: format!("{base}{}", i + 1),
        dimension: Some(Dimension::Number),
        unit: unit.to_owned(),
        limit: None,
    }));
    wanted
}

/// The load at the actuator of line `i`, from 0.
fn load(i: usize) -> Wanted {
    Wanted {
        role: Role::Load(i),
        base: format!("tau{}", i + 1),
        dimension: Some(Dimension::Force),
        unit: "n".to_owned(),
        limit: Some((1e4, "no load that a line can bear")),
    }
}

/// A position that is wanted, by its name with a unit: `y1_rad`.
pub(super) fn named((k, name): (usize, &String)) -> Wanted {
    let (base, unit) = name.rsplit_once('_').unwrap_or((name, ""));
    column(Role::Input(k), base.to_owned(), unit, None)
}

pub(super) fn time() -> Wanted {
    let (base, unit) = ("time".to_owned(), "s".to_owned());
    Wanted { role: Role::Time, base, dimension: Some(Dimension::Time), unit, limit: None }
}

fn trial() -> Wanted {
    plain(Role::Trial, "trial")
}

fn circumstances() -> [Wanted; 3] {
    let dimension = Some(Dimension::Temperature);
    let limit = Some((273.15, "no temperature of a machine"));
    [
        angle(Role::StemAngle, "stem_angle", Some((4.0 * PI, "no angle of a stem"))),
        Wanted { role: Role::Temperature, base: "temperature".to_owned(), dimension, unit: "c".to_owned(), limit },
        plain(Role::Weight, "weight"),
    ]
}

fn plain(role: Role, base: &str) -> Wanted {
    Wanted { role, base: base.to_owned(), dimension: None, unit: String::new(), limit: None }
}

fn angle(role: Role, base: &str, limit: Option<(f64, &'static str)>) -> Wanted {
    Wanted { role, base: base.to_owned(), dimension: Some(Dimension::Angle), unit: "rad".to_owned(), limit }
}

fn length(role: Role, base: String, limit: (f64, &'static str)) -> Wanted {
    Wanted { role, base, dimension: Some(Dimension::Length), unit: "m".to_owned(), limit: Some(limit) }
}
