//! The machine-readable answer of a diagnosis is a contract: its keys, their types, what is null, and what they say together.

use crate::noise::Noise;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::{JointsLab, SnakeLab, machine_of};
use krait_lab::read::{ColumnMap, read};
use krait_lab::{Measurements, Session};
use krait_lab_benchmark::force::FORCE_MODEL;
use krait_lab_benchmark::generate::{Kind, Recipe, generate};
use krait_model::model_file::ModelFile;
use serde_json::Value;
use std::path::{Path, PathBuf};

const SNAKE: &str = "format = 1\n[machine]\nkind = \"snake\"\n";
const IN_MM: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\nu_unit = \"mm\"\ny_unit = \"mm\"\n";

/// Every key of an answer, and what stands under it: s text, n number, a list, o object, b truth; ? where it may be null.
const KEYS: [(&str, &str); 41] = [
    ("format", "n"),
    ("verdict", "s"),
    ("sentence", "s"),
    ("needed_s", "n?"),
    ("cautions", "a"),
    ("unit", "s"),
    ("noise_floor", "n?"),
    ("noise_floor_deg", "n?"),
    ("noise_floor_source", "s"),
    ("noise_floor_relative_se", "n?"),
    ("as_given_rms", "n"),
    ("as_given_rms_deg", "n?"),
    ("base_heldout_rms", "n"),
    ("base_heldout_rms_deg", "n?"),
    ("final_heldout_rms", "n"),
    ("final_heldout_rms_deg", "n?"),
    ("final_error_is", "s"),
    ("locked", "o?"),
    ("explained_share", "n?"),
    ("model_free_rms", "n?"),
    ("model_free_rms_deg", "n?"),
    ("calibration", "a"),
    ("clocks", "a"),
    ("camera_offsets", "a"),
    ("effects", "a"),
    ("chain_order", "a"),
    ("partial", "a"),
    ("candidates", "a"),
    ("remaining", "o"),
    ("proposals", "a"),
    ("variations", "a"),
    ("next_experiment", "o?"),
    ("rows", "n"),
    ("scored_rows", "n"),
    ("outliers", "n"),
    ("blocks", "n"),
    ("seed", "n"),
    ("remaining.structured", "b"),
    ("remaining.p_value", "n"),
    ("remaining.unexplained_share", "n"),
    ("remaining.groups", "a"),
];
const OF_EFFECT: [(&str, &str); 11] = [
    ("effect", "s"),
    ("joint", "n?"),
    ("class", "a"),
    ("heldout_rms", "o"),
    ("heldout_rms_deg", "o?"),
    ("unit", "s"),
    ("probability", "n"),
    ("params", "o"),
    ("title", "s?"),
    ("explanation", "o?"),
    ("sketch", "o?"),
];
const OF_PARAMETER: [(&str, &str); 6] =
    [("value", "n"), ("se", "n"), ("se_if_independent", "n"), ("unit", "s"), ("free", "b"), ("on_bound", "b")];
const OF_CANDIDATE: [(&str, &str); 7] = [
    ("effect", "s"),
    ("looks", "s"),
    ("heldout_rms", "n?"),
    ("heldout_rms_deg", "n?"),
    ("probability", "n"),
    ("p_value", "n"),
    ("state", "s"),
];
const OF_CALIBRATION: [(&str, &str); 8] = [
    ("name", "s"),
    ("joint", "n?"),
    ("recording", "s?"),
    ("value", "n"),
    ("se", "n"),
    ("unit", "s"),
    ("held", "b"),
    ("prior", "o?"),
];

fn is_of(value: &Value, kind: &str) -> bool {
    value.is_null() && kind.ends_with('?')
        || match &kind[..1] {
            "s" => value.is_string(),
            "n" => value.is_number(),
            "a" => value.is_array(),
            "o" => value.is_object(),
            _ => value.is_boolean(),
        }
}

/// These keys with these types, and no others.
fn assert_has(value: &Value, keys: &[(&str, &str)]) {
    for (key, kind) in keys {
        let own = value.pointer(&format!("/{}", key.replace('.', "/"))).unwrap_or_else(|| panic!("{key}: {value}"));
        assert!(is_of(own, kind), "{key} is {own}, expected {kind}");
    }
    let known = |key: &String| keys.iter().any(|(own, _)| own == key);
    let other: Vec<&String> = value.as_object().expect("an object").keys().filter(|key| !known(key)).collect();
    assert_eq!(other, Vec::<&String>::new(), "keys that are in no contract");
}

fn list<'v>(value: &'v Value, key: &str) -> &'v Vec<Value> {
    value[key].as_array().unwrap_or_else(|| panic!("{key}: {value}"))
}

/// What every answer keeps, whatever it says.
fn assert_contract(found: &Diagnosis) -> Value {
    let json = found.to_json();
    assert_has(&json, &KEYS);
    let again: Value = serde_json::from_str(&json.to_string()).expect("it is JSON");
    assert_eq!(again, json, "no digit is lost on the way");
    assert_eq!((json["format"].as_u64(), json["verdict"].as_str()), (Some(2), Some(found.verdict.word())));
    let is_deg = json["unit"] == "deg";
    for (key, _) in KEYS.iter().filter(|(key, _)| key.ends_with("_deg")) {
        let expected = if is_deg { json[&key[..key.len() - 4]].clone() } else { Value::Null };
        assert_eq!(json[*key], expected, "{key}");
    }
    for effect in list(&json, "effects").iter().chain(list(&json, "partial")) {
        assert_has(effect, &OF_EFFECT);
        assert_eq!(effect["class"][0], effect["effect"], "itself first");
        assert_eq!(effect["heldout_rms_deg"].is_object(), is_deg);
        let params = effect["params"].as_object().expect("parameters");
        params.values().for_each(|own| assert_has(own, &OF_PARAMETER));
        assert!(params.values().any(|own| own["free"] == true && own["se"].as_f64() > Some(0.0)), "{effect}");
        let explained = &effect["explanation"];
        assert!(["title", "what", "check"].iter().all(|key| explained[key].is_string()), "{effect}");
        let [title, plain] = [&effect["title"], &explained["title"]].map(|own| own.as_str().expect("a title"));
        let size = title.strip_prefix(plain).and_then(|rest| rest.strip_prefix(": "));
        assert!(size.is_some_and(|size| size.contains(|c: char| c.is_ascii_digit())), "{title} carries its size");
    }
    list(&json, "candidates").iter().for_each(|own| assert_has(own, &OF_CANDIDATE));
    list(&json, "calibration").iter().for_each(|own| assert_has(own, &OF_CALIBRATION));
    // An answer is either asserted or a hypothesis.
    let asserts = matches!(found.verdict, Verdict::Missing | Verdict::Partly);
    assert_eq!(list(&json, "effects").is_empty(), !asserts, "{}", found.sentence);
    assert!(!asserts || list(&json, "partial").is_empty() || found.verdict == Verdict::Partly, "{}", found.sentence);
    let mut order: Vec<u64> = list(&json, "chain_order").iter().filter_map(Value::as_u64).collect();
    order.sort_unstable();
    assert!(order.into_iter().eq(0..found.effects.len() as u64), "each effect once in the order of the chain");
    let [base, last] = ["base_heldout_rms", "final_heldout_rms"].map(|key| json[key].as_f64().expect("an error"));
    match (json["explained_share"].as_f64(), json["noise_floor"].as_f64()) {
        (Some(share), Some(floor)) => {
            let expected = ((base * base - last * last) / (base * base - floor * floor)).clamp(0.0, 1.0);
            assert!((share - expected).abs() < 1e-9, "{share}, {expected}");
        }
        (share, floor) => assert!(share.is_none() && (floor.is_none() || !asserts), "{share:?} {floor:?}"),
    }
    json
}

fn snake(hidden: &[(&str, f64)], seed: u64) -> Diagnosis {
    let machine = SnakeLab::new(&ModelFile::parse(SNAKE).expect("a model")).expect("a snake");
    let hidden = hidden.iter().map(|(name, size)| (Kind::from_name(name).expect("a kind"), *size)).collect();
    let data = generate(&Recipe { hidden, seconds: 60.0, seed, ..Recipe::default() }).expect("data").measurements;
    diagnose(&machine, &data, &DiagnoseOptions { max_effects: 2, ..DiagnoseOptions::default() }).expect("a chain")
}

fn file(name: &str, text: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("krait-lab-answer-{}-{name}", std::process::id()));
    std::fs::write(&path, text).expect("a file");
    path
}

/// A minute of one joint in millimetres, whose error is `hidden`, a function of its command and of time.
fn joint(what: &str, hidden: impl Fn(f64, f64) -> f64) -> Diagnosis {
    let model = ModelFile::parse(IN_MM).expect("a model");
    let mut noise = Noise(9);
    let mut text = String::from("time_s,u1_mm,y1_mm\n");
    for k in 0..3000_u32 {
        let t = f64::from(k) * 0.02;
        let u = 30.0 * (0.5 * t).sin() + 12.0 * (1.7 * t).sin();
        text += &format!("{t:.2},{u:.6},{:.6}\n", 1.02 * u + 0.4 + hidden(u, t) + 0.1 * noise.normal());
    }
    let path = file(&format!("{what}.csv"), &text);
    let data: Measurements = read(&path, &ColumnMap::default(), model.machine().into()).expect("measurements");
    std::fs::remove_file(&path).expect("the file goes");
    let machine = JointsLab::new(&model).expect("joints");
    diagnose(&machine, &data, &DiagnoseOptions { max_effects: 2, ..DiagnoseOptions::default() }).expect("a chain")
}

#[test]
fn an_answer_about_a_snake_keeps_the_contract() {
    let missing = snake(&[("backlash", 3.0)], 7);
    let json = assert_contract(&missing);
    assert_eq!(json["verdict"], "missing", "{}", missing.sentence);
    assert!(json["effects"][0]["joint"].is_null() && json["next_experiment"]["do"].is_string(), "{json}");
    assert_eq!(json["final_error_is"], "used in selection");
    let nothing = snake(&[], 8);
    assert_eq!(assert_contract(&nothing)["verdict"], "none", "{}", nothing.sentence);
}

#[test]
fn an_answer_in_millimetres_has_no_degrees_and_the_same_keys() {
    let json = assert_contract(&joint("cubic", |u, _| 6e-5 * u.powi(3)));
    assert_eq!((&json["verdict"], &json["unit"]), (&"missing".into(), &"mm".into()), "{json}");
    assert_eq!(json["effects"][0]["joint"], 1);
    let gain = list(&json, "calibration").iter().find(|own| own["name"] == "gain").expect("a gain");
    assert_eq!((&gain["unit"], &gain["held"]), (&"mm/mm".into(), &false.into()));
    // A jump in time, which no effect makes.
    let json = assert_contract(&joint("jump", |_, t| if t > 37.0 { 2.5 } else { 0.0 }));
    assert_eq!(json["verdict"], "unknown", "{json}");
    assert!(json["remaining"]["looks_like"].as_str().is_some_and(|own| own.contains("jump")), "{json}");
    assert!(json["model_free_rms"].is_number() && json["model_free_rms_deg"].is_null());
}

#[test]
fn every_key_of_an_answer_is_in_its_documentation() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/lab-answers.md");
    let docs = std::fs::read_to_string(docs).expect("the page");
    let (_, own) = docs.split_once("## diagnose").expect("its section");
    let own = own.split("\n## ").next().expect("up to the next");
    let all = KEYS.iter().chain(&OF_EFFECT).chain(&OF_PARAMETER).chain(&OF_CANDIDATE).chain(&OF_CALIBRATION);
    let keys = all.map(|(key, _)| key.rsplit('.').next().unwrap_or(key)).filter(|key| !key.ends_with("_deg"));
    // The one that names the page stands above all sections.
    let missing: Vec<&str> = keys.filter(|key| *key != "format" && !own.contains(&format!("`{key}`"))).collect();
    assert_eq!(missing, Vec::<&str>::new());
}

#[test]
fn a_torque_that_never_changes_and_a_joint_that_does_not_move_are_refused_in_one_sentence() {
    let model = ModelFile::parse(FORCE_MODEL).expect("a model");
    let path = file("force.toml", FORCE_MODEL);
    let refused = |name: &str, row: fn(f64) -> (f64, f64)| {
        let mut text = String::from("time_s,q1_rad,tau1_nm\n");
        for k in 0..2000_u32 {
            let t = f64::from(k) * 0.01;
            let (q, tau) = row(t);
            text += &format!("{t:.2},{q:.6},{tau:.6}\n");
        }
        let data = file(&format!("{name}.csv"), &text);
        let said = Session::open(&path, &data, &ColumnMap::default()).err().expect("refused").to_string();
        std::fs::remove_file(&data).expect("the file goes");
        assert!(said.contains(&format!("{name}.csv")) && !said.contains('\n'), "{said}");
        said
    };
    let still = refused("constant", |t| ((2.0 * t).sin(), 0.25));
    assert!(still.contains("nothing ever changes in column tau1_nm") && still.contains("check the sensor"), "{still}");
    let rests = refused("rests", |t| (0.3, t.sin()));
    assert!(
        rests.contains("one single pose was found in column q1_rad") && rests.contains("record a motion"),
        "{rests}"
    );
    std::fs::remove_file(&path).expect("the file goes");
    assert!(machine_of(&model).is_ok(), "the model is no reason");
}
