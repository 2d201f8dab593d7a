//! `krait lab quiz` and `krait lab check`: a riddle is asked, guessed wrong, given up and guessed right; a changed file is refused.

use serde_json::Value;
use std::path::PathBuf;
use std::process::{Command, Output};

fn krait(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_krait")).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_riddle_is_asked_guessed_and_told_and_a_changed_one_is_refused() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("quiz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let data = folder.join("riddle.csv");
    let data = data.to_str().unwrap();
    let asked = krait(&["lab", "quiz", "--seed", "3", "--out", data, "--json"]);
    assert_eq!(asked.status.code(), Some(0), "{}", String::from_utf8_lossy(&asked.stderr));
    let choices: Vec<String> = serde_json::from_value(json(&asked)["choices"].clone()).unwrap();
    assert_eq!(choices.len(), 4);
    assert!(
        json(&asked)["explanations"].as_array().unwrap().iter().all(|own| own["what"].is_string()),
        "each in words"
    );
    let again = krait(&["lab", "quiz", "--seed", "3", "--out", data]);
    assert!(again.status.code() == Some(2), "a riddle that is there is not overwritten");
    let (other, kept) = (folder.join("other.csv"), folder.join("kept.json"));
    std::fs::write(&kept, "somebody's").unwrap();
    let beside = krait(&["lab", "quiz", "--out", other.to_str().unwrap(), "--answer", kept.to_str().unwrap()]);
    assert!(beside.status.code() == Some(2) && !other.exists(), "nothing is written where the answer would overwrite");
    let odd = krait(&["lab", "quiz", "--level", "odd", "--out", other.to_str().unwrap()]);
    assert!(String::from_utf8_lossy(&odd.stderr).contains("none of easy, medium, hard"), "{odd:?}");

    let guessed = |name: &str| krait(&["lab", "check", "--data", data, "--guess", name, "--json"]);
    let right: Vec<&String> = choices.iter().filter(|name| guessed(name).status.code() == Some(0)).collect();
    assert_eq!(right.len(), 1, "one of {choices:?}");
    assert_eq!(json(&guessed(right[0]))["judgement"], "right");
    let wrong = choices.iter().find(|name| *name != right[0]).unwrap();
    let said = json(&guessed(wrong));
    assert!(
        said["judgement"] == "wrong" && said["hidden"].is_null() && said["effect_rms_deg"].is_null(),
        "a wrong guess tells nothing: {said}"
    );
    assert_eq!(said["guessed"][0]["worth"], "wrong", "{said}");
    assert!(said["guessed"][0]["is_near"].is_boolean() && said["n_unnamed"] == 1 && said["n_hidden"] == 1, "{said}");
    let named = json(&guessed(right[0]));
    let title = named["titles"][0].as_str().unwrap();
    let told = krait(&["lab", "check", "--data", data, "--give-up"]);
    let said = String::from_utf8_lossy(&told.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(told.status.code() == Some(0) && said.contains(right[0].as_str()) && said.contains(title), "{said}");
    let nonsense = guessed("backlsh");
    assert_eq!(nonsense.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&nonsense.stderr).contains("did you mean backlash?"));

    let text = std::fs::read_to_string(data).unwrap();
    std::fs::write(data, text.replacen("0.0", "0.1", 1)).unwrap();
    let refused = guessed(right[0]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    assert!(String::from_utf8_lossy(&refused.stderr).contains("was changed"), "{refused:?}");
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Seed 2 hides a compliance, which is a parameter of its effect.
#[test]
fn an_answer_says_how_large_the_effect_is() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("quiz-size-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let data = folder.join("riddle.csv");
    let data = data.to_str().unwrap();
    assert_eq!(krait(&["lab", "quiz", "--seed", "2", "--out", data]).status.code(), Some(0));
    let told = krait(&["lab", "check", "--data", data, "--give-up", "--json"]);
    let answer: Value = serde_json::from_slice(&std::fs::read(folder.join("riddle.answer.json")).unwrap()).unwrap();
    let hidden = json(&told)["hidden"][0].as_str().unwrap().to_owned();
    let known = answer[0]["known"][&hidden].as_object().unwrap().values().next().unwrap().as_f64().unwrap();
    let title = json(&told)["titles"][0].as_str().unwrap().to_owned();
    assert!(title.contains(&format!("{known:.2e}")), "{hidden}: {title}, {known}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_riddle_on_segments_is_asked_looked_at_and_guessed() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("quiz-segments-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let data = file("riddle.csv");
    let asked = krait(&["lab", "quiz", "--segments", "--seed", "5", "--out", &data, "--json"]);
    assert_eq!(asked.status.code(), Some(0), "{}", String::from_utf8_lossy(&asked.stderr));
    let riddle = json(&asked);
    let choices: Vec<String> = serde_json::from_value(riddle["choices"].clone()).unwrap();
    assert_eq!(choices.len(), 4);
    assert!(riddle["explanations"].as_array().unwrap().iter().all(|own| own["what"].is_string()), "each in words");
    let model = riddle["model"].as_str().unwrap();
    let text = std::fs::read_to_string(model).unwrap();
    assert!(text.contains("kind = \"segments\"") && text.matches("[[machine.segment]]").count() == 2, "{text}");
    let looked = krait(&["lab", "compare", "--model", model, "--data", &data]);
    assert_eq!(looked.status.code(), Some(0), "{}", String::from_utf8_lossy(&looked.stderr));

    let guessed = |name: &str| krait(&["lab", "check", "--data", &data, "--guess", name, "--json"]);
    let right: Vec<&String> = choices.iter().filter(|name| guessed(name).status.code() == Some(0)).collect();
    assert_eq!(right.len(), 1, "one of {choices:?}");
    assert_eq!(json(&guessed(right[0]))["judgement"], "right");
    let wrong = choices.iter().find(|name| *name != right[0]).unwrap();
    assert!(json(&guessed(wrong))["hidden"].is_null(), "a wrong guess tells nothing");
    let told = krait(&["lab", "check", "--data", &data, "--give-up"]);
    assert!(told.status.code() == Some(0) && String::from_utf8_lossy(&told.stdout).contains(right[0].as_str()));

    let four = krait(&["lab", "quiz", "--segments", "4", "--out", &file("four.csv")]);
    assert_eq!(four.status.code(), Some(2), "{four:?}");
    let asked = krait(&[
        "lab",
        "quiz",
        "--segments",
        "3",
        "--level",
        "hard",
        "--seed",
        "7",
        "--out",
        &file("three.csv"),
        "--force",
    ]);
    assert_eq!(asked.status.code(), Some(0), "{}", String::from_utf8_lossy(&asked.stderr));
    let said = String::from_utf8_lossy(&asked.stdout);
    assert!(said.contains("the robot of segments in") && said.contains("krait lab check"), "{said}");
    std::fs::remove_dir_all(&folder).unwrap();
}

/// A guess may be another word for an effect, or its title; of several names each is weighed.
#[test]
fn a_guess_in_peoples_own_words_is_understood_and_told_how_far_it_was_right() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("words-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let data = folder.join("two.csv");
    let data = data.to_str().unwrap();
    let hidden = ["--kind", "backlash+camera-offset", "--size", "3,3", "--seconds", "30"];
    let made = krait(&[&["lab", "generate", "--seed", "3", "--out", data], &hidden[..]].concat());
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    let guessed = |guess: &str| krait(&["lab", "check", "--data", data, "--guess", guess, "--json"]);
    for right in ["play + the camera's zero is off", "Camera_Offset+Slack", "backlash+camera-offset"] {
        let said = guessed(right);
        assert!(said.status.code() == Some(0) && json(&said)["judgement"] == "right", "{right}: {said:?}");
    }
    let alike = json(&guessed("Coulomb friction+camera-offset"));
    assert_eq!(alike["judgement"], "look-alike", "{alike}");
    assert_eq!(alike["guessed"][0]["effect"], "static-friction", "{alike}");
    let half = guessed("play+camera scale");
    let told = json(&half);
    assert_eq!((half.status.code(), &told["judgement"], &told["hidden"]), (Some(1), &"wrong".into(), &Value::Null));
    assert_eq!((&told["guessed"][0]["worth"], &told["guessed"][1]["worth"]), (&"right".into(), &"wrong".into()));
    assert_eq!((&told["n_hidden"], &told["n_unnamed"]), (&2.into(), &1.into()), "{told}");
    let said = krait(&["lab", "check", "--data", data, "--guess", "play+camera scale"]);
    let said = String::from_utf8_lossy(&said.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    for words in [
        "No, it is not backlash (play) and camera-scale (camera scale).",
        "2 effects are hidden, of which the guess names 1. right: backlash (play). wrong: camera-scale",
        "camera-scale acts on what the camera sees, and so does something that is hidden.",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let nonsense = guessed("play+backlsh");
    assert!(String::from_utf8_lossy(&nonsense.stderr).contains("did you mean backlash?"), "{nonsense:?}");
    std::fs::remove_dir_all(&folder).unwrap();
}
