//! The measurements as CSV, in the columns of the model lab: the unit in each header, an empty cell where nothing was measured.

use super::{Columns, Row};
use std::io::{self, Write};

/// Writes a header and one line per row: `time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad`, then
/// `tau1_n,tau2_n,tau3_n` if any load was measured, then `trial`. Every number comes back bit for bit when it is parsed.
///
/// # Errors
/// What the system says.
pub fn write_csv(columns: &Columns, out: &mut impl Write) -> io::Result<()> {
    let has_tau = columns.has_tau();
    out.write_all(b"time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad,")?;
    out.write_all(if has_tau { b"tau1_n,tau2_n,tau3_n,trial\n" } else { b"trial\n" })?;
    for Row { time_s, q_m, bend_rad, sigma_bend_rad, tau_n, trial } in &columns.rows {
        write!(out, "{time_s},")?;
        for value in q_m.iter().chain(bend_rad).chain([sigma_bend_rad]) {
            cell(out, *value)?;
        }
        if has_tau {
            for value in tau_n {
                cell(out, *value)?;
            }
        }
        writeln!(out, "{trial}")?;
    }
    out.flush()
}

fn cell(out: &mut impl Write, value: f64) -> io::Result<()> {
    if value.is_nan() { out.write_all(b",") } else { write!(out, "{value},") }
}
