//! From a file's columns to measurements: rows interleaved, polar shapes as bend vectors, weights as standard deviations.

use super::Expected;
use super::at::At;
use super::check::Place;
use super::header::{Plan, in_brackets};
use super::role::Role;
use super::rows::Table;
use super::unit::Unit;
use crate::{LoadUse, Measurements, Names, Quantity};
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

/// The measurements that a table holds.
pub(super) fn measurements(path: &Path, mut table: Table, expected: Expected, sha256: String) -> Measurements {
    let (n_inputs, n_outputs) = (table.plan.n_inputs, table.plan.n_outputs);
    let weight = take(&mut table, Role::Weight);
    // A file that another one is joined to has a part of the columns.
    let n_rows = table.trial.len();
    let has = |role| table.plan.place(role).is_some();
    let (has_inputs, has_outputs) =
        (has(Role::Input(0)), has(Role::Output(0)) || has(Role::ThetaL) || has(Role::TipPos(0)));
    let mut outputs = if has_outputs { outputs(&mut table, n_outputs) } else { vec![f64::NAN; n_outputs * n_rows] };
    if let Some(weight) = &weight {
        let unscored = weight.iter().enumerate().filter(|(_, w)| **w == 0.0).map(|(row, _)| row);
        unscored.for_each(|row| outputs[row * n_outputs..(row + 1) * n_outputs].fill(f64::NAN));
    }
    Measurements {
        source: super::source(path),
        sha256,
        quantity: match expected {
            Expected::Snake => Quantity::Snake,
            Expected::Segments(_) => Quantity::Segments,
            Expected::Joints(_) => Quantity::Joints,
            Expected::Force(_) => Quantity::Force,
        },
        time_s: planned(take(&mut table, Role::Time)),
        inputs: if has_inputs {
            planned(interleave(&mut table, n_inputs, Role::Input))
        } else {
            vec![0.0; n_inputs * n_rows]
        },
        n_inputs,
        outputs,
        n_outputs,
        loads_n: interleave(&mut table, n_inputs, Role::Load),
        load_use: LoadUse::UNCALIBRATED,
        stem_angle_rad: take(&mut table, Role::StemAngle),
        temperature_c: take(&mut table, Role::Temperature),
        sigma: take(&mut table, Role::Sigma).or_else(|| weight.map(|w| w.iter().map(|w| w.sqrt().recip()).collect())),
        extra: extra(&mut table),
        names: names(&table.plan, n_inputs, n_outputs, expected),
        n_held_rows: 0,
        clock: None,
        tip_frames: Vec::new(),
        trial: table.trial,
    }
}

/// Where a table's measurements stand in their file.
pub(super) fn place<'a>(path: &'a Path, table: &Table) -> Place<'a> {
    let names = |is_one: fn(Role) -> bool| match table.plan.names(is_one) {
        several if several.contains(", ") => format!("columns {several}"),
        one => format!("column {one}"),
    };
    Place {
        path,
        rows: match table.last {
            At::Line(last) => format!("lines 2 to {last}"),
            At::Row(last) => format!("rows 1 to {last}"),
            At::Names => String::new(),
        },
        time: table.plan.names(|role| role == Role::Time),
        inputs: names(|role| matches!(role, Role::Input(_))),
        outputs: names(Role::is_of_shape),
    }
}

fn take(table: &mut Table, role: Role) -> Option<Vec<f64>> {
    let place = table.plan.place(role)?;
    table.columns.get_mut(place).map(std::mem::take)
}

/// Columns without which a heading is refused, so that every plan has them.
fn planned(columns: Option<Vec<f64>>) -> Vec<f64> {
    columns.unwrap_or_else(|| unreachable!("a heading without these columns is refused"))
}

/// Columns 0 to n-1 of a kind, row after row; `None` unless all are there.
fn interleave(table: &mut Table, n: usize, role: impl Fn(usize) -> Role) -> Option<Vec<f64>> {
    let columns = (0..n).map(|k| take(table, role(k))).collect::<Option<Vec<_>>>()?;
    let n_rows = table.trial.len();
    let mut rows = Vec::with_capacity(n * n_rows);
    for row in 0..n_rows {
        rows.extend(columns.iter().map(|column| column[row]));
    }
    Some(rows)
}

fn outputs(table: &mut Table, n_outputs: usize) -> Vec<f64> {
    if let Some(rows) = interleave(table, n_outputs, Role::Output) {
        return rows;
    }
    if let Some(rows) = interleave(table, n_outputs, Role::TipPos) {
        return rows;
    }
    let theta_l_rad = planned(take(table, Role::ThetaL));
    let delta_rad = planned(take(table, Role::Delta));
    let bend = |(theta_l, delta): (&f64, &f64)| {
        let bend = FRAC_PI_2 - theta_l;
        [bend * delta.cos(), bend * delta.sin()]
    };
    theta_l_rad.iter().zip(&delta_rad).flat_map(bend).collect()
}

/// The file's own names, where they are not the lab's.
fn names(plan: &Plan, n_inputs: usize, n_outputs: usize, expected: Expected) -> Names {
    let name = |role: Role, own: &str| {
        let found = plan.columns.iter().find(|column| column.role == role)?;
        let stem = stem(&found.name);
        (!stem.eq_ignore_ascii_case(own)).then(|| stem.replace(char::is_control, " "))
    };
    let is_snake = matches!(expected, Expected::Snake);
    let letter = if is_snake { "q" } else { "u" };
    let force = matches!(expected, Expected::Force(_));
    let input = |k: usize| {
        let own = if force { String::new() } else { format!("{letter}{}", k + 1) };
        name(Role::Input(k), &own).unwrap_or_default()
    };
    let output = |k: usize| match is_snake {
        true => name(Role::Output(k), ["bend_x", "bend_y"].get(k).copied().unwrap_or_default()),
        // A force has no name of the lab's own besides: `y1` would say nothing.
        false if force => name(Role::Output(k), ""),
        false => name(Role::Output(k), &format!("y{}", k + 1)),
    };
    Names {
        inputs: (0..n_inputs).map(input).collect(),
        outputs: match expected {
            Expected::Segments(_) => Names::of_segments((0..n_outputs).map(output)),
            _ => (0..n_outputs).map(|k| output(k).unwrap_or_default()).collect(),
        },
    }
}

/// A name without its unit: what is shown is in the lab's.
fn stem(name: &str) -> &str {
    let suffix = name.rsplit_once('_').filter(|(stem, unit)| !stem.is_empty() && Unit::from_suffix(unit).is_some());
    in_brackets(name).or(suffix).map_or(name, |(stem, _)| stem)
}

fn extra(table: &mut Table) -> Vec<(String, Vec<f64>)> {
    let of_kind = table.plan.columns.iter().zip(&mut table.columns).filter(|(column, _)| column.role == Role::Extra);
    let named = of_kind.map(|(column, values)| (column.name.clone(), std::mem::take(values)));
    named.filter(|(_, values)| values.iter().any(|v| v.is_finite())).collect()
}
