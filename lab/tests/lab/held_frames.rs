//! A camera slower than the file's rows: its frames count once, and what repeats for another reason stays.

use crate::noise::Noise;
use krait_lab::Measurements;
use krait_lab::diagnose::{DiagnoseOptions, Verdict, diagnose};
use krait_lab::machine::JointsLab;
use krait_lab::read::{ColumnMap, read};
use krait_model::model_file::ModelFile;
use std::fmt::Write;

const ROWS: usize = 3000;

fn command(row: usize) -> f64 {
    let wave = |hz: f64| (core::f64::consts::TAU * hz * 0.02 * row as f64).sin();
    20.0 * wave(0.11) + 8.0 * wave(0.37)
}

/// Reads a file in which row after row this was measured, deg.
fn file(name: &str, mut measured: impl FnMut(usize) -> f64) -> (JointsLab, Measurements) {
    let mut text = "time_s,u1_deg,y1_deg\n".to_owned();
    for row in 0..ROWS {
        let line = writeln!(text, "{:.2},{:.5},{:.5}", 0.02 * row as f64, command(row), measured(row));
        line.expect("a string takes everything");
    }
    let path = std::env::temp_dir().join(format!("krait-{name}-{}.csv", std::process::id()));
    std::fs::write(&path, text).expect("written");
    let model = ModelFile::parse("format = 1\n[machine]\nkind = \"joints\"\nn = 1\n").expect("a model");
    let data = read(&path, &ColumnMap::default(), model.machine().into()).expect("good");
    std::fs::remove_file(&path).expect("there");
    (JointsLab::new(&model).expect("joints"), data)
}

#[test]
fn held_frames_count_once_and_nothing_is_missing() {
    let (mut noise, mut last) = (Noise(1), 0.0);
    let (machine, data) = file("held", |row| {
        if row % 5 == 0 {
            last = 1.03 * command(row) + 2.0 + 0.05 * noise.normal();
        }
        last
    });
    assert_eq!(data.n_held_rows, ROWS / 5 * 4);
    let found = diagnose(&machine, &data, &DiagnoseOptions::default()).expect("a chain");
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    assert!(found.cautions.iter().any(|own| own.contains("2400 rows")), "{:?}", found.cautions);
    assert!((0.045..0.055).contains(&found.base_heldout_rms), "{}", found.sentence);
}

/// 60 frames a second in rows of 100 Hz: two in five rows repeat.
#[test]
fn a_camera_nearly_as_fast_as_the_rows_is_seen_as_well() {
    let (mut noise, mut last, mut frame) = (Noise(1), 0.0, usize::MAX);
    let (_, data) = file("sixty", |row| {
        if row * 3 / 5 != frame {
            frame = row * 3 / 5;
            last = command(row) + 0.05 * noise.normal();
        }
        last
    });
    assert_eq!(data.n_held_rows, ROWS / 5 * 2);
}

#[test]
fn a_coarse_encoder_and_a_play_without_noise_repeat_and_are_measurements() {
    let (_, coarse) = file("coarse", |row| (command(row) / 0.7).round() * 0.7);
    let mut p = 0.0_f64;
    let (_, played) = file("played", |row| {
        p = p.clamp(command(row) - 6.0, command(row) + 6.0);
        p
    });
    for data in [coarse, played] {
        let repeats = (1..ROWS).filter(|row| data.output(*row) == data.output(row - 1)).count();
        assert!(repeats > ROWS / 5, "{repeats} rows repeat");
        assert_eq!(data.n_held_rows, 0);
    }
}
