//! The paper on a terminal: tables beside the printed values, then where the pictures are.

use crate::errors::Number;
use crate::table2::Table2;
use crate::table3::Table3;
use crate::{Claim, Paper};
use krait_report::{Spread, Table};
use std::path::Path;

/// Everything as text.
pub fn terminal(paper: &Paper, folder: &Path) -> String {
    let mut text = String::from("Table II: friction of the cone, tau~ = e^(2 mu phi) (tau + f_s)\n");
    text += &table_2(&paper.table_2).to_string();
    text += "\nTable III's kind of run: ten recursive estimates on a one-way ramp of the simulated bench\n";
    text += &table_3(&paper.table_3).to_string();
    text += &after_table_3(&paper.table_3);
    text += "\nError of the bend on the one-way ramp of Figs. 9 to 11, degrees\n";
    text += &ramp(&paper.verdict).to_string();
    text += "\nWhere lines reverse and the plane turns, which no figure of the paper shows, degrees (bend vector)\n";
    text += &motions(paper).to_string();
    text += "\nErrors of the paper, with the numbers that show each\n";
    for finding in &paper.errors {
        text += &format!("  {}\n    printed: {}\n    correct: {}\n", finding.place, finding.printed, finding.correct);
        for number in &finding.numbers {
            text += &format!("      {}: {}\n", number.what, value(number));
        }
    }
    text += &format!("\nPictures and page: {}\n", folder.join("index.html").display());
    text += &format!("{}\n", sentence(&paper.verdict));
    text
}

/// Table II beside the printed values.
pub fn table_2(t: &Table2) -> Table {
    let mut table = Table::new(&["", "printed", "regenerated"]);
    let mut row = |what: &str, printed: String, found: String| table.row(vec![what.to_owned(), printed, found]);
    row("mu", format!("{:.4}", t.printed.mu), format!("{:.5}", t.mu));
    row("f_s with g = 9.80665 m/s2, N", String::new(), format!("{:.3}", t.f_s_n));
    row("f_s with g = 10 m/s2, N", format!("{:.3}", t.printed.f_s_n), format!("{:.3}", t.f_s_n_with_g_10));
    row("slope e^(2 mu phi)", String::new(), format!("{:.5}", t.slope));
    row("intercept, g", String::new(), format!("{:.2}", t.intercept_g));
    row("error of a weight, g: rms", format!("{:.0}", t.printed.weight_error_g), format!("{:.1}", t.residual_g.rms));
    row("error of a weight, g: max", String::new(), format!("{:.1}", t.residual_g.max));
    row("df_s of Eq. (14), N", format!("{:.3}", t.printed.df_s_n), format!("{:.3}", t.df_s_of_one_weight_n));
    table
}

/// Table III.
pub fn table_3(t: &Table3) -> Table {
    let mut table = Table::new(&["pose", "commanded deg", "measured deg", "eta", "sd", "lambda mm", "sd mm"]);
    for (k, row) in t.rows.iter().enumerate() {
        let mut cells = vec![format!("{}", k + 1)];
        cells.extend([row.commanded_deg, row.measured_deg].map(|v| format!("{v:.1}")));
        cells.extend([row.eta, row.eta_sd, row.lambda_mm, row.lambda_sd_mm].map(|v| format!("{v:.4}")));
        table.row(cells);
    }
    table
}

/// What the table means and what the paper prints.
pub fn after_table_3(t: &Table3) -> String {
    format!(
        "  bench: eta {:.3}, half of the play {:.4} mm; sd: one standard deviation, from the camera's 1 deg\n  \
         paper, Eq. (22): eta {:.3} +- {:.4}, lambda {:.4} +- {:.4} mm, which are the values of row 9, not of row 10;\n  \
         its +- are variances: the standard deviations are {:.3} and {:.3} mm\n",
        t.true_eta,
        t.true_lambda_mm,
        t.printed.eta,
        t.printed.eta_plus_minus,
        t.printed.lambda_mm,
        t.printed.lambda_plus_minus_mm,
        t.printed.eta_plus_minus.sqrt(),
        t.printed.lambda_plus_minus_mm.sqrt(),
    )
}

/// Errors on the ramp.
pub fn ramp(v: &Claim) -> Table {
    let rows = [("off", v.off_deg), ("naive", v.naive_deg), ("estimated", v.estimated_deg)];
    spreads(rows.into_iter())
}

/// Errors on the operator-like motion.
pub fn motions(paper: &Paper) -> Table {
    spreads(paper.motions.iter().map(|row| (row.compensation, row.error_deg)))
}

/// The verdict in one sentence.
pub fn sentence(v: &Claim) -> String {
    let (word, rest) =
        if v.holds { ("holds", "") } else { ("DOES NOT HOLD", " (expected: estimated within, naive beyond)") };
    format!(
        "The paper's claim {word}: within {:.0} deg is asked for, the estimate leaves {:.2} deg rms ({:.2} max), naive \
         compensation {:.2} deg rms ({:.2} max){rest}; with other noise of the camera the estimate is within it on {:.0} of {} benches, {:.2} deg rms on the worst.",
        v.goal_deg,
        v.estimated_deg.rms,
        v.estimated_deg.max,
        v.naive_deg.rms,
        v.naive_deg.max,
        v.part_of_seeds_within_goal * v.n_seeds as f64,
        v.n_seeds,
        v.worst_rms_of_seeds_deg,
    )
}

/// A number with as many digits as it deserves, and its unit.
pub fn value(number: &Number) -> String {
    let size = number.value.abs();
    let digits = if size >= 100.0 {
        1
    } else if size >= 1.0 {
        3
    } else {
        4
    };
    let text = if size < ROUNDING {
        "0 (rounding)".to_owned()
    } else if size < 1e-3 {
        format!("{:.2e}", number.value)
    } else {
        format!("{:.digits$}", number.value)
    };
    if number.unit.is_empty() { text } else { format!("{text} {}", number.unit) }
}

/// What is left of a zero after a few dozen operations on numbers of the order of one.
const ROUNDING: f64 = 1e-12;

fn spreads<'a>(rows: impl Iterator<Item = (&'a str, Spread)>) -> Table {
    let mut table = Table::new(&["compensation", "rms", "p95", "max"]);
    for (name, s) in rows {
        let mut cells = vec![name.to_owned()];
        cells.extend([s.rms, s.p95, s.max].map(|v| format!("{v:.2}")));
        table.row(cells);
    }
    table
}
