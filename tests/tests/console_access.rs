//! The page for people who cannot see it well, or use no mouse: the rules of axe-core, and the keyboard alone.
//!
//! axe-core comes from the npm registry while the test runs; without it, or without a Chromium, this is skipped aloud. Its rules
//! take minutes on a machine without a graphics processor, so `.ci/run` asks for it by name.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::Reason;
use krait_ipc::message::SlaveState;
use krait_tests::{
    Browser, BrowserPage, ChainSender, Console, Ended, Krait, TempFolder, instance_name, say_aloud, wait_for_motion,
    wait_until,
};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

const PATIENCE: Duration = Duration::from_secs(240);
/// The rules that the page is held to; a newer version may have others.
const AXE: &str = "axe-core@4.10.3";

/// The script with the rules, or nothing where it cannot be had.
fn axe() -> Option<String> {
    let folder = TempFolder::new("axe");
    let packed = Command::new("npm")
        .args(["pack", AXE, "--silent", "--fetch-timeout=30000", "--fetch-retries=1"])
        .current_dir(folder.path())
        .output()
        .ok()?;
    let name = String::from_utf8(packed.stdout).ok()?.trim().to_owned();
    let archive = Path::new(folder.path()).join(&name);
    let script = Command::new("tar").args(["-xzO", "-f"]).arg(archive).arg("package/axe.min.js").output().ok()?;
    let script = script.status.success().then(|| String::from_utf8(script.stdout)).and_then(Result::ok)?;
    script.contains("axe").then_some(script)
}

/// The whole document, for axe-core.
const ALL: &str = "document";
/// What shows a state.
const OF_STATE: &str = "{ include: [['.banner'], ['.side'], ['.foot']] }";

/// Serious and critical findings within a part of the page: rule, and the first elements that break it.
fn findings(page: &mut BrowserPage, part: &str) -> Vec<Value> {
    let script = format!(
        "axe.run({part}, {{ iframes: false, resultTypes: ['violations'] }}).then(result => result.violations
        .filter(({{ impact }}) => ['serious', 'critical'].includes(impact))
        .map(({{ id, help, nodes }}) => [id, help, nodes.slice(0, 4).map(node => node.html.slice(0, 160))]))"
    );
    page.value(&script).as_array().expect("a list").clone()
}

/// The same in the dark and in the light theme, each with where it was found.
fn findings_in_both_themes(page: &mut BrowserPage, part: &str, place: &str) -> Vec<String> {
    let mut broken = Vec::new();
    for theme in ["dark", "light"] {
        if page.value("document.documentElement.dataset.theme") != json!(theme) {
            page.key("t", 84);
        }
        page.value("new Promise(done => setTimeout(done, 700))");
        broken.extend(findings(page, part).into_iter().map(|found| format!("{place}, {theme}: {found}")));
    }
    broken
}

/// What the lab says of a measurement, and the form for the columns of a table whose names nobody knows: what to do, what comes then, and
/// how to see that it is there.
const LAB: [(&str, &str, &str); 4] = [
    (
        "(select => { select.value = 'data.csv'; select.dispatchEvent(new Event('change')); })([...document.querySelectorAll('#lab select')].find(s => [...s.options].some(o => o.value === 'data.csv'))); [...document.querySelectorAll('#lab .work button')].find(b => b.textContent === 'Compare').click()",
        "the lab's comparison",
        "document.querySelector('#lab .work .tiles') !== null && document.querySelector('#lab .work .residuals') !== null",
    ),
    (
        "[...document.querySelectorAll('#lab .work button')].find(b => b.textContent === 'Diagnose').click()",
        "the lab's diagnosis",
        "document.querySelector('#lab .work .effect .sketch') !== null && document.querySelectorAll('#lab .fall rect').length > 0",
    ),
    (
        "[...document.querySelectorAll('#lab .work .alone')][0].click()",
        "the lab's question before an effect is added",
        "[...document.querySelectorAll('#lab .work button')].some(b => b.textContent.startsWith('Add ')) && document.querySelector('#lab .work progress') === null",
    ),
    (
        "(files => { files.items.add(new File(['Zeit;links;rechts;unten;horizontal;vertikal\\n' + Array.from({ length: 200 }, (_, k) => `${k / 50};${Math.sin(k)};${k % 7};${k % 11};${Math.cos(k)};${k % 13}`).join('\\n')], 'theirs.csv')); document.getElementById('lab').dispatchEvent(new DragEvent('drop', { dataTransfer: files, bubbles: true })); })(new DataTransfer())",
        "the form for columns",
        "document.querySelectorAll('#lab .columns tbody select').length >= 6",
    ),
];

/// The quiz of the lab from its form to its answer: what to do, what comes then, and how to see that it is there.
const QUIZ: [(&str, &str, &str); 3] = [
    (
        "[...document.querySelectorAll('#lab button')].find(button => button.textContent.startsWith('Quiz')).click()",
        "the form of the quiz",
        "document.querySelector('#quiz-new') !== null",
    ),
    (
        "document.querySelector('#quiz-new [name=seed]').value = '3'; document.querySelector('#quiz-new').requestSubmit()",
        "the question of the quiz",
        "document.querySelectorAll('#quiz-guess [name=guess]').length === 4 && document.querySelector('#lab .residuals') !== null",
    ),
    (
        "[...document.querySelectorAll('#lab button')].find(button => button.textContent === 'Give up').click()",
        "the answer of the quiz",
        "document.querySelectorAll('#lab .effect p').length === 2",
    ),
];

/// A recording that is opened, and one that is compared with another: what to do, what comes then, how to see that it is there, and where.
const RECORDED: [(&str, &str, &str, &str); 2] = [
    (
        "document.querySelector('#recordings tr[data-name=\"one.mcap\"] button').click()",
        "the player",
        "document.querySelector('#recordings .ribbon')?.textContent === 'Recording one – not live'",
        "'.viewer'",
    ),
    (
        "document.querySelector('#recordings select[aria-label=\"The other recording\"]').value = 'two.mcap'; [...document.querySelectorAll('#recordings button')].find(button => button.textContent === 'Compare').click()",
        "the comparison",
        "document.querySelectorAll('#recordings .figures tbody tr').length > 3",
        "'.compared'",
    ),
];

/// The drive pad of a page of its own.
fn findings_of_the_pad(browser: &Browser, axe: &str) -> Vec<String> {
    let instance = instance_name("access-pad");
    let mut krait = Krait::start(&["run", "--master", "browser", "--no-recording", "--instance", &instance]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for(
        "the pad",
        "document.getElementById('pad')?.hidden === false && document.documentElement.dataset.shown === 'ready'",
    );
    page.value(axe);
    let found = findings_in_both_themes(&mut page, "'#pad'", "the drive pad");
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    found
}

/// A fault and the machine's own emergency stop, as a slave with real drives says them.
fn findings_of_failures(browser: &Browser, axe: &str) -> Vec<String> {
    let instance = instance_name("access-fault");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let sender = ChainSender::start(&instance);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("a state", "document.documentElement.dataset.shown === 'fault'");
    page.value(axe);
    let second = SlaveState::failed_drive_flags(2);
    let mut found = Vec::new();
    for (shown, flags) in [("fault", second), ("emergency", second | SlaveState::HARDWARE_STOP)] {
        sender.say_fault(flags, &[Reason::DriveFault]);
        page.wait_for(shown, &format!("document.documentElement.dataset.shown === '{shown}'"));
        found.extend(findings_in_both_themes(&mut page, OF_STATE, shown));
    }
    drop(sender);
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    found
}

/// Every control of the room in front can be reached by Tab; of the choices of one question the one that is chosen.
fn assert_reached_by_tab(page: &mut BrowserPage, room: &str) {
    let visible = "[...document.querySelectorAll('button, select, input, a[href], [tabindex=\"0\"]')].filter(e => !e.disabled && e.checkVisibility() && e.offsetParent !== null && e.tabIndex >= 0 && (e.type !== 'radio' || e.checked))";
    let n = page.value(&format!("{visible}.length")).as_u64().expect("a number");
    assert!(n > 5, "{room}: {n} controls");
    page.value("document.activeElement.blur(); window.reached = new Set(); 0");
    // What has the focus is asked after each press, and how many it takes is left open: the stop on the way is a document of another
    // process, and on a busy machine it may keep the focus for some presses.
    let missed = format!(
        "window.reached.add(document.activeElement), {visible}.filter(e => !window.reached.has(e)).map(e => e.outerHTML.slice(0, 120))"
    );
    let mut left = json!(null);
    for _ in 0..4 * n + 40 {
        page.key("Tab", 9);
        left = page.value(&missed);
        if left == json!([]) {
            return;
        }
    }
    panic!("{room}: not reached by Tab: {left}");
}

#[test]
#[ignore = "fetches axe-core and takes minutes; .ci/run runs it"]
fn no_room_of_the_page_breaks_a_serious_rule_and_the_keyboard_alone_suffices() {
    let Some(browser) = Browser::start() else { return };
    let Some(axe) = axe() else {
        say_aloud(&format!("SKIPPED ALOUD: {AXE} cannot be had with npm on this machine"));
        return;
    };
    let (instance, folder) = (instance_name("access"), TempFolder::new("access"));
    let recording = folder.file("run.mcap");
    let lab = folder.file("lab");
    std::fs::create_dir(&lab).expect("a folder");
    let hidden = ["--kind", "backlash", "--size", "3", "--seconds", "40", "--rate", "15", "--seed", "5"];
    let data = format!("{lab}/data.csv");
    let made = Ended::of(&[&["lab", "generate", "--out", &data][..], &hidden].concat(), PATIENCE);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    let recordings = folder.file("recordings");
    std::fs::create_dir(&recordings).expect("a folder");
    for name in ["one.mcap", "two.mcap"] {
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/flick.mcap");
        std::fs::copy(shipped, Path::new(&recordings).join(name)).expect("copied");
    }
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &lab, "--recordings", &recordings]);
    let console = Console::of(&mut server);
    wait_for_motion(&instance, &recording);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    page.value(&axe);
    let mut broken = Vec::new();
    for (key, tab) in [("1", "operate"), ("2", "latency"), ("4", "recordings"), ("3", "lab")] {
        page.key(key, u32::from(key.as_bytes()[0]));
        page.wait_for("the key opens the room", &format!("document.documentElement.dataset.tab === '{tab}'"));
        broken.extend(findings_in_both_themes(&mut page, ALL, tab));
    }
    for (act, what, is_there) in LAB {
        page.value(&format!("{act}; 0"));
        page.wait_for(what, is_there);
        broken.extend(findings_in_both_themes(&mut page, "'#lab'", what));
    }
    assert_reached_by_tab(&mut page, "the form for columns");
    page.value(
        "[...document.querySelectorAll('#lab .work button')].find(b => b.textContent === 'Leave it').click(); 0",
    );
    for (act, what, is_there) in QUIZ {
        page.value(&format!("{act}; 0"));
        page.wait_for(what, is_there);
        broken.extend(findings_in_both_themes(&mut page, ALL, what));
    }
    page.key("4", u32::from(b'4'));
    for (act, what, is_there, part) in RECORDED {
        page.value(&format!("{act}; 0"));
        page.wait_for(what, is_there);
        broken.extend(findings_in_both_themes(&mut page, part, what));
    }
    // As long as this page is the browser's newest: only that one takes keys.
    for tab in ["operate", "latency", "recordings", "lab"] {
        page.value(&format!("document.querySelector('[data-go={tab}]').click()"));
        assert_reached_by_tab(&mut page, tab);
    }
    broken.extend(findings_of_the_pad(&browser, &axe));
    broken.extend(findings_of_failures(&browser, &axe));
    assert!(broken.is_empty(), "{broken:#?}");

    // The stop is a document of its own.
    let mut stop = browser.page(&console.stop, 600, 400);
    stop.wait_for("the stop is there", "document.querySelector('button') !== null");
    stop.value(&axe);
    let found = findings(&mut stop, ALL);
    assert!(found.is_empty(), "the stop: {found:#?}");
    stop.value("document.querySelector('button').focus(); 0");
    stop.key_half(true, "Enter", 13);
    stop.key_half(false, "Enter", 13);
    let paused = || Ended::of(&["state", "--instance", &instance], PATIENCE).stdout.starts_with("PAUSED");
    assert!(wait_until(PATIENCE, paused), "Enter on the stop stops");
    server.signal(Signal::TERM);
    server.end(PATIENCE);
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
}
