//! Setpoints of segments for `krait model compensate`: positions of the actuators, loads of the lines, and which line limits.

use krait_model::model_file::ModelFile;
use krait_model::segments::{Bends, MAX_LINES, SegmentCompensator, SegmentStatus, Sharing};
use serde::Serialize;

/// The inverse of a model of segments, with what its rows said so far.
pub struct SegmentInverse {
    lines: SegmentCompensator,
    /// Largest bend of each segment, rad.
    max_bend_rad: Vec<f64>,
    n_lines: usize,
    largest: Option<Load>,
    rows_at_bound: [usize; MAX_LINES],
}

/// The loads of a table, as `--json` prints them.
#[derive(Serialize)]
pub struct TableLoads {
    /// The largest load of any line at the snake.
    largest: Option<Load>,
    /// Rows in which lines are at their bounds.
    rows_at_bound: usize,
    /// The line that limits in most of these rows, from 1; null where none ever does.
    limiting_line: Option<usize>,
}

/// A load of a line in a row.
#[derive(Clone, Copy, Serialize)]
struct Load {
    /// N, push positive.
    load_n: f64,
    /// The line, from 1.
    line: usize,
    /// The row's time, s.
    time_s: f64,
}

impl SegmentInverse {
    /// Of a model file; `None` where it is of another machine.
    pub fn of(file: &ModelFile) -> anyhow::Result<Option<Self>> {
        let Some(chain) = file.segment_chain()? else { return Ok(None) };
        let n_lines = chain.machine().n_lines();
        let max_bend_rad = (0..chain.machine().n()).map(|segment| chain.machine().max_bend_rad(segment)).collect();
        let (lines, largest, rows_at_bound) = (chain.compensator(), None, [0; MAX_LINES]);
        Ok(Some(Self { lines, max_bend_rad, n_lines, largest, rows_at_bound }))
    }

    /// Columns that a row of setpoints has besides its time.
    pub fn wanted(&self) -> Vec<String> {
        (1..=self.max_bend_rad.len())
            .flat_map(|segment| [format!("bend{segment}_rad"), format!("plane{segment}_rad")])
            .collect()
    }

    /// Columns that a row of commands has.
    pub fn commanded(&self) -> Vec<String> {
        let numbered =
            |name: &str, unit: &str| (1..=self.n_lines).map(|line| format!("{name}{line}_{unit}")).collect::<Vec<_>>();
        [numbered("q", "m"), numbered("tau", "n"), numbered("tau_tilde", "n"), vec!["limiting_line".to_owned()]]
            .concat()
    }

    /// The commands for the next bends and planes, rad, and the largest correction, m; why there are none, if there are none.
    pub fn step(&mut self, time_s: f64, wanted: &[f64]) -> Result<(Vec<f64>, f64), String> {
        let too_far = |segment: usize, limit_rad: f64| {
            let number = segment + 1;
            format!(
                "the bend of segment {number} is larger than {limit_rad:.3} rad, which the model's strain_limit allows; ask for less"
            )
        };
        let mut bends_rad = Bends::zeros();
        for (segment, pair) in wanted.chunks_exact(2).enumerate() {
            if pair[0].abs() > self.max_bend_rad[segment] {
                return Err(too_far(segment, self.max_bend_rad[segment]));
            }
            let (sin, cos) = pair[1].sin_cos();
            (bends_rad[2 * segment], bends_rad[2 * segment + 1]) = (pair[0] * cos, pair[0] * sin);
        }
        let plain_m = self.lines.without_effects(&bends_rad);
        let found = self.lines.step(&bends_rad);
        let limiting = match found.status {
            SegmentStatus::Good(Sharing::Bounded { line_idx }) => Some(line_idx),
            SegmentStatus::Good(_) => None,
            SegmentStatus::BeyondStrain { segment, limit_rad } => return Err(too_far(segment, limit_rad)),
            SegmentStatus::Held(Sharing::Infeasible { line_idx, load_n, limit_n }) => {
                return Err(format!(
                    "no loads within low_n and high_n hold these bends: line {} would bear {load_n:.1} N, its bound is {limit_n} N; ask for \
                     smaller bends, or change the bound or preload_n in the model file",
                    line_idx + 1
                ));
            }
            SegmentStatus::Held(_) => {
                return Err(
                    "no loads within low_n and high_n were found for these bends; ask for smaller ones".to_owned()
                );
            }
            SegmentStatus::NotFinite => return Err("bend or plane is too large a number; ask for less".to_owned()),
        };
        if let Some(line_idx) = limiting {
            self.rows_at_bound[line_idx] += 1;
        }
        for line in 0..self.n_lines {
            let load_n = found.tau_n[line];
            if self.largest.is_none_or(|before| load_n.abs() > before.load_n.abs()) {
                self.largest = Some(Load { load_n, line: line + 1, time_s });
            }
        }
        let lines = |values: &krait_model::segments::LineValues| values.as_slice()[..self.n_lines].to_vec();
        let limiting_line = limiting.map_or(0.0, |line_idx| (line_idx + 1) as f64);
        let commands =
            [lines(&found.q_tilde_m), lines(&found.tau_n), lines(&found.tau_tilde_n), vec![limiting_line]].concat();
        Ok((commands, (found.q_tilde_m - plain_m).amax()))
    }

    /// The loads of all rows so far.
    pub fn loads(&self) -> TableLoads {
        let rows_at_bound = self.rows_at_bound.iter().sum();
        let most = (0..self.n_lines).rev().max_by_key(|&line| self.rows_at_bound[line]);
        let limiting_line = most.filter(|_| rows_at_bound > 0).map(|line| line + 1);
        TableLoads { largest: self.largest, rows_at_bound, limiting_line }
    }
}

impl TableLoads {
    /// The same in words.
    pub fn sentence(&self) -> String {
        let Some(Load { load_n, line, time_s }) = self.largest else { return String::new() };
        let way = if load_n < 0.0 { "pull" } else { "push" };
        let mut text = format!("the largest load is {:.2} N of {way}, on line {line} at {time_s} s\n", load_n.abs());
        if let Some(line) = self.limiting_line {
            let rows = self.rows_at_bound;
            text +=
                &format!("lines are at their bounds in {rows} rows; the one that limits most often is line {line}\n");
        }
        text
    }
}
