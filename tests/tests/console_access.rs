//! The page for people who cannot see it well, or use no mouse: the rules of axe-core, and the keyboard alone.
//!
//! axe-core comes from the npm registry while the test runs; without it, or without a Chromium, this is skipped aloud. Its rules
//! take minutes on a machine without a graphics processor, so `.ci/run` asks for it by name.

#![allow(clippy::expect_used, clippy::panic, clippy::print_stdout, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{
    Browser, BrowserPage, Console, Ended, Krait, TempFolder, instance_name, wait_for_motion, wait_until,
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

/// Serious and critical findings: rule, and the first elements that break it.
fn findings(page: &mut BrowserPage) -> Vec<Value> {
    let script = "axe.run(document, { iframes: false, resultTypes: ['violations'] }).then(result => result.violations
        .filter(({ impact }) => ['serious', 'critical'].includes(impact))
        .map(({ id, help, nodes }) => [id, help, nodes.slice(0, 4).map(node => node.html.slice(0, 160))]))";
    page.value(script).as_array().expect("a list").clone()
}

/// The same in the dark and in the light theme, each with where it was found.
fn findings_in_both_themes(page: &mut BrowserPage, place: &str) -> Vec<String> {
    let mut broken = Vec::new();
    for theme in ["dark", "light"] {
        if page.value("document.documentElement.dataset.theme") != json!(theme) {
            page.key("t", 84);
        }
        page.value("new Promise(done => setTimeout(done, 700))");
        broken.extend(findings(page).into_iter().map(|found| format!("{place}, {theme}: {found}")));
    }
    broken
}

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

#[test]
#[ignore = "fetches axe-core and takes minutes; .ci/run runs it"]
fn no_room_of_the_page_breaks_a_serious_rule_and_the_keyboard_alone_suffices() {
    let Some(browser) = Browser::start() else { return };
    let Some(axe) = axe() else {
        println!("SKIPPED ALOUD: {AXE} cannot be had with npm on this machine");
        return;
    };
    let (instance, folder) = (instance_name("access"), TempFolder::new("access"));
    let recording = folder.file("run.mcap");
    let lab = folder.file("lab");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let console = Console::of(&mut server);
    wait_for_motion(&instance, &recording);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    page.value(&axe);
    let mut broken = Vec::new();
    for (key, tab) in [("1", "operate"), ("2", "latency"), ("4", "recordings"), ("3", "lab")] {
        page.key(key, u32::from(key.as_bytes()[0]));
        page.wait_for("the key opens the room", &format!("document.documentElement.dataset.tab === '{tab}'"));
        broken.extend(findings_in_both_themes(&mut page, tab));
    }
    for (act, what, is_there) in QUIZ {
        page.value(&format!("{act}; 0"));
        page.wait_for(what, is_there);
        broken.extend(findings_in_both_themes(&mut page, what));
    }
    assert!(broken.is_empty(), "{broken:#?}");
    page.key("1", u32::from(b'1'));

    // Every button of the room in front can be reached by Tab, and shows that it has the focus.
    let visible = "[...document.querySelectorAll('button, select, input, a[href]')].filter(e => !e.disabled && e.offsetParent !== null && e.tabIndex >= 0)";
    let n = page.value(&format!("{visible}.length")).as_u64().expect("a number");
    assert!(n > 5, "{n} controls");
    page.value("document.activeElement.blur(); window.reached = new Set(); document.addEventListener('focusin', event => { window.reached.add(event.target); }); 0");
    for _ in 0..3 * n {
        page.key("Tab", 9);
    }
    let missed =
        page.value(&format!("{visible}.filter(e => !window.reached.has(e)).map(e => e.outerHTML.slice(0, 120))"));
    assert_eq!(missed, json!([]), "not reached by Tab");

    // The stop is a document of its own.
    let mut stop = browser.page(&console.stop, 600, 400);
    stop.wait_for("the stop is there", "document.querySelector('button') !== null");
    stop.value(&axe);
    let found = findings(&mut stop);
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
