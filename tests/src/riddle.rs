//! Data in which an effect is hidden, with the sealed answer, and a hand's motion to replay.

use crate::{Ended, TempFolder};
use core::time::Duration;
use serde_json::Value;

/// The longest diagnosis takes more than a minute of processor time, of which a busy machine may give little.
const PATIENCE: Duration = Duration::from_secs(900);

/// What `krait` with arguments says as JSON, when all is well.
pub fn krait_json(arguments: &[&str]) -> Value {
    let ended = Ended::of(arguments, PATIENCE);
    assert_eq!(ended.code, Some(0), "krait {arguments:?}: {}", ended.stderr);
    ended.json()
}

/// Data with something hidden, in a folder of its own.
pub struct Riddle {
    /// Where they lie.
    pub folder: TempFolder,
    /// What is right.
    pub answer: Value,
}

impl Riddle {
    /// Hides an effect in data: `data.csv`, `base.toml` without it, `truth.toml` with it.
    pub fn new(kind: &str, options: &[&str]) -> Self {
        let folder = TempFolder::new("riddle");
        let (data, truth) = (folder.file("data.csv"), folder.file("truth.toml"));
        let mut arguments = vec!["lab", "generate", "--json", "--kind", kind, "--out", &data, "--truth", &truth];
        arguments.extend(options);
        krait_json(&arguments);
        let text = std::fs::read_to_string(folder.file("data.answer.json")).expect("a sealed answer");
        let answers: Value = serde_json::from_str(&text).expect("JSON");
        Self { folder, answer: answers[0].clone() }
    }

    /// What the lab says of the data.
    pub fn diagnosis(&self) -> Value {
        krait_json(&["lab", "diagnose", "--json", "--model", &self.file("base.toml"), "--data", &self.file("data.csv")])
    }

    /// Adds effects one after the other; gives the last one's figures.
    pub fn add(&self, effects: &[&str]) -> Value {
        let data = self.file("data.csv");
        let mut model = self.file("base.toml");
        let mut added = Value::Null;
        for effect in effects {
            let out = self.file(&format!("with-{effect}.toml"));
            added = krait_json(&["lab", "add", effect, "--json", "--model", &model, "--data", &data, "--out", &out]);
            model = out;
        }
        added
    }

    /// A file of its folder.
    pub fn file(&self, name: &str) -> String {
        self.folder.file(name)
    }

    /// Whether a name counts as right for the hidden effect of this place.
    pub fn is_right(&self, place: usize, name: &Value) -> bool {
        self.answer["right"][place].as_array().expect("names").contains(name)
    }
}

/// 40 s of a hand: reversals of the bend, turns of the plane, at rest at both ends; as a table for `krait replay`.
pub fn hand(folder: &TempFolder) -> String {
    const LENGTH_S: f64 = 40.0;
    let mut text = String::from("time_s,bend_x_deg,bend_y_deg\n");
    for k in 0..=400_u16 {
        let t = f64::from(k) / 10.0;
        let inside = (t / 2.0).min((LENGTH_S - t) / 2.0).min(1.0);
        let bend = inside * (28.0 + 22.0 * (0.55 * t).sin()) * (1.05 * t).sin();
        let (sin, cos) = (10_f64.to_radians() * t + 0.6 * (0.4 * t).sin()).sin_cos();
        text += &format!("{t:.1},{:.4},{:.4}\n", bend * cos, bend * sin);
    }
    let path = folder.file("hand.csv");
    std::fs::write(&path, text).expect("a table");
    path
}
