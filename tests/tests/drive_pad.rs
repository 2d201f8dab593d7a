//! The drive pad by hand, as a page or an attacker would: one page drives, only while it holds, and its loss stops the motion.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{Console, Ended, Krait, PadPage, TempFolder, instance_name, pad_losses, real_drives};
use rustix::process::Signal;
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(240);
/// The lease, in ticks of the master, and two more.
const MOST_INPUTS: usize = 150 + 2;

fn is_present(frame: &Value) -> bool {
    frame["operator"]["present"] == true
}

fn is_lost(frame: &Value) -> bool {
    frame["operator"]["device"] == "lost" && !is_present(frame)
}

/// What the camera sees of the bend to its right, degrees.
fn right_deg(frame: &Value) -> f64 {
    frame["bend"][0].as_f64().unwrap_or(0.0).to_degrees()
}

#[test]
fn one_page_drives_while_it_holds_and_its_silence_stops_the_motion_within_the_lease() {
    let folder = TempFolder::new("pad");
    let (recording, instance) = (folder.file("pad.mcap"), instance_name("pad"));
    let mut krait = Krait::start(&["run", "--master", "browser", "--instance", &instance, "--recording", &recording]);
    let console = Console::of(&mut krait);
    let mut page = PadPage::open(&console);
    let first = page.until("offered", |_, frame| !frame["pad"].is_null() && frame["state"]["homed"] == true);
    assert!(!is_present(&first) && first["state"]["engaged"] == false, "a page that opens engages nothing: {first}");
    let in_vain = page.hold_for_a_while([0.6, 0.0]);
    assert!(!is_present(&in_vain) && in_vain["pad"]["driver"].is_null(), "nobody has the pad: {in_vain}");
    let taken = page.take();
    assert_eq!(taken["is_done"], true, "{taken}");
    page.let_go_until("the pad is its own", |frame| frame["pad"]["driver"] == json!(1));
    let bent = page.hold_until("follows to the right", [0.6, 0.0], |frame| right_deg(frame) > 10.0);
    assert!(bent["shown"] == "following" || bent["shown"] == "limited", "{bent}");

    // Another page while the first holds: it neither drives nor stops nor takes over, and its end stops nothing.
    let mut other = PadPage::open(&console);
    other.ask(&page.frame()["t_ms"]);
    undisturbed(&mut page, |n, frame| other.say(n % 2 == 0, [-1.0, 0.0], &frame["t_ms"], &Value::Null));
    let refused = other.answer();
    assert!(refused["is_done"] == false && refused["say"].as_str().expect("a word").contains("let go"), "{refused}");
    drop(other);
    undisturbed(&mut page, |_, _| ());

    nothing_wrong_renews_the_lease(&mut page);
    let in_vain = page.hold_for_a_while([0.6, 0.0]);
    assert!(!is_present(&in_vain), "a hand that was not off the pad since: {in_vain}");
    page.let_go_until("let go", |frame| frame["operator"]["device"] == "at rest");
    page.hold_until("drives again", [0.3, 0.0], |frame| is_present(frame) && frame["state"]["engaged"] == true);
    page.until("lost by its silence", |_, frame| is_lost(frame));

    // The page that drives is gone; the next one takes the pad and drives the other way.
    page.let_go_until("let go again", |frame| frame["operator"]["device"] == "at rest");
    page.hold_until("holds to the last", [0.3, 0.0], is_present);
    drop(page);
    let mut next = PadPage::open(&console);
    next.until("the pad is free and the snake rests", |_, frame| {
        frame["pad"]["driver"].is_null() && !is_present(frame) && frame["state"]["engaged"] == false
    });
    assert_eq!(next.take()["is_done"], true);
    next.hold_until("follows to the left", [-0.6, 0.0], |frame| right_deg(frame) < -5.0);
    next.let_go_until("let go at the end", |frame| frame["shown"] == "ready");
    krait.signal(Signal::TERM);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);

    let (losses, n_without_hand) = pad_losses(&recording);
    assert!(losses.len() >= 2 && losses.iter().all(|n_inputs| *n_inputs <= MOST_INPUTS), "{losses:?}");
    assert_eq!(n_without_hand, 0, "commands that follow nobody");
    let verified = Ended::of(&["verify", &recording], PATIENCE);
    assert_eq!(verified.code, Some(0), "{}\n{}", verified.stdout, verified.stderr);
}

/// Holds for a while beside what another does, and is present in each picture. A busy machine may hold this test up for longer
/// than the lease, but not five times in a row.
fn undisturbed(page: &mut PadPage, mut beside: impl FnMut(u32, &Value)) {
    let mut once = || {
        page.let_go_until("off the pad", |frame| frame["operator"]["device"] == "at rest");
        page.hold_until("present", [0.1, 0.0], is_present);
        let (mut n, mut n_present) = (0, 0);
        page.until("a second", |page, frame| {
            page.say(true, [0.1, 0.0], &frame["t_ms"], &Value::Null);
            beside(n, frame);
            n += 1;
            n_present += u32::from(is_present(frame));
            n == 60
        });
        n_present == n
    };
    assert!((0..5).any(|_| once()), "never present for a second");
}

fn nothing_wrong_renews_the_lease(page: &mut PadPage) {
    page.let_go_until("off the pad", |frame| frame["operator"]["device"] == "at rest");
    page.hold_until("present", [0.1, 0.0], is_present);
    let wrong = [
        json!({ "x": 2.0 }),
        json!({ "y": -1.5 }),
        json!({ "x": "NaN" }),
        json!({ "x": null }),
        json!({ "jaw": 2 }),
        json!({ "jaw": 0.5 }),
        json!({ "session": "another" }),
        json!({ "n": page.n }),
        json!({ "n": -1 }),
        json!({ "at_ms": 0 }),
        json!({ "at_ms": 1e300 }),
        json!({ "more": 1 }),
    ];
    let mut kinds = wrong.iter().cycle();
    page.until("lost among nonsense", |page, frame| {
        page.say(true, [0.1, 0.0], &frame["t_ms"], kinds.next().expect("a cycle"));
        is_lost(frame)
    });
}

#[test]
fn a_page_never_drives_real_drives_nor_a_chain_that_something_else_drives() {
    let folder = TempFolder::new("pad-real");
    let config = real_drives(&folder);
    let instance = instance_name("pad-real");
    for verb in [["run", "--master"], ["master", "--source"]] {
        let refused = Ended::of(&[verb[0], verb[1], "browser", "--instance", &instance, "--config", &config], PATIENCE);
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.sentence().contains("simulated drives only"), "{}", refused.sentence());
    }
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let mut page = PadPage::open(&console);
    assert!(page.frame()["pad"].is_null(), "there is no pad");
    let refused = page.take();
    assert!(refused["say"].as_str().is_some_and(|say| say.contains("not driven from a page")), "{refused}");
    krait.signal(Signal::TERM);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
}
