//! Hysteresis that is wider on one side is told from that of plain plays, where the data can tell. The joint's law is the model's own:
//! what is tested is the search, not the law.

use crate::noise::Noise;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::{JointsLab, MachineUnderTest};
use krait_lab::read::{ColumnMap, read};
use krait_model::model_file::ModelFile;

const MODEL: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n";

/// A joint with this effect, in motion with reversals of several sizes on both sides.
fn diagnosed(what: &str, effect: &str, seed: u64) -> Diagnosis {
    let file = ModelFile::parse(MODEL).expect("a model");
    let mut noise = Noise(seed);
    let mut text = String::from("time_s,u1_rad,y1_rad\n");
    for k in 0..4000_u32 {
        let t = f64::from(k) * 0.02;
        let u = 0.4 * (0.35 * t).sin() + 0.3 * (1.1 * t + 0.4).sin() + 0.1 * (2.9 * t).sin();
        text += &format!("{t:.2},{u:.7},{u:.7}\n");
    }
    let path = std::env::temp_dir().join(format!("krait-lab-uneven-{}-{what}.csv", std::process::id()));
    std::fs::write(&path, text).expect("a file");
    let mut data = read(&path, &ColumnMap::default(), file.machine().into()).expect("measurements");
    std::fs::remove_file(&path).expect("the file goes");
    let hidden = JointsLab::new(&ModelFile::parse(&format!("{MODEL}[[effect]]\n{effect}")).expect("a model"));
    let hidden = hidden.expect("joints");
    let moved = hidden.predict(hidden.effects(), &data).expect("a chain");
    data.outputs = moved.iter().map(|y| 0.98 * y + 0.01 + 0.002 * noise.normal()).collect();
    let machine = JointsLab::new(&file).expect("joints");
    diagnose(&machine, &data, &DiagnoseOptions { max_effects: 2, ..DiagnoseOptions::default() }).expect("a chain")
}

const UNEVEN: &str = "generalised-prandtl-ishlinskii";

#[test]
fn loops_that_are_wider_on_one_side_are_named_and_plain_plays_are_no_look_alike() {
    let effect = format!(
        "kind = \"{UNEVEN}\"\njoint = 1\nreach = 0.2\nbend = 0.45\ncentre = 0.0\nweight1 = 0.0\nweight2 = 0.15\nweight3 = 0.0\nweight4 = 0.25\n"
    );
    let found = diagnosed("uneven", &effect, 3);
    let first = found.effects.first().unwrap_or_else(|| panic!("{}", found.sentence));
    assert_eq!((found.verdict, first.name.as_str()), (Verdict::Missing, UNEVEN), "{}", found.sentence);
    assert_eq!(first.class, [UNEVEN], "{}", found.sentence);
    let value = |name: &str| first.parameters.iter().find(|own| own.name == name).map_or(f64::NAN, |own| own.value);
    for (name, truth, off) in [("reach", 0.2, 0.03), ("bend", 0.45, 0.1), ("weight4", 0.25, 0.05)] {
        assert!((value(name) - truth).abs() < off, "{name}: {}, {truth}", value(name));
    }
}

#[test]
fn plain_plays_stay_plain() {
    let effect = "kind = \"prandtl-ishlinskii\"\njoint = 1\nweight1 = 0.25\nhalf_width1 = 0.2\nweight2 = 0.15\nhalf_width2 = 0.05\n\
                  weight3 = 0.0\nhalf_width3 = 0.1\n";
    let found = diagnosed("plain", effect, 4);
    let first = found.effects.first().unwrap_or_else(|| panic!("{}", found.sentence));
    assert!(first.class.iter().any(|name| name == "prandtl-ishlinskii"), "{}", found.sentence);
    assert_ne!(first.name, UNEVEN, "{}", found.sentence);
    let uneven = found.candidates.iter().find(|own| own.name == UNEVEN).expect("it is a candidate");
    assert!(!uneven.state.starts_with("chosen"), "{uneven:?}");
}
