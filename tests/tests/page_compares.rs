//! Two recordings beside each other on the page, as `krait compare` has them, and what the doctor finds on this machine.
//! Skipped aloud where there is no Chromium.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::message::Marker;
use krait_record::{About, Recording, RecordingWriter};
use krait_schema::Sample;
use krait_tests::{Browser, BrowserPage, Console, Ended, Krait, TempFolder, instance_name};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);
const SIZES: [(u32, u32); 3] = [(1920, 1080), (1280, 800), (1024, 768)];

#[test]
fn two_recordings_are_compared_as_the_command_compares_them() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("pair"), TempFolder::new("pair"));
    let table = folder.file("hand.csv");
    std::fs::write(&table, sixteen_seconds()).expect("written");
    let sides = ["naive", "off"].map(|compensation| {
        let path = folder.file(&format!("{compensation}.mcap"));
        let own = instance_name(compensation);
        let words = ["replay", "--instance", &own, &table, "--speed", "max", "--compensation", compensation];
        let ended = Ended::of(&[&words[..], &["--recording", &path]].concat(), PATIENCE);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        path
    });
    let own = Ended::of(&["compare", "--json", &sides[0], &sides[1]], PATIENCE).json();
    let verdict = own["verdict"].as_str().expect("a verdict");
    assert!(verdict.starts_with("A follows better"), "{verdict}");
    let text = Ended::of(&["compare", &sides[0], &sides[1]], PATIENCE).stdout;
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words(&text).contains(&words(&format!("Verdict: {verdict}"))), "{text}");

    let (recordings, lab) = (folder.path().display().to_string(), folder.file("lab"));
    let mut krait = Krait::start(&["console", "--instance", &instance, "--recordings", &recordings, "--lab", &lab]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the page is there", "location.hash === '' && document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=recordings]').click()");
    page.wait_for("the list", "document.querySelectorAll('#recordings tbody tr').length === 2");
    press(&mut page, "Compare");
    page.wait_for(
        "nothing is chosen",
        "document.querySelector('.verdict-says').textContent.includes('Choose a recording')",
    );
    page.value("document.querySelector('#recordings tr[data-name=\"naive.mcap\"] button').click()");
    page.wait_for("it is chosen", "document.querySelector('#recordings tr.chosen')?.dataset.name === 'naive.mcap'");
    page.value(
        "document.querySelector('#recordings select[aria-label=\"The other recording\"]').value = 'off.mcap'; 0",
    );
    press(&mut page, "Compare");
    let upper = verdict[..1].to_uppercase() + &verdict[1..];
    let is_told = format!("document.querySelector('#recordings .compared h1')?.textContent === {}", json!(upper));
    page.wait_for("the verdict of the command", &is_told);
    let rows = "[...document.querySelectorAll('#recordings .figures tbody tr')].map(row => [...row.children].map(cell => cell.textContent))";
    let figures = own["figures"].as_array().expect("figures");
    let expected: Vec<Value> =
        figures.iter().map(|row| json!([row["name"], row["a"], row["b"], row["difference"]])).collect();
    assert!(expected.iter().any(|row| row[0] == "tracking error rms, deg" && row[1] != "too short"), "{expected:?}");
    assert_eq!(page.value(rows), json!(expected));
    page.wait_for(
        "the pictures are drawn",
        "(all => all.length >= 3 && all.every(picture => picture.complete && picture.naturalWidth > 300))([...document.querySelectorAll('#recordings .shots img')])",
    );
    let policy = "fetch(document.querySelector('#recordings .shots img').src).then(answer => answer.headers.get('content-security-policy'))";
    assert!(page.value(policy).as_str().expect("a policy").starts_with("sandbox; default-src 'none'"));
    for (width, height) in SIZES {
        page.resize(width, height);
        for theme in ["light", "dark"] {
            page.in_theme(theme);
            page.keep(&format!("compared-{theme}-{width}"));
            page.wait_for(
                &format!("it fits into {width} x {height}"),
                "document.documentElement.scrollWidth <= innerWidth && (own => own.scrollWidth <= own.clientWidth)(document.querySelector('.compared'))",
            );
        }
    }
    press(&mut page, "Back to the pictures");
    page.wait_for(
        "the player is back",
        "document.querySelector('.compared').hidden && !document.querySelector('.viewer').hidden",
    );
    a_recording_is_used_in_the_lab(&mut page, &sides[0], &folder.file("lab/base.toml"));
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// One window for all who score a file: `run` says of its run what `compare` says of the recording, `replay` what `compare` says of the
/// replay's, and both are alike. A file that is cut is said to be cut, and is compared over what both have.
#[test]
fn run_replay_and_compare_score_the_same_file_the_same() {
    let folder = TempFolder::new("scored");
    let [live, again, cut] = ["live.mcap", "again.mcap", "cut.mcap"].map(|name| folder.file(name));
    let run = ["run", "--engage=again", "--json", "--seconds", "14", "--recording", &live];
    let run = Ended::of(&[&run[..], &["--instance", &instance_name("scored")]].concat(), PATIENCE);
    assert!(matches!(run.code, Some(0 | 1)), "{}", run.stderr);
    let by_run = run.json()["passes"][0].clone();
    let replay = ["replay", "--json", "--speed", "max", &live, "--recording", &again];
    let replay = Ended::of(&[&replay[..], &["--instance", &instance_name("again")]].concat(), PATIENCE);
    assert_eq!(replay.code, Some(0), "{}", replay.stderr);
    let by_replay = replay.json();
    let compared = Ended::of(&["compare", "--json", &live, &again], PATIENCE).json();
    let rms = |score: &Value| score["rms"].as_f64().unwrap_or_else(|| panic!("a score, found {score}"));
    for (own, key, side) in [(&by_run, "error_deg", "a"), (&by_replay, "tracking_error_deg", "b")] {
        assert_eq!(own[key], compared[side]["tracking_error_deg"], "{side}: {own}");
        assert!(rms(&own[key]) > 0.0 && own[key]["n"].as_u64() > Some(60), "{own}");
        assert_eq!((&own["scored_from_s"], &compared[side]["scored_from_s"]), (&json!(10.0), &json!(10.0)));
    }
    // A run that ends in motion is brought to rest by its replay, which counts too; over the time that both have they are alike.
    let ratio = rms(&compared["common"]["a"]) / rms(&compared["common"]["b"]);
    assert!((0.75..1.34).contains(&ratio), "live and replayed: {ratio}");
    let apart = rms(&compared["apart"]["setpoint_deg"]);
    assert!(apart < 1.0, "a replay is compared with its recording from the same motion on: {apart} deg");

    let bytes = std::fs::read(&live).expect("there");
    std::fs::write(&cut, &bytes[..bytes.len() * 23 / 25]).expect("written");
    let answer = Ended::of(&["compare", "--json", &cut, &live], PATIENCE).json();
    let missing = answer["a"]["missing"].as_array().expect("sentences");
    assert!(missing.iter().any(|said| said.as_str().is_some_and(|said| said.contains("is cut"))), "{missing:?}");
    assert_eq!(answer["b"]["missing"], json!([]));
    assert!(answer["a"]["samples"]["shape"].as_u64() < answer["b"]["samples"]["shape"].as_u64(), "{answer}");
    let verdict = answer["verdict"].as_str().expect("a verdict");
    assert!(verdict.starts_with("both follow alike") && verdict.contains("their lengths differ"), "{verdict}");
    let text = Ended::of(&["compare", &cut, &live], PATIENCE).stdout;
    let (of_a, of_b) = text.split_once("\nB: ").expect("two sides");
    assert!(of_a.contains("   not whole: the recording is cut") && !of_b.contains("not whole"), "{text}");
}

/// Less than ten seconds of motion have no error, for people and for programs, and no command calls it zero.
#[test]
fn a_run_that_is_too_short_has_no_error_and_says_why() {
    let folder = TempFolder::new("short");
    let recording = folder.file("short.mcap");
    let run = |words: &[&str]| {
        let instance = instance_name("short");
        let ended = Ended::of(
            &[&["run", "--engage=again", "--seconds", "3", "--instance", &instance], words].concat(),
            PATIENCE,
        );
        assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
        ended
    };
    let pass = run(&["--json", "--recording", &recording]).json()["passes"][0].clone();
    for key in ["error_deg", "bend_error_deg", "plane_error_deg"] {
        assert!(pass.get(key).is_some_and(Value::is_null), "{key}: {pass}");
    }
    let text = run(&["--recording", &folder.file("told.mcap")]).stdout;
    let row = text.lines().find(|line| line.starts_with("  estimated ")).unwrap_or_else(|| panic!("its row in {text}"));
    assert_eq!(row.split_whitespace().filter(|cell| *cell == "-").count(), 9, "no figure of an error: {row}");
    assert!(text.contains("too short: 10 s needed"), "{text}");
    let replay = |words: &[&str]| {
        let all =
            ["replay", "--speed", "max", "--no-recording", &recording, "--instance", &instance_name("short-again")];
        Ended::of(&[&all[..], words].concat(), PATIENCE)
    };
    let figures = replay(&["--json"]).json();
    assert!(figures.get("tracking_error_deg").is_some_and(Value::is_null), "{figures}");
    let said = replay(&[]).stdout;
    assert!(said.contains("too short: 10 s needed"), "{said}");
}

/// The list has what each recording's chain had learnt, as `krait model save-learnt` says it, and what its recorder lost.
#[test]
fn the_list_says_what_was_learnt_and_what_was_lost() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("learnt"), TempFolder::new("learnt"));
    let shipped = format!("{}/recordings/flick.mcap", env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(&shipped, folder.file("whole.mcap")).expect("copied");
    let recording = Recording::open(Path::new(&shipped)).expect("readable");
    let about = About::run("lossy", &BTreeMap::new(), recording.contents().attachments.clone());
    let mut writer = RecordingWriter::create(Path::new(&folder.file("lossy.mcap")), 1 << 18, &about).expect("created");
    let mut last_ns = 0;
    for recorded in recording.samples().expect("samples").map(|recorded| recorded.expect("readable")) {
        if !matches!(recorded.sample, Sample::ModelUpdate(_)) {
            writer.write(&recorded.sample, recorded.sample.sample_ns()).expect("written");
            last_ns = last_ns.max(recorded.sample.sample_ns());
        }
    }
    // Three marks, of which the last makes the recording longer than an hour.
    let after_ns = [0, 1_000_000_000, 3_725_000_000_000];
    for (sequence, after_ns) in (1..).zip(after_ns) {
        let mark = Marker::new(sequence, last_ns + after_ns, "a vessel").expect("a mark");
        writer.write(&Sample::Marker(Box::new(mark)), last_ns + after_ns).expect("written");
    }
    let end = [("n_dropped", "1200"), ("n_lost", "34")].map(|(key, n)| (key.to_owned(), n.to_owned()));
    writer.finish(&BTreeMap::from(end)).expect("finished");
    let (saved, lab) = (folder.file("saved.toml"), folder.file("lab"));
    let own = Ended::of(&["model", "save-learnt", &shipped, "--out", &saved, "--json"], PATIENCE).json();
    let own = own["learnt"].as_array().expect("learnt").clone();
    assert!(own.len() == 2, "{own:?}");

    let recordings = folder.path().display().to_string();
    let mut krait = Krait::start(&["console", "--instance", &instance, "--recordings", &recordings, "--lab", &lab]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the page is there", "location.hash === '' && document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=recordings]').click()");
    page.wait_for("the list", "document.querySelectorAll('#recordings tbody tr').length === 2");
    let mut of = |name: &str, what: &str| {
        page.value(&format!(
            "[...document.querySelectorAll('#recordings tr[data-name=\"{name}.mcap\"] {what}')].map(own => own.textContent)"
        ))
    };
    let learnt = of("whole", ".learnt");
    for (k, parameter) in own.iter().enumerate() {
        let said = learnt[k].as_str().expect("a sentence");
        let name = parameter["name"].as_str().expect("a name");
        let value = said.strip_prefix(name).and_then(|rest| rest.split_whitespace().next()).expect("a value");
        let (value, exact) = (value.parse::<f64>().expect("a number"), parameter["value"].as_f64().expect("a number"));
        assert!((value / exact - 1.0).abs() < 1e-3 && said.contains(" \u{b1} "), "{said}: {parameter}");
    }
    assert_eq!(of("lossy", ".learnt"), json!([]));
    // Length, marks, lost and size of each, as the file itself has them.
    for (name, n_marks, lost) in [("whole", 0, "0"), ("lossy", 3, "1\u{202f}234")] {
        let path = folder.file(&format!("{name}.mcap"));
        let samples = Recording::open(Path::new(&path)).and_then(|own| own.samples()).expect("readable");
        let written: Vec<u64> = samples.map(|recorded| recorded.expect("readable").log_ns).collect();
        let (first, last) = written.iter().fold((u64::MAX, 0), |(a, b), own| (a.min(*own), b.max(*own)));
        let seconds = (last - first) / 1_000_000_000;
        let length = format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60);
        assert_eq!(length.starts_with("1:02:0"), name == "lossy", "{length}");
        let bytes = std::fs::metadata(&path).expect("a file").len();
        let size = format!("{:.1} MB", bytes as f64 / 1e6);
        let shown = of(name, "td");
        assert_eq!(
            (&shown[2], &shown[3], &shown[4], &shown[5]),
            (&json!(length), &json!(n_marks.to_string()), &json!(lost), &json!(size)),
            "{shown}"
        );
    }
    for (width, height) in SIZES {
        page.resize(width, height);
        page.keep(&format!("learnt-{width}"));
        page.wait_for(
            &format!("the list fits at {width}"),
            "(rows => rows.scrollWidth <= rows.clientWidth)(document.querySelector('#recordings .rows'))",
        );
    }
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// The recording that is chosen becomes the lab's measurement; its comparison with the model to begin with is the command's.
fn a_recording_is_used_in_the_lab(page: &mut BrowserPage, recording: &str, base: &str) {
    press(page, "Use in Lab");
    page.wait_for(
        "the lab has it",
        "document.querySelector('#lab select[aria-label=Measurement]')?.value === 'naive.mcap'",
    );
    let compare =
        "[...document.querySelectorAll('#lab .work button')].find(button => button.textContent === 'Compare')";
    page.wait_for(
        "it asks",
        &format!("{compare} !== undefined && document.querySelector('#lab h1').textContent.includes('naive.mcap')"),
    );
    page.value(&format!("{compare}.click()"));
    page.wait_for("the answer", "document.querySelector('#lab .work .tiles') !== null");
    let shown = page.value("[...document.querySelectorAll('#lab .work .tiles b')].map(b => b.textContent)");
    let own = Ended::of(&["lab", "compare", "--model", base, "--data", recording, "--json"], PATIENCE).json();
    let (rms, rows) = (own["error"]["rms"].as_f64().expect("a number"), own["rows"].to_string());
    assert_eq!((&shown[0], &shown[3]), (&json!(format!("{rms:.2}°")), &json!(rows)));
}

/// The doctor is asked beside a job of the lab, not in its place; what the page says is what the command finds.
#[test]
fn latency_shows_what_the_doctor_finds_worst_first_and_asks_again() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("doctor"), TempFolder::new("doctor"));
    let lab = folder.file("lab");
    let mut own: Vec<Value> = Ended::of(&["doctor", "--seconds", "0", "--json"], PATIENCE).json()["findings"]
        .as_array()
        .expect("findings")
        .clone();
    let grade = |finding: &Value| ["bad", "advice", "good"].iter().position(|grade| finding["verdict"] == *grade);
    own.sort_by_key(grade);
    let mut krait = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let console = Console::of(&mut krait);
    let refused = console.request("GET", "/doctor", &[], "");
    assert_eq!(refused.status, 403, "{refused:?}");
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the page is there", "location.hash === '' && document.querySelectorAll('#stop').length === 1");
    let (origin, cookie) = (console.origin(), console.cookie());
    let quiz = r#"{"verb":"quiz","level":"hard","seed":7}"#;
    let begun = console.request("POST", "/lab/job", &[("Origin", &origin), ("Cookie", &cookie)], quiz);
    assert_eq!(begun.status, 200, "{begun:?}");
    page.value("document.querySelector('[data-go=latency]').click()");
    let n_rows = format!("document.querySelectorAll('.findings li').length === {}", own.len());
    page.wait_for("every finding", &n_rows);
    let said = page.value("[...document.querySelectorAll('.findings li')].map(row => row.textContent)");
    let marks = page.value("[...document.querySelectorAll('.findings li')].map(row => row.className)");
    for (k, finding) in own.iter().enumerate() {
        let row = said[k].as_str().expect("a sentence").replace('`', "");
        let says = |part: &Value, is_said: &dyn Fn(&str) -> bool| {
            let part = part.as_str().map(|part| part.replace('`', ""));
            assert!(part.is_none_or(|part| is_said(part.trim_end_matches('.'))), "{row}: {finding}");
        };
        // A command to mend it can be copied: its letters are as they are typed.
        says(&finding["name"], &|part| row.contains(part));
        says(&finding["mend"], &|part| row.contains(part));
        says(&finding["meaning"], &|part| row.to_lowercase().contains(&part.to_lowercase()));
        let mark = ["fault", "warn", "ok"][grade(finding).expect("a grade")];
        assert_eq!(marks[k], mark, "{row}: {finding}");
    }
    let job = console.request("GET", "/lab/job", &[("Cookie", &cookie)], "");
    assert!(job.body.contains("krait lab quiz"), "the lab's place was left alone: {job:?}");
    page.value("document.querySelector('.findings').replaceChildren()");
    page.value("document.querySelector('.doctor button').click()");
    page.wait_for("every finding again", &n_rows);
    for (width, height) in SIZES {
        page.resize(width, height);
        for theme in ["light", "dark"] {
            page.in_theme(theme);
            page.value("new Promise(done => setTimeout(done, 700))");
            page.keep(&format!("doctor-{theme}-{width}"));
        }
    }
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// A motion with reversals and turns of the plane, longer than a score needs.
fn sixteen_seconds() -> String {
    let mut text = String::from("time_s,bend_x_deg,bend_y_deg\n");
    for k in 0..=160_u16 {
        let t = f64::from(k) / 10.0;
        let bend = 30.0 * (t / 2.0).min((16.0 - t) / 2.0).min(1.0) * (1.3 * t).sin();
        let (sin, cos) = (0.2 * t).sin_cos();
        text += &format!("{t:.1},{:.4},{:.4}\n", bend * cos, bend * sin);
    }
    text
}

fn press(page: &mut BrowserPage, words: &str) {
    page.value(&format!(
        "[...document.querySelectorAll('#recordings button')].find(button => button.textContent === '{words}').click()"
    ));
}
