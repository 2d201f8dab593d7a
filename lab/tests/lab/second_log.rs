//! Commands in one log, what a camera saw in another, whose clock is its own: joined where the motion says, or refused.

use crate::noise::Noise;
use krait_lab::Session;
use krait_lab::diagnose::{DiagnoseOptions, Verdict, diagnose};
use krait_lab::read::ColumnMap;
use std::fmt::Write;
use std::path::PathBuf;

struct Logs(PathBuf);

impl Logs {
    /// 60 s of a joint with this command, deg: commands at 100 Hz, and behind a play of 1 deg each way a camera at 30 Hz whose clock
    /// began at another time and runs 50 ppm fast.
    fn new(test: &str, command: impl Fn(f64) -> f64) -> Self {
        let folder = std::env::temp_dir().join(format!("krait-second-log-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let mut commands = "time_s,u1_deg,motor_temperature\n".to_owned();
        for row in 0..6000 {
            let t = 0.01 * f64::from(row);
            writeln!(commands, "{t:.2},{:.5},41", command(t)).expect("a string");
        }
        let mut camera = "stamp,y1_deg\n".to_owned();
        let (mut p, mut noise) = (command(0.0), Noise(1));
        for step in 0..59_000_u32 {
            let t = 0.001 * f64::from(step);
            p = p.clamp(command(t) - 1.0, command(t) + 1.0);
            if step % 33 != 7 {
                continue;
            }
            let stamp = 5000.0 + t * (1.0 + 50e-6);
            writeln!(camera, "{stamp:.6},{:.5}", 1.03 * p + 2.0 + 0.05 * noise.normal()).expect("a string");
        }
        std::fs::write(folder.join("commands.csv"), commands).expect("written");
        std::fs::write(folder.join("camera.csv"), camera).expect("written");
        let model = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\nu_unit = \"deg\"\ny_unit = \"deg\"\n";
        std::fs::write(folder.join("m.toml"), model).expect("written");
        Self(folder)
    }

    fn open(&self, data: &[&str], with: &str) -> Result<Session, String> {
        let map: ColumnMap = ["time_s=stamp".parse().expect("a mapping")].into_iter().collect();
        let data: Vec<PathBuf> = data.iter().map(|name| self.0.join(name)).collect();
        Session::open_with(&self.0.join("m.toml"), &data, Some(&self.0.join(with)), &map)
            .map_err(|error| error.to_string())
    }
}

fn changing(t: f64) -> f64 {
    20.0 * (0.9 * t).sin() + 9.0 * (2.3 * t + 1.0).sin() + 4.0 * (4.1 * t).sin()
}

#[test]
fn two_clocks_are_joined_by_the_motion_and_the_play_is_found() {
    let logs = Logs::new("joined", changing);
    let session = logs.open(&["commands.csv"], "camera.csv").expect("joined");
    let clock = session.data.clock.clone().expect("a clock");
    // What is added in the middle of the camera's log; its own clock had gained 1.5 ms by then.
    let truth_s = -5000.0 - 29.5 * 50e-6;
    // A play comes late by a time that the motion decides: 1 deg at some 20 deg/s.
    assert!((clock.shift_s - truth_s).abs() < 0.12, "{clock:?}");
    assert!((clock.rate + 50e-6).abs() < 400e-6, "{clock:?}");
    let scored = (0..session.data.n_rows()).filter(|row| session.data.is_scored(*row)).count();
    assert!(scored > 1700 && session.data.n_rows() > 7000, "{scored} of {}", session.data.n_rows());
    let found = diagnose(session.machine.as_ref(), &session.data, &DiagnoseOptions::default()).expect("a chain");
    assert!(matches!(found.verdict, Verdict::Missing | Verdict::Partly), "{}", found.sentence);
    let play = found.effects.iter().find(|own| own.name == "backlash").expect("a play");
    let width = play.parameters.iter().find(|own| own.name == "half_width").expect("a width");
    assert!((width.value - 1.0).abs() < 0.05, "{width:?}");
    assert!(found.final_heldout_rms < 0.07, "{}", found.sentence);
    assert!(found.cautions.iter().any(|own| own.contains("second log's times")), "{:?}", found.cautions);
    assert!(session.data.source == "commands.csv with camera.csv", "{}", session.data.source);
}

#[test]
fn a_motion_that_repeats_another_motion_and_a_second_recording_are_refused() {
    let refused = |logs: &Logs, data: &[&str], with: &str| {
        let said = logs.open(data, with).err().expect("refused");
        assert!(!said.contains('\n'), "{said}");
        said
    };
    let logs = Logs::new("repeats", |t| 20.0 * (core::f64::consts::TAU * 0.5 * t).sin());
    let said = refused(&logs, &["commands.csv"], "camera.csv");
    assert!(said.contains("camera.csv") && said.contains("the motion repeats"), "{said}");
    let other = Logs::new("other", |t| 15.0 * (0.31 * t * t).sin());
    std::fs::copy(other.0.join("camera.csv"), logs.0.join("other.csv")).expect("copied");
    let changing = Logs::new("changing", changing);
    std::fs::copy(other.0.join("camera.csv"), changing.0.join("other.csv")).expect("copied");
    let said = refused(&changing, &["commands.csv"], "other.csv");
    assert!(said.contains("no shift of its clock"), "{said}");
    let said = refused(&changing, &["commands.csv", "commands.csv"], "camera.csv");
    assert!(said.contains("a second recording"), "{said}");
    let said = refused(&changing, &["camera.csv"], "commands.csv");
    assert!(said.contains("u1_deg is missing") || said.contains("u1"), "{said}");
}
