//! Names of the columns, each with its unit, and in which unit numbers are written.

use super::Columns;

/// In which units the columns of joints are written: those of the model that drove them.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnUnits {
    /// Unit of the commands, `rad` or `mm` say.
    pub u_unit: String,
    /// How many of it are a metre of an actuator's cable.
    pub u_per_m: f64,
    /// Unit of the positions.
    pub y_unit: String,
    /// How many of it are a radian, or a metre where the joints slide.
    pub y_per_si: f64,
}

/// A column of numbers.
pub(super) struct Column<'a> {
    pub(super) name: String,
    values: &'a [f64],
    every: usize,
    from: usize,
    scale: f64,
}

impl Column<'_> {
    /// The number of a row; NaN: nothing was measured.
    pub(super) fn value(&self, row: usize) -> f64 {
        let value = self.values[row * self.every + self.from];
        if self.scale == 1.0 { value } else { value * self.scale }
    }
}

/// Every column but the trial: the lab's names; of joints in `units`, or in SI where none are given.
pub(super) fn columns<'a>(columns: &'a Columns, units: Option<&ColumnUnits>) -> Vec<Column<'a>> {
    let (n, n_outputs) = (columns.n_actuators, columns.n_outputs());
    let column = |name: String, values: &'a [f64], every: usize, from: usize, scale: f64| Column {
        name,
        values,
        every,
        from,
        scale,
    };
    let mut all = vec![column("time_s".to_owned(), &columns.time_s, 1, 0, 1.0)];
    let mut table = |name: &dyn Fn(usize) -> String, values: &'a [f64], every: usize, scale: f64| {
        all.extend((0..every).map(|k| column(name(k), values, every, k, scale)));
    };
    if columns.n_joints == 0 {
        table(&|k| format!("q{}_m", k + 1), &columns.q_m, n, 1.0);
        table(&|k| format!("bend_{}_rad", ["x", "y"][k]), &columns.outputs, n_outputs, 1.0);
        table(&|_| "sigma_bend_rad".to_owned(), &columns.sigma, 1, 1.0);
    } else {
        let (u, u_per_m) = units.map_or(("m", 1.0), |units| (&units.u_unit, units.u_per_m));
        let (y, y_per_si) = units.map_or(("rad", 1.0), |units| (&units.y_unit, units.y_per_si));
        table(&|k| format!("u{}_{u}", k + 1), &columns.q_m, n, u_per_m);
        table(&|k| format!("y{}_{y}", k + 1), &columns.outputs, n_outputs, y_per_si);
    }
    if columns.has_tau() {
        table(&|k| format!("tau{}_n", k + 1), &columns.tau_n, n, 1.0);
    }
    if let Some(jaw) = &columns.jaw {
        for (name, values) in [("jaw_wire_m", &jaw.wire_m), ("jaw_wire_n", &jaw.wire_n), ("jaw_rad", &jaw.jaw_rad)] {
            table(&|_| name.to_owned(), values, 1, 1.0);
        }
    }
    all
}
