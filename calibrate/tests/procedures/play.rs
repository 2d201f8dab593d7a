//! Play by a dial indicator, through the dialogue, on a simulated actuator with play behind its encoder.

use crate::common::{N_SEEDS, Noise, User, fresh, honest, shared};
use krait_calibrate::play::{Play, PlaySettings, run};
use krait_calibrate::{CalibrateError, Dialogue};

/// A nut on a screw: it is pushed by whichever flank it touches.
struct Nut {
    nut_m: Vec<f64>,
    gap_m: Vec<f64>,
    line: usize,
    noise: Noise,
}

impl Nut {
    fn turn(&mut self, line: u32, to_m: f64) -> f64 {
        self.line = line as usize - 1;
        let k = self.line;
        let offset = self.nut_m[k] - to_m;
        // The flanks are half of the gap before and behind the screw.
        if offset > 0.5 * self.gap_m[k] {
            self.nut_m[k] = to_m + 0.5 * self.gap_m[k];
        } else if offset < -0.5 * self.gap_m[k] {
            self.nut_m[k] = to_m - 0.5 * self.gap_m[k];
        }
        to_m
    }

    /// A dial of 10 um, whose own zero is anywhere.
    fn dial_mm(&mut self) -> f64 {
        1e3 * self.nut_m[self.line] + 0.37 + 0.010 * self.noise.next()
    }
}

fn measured(gap_m: &[f64], seed: u64, name: &str) -> (Result<Play, CalibrateError>, String) {
    let csv = fresh(name);
    let settings = PlaySettings { n_lines: gap_m.len() as u32, ..PlaySettings::default() };
    let nut = Nut { nut_m: vec![0.0; gap_m.len()], gap_m: gap_m.to_vec(), line: 0, noise: Noise::new(seed) };
    let bench = shared(nut);
    let eyes = bench.clone();
    let mut said = Vec::new();
    let user = User::new(move || Some(format!("{:.6}", eyes.borrow_mut().dial_mm())));
    let mut dialogue = Dialogue::new(user, &mut said);
    let found = run(&mut dialogue, &csv, &settings, |_, line, to_m| Ok(bench.borrow_mut().turn(line, to_m)));
    (found, String::from_utf8(said).unwrap())
}

#[test]
fn every_seed_states_its_own_error() {
    let mut found = Vec::new();
    for seed in 0..N_SEEDS {
        let (play, _) = measured(&[0.178e-3; 3], seed, "play-seeds");
        found.push(play.unwrap().half_width_m());
    }
    honest("half-width", &found, 0.089e-3);
    assert!(found[0].1 < 3e-6, "ten turns of three lines with 10 um: {:e}", found[0].1);
}

#[test]
fn lines_that_differ_are_named() {
    let (play, said) = measured(&[0.15e-3, 0.2e-3, 0.15e-3], 3, "play-unlike");
    let play = play.unwrap();
    assert_eq!(play.unlike().map(|u| u.0), Some(2), "{play:?}");
    assert!(said.contains("lines 2 and") && said.contains("standard errors"), "{said}");
}

#[test]
fn a_play_wider_than_the_travel_is_refused() {
    let (play, _) = measured(&[0.8e-3; 3], 3, "play-wide");
    let sentence = play.unwrap_err().to_string();
    assert!(sentence.contains("half_width_m is not determined"), "{sentence}");
}

#[test]
fn every_line_of_a_robot_of_segments_is_asked_for_and_counts() {
    let (play, said) = measured(&[0.178e-3; 6], 5, "play-six");
    let play = play.unwrap();
    assert_eq!(play.lines.iter().map(|own| own.line).collect::<Vec<u32>>(), [1, 2, 3, 4, 5, 6]);
    let (half_width_m, se_m) = play.half_width_m();
    assert!((half_width_m - 0.089e-3).abs() < 4.0 * se_m && said.contains("line 6: half-width"), "{said}");
    let (three, _) = measured(&[0.178e-3; 3], 5, "play-three");
    assert!(se_m < 0.85 * three.unwrap().half_width_m().1, "twice the turns");
}
