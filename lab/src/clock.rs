//! A camera's clock beside that of the encoders: measurements are put where the encoders' clock has them.

use crate::Measurements;
use crate::read::merged;

/// How the measurements' clock differs from that of the commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClockOffset {
    /// What is to be added to the measurements' times in the recording's middle, s: positive where they come ahead of the motion.
    pub shift_s: f64,
    /// How much longer a second of theirs is by the commands' clock, as a part of one.
    pub rate: f64,
}

impl ClockOffset {
    /// Largest shift that is believed, s.
    pub const MOST_S: f64 = 10.0;
    /// Largest rate that is believed: 1 %.
    pub const MOST_RATE: f64 = 0.01;

    /// Whether both clocks are one.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Both differences together.
    pub fn and(self, other: Self) -> Self {
        Self { shift_s: self.shift_s + other.shift_s, rate: self.rate + other.rate }
    }

    /// Shift and rate as the option `--clock` has them: seconds, and after a comma parts in a million.
    pub fn words(&self) -> String {
        if self.rate == 0.0 {
            format!("{:.4}", self.shift_s)
        } else {
            format!("{:.4},{:.1}", self.shift_s, 1e6 * self.rate)
        }
    }
}

impl core::str::FromStr for ClockOffset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            format!(
                "clock {text:?}: expected seconds that the measurements come ahead (at most {} either way), and after a comma the clock's \
                 rate in parts per million (at most {:.0}), as in 0.031 or 0.031,-40",
                Self::MOST_S,
                1e6 * Self::MOST_RATE
            )
        };
        let (shift, ppm) = text.split_once(',').unwrap_or((text, "0"));
        let number = |text: &str| text.trim().parse::<f64>().ok().ok_or_else(expected);
        let own = Self { shift_s: number(shift)?, rate: 1e-6 * number(ppm)? };
        let is_believed = own.shift_s.abs() <= Self::MOST_S && own.rate.abs() <= Self::MOST_RATE;
        if is_believed { Ok(own) } else { Err(expected()) }
    }
}

impl Measurements {
    /// The same with the measurements of each recording where the commands' clock has them; the rows of the commands stay, and those of
    /// measurements stand between them. `first_trials` has the first trial of each recording.
    #[must_use]
    pub fn by_clocks(&self, clocks: &[ClockOffset], first_trials: &[usize]) -> Self {
        if clocks.iter().all(ClockOffset::is_none) {
            return self.clone();
        }
        let mut parts = Vec::new();
        for (k, clock) in clocks.iter().enumerate() {
            let own = self.trials_of(k, first_trials);
            let middle_s = self.middle_s(own.clone());
            for trial in own {
                let rows = self.rows_of(trial..trial + 1);
                let own = self.select(&rows);
                if clock.is_none() {
                    parts.push(own);
                    continue;
                }
                let scored: Vec<usize> = (0..own.n_rows()).filter(|row| own.is_scored(*row)).collect();
                let time_s = |row: usize| own.time_s[row] + clock.shift_s + clock.rate * (own.time_s[row] - middle_s);
                parts.push(merged(&own, &own, &scored, time_s));
            }
        }
        let mut parts = parts.into_iter().map(|own| Self { trial: vec![0; own.n_rows()], ..own });
        let Some(first) = parts.next() else { return self.clone() };
        let (all, _) = Self::joined(first, parts);
        Self {
            source: self.source.clone(),
            sha256: self.sha256.clone(),
            n_held_rows: self.n_held_rows,
            tip_frames: self.tip_frames.clone(),
            ..all
        }
    }

    /// The trials of a recording, from 0, where these are the first of each.
    pub(crate) fn trials_of(&self, recording: usize, first_trials: &[usize]) -> core::ops::Range<usize> {
        let n_trials = self.trial.last().map_or(0, |last| *last as usize + 1);
        let first = |k: usize| first_trials.get(k).copied();
        first(recording).unwrap_or(0)..first(recording + 1).unwrap_or(n_trials)
    }

    /// The first and the last time of some trials.
    fn ends_s(&self, trials: core::ops::Range<usize>) -> [f64; 2] {
        let rows = self.rows_of(trials);
        [rows.first(), rows.last()].map(|row| row.map_or(0.0, |row| self.time_s[*row]))
    }

    /// The middle of the time of some trials: half of the way from the first to the last of their times.
    pub(crate) fn middle_s(&self, trials: core::ops::Range<usize>) -> f64 {
        let [first_s, last_s] = self.ends_s(trials);
        0.5 * (first_s + last_s)
    }

    /// The time from the first row of some trials to their middle.
    pub(crate) fn half_s(&self, trials: core::ops::Range<usize>) -> f64 {
        let [first_s, last_s] = self.ends_s(trials);
        0.5 * (first_s + last_s) - first_s
    }

    /// The rows of some trials.
    pub(crate) fn rows_of(&self, trials: core::ops::Range<usize>) -> Vec<usize> {
        (0..self.n_rows()).filter(|row| trials.contains(&(self.trial[*row] as usize))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quantity;

    /// Two trials at 50 Hz of which the outputs show the input of 37 ms later.
    fn ahead(shift_s: f64) -> Measurements {
        let time_s: Vec<f64> = (0..200).map(|k| f64::from(k % 100) * 0.02).collect();
        let input = |t: f64| (3.0 * t).sin();
        let inputs = time_s.iter().map(|t| input(*t)).collect();
        let outputs = time_s.iter().map(|t| input(t + shift_s)).collect();
        let trial = (0..200).map(|k| u32::from(k >= 100)).collect();
        let whole = Measurements::bare("made".to_owned(), Quantity::Joints, time_s, (inputs, 1), (outputs, 1));
        Measurements { trial, ..whole }
    }

    #[test]
    fn measurements_stand_beside_the_inputs_that_they_show() {
        let data = ahead(0.037);
        let moved = data.by_clocks(&[ClockOffset { shift_s: 0.037, rate: 0.0 }], &[0]);
        assert!(moved.trial.windows(2).all(|pair| pair[0] <= pair[1]) && moved.trial.last() == Some(&1));
        let scored: Vec<usize> = (0..moved.n_rows()).filter(|row| moved.is_scored(*row)).collect();
        // Of each trial the last two rows show what the inputs do not have.
        assert_eq!(scored.len(), 200 - 4);
        for row in scored {
            assert!((moved.input(row)[0] - moved.output(row)[0]).abs() < 5e-4, "{row}");
        }
        let rows_of_inputs = (0..moved.n_rows()).filter(|row| !moved.is_scored(*row)).count();
        assert_eq!(rows_of_inputs, 200, "no input is lost");
    }

    #[test]
    fn a_clock_is_read_as_it_is_written() {
        for own in [ClockOffset { shift_s: 0.031, rate: 0.0 }, ClockOffset { shift_s: -0.25, rate: -40e-6 }] {
            let again: ClockOffset = own.words().parse().unwrap();
            assert!((again.shift_s - own.shift_s).abs() < 1e-9 && (again.rate - own.rate).abs() < 1e-12);
        }
        for wrong in ["soon", "nan", "1,2,3", "11", "0,20000", ""] {
            let sentence = wrong.parse::<ClockOffset>().unwrap_err();
            assert!(sentence.contains("expected seconds"), "{sentence}");
        }
    }
}
