//! Several joints on the command line: effects of one kind have names of their own, and the command that is printed is the one that helps.

use krait_bridge::LiveModel;
use krait_model::model_file::ModelFile;
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

const KRAIT: &str = env!("CARGO_BIN_EXE_krait");
const HELD: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 2\ngain = [1.0, 1.0]\noffset = [0.0, 0.0]\n";

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("joints-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str, text: &str) {
        fs::write(self.0.join(name), text).unwrap();
    }

    /// The words as a shell takes them, in this folder.
    fn krait(&self, words: &str) -> Output {
        Command::new("sh").current_dir(&self.0).args(["-c", &format!("'{KRAIT}' {words}")]).output().unwrap()
    }

    fn said(&self, words: &str) -> String {
        let output = self.krait(words);
        assert!(output.status.success(), "{words}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn refused(&self, words: &str) -> String {
        let output = self.krait(words);
        assert!(!output.status.success(), "{words}");
        String::from_utf8(output.stderr).unwrap()
    }

    fn json(&self, words: &str) -> Value {
        serde_json::from_str(&self.said(words)).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _removed = fs::remove_dir_all(&self.0);
    }
}

/// Two joints behind plays of 0.05 and 0.08 rad, under these names.
fn data(names: &str) -> String {
    let mut text = format!("{names}\n");
    let mut state = 7_u64;
    let mut held = [0.0, 0.4];
    for k in 0..1500_u32 {
        let t = f64::from(k) * 0.02;
        let u = [0.5 * (1.55 * t).sin() + 0.2 * (4.1 * t).sin(), 0.5 * (1.15 * t + 1.0).sin() + 0.2 * (3.3 * t).sin()];
        for (joint, half_width) in [0.05, 0.08].into_iter().enumerate() {
            held[joint] = f64::clamp(held[joint], u[joint] - half_width, u[joint] + half_width);
        }
        let mut noise = || {
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (state >> 11) as f64 / (1_u64 << 53) as f64
            })
        };
        let y = [held[0] + 5e-4 * noise(), held[1] + 5e-4 * noise()];
        writeln!(text, "{t:.2},{:.7},{:.7},{:.7},{:.7}", u[0], u[1], y[0], y[1]).unwrap();
    }
    text
}

fn plays(half_width: &str) -> String {
    let one = |joint: usize| format!("[[effect]]\nkind = \"backlash\"\njoint = {joint}\nhalf_width = {half_width}\n");
    format!("{HELD}{}{}", one(1), one(2))
}

#[test]
fn plays_of_two_joints_stand_in_the_answer_by_their_joints_and_both_are_fitted() {
    let folder = Folder::new("plays");
    folder.file("d.csv", &data("time_s,u1_rad,u2_rad,y1_rad,y2_rad"));
    folder.file("m.toml", &plays("0.03"));
    let words = "lab fit --free backlash.half_width --model m.toml --data d.csv --force --out o.toml";
    let answer = folder.json(&format!("{words} --json"));
    for (name, truth) in [("backlash-1.half_width", 0.05), ("backlash-2.half_width", 0.08)] {
        let value = answer["params"][name]["value"].as_f64().unwrap_or_else(|| panic!("{answer}"));
        assert!((value / truth - 1.0).abs() < 0.05, "{answer}");
    }
    let told = folder.said(words);
    assert!(told.contains("backlash-1.half_width") && told.contains("backlash-2.half_width"), "{told}");
    let more = folder.json("lab add cubic --set joint=1 --model o.toml --data d.csv --out p.toml --json");
    let params = more["params"].as_object().unwrap();
    for name in ["cubic", "backlash-1.half_width", "backlash-2.half_width"] {
        assert!(params.contains_key(name), "{name}: {more}");
    }
}

#[test]
fn what_a_file_leaves_free_is_what_the_next_command_fits_and_then_the_model_runs() {
    let folder = Folder::new("free");
    folder.file("d.csv", &data("time_s,u1_rad,u2_rad,y1_rad,y2_rad"));
    folder.file("m.toml", &plays("\"free\""));
    let said = folder.said("lab diagnose --max-effects 1 --model m.toml --data d.csv");
    let next = said.lines().find_map(|line| line.strip_prefix("Next: krait ")).unwrap_or_else(|| panic!("{said}"));
    assert_eq!(next, "lab fit --model m.toml --data d.csv --out m.better.toml", "{said}");
    let refused = |name: &str| {
        let file = ModelFile::parse(&fs::read_to_string(folder.0.join(name)).unwrap()).unwrap();
        LiveModel::of(&file).err().map(|why| why.to_string())
    };
    let why = refused("m.toml").unwrap();
    assert!(why.contains("half_width of backlash is not known"), "{why}");
    let told = folder.said(next);
    assert!(told.contains("krait run --engage --model m.better.toml"), "{told}");
    assert_eq!(refused("m.better.toml"), None);
}

#[test]
fn exchanged_columns_are_followed_by_the_diagnosis_that_maps_them() {
    let folder = Folder::new("exchanged");
    folder.file("d.csv", &data("time_s,u1_rad,u2_rad,y2_rad,y1_rad"));
    folder.file("m.toml", "format = 1\n[machine]\nkind = \"joints\"\nn = 2\n");
    let said = folder.said("lab diagnose --max-effects 1 --model m.toml --data d.csv");
    assert!(said.contains("are probably exchanged"), "{said}");
    let next = said.lines().find_map(|line| line.strip_prefix("Next: with the columns in order: krait "));
    let next = next.unwrap_or_else(|| panic!("{said}"));
    assert!(next.contains("--map y1_rad=y2_rad") && next.contains("--map y2_rad=y1_rad"), "{next}");
    let again = folder.said(&format!("{next} --max-effects 1"));
    assert!(!again.contains("exchanged") && again.contains("Next: krait lab add backlash"), "{again}");
    // The same of a file whose names are mapped.
    folder.file("e.csv", &data("Time,a,b,B,A"));
    folder.file(
        "e.toml",
        "format = 1\n[columns]\ntime_s = { column = \"Time\" }\nu1_rad = { column = \"a\" }\nu2_rad = { column = \"b\" }\n\
         y1_rad = { column = \"A\" }\ny2_rad = { column = \"B\" }\n",
    );
    let said = folder.said("lab diagnose --max-effects 1 --model m.toml --data e.csv --map-file e.toml");
    assert!(said.contains("--map y1_rad=B --map y2_rad=A") || said.contains("--map y2_rad=A --map y1_rad=B"), "{said}");
}

#[test]
fn a_second_formula_of_one_name_is_refused_before_anything_is_fitted() {
    let folder = Folder::new("twice");
    folder.file("d.csv", &data("time_s,u1_rad,u2_rad,y1_rad,y2_rad"));
    let own = "[[effect]]\nkind = \"formula\"\nname = \"own\"\nhook = \"joint\"\nformula = \"a * u_i^2\"\nparams = { a = 0.01 }\n";
    folder.file("m.toml", &format!("{HELD}{own}"));
    let add = "lab add formula --hook joint --formula 'b * u_i' --param b=0.1 --model m.toml --data d.csv --out o.toml";
    let why = folder.refused(&format!("{add} --name own"));
    assert!(why.contains("m.toml has a formula of that name already") && why.trim().lines().count() == 1, "{why}");
    assert!(!folder.0.join("o.toml").exists());
    folder.said(&format!("{add} --name other"));
    // By its name in a file of formulas it takes the next name, on another joint.
    let added =
        folder.json("lab add own --effects m.toml --set joint=2 --model m.toml --data d.csv --out p.toml --json");
    assert_eq!(added["effect"], "own2", "{added}");
}

/// A standard error of zero would say that it is known exactly.
#[test]
fn a_formula_of_which_a_parameter_changes_nothing_is_refused_and_nothing_is_written() {
    let folder = Folder::new("unseen");
    folder.file("base.toml", HELD);
    folder.file("run.csv", &data("time_s,u1_rad,u2_rad,y1_rad,y2_rad"));
    let adding = "lab add formula --name shelf --hook joint --formula 'a * b * u_i' --model base.toml --data run.csv --out out.toml";
    let told = folder.refused(&format!("{adding} --param a=0:1 --param b=0:1"));
    assert!(told.contains("change nothing where its fit ended (a, b): begin with other values"), "{told}");
    assert!(!folder.0.join("out.toml").exists());
}
