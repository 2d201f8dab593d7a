//! The measurements as CSV, in the columns of the model lab: the unit in each header, an empty cell where nothing was measured.

use super::header::columns;
use super::{ColumnUnits, Columns};
use std::io::{self, Write};

/// Writes a header and one line per row: `time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad` of a snake,
/// `time_s,u1_...,y1_...` of joints in their `units`, then `tau1_n` and so on if any load was measured, then `trial`. Every
/// number comes back bit for bit when it is parsed.
///
/// # Errors
/// What the system says.
pub fn write_csv(table: &Columns, units: Option<&ColumnUnits>, out: &mut impl Write) -> io::Result<()> {
    let doubles = columns(table, units);
    for column in &doubles {
        write!(out, "{},", column.name)?;
    }
    out.write_all(b"trial\n")?;
    for (row, trial) in table.trial.iter().enumerate() {
        for column in &doubles {
            let value = column.value(row);
            if !value.is_nan() {
                write!(out, "{value}")?;
            }
            out.write_all(b",")?;
        }
        writeln!(out, "{trial}")?;
    }
    out.flush()
}
