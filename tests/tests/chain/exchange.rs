//! A better model in a chain that runs: asked for from the page, taken while the snake holds still, seen in the tracking error.

use core::time::Duration;
use krait_ipc::message::Phase;
use krait_ipc::{Reason, Reasons};
use krait_schema::Sample;
use krait_tests::{
    Browser, BrowserPage, Console, Ended, Krait, TempFolder, assert_no_jump, assert_starts_at_setpoint, commands_in,
    instance_name, next_of_kind, samples_in, states_in, wait_until,
};
use rustix::process::Signal;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};

const PATIENCE: Duration = Duration::from_secs(240);

#[test]
fn a_chain_takes_a_better_model_and_its_error_falls_and_each_recording_can_be_repeated() {
    let folder = TempFolder::new("exchange");
    let (recording, instance, lab) = (folder.file("run.mcap"), instance_name("exchange"), folder.file("lab"));
    std::fs::create_dir(&lab).expect("made");
    let models = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/models");
    std::fs::copy(models.join("estimated.toml"), format!("{lab}/better.toml")).expect("copied");
    std::fs::write(format!("{lab}/other.toml"), "format = 1\n[machine]\nkind = \"snake\"\nl_m = 0.031\n")
        .expect("written");
    let krait = Krait::start(&[
        "run",
        "--engage=again",
        "--compensation",
        "off",
        "--instance",
        &instance,
        "--recording",
        &recording,
    ]);
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let console = Console::of(&mut server);
    follows(&console);

    // What cannot be taken is refused, and the chain goes on as if nobody had asked.
    let (status, said) = ordered(&console, "../better.toml");
    assert!(status == 409 && said.contains("no model"), "{said}");
    let (status, said) = ordered(&console, "other.toml");
    assert!(status == 200 && said.contains("\"failed\"") && said.contains("another machine"), "{said}");
    let gone = Ended::of(&["model", "exchange", &format!("{lab}/none.toml"), "--instance", &instance], PATIENCE);
    assert_eq!(gone.code, Some(2), "{gone:?}");
    follows(&console);

    match Browser::start() {
        Some(browser) => by_one_click(&mut browser.page(&console.address, 1280, 800)),
        None => {
            // The recording, too, shall have seconds in which nothing is eased in.
            std::thread::sleep(Duration::from_secs(6));
            let (status, said) = ordered(&console, "better.toml");
            assert!(status == 200 && said.contains("\"done\""), "{said}");
            follows(&console);
            std::thread::sleep(Duration::from_secs(10));
        }
    }
    for running in [krait, server] {
        running.signal(Signal::TERM);
        let ended = running.end(PATIENCE);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    }
    let second = folder.file("run-model2.mcap");
    let (before, after) = (found_in(&recording), found_in(&second));
    assert!(before.models.len() == 1 && after.models.len() == 1 && before.models != after.models);
    assert!(!after.was_engaged_at_first && after.was_engaged_later, "the operator takes hold anew");
    assert!(after.error_deg < before.error_deg / 4.0, "{} deg, {} deg before", after.error_deg, before.error_deg);
    assert!(
        before.n_learnt_from == 0 && after.n_learnt_from > 100,
        "the better model learns from {} pictures, the one before from {}",
        after.n_learnt_from,
        before.n_learnt_from
    );
    for recording in [&recording, &second] {
        let states = states_in(recording);
        assert_no_jump(&states);
        assert_starts_at_setpoint(&commands_in(recording), &states);
        let verified = Ended::of(&["verify", recording], PATIENCE);
        assert_eq!(verified.code, Some(0), "{}\n{}", verified.stdout, verified.stderr);
    }
}

/// The person chooses the model, presses once, and sees both figures.
fn by_one_click(page: &mut BrowserPage) {
    page.wait_for("it follows", "document.documentElement.dataset.shown === 'following'");
    // The page's figures rest on seconds of following.
    std::thread::sleep(Duration::from_secs(6));
    page.value("document.querySelector('[data-go=lab]').click()");
    page.wait_for(
        "the model is on the shelf",
        "[...document.querySelectorAll('#lab option')].some(o => o.value === 'better.toml')",
    );
    page.value(
        "(() => { const select = [...document.querySelectorAll('#lab select')].find(s => [...s.options].some(o => o.value === 'better.toml'));
            select.value = 'better.toml'; select.dispatchEvent(new Event('change')); return 0; })()",
    );
    page.value("document.querySelectorAll('#lab .steps button')[3].click()");
    page.wait_for("one button", "document.querySelector('#lab .prime')?.textContent === 'Run with it'");
    page.value("document.querySelector('#lab .prime').click()");
    page.wait_for("it runs", "document.querySelector('#lab h1').textContent === 'The chain runs with better.toml.'");
    page.wait_for(
        "the error falls",
        "(() => { const said = document.querySelector('.run-says').textContent.match(/was ([0-9.]+)°; it is ([0-9.]+)° now/); return said !== null && Number(said[2]) < Number(said[1]) / 4; })()",
    );
    // The second recording, too, shall have seconds in which nothing is eased in.
    std::thread::sleep(Duration::from_secs(5));
    page.keep("exchange");
    assert!(page.complaints.is_empty(), "{:?}", page.complaints);
}

/// Waits until the snake follows.
fn follows(console: &Console) {
    let mut page = console.page();
    let is_so = || next_of_kind(&mut page, "frame")["shown"] == "following";
    assert!(wait_until(PATIENCE, is_so), "it never followed");
}

/// Orders an exchange as the page does, and waits for its end.
fn ordered(console: &Console, model: &str) -> (u16, String) {
    let (origin, cookie) = (console.origin(), console.cookie());
    let own = [("Origin", origin.as_str()), ("Cookie", cookie.as_str())];
    let started = console.request("POST", "/lab/job", &own, &json!({ "verb": "exchange", "model": model }).to_string());
    let mut said = started.body;
    if started.status == 200 {
        let is_over = || {
            said = console.request("GET", "/lab/job", &own, "").body;
            !said.contains("\"running\"")
        };
        assert!(wait_until(PATIENCE, is_over), "{said}");
    }
    (started.status, said)
}

/// What a recording says of its model and of the engagement.
struct Found {
    models: BTreeSet<u64>,
    /// When the first command of the recording came.
    was_engaged_at_first: bool,
    was_engaged_later: bool,
    error_deg: f64,
    /// Pictures that what is learnt rests on.
    n_learnt_from: u64,
}

fn found_in(recording: &str) -> Found {
    let samples = samples_in(recording);
    let state = |s: &Sample| if let Sample::State(state) = s { Some(state.is_engaged()) } else { None };
    let first = samples.iter().position(|s| matches!(s, Sample::Command(_))).expect("commands");
    // The slave's word from before the exchange may stand first of all: its watchdog takes its time.
    let was_engaged_at_first = samples[..first].iter().rev().find_map(state).expect("a state before the first command");
    let was_engaged_later = samples[first..].iter().filter_map(state).any(|is_engaged| is_engaged);
    let commands = samples.iter().filter_map(|s| if let Sample::Command(c) = s { Some(c.model_hash) } else { None });
    // A model without learnt values counts the pictures that it explains, and learns nothing from them.
    let learnt_from = |s: &Sample| match s {
        Sample::ModelUpdate(own) if !own.learnt().is_empty() => Some(own.n_used),
        _ => None,
    };
    let n_learnt_from = samples.iter().filter_map(learnt_from).max().unwrap_or(0);
    let error_deg = error_deg(&samples);
    Found { models: commands.collect(), was_engaged_at_first, was_engaged_later, error_deg, n_learnt_from }
}

/// How far the measured bend is from what was wanted at its instant while the snake follows and nothing is eased in any more,
/// root mean square, degrees.
fn error_deg(samples: &[Sample]) -> f64 {
    let mut commands = BTreeMap::new();
    let mut squares = Vec::new();
    for sample in samples {
        match sample {
            Sample::Command(command) => drop(commands.insert(command.sample_ns, command)),
            Sample::Shape(shape) => {
                let command = commands.range(..=shape.sample_ns).next_back().map(|(_, command)| *command);
                let follows = command.filter(|command| {
                    let is_easing = Reasons::from_bits(command.reasons).contains(Reason::EasingIn);
                    command.phase == Phase::Following as u32 && !is_easing
                });
                if let (Some(command), Some([x, y])) = (follows, shape.valid_bend_rad()) {
                    squares.push((x - command.bend_rad[0]).powi(2) + (y - command.bend_rad[1]).powi(2));
                }
            }
            _ => {}
        }
    }
    assert!(squares.len() > 100, "{} pictures while it follows", squares.len());
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt().to_degrees()
}
