//! The paper as sections of words and tables: for a terminal, and for the page.

use crate::errors::Number;
use crate::fig_11::{BENDS_DEG, TurnErrors, TurnRow};
use crate::{Paper, bias, claims, fig_10, fig_12};
use krait_report::{Spread, Table};
use std::path::Path;

/// A heading, a table, and what must be said about it.
pub struct Section {
    /// The heading.
    pub title: String,
    /// The table.
    pub table: Table,
    /// Sentences under it.
    pub notes: String,
}

impl Section {
    /// The section for a terminal, with an empty line behind it.
    pub(crate) fn text(&self) -> String {
        let notes: String = self.notes.lines().map(|line| format!("  {line}\n")).collect();
        format!("{}\n{}{notes}\n", self.title, self.table)
    }
}

/// Everything as text.
pub fn terminal(paper: &Paper, folder: &Path) -> String {
    let mut text = String::new();
    for section in sections(paper) {
        text += &section.text();
    }
    text += "What the paper claims\n";
    for claim in &paper.claims {
        let word = |v: &claims::ClaimVerdict| if v.holds { "holds" } else { "does not hold" };
        text += &format!("  {}: {}\n", claim.place, claim.claim);
        text += &format!("    as printed: {}: {}\n", word(&claim.printed), claim.printed.found);
        text += &format!("    corrected:  {}: {}\n", word(&claim.corrected), claim.corrected.found);
    }
    text += "\nErrors of the paper, with the numbers that show each\n";
    for finding in &paper.errors {
        text += &format!("  {}\n    printed: {}\n    correct: {}\n", finding.place, finding.printed, finding.correct);
        for number in &finding.numbers {
            text += &format!("      {}: {}\n", number.what, value(number));
        }
    }
    text += &format!("\nPictures and page: {}\n", folder.join("index.html").display());
    text += &format!("{}\n", sentence(paper));
    text
}

/// Every section with a table, in the order of the paper.
pub fn sections(paper: &Paper) -> Vec<Section> {
    let section = |title: &str, table, notes: String| Section { title: title.to_owned(), table, notes };
    let t = &paper.table_3;
    let none = String::new;
    let mut sections = vec![
        section("Table II, Fig. 8: friction of the cone, tau~ = e^(2 mu phi) (tau + f_s)", table_2(paper), none()),
        section(
            "Table III as printed, again from the photographs that it contains",
            as_printed(paper),
            after_as_printed(paper),
        ),
        section("Table III's kind of run on the bench, line 1 alone", line_1(paper), after_line_1(paper)),
        section(
            "The same on a one-way ramp with contrasts of three lines, loads at the predicted bend, camera 1 deg",
            contrasts(paper),
            format!(
                "bench: eta {:.3}, half of the play {:.4} mm; sd: one standard deviation\nkrait's prior moves the last row by {:+.4} and {:+.4} mm",
                t.true_eta, t.true_lambda_mm, t.pull_of_the_prior.0, t.pull_of_the_prior.1
            ),
        ),
        section(
            "Bias: which bend stands in the load of Eq. (20), and what the prior does; mean over runs",
            bias_table(&paper.bias),
            after_bias(),
        ),
        section(
            "Fig. 10: error of the bend on the ramp of 1 deg steps to 80 deg, delta = 0, deg; back: 80 to 5 deg",
            ramp(&paper.fig_10),
            none(),
        ),
        section("Fig. 10 at single bends, deg", ramp_points(&paper.fig_10), none()),
    ];
    for bend_deg in BENDS_DEG {
        sections.push(section(
            &format!("Fig. 11: bend {bend_deg:.0} deg, other planes; errors rms / max, deg"),
            turns(&paper.fig_11, bend_deg),
            "turning: bent at delta = 0, then turned once in 2 deg steps; from straight: each of 12 planes bent from straight".to_owned(),
        ));
    }
    sections.push(section("Fig. 12: poses with the end disk's centre, mm", poses(&paper.fig_12), none()));
    sections.push(section(
        "Where lines reverse and the plane turns, which no figure of the paper shows, deg (bend vector)",
        motions(paper),
        none(),
    ));
    sections
}

fn table_2(paper: &Paper) -> Table {
    let t = &paper.table_2;
    let mut table = Table::new(&["", "printed", "found", "standard error", "of 25 g and 1 g"]);
    let mut row = |cells: [String; 5]| table.row(cells.to_vec());
    let e = String::new;
    let f = |v: f64, digits: usize| format!("{v:.digits$}");
    row(["mu".into(), f(t.printed.mu, 4), f(t.mu, 5), f(t.se.mu, 5), f(t.se_of_25_g.mu, 5)]);
    row(["f_s, g = 9.80665 m/s2, N".into(), e(), f(t.f_s_n, 3), f(t.se.f_s_n, 3), f(t.se_of_25_g.f_s_n, 3)]);
    row(["f_s, g = 10 m/s2, N".into(), f(t.printed.f_s_n, 3), f(t.f_s_n_with_g_10, 3), e(), e()]);
    row(["correlation of the two".into(), e(), f(t.correlation, 3), e(), e()]);
    row(["slope e^(2 mu phi)".into(), e(), f(t.slope, 5), e(), e()]);
    row(["intercept, g".into(), e(), f(t.intercept_g, 2), e(), e()]);
    row(["a reading, g: rms".into(), f(t.printed.weight_error_g, 0), f(t.residual_g.rms, 1), e(), e()]);
    row(["a reading, g: n - 2".into(), e(), f(t.reading_sd_g, 1), e(), e()]);
    row(["a reading, g: max".into(), e(), f(t.residual_g.max, 1), e(), e()]);
    row(["chi2 of 8, weights +-25 and +-1 g".into(), e(), f(t.chi2, 2), e(), e()]);
    row(["df_s of Eq. (14), g = 10 m/s2, N".into(), f(t.printed.df_s_n, 3), f(t.eq_14.df_s_n_with_g_10, 3), e(), e()]);
    let rows = &t.eq_14.dmu_of_rows;
    row([
        "dmu of Eq. (14), first and last row".into(),
        f(t.printed.dmu, 4),
        format!("{:.4} .. {:.4}", rows[0], rows[9]),
        e(),
        e(),
    ]);
    row([
        "mu, f_s of logarithms, g".into(),
        e(),
        format!("{:.4}, {:.1}", t.of_logarithms.0, t.of_logarithms.1),
        e(),
        e(),
    ]);
    table
}

fn as_printed(paper: &Paper) -> Table {
    let p = &paper.table_3.as_printed;
    let mut table =
        Table::new(&["photograph", "bend deg", "x mm", "z mm", "row", "eta", "printed", "lambda mm", "printed"]);
    for (k, photograph) in p.photographs.iter().enumerate() {
        let mut cells = vec![format!("{}", k + 1), format!("{:.1}", p.bend_deg[k])];
        cells.extend([photograph.x_mm, photograph.z_mm].map(|v| format!("{v:.5}")));
        // The first row rests on two photographs.
        if let Some(row) = k.checked_sub(1) {
            let (found, printed) = (p.rows[row], p.printed[row]);
            cells.push(format!("{}", row + 1));
            cells.extend([found.0, printed.0, found.1, printed.1].map(|v| format!("{v:.4}")));
        } else {
            cells.extend(vec![String::new(); 5]);
        }
        table.row(cells);
    }
    table
}

fn after_as_printed(paper: &Paper) -> String {
    let (p, printed) = (&paper.table_3.as_printed, &paper.table_3.printed);
    format!(
        "variances by Eq. (21) with 1 deg = 0.0294 mm: {:.6}, {:.6} mm2 (sd {:.4}, {:.4} mm); paper, Eq. (22): eta {:.3} +- {:.4}, lambda {:.4} +- {:.4} mm: row 9, variances\n\
         residuals of these photographs: {:.3} mm rms, {:.1} sigma; sd from them {:.3}, {:.3} mm; first row: sd {:.3}, {:.3} mm",
        p.variances.0,
        p.variances.1,
        p.variances.0.sqrt(),
        p.variances.1.sqrt(),
        printed.eta,
        printed.eta_plus_minus,
        printed.lambda_mm,
        printed.lambda_plus_minus_mm,
        p.residual_rms_mm,
        p.residual_rms_mm / crate::reconstruction::SIGMA_MM,
        p.sd_from_residuals.0,
        p.sd_from_residuals.1,
        p.sd_of_first.0,
        p.sd_of_first.1,
    )
}

fn line_1(paper: &Paper) -> Table {
    let l = &paper.table_3.line_1;
    let mut table = Table::new(&["row", "commanded deg", "reached deg", "eta", "lambda mm"]);
    for (k, (eta, lambda_mm)) in l.rows.iter().enumerate() {
        table.row(vec![
            format!("{}", k + 1),
            format!("{:.1}", l.commanded_deg[k + 1]),
            format!("{:.1}", l.reached_deg[k + 1]),
            format!("{eta:.4}"),
            format!("{lambda_mm:.5}"),
        ]);
    }
    table
}

fn after_line_1(paper: &Paper) -> String {
    let l = &paper.table_3.line_1;
    let scatter = |s: &crate::line_1::Scatter| {
        format!("eta {:.3} +- {:.3}, lambda {:.4} +- {:.4} mm", s.mean.0, s.sd.0, s.mean.1, s.sd.1)
    };
    format!(
        "no noise above; 4000 runs with 1 deg: first row {}; last row {}\n\
         line 1 alone takes (4/3) (h + e^(2 mu phi) f_s / K_c) = {:.4} mm for lambda; contrasts of the last ten poses: eta {:.4}, half-width {:.4} mm",
        scatter(&l.first),
        scatter(&l.last),
        l.lambda_closed_form_mm,
        l.contrasts.0,
        l.contrasts.1,
    )
}

fn contrasts(paper: &Paper) -> Table {
    let mut table = Table::new(&["pose", "commanded deg", "measured deg", "eta", "sd", "lambda mm", "sd mm"]);
    for (k, row) in paper.table_3.rows.iter().enumerate() {
        let mut cells = vec![format!("{}", k + 1)];
        cells.extend([row.commanded_deg, row.measured_deg].map(|v| format!("{v:.1}")));
        cells.extend([row.eta, row.eta_sd, row.lambda_mm, row.lambda_sd_mm].map(|v| format!("{v:.4}")));
        table.row(cells);
    }
    table
}

fn bias_table(rows: &[bias::BiasRow]) -> Table {
    let mut table = Table::new(&[
        "photographs",
        "load at",
        "eta",
        "sd",
        "half-width mm",
        "sd mm",
        "bend at 30 deg",
        "at 80 deg",
        "pull of the prior",
        "mm",
    ]);
    for r in rows {
        let mut cells = vec![r.range.to_owned(), r.method.to_owned()];
        cells.extend([r.found.mean.0, r.found.sd.0, r.found.mean.1, r.found.sd.1].map(|v| format!("{v:.4}")));
        cells.extend(r.bend_error_deg.map(|v| format!("{v:+.2}")));
        cells.extend(if r.with_prior {
            [r.pull_of_the_prior.0, r.pull_of_the_prior.1].map(|v| format!("{v:+.4}"))
        } else {
            [String::new(), String::new()]
        });
        table.row(cells);
    }
    table
}

fn after_bias() -> String {
    "ten photographs of a one-way ramp, 2000 runs with the same noise in every row; the mean's own error is sd / 45\n\
     prior: eta 1 with sd 0.3, half-width 0 with sd 0.1 mm"
        .to_owned()
}

fn ramp(rows: &[fig_10::RampRow]) -> Table {
    let mut table = Table::new(&["compensation", "rms", "p95", "max", "back rms", "back max"]);
    for row in rows {
        let (t, b) = (row.there_deg, row.back_deg);
        let mut cells = vec![row.compensation.to_owned()];
        cells.extend([t.rms, t.p95, t.max, b.rms, b.max].map(|v| format!("{v:.3}")));
        table.row(cells);
    }
    table
}

fn ramp_points(rows: &[fig_10::RampRow]) -> Table {
    let mut table = Table::new(&["compensation", "10", "20", "30", "40", "50", "60", "70", "80"]);
    for row in rows {
        let mut cells = vec![row.compensation.to_owned()];
        cells.extend(row.at_10_to_80_deg.iter().map(|v| format!("{v:+.3}")));
        table.row(cells);
    }
    table
}

fn turns(rows: &[TurnRow], bend_deg: f64) -> Table {
    let mut table =
        Table::new(&["compensation", "turning: bend", "turning: plane", "from straight: bend", "from straight: plane"]);
    let cell = |s: Spread| format!("{:.3} / {:.3}", s.rms, s.max);
    for row in rows.iter().filter(|row| row.bend_deg == bend_deg) {
        let pair = |e: &TurnErrors| [cell(e.bend_deg), cell(e.plane_deg)];
        let mut cells = vec![row.compensation.to_owned()];
        cells.extend(pair(&row.turning));
        cells.extend(pair(&row.from_straight));
        table.row(cells);
    }
    table
}

fn poses(rows: &[fig_12::PoseRow]) -> Table {
    let mut table =
        Table::new(&["bend deg", "delta deg", "x", "y", "z", "q1", "q2", "q3", "off by", "naive by", "signed by"]);
    for row in rows {
        let mut cells = vec![format!("{:.0}", row.bend_deg), format!("{:.0}", row.delta_deg)];
        cells.extend(row.tip_mm.iter().chain(row.q_mm.iter()).map(|v| format!("{:.4}", v + 0.0)));
        cells.extend(row.reached.iter().map(|r| format!("{:.2}", r.error_mm)));
        table.row(cells);
    }
    table
}

fn motions(paper: &Paper) -> Table {
    let mut table = Table::new(&["compensation", "rms", "p95", "max"]);
    for row in &paper.motions {
        let s = row.error_deg;
        let mut cells = vec![row.compensation.to_owned()];
        cells.extend([s.rms, s.p95, s.max].map(|v| format!("{v:.2}")));
        table.row(cells);
    }
    table
}

/// The verdict in one sentence: the corrected method, and the printed one apart.
pub fn sentence(paper: &Paper) -> String {
    let v = &paper.verdict;
    let (word, rest) =
        if v.holds { ("holds", "") } else { ("DOES NOT HOLD", " (expected: estimated within, naive beyond)") };
    let n = |holds: fn(&claims::Claim) -> bool| paper.claims.iter().filter(|c| holds(c)).count();
    format!(
        "The paper's claim {word} with the corrected method: within {:.0} deg is asked for, the estimate leaves {:.2} deg rms ({:.2} max), naive \
         compensation {:.2} deg rms ({:.2} max){rest}; with other noise of the camera the estimate is within it on {:.0} of {} benches, {:.2} deg rms on the worst. \
         As printed, {} of {} claims hold, corrected {}.",
        v.goal_deg,
        v.estimated_deg.rms,
        v.estimated_deg.max,
        v.naive_deg.rms,
        v.naive_deg.max,
        v.seeds.part_within_goal * v.seeds.n as f64,
        v.seeds.n,
        v.seeds.worst_rms_deg,
        n(|c| c.printed.holds),
        paper.claims.len(),
        n(|c| c.corrected.holds),
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
