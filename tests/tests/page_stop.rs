//! The stop in its own frame works by mouse and by key while the page around it is cut off or hangs, by finger while it is cut off, and
//! its form without any script; a command that is held up on its way runs nothing. What the slave says of itself decides, and no time does. Skipped aloud where there is no Chromium.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::message::{OperatingState, SlaveState, StateRequest};
use krait_ipc::{Bus, ReadOptions};
use krait_tests::{
    Browser, BrowserPage, Console, CuttableWay, Ended, Krait, WayCut, instance_name, is_moving, signal_process,
    wait_for, wait_until,
};
use rustix::process::Signal;
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(240);
const FOLLOWS: &str = "document.documentElement.dataset.shown === 'following'";
/// A command counts for half a second, and the page waits four for its answer.
const LONGER_THAN_IT_COUNTS: Duration = Duration::from_millis(800);
/// Begins a loop that ends after longer than a command counts.
const HANG_FOR_A_WHILE: &str = "setTimeout(() => {
    const ask = new XMLHttpRequest();
    ask.open('GET', '/hangs-for-a-while', false);
    try { ask.send(); } finally { for (const from = performance.now(); performance.now() < from + 1500;); }
}, 0); 0";
/// A page that hangs has not answered after this long, and never will.
const HANGS_FOR: Duration = Duration::from_secs(1);

/// Begins a loop without an end on the page's main thread, and asks for an address first that the way to the console can see.
const HANG: &str = "setTimeout(() => {
    const ask = new XMLHttpRequest();
    ask.open('GET', '/hangs', false);
    try { ask.send(); } finally { for (;;); }
}, 0); 0";

/// Takes the focus to the page's body, or into a field of this kind that is made for it.
const FOCUS: &str = "(place => {
    window.focus();
    document.activeElement?.blur();
    if (window.field !== document.body) window.field?.remove();
    window.field = place === 'body' ? document.body : Object.assign(document.createElement('input'), { type: place });
    if (place !== 'body') { document.body.append(field); field.focus(); }
    return document.activeElement === field;
})('PLACE')";

/// How the operator stops.
#[derive(Debug)]
enum Stops {
    Mouse,
    Finger,
    Escape,
    Enter,
    Space,
}

#[test]
fn the_stop_works_while_the_live_connection_is_silent() {
    stops_while(Some(WayCut::Silent));
}

#[test]
fn the_stop_works_while_the_live_connection_is_closed() {
    stops_while(Some(WayCut::Closed));
}

#[test]
fn the_stop_works_while_the_page_is_in_an_endless_loop() {
    stops_while(None);
}

/// The session of the stop's own document, which is loaded and painted: until it has been painted where it stands, the browser asks the
/// page who is pressed.
fn stop_there(page: &mut BrowserPage, console: &Console) -> String {
    let stop = page.inner("iframe");
    let loaded = format!("document.readyState === 'complete' && location.pathname === '{}'", console.stop_path());
    let is_loaded = wait_until(PATIENCE, || page.value_in(&stop, &loaded) == true);
    assert!(is_loaded, "the stop's own document");
    page.painted_in(&stop);
    page.painted();
    stop
}

/// A chain that moves, a page with a way of its own to its console, and that way cut; without a cut the page hangs.
fn stops_while(cut: Option<WayCut>) {
    let instance = instance_name("page-stop");
    let mut krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--console", "--no-recording"]);
    let console = Console::of(&mut krait);
    let relay = CuttableWay::to(console.port);
    let Some(browser) = Browser::start_by_way_of(&relay) else { return };
    let mut page = browser.page(&console.address, 1280, 800);
    page.call("Emulation.setTouchEmulationEnabled", &json!({ "enabled": true, "maxTouchPoints": 1 }));
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    assert!(relay.was_asked("GET /live"), "the page came by its own way");
    let place = place_of_stop(&mut page);
    let stop = stop_there(&mut page, &console);
    // Keys go to the stop from here on: a page that hangs could not hand them on.
    page.value("document.getElementById('stop').focus(); 0");
    page.value_in(&stop, "document.getElementById('stop').focus(); 0");
    match cut {
        Some(how) => {
            relay.cut(how);
            page.wait_for("the page is cut off", "document.documentElement.dataset.shown === 'stale'");
        }
        None => {
            page.value(HANG);
            assert!(wait_until(PATIENCE, || relay.was_asked("GET /hangs")), "the page begins to hang");
        }
    }
    // The browser's debugger hands a finger on only once the page has answered: on one that hangs none can be tried.
    let mut ways = vec![Stops::Mouse, Stops::Escape];
    ways.extend(cut.map(|_| Stops::Finger));
    ways.extend([Stops::Enter, Stops::Space]);
    for way in ways {
        let n_before = wait_for(&instance, "moving", is_moving).n_stops;
        match way {
            Stops::Mouse => page.press(place[0], place[1]),
            Stops::Finger => {
                page.touch("touchStart", &[place]);
                page.touch("touchEnd", &[]);
            }
            Stops::Escape => page.key("Escape", 27),
            Stops::Enter => [true, false].into_iter().for_each(|is_down| page.key_half(is_down, "Enter", 13)),
            Stops::Space => [true, false].into_iter().for_each(|is_down| page.key_half(is_down, " ", 32)),
        }
        wait_for(&instance, &format!("stopped by {way:?} with {cut:?}"), |state| {
            state.n_stops > n_before && state.operating() == Some(OperatingState::Paused)
        });
        let resumed = Ended::of(&["state", "resume", "--instance", &instance], PATIENCE);
        assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    }
    let patience = if cut.is_some() { PATIENCE } else { HANGS_FOR };
    assert_eq!(page.answers_within(patience), cut.is_some(), "a page that is cut off lives, one in a loop hangs");
    if cut == Some(WayCut::Closed) {
        stops_without_script(&browser, &console, &instance);
    }
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// A command that is held up on its way for longer than it counts, and one whose connection is lost with it: nothing runs, also not after
/// the page has connected anew, and the page says what became of each.
#[test]
fn a_command_that_is_held_up_on_its_way_runs_nothing_and_the_page_says_so() {
    let instance = instance_name("page-held");
    let mut krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--console", "--no-recording"]);
    let console = Console::of(&mut krait);
    let relay = CuttableWay::to(console.port);
    let Some(browser) = Browser::start_by_way_of(&relay) else { return };
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the snake follows", FOLLOWS);
    page.wait_for("the clocks are joined", "/ ms$/.test(document.querySelector('#fact-live b')?.textContent ?? '')");
    let bus = Bus::open(&instance, "test").expect("a bus");
    let mut requests = bus.reader::<StateRequest>(ReadOptions::observing()).expect("requests");
    let before = wait_for(&instance, "moving", is_moving);
    while requests.take().expect("readable").is_some() {}

    relay.cut(WayCut::Held);
    press_pause(&mut page);
    std::thread::sleep(LONGER_THAN_IT_COUNTS);
    relay.open();
    page.wait_for("it came too late", &says("Pause: Not done: it came too late."));

    relay.cut(WayCut::Held);
    press_pause(&mut page);
    relay.cut(WayCut::Closed);
    page.wait_for("the page is cut off", "document.documentElement.dataset.shown === 'stale'");
    relay.open();
    page.wait_for("it has connected anew", FOLLOWS);
    page.wait_for("nothing came back", &says("Pause: no answer"));

    // A page that hangs hears of the press when it has got over that: the press is what is too late then.
    page.value(HANG_FOR_A_WHILE);
    assert!(wait_until(PATIENCE, || relay.was_asked("GET /hangs-for-a-while")), "the page begins to hang");
    // A key: of a click the debugger sends the second half when the page has heard of the first.
    page.key("p", 80);
    page.wait_for("it was pressed too long ago", &says("Pause: Not done: it came too late."));
    page.wait_for("the page follows again", FOLLOWS);

    // What comes late is no picture, however much of it comes.
    relay.cut(WayCut::Late);
    page.wait_for("the way is late", "document.documentElement.dataset.shown === 'stale' && /late, because the way/.test(document.getElementById('blank-text').textContent)");
    relay.open();
    page.wait_for("pictures are in time again", FOLLOWS);

    assert!(requests.take().expect("readable").is_none(), "nothing was asked for");
    let after = wait_for(&instance, "moving still", is_moving);
    let counts = |state: &SlaveState| (state.state_command_sequence, state.n_stops, state.operating_state);
    assert_eq!(counts(&after), counts(&before));
    // The same button with the way open.
    let asked = wait_until(PATIENCE, || {
        page.value("document.querySelector('.command[data-wish=pause]')?.click(); 0");
        requests.take().expect("readable").is_some()
    });
    assert!(asked, "it asks for a pause");
    wait_for(&instance, "paused", |state| state.operating() == Some(OperatingState::Paused));
    drop((requests, bus));
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

fn press_pause(page: &mut BrowserPage) {
    page.value("document.querySelector('.command[data-wish=pause]').click(); 0");
    assert_eq!(page.text("#ack-title"), "Pause sent");
}

/// Whether this is the newest that the page says of a command.
fn says(title: &str) -> String {
    format!("document.getElementById('ack-title').textContent === '{title}'")
}

/// Escape on a page that works, where STOP has not the keyboard: with the focus nowhere, and in fields that have uses of their own for keys.
#[test]
fn escape_stops_with_the_focus_on_the_page_itself_and_in_its_fields() {
    let Some(browser) = Browser::start() else { return };
    let instance = instance_name("page-escape");
    let mut krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--console", "--no-recording"]);
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    stop_there(&mut page, &console);
    for place in ["body", "text", "number", "range"] {
        let n_before = wait_for(&instance, "moving", is_moving).n_stops;
        let has_focus = page.value(&FOCUS.replace("PLACE", place));
        assert_eq!(has_focus, true, "the focus is there: {place}");
        page.key("Escape", 27);
        wait_for(&instance, &format!("stopped by Escape, focus: {place}"), |state| {
            state.n_stops > n_before && state.operating() == Some(OperatingState::Paused)
        });
        let resumed = Ended::of(&["state", "resume", "--instance", &instance], PATIENCE);
        assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    }
    // A console that stands still: nothing confirms the stop, and whoever pressed is told so; it is done as soon as the console goes on.
    let stop = page.inner("iframe");
    let n_before = wait_for(&instance, "moving", is_moving).n_stops;
    signal_process(&instance, "console", Signal::STOP);
    page.key("Escape", 27);
    let is_told = "document.getElementById('say').textContent.includes('does not answer. Use the machine')";
    assert!(wait_until(PATIENCE, || page.value_in(&stop, is_told) == true), "nothing is confirmed, and that is said");
    assert_eq!(wait_for(&instance, "moving still", is_moving).n_stops, n_before);
    signal_process(&instance, "console", Signal::CONT);
    wait_for(&instance, "stopped by the console that goes on", |state| state.n_stops > n_before);
    let is_confirmed = "document.getElementById('say').textContent.includes('the drives confirmed it')";
    assert!(wait_until(PATIENCE, || page.value_in(&stop, is_confirmed) == true), "the later answer is shown");
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// The stop's own document in a browser that runs no script: its form is sent, and the document that comes back says what became of it.
fn stops_without_script(browser: &Browser, console: &Console, instance: &str) {
    let mut page = browser.page("about:blank", 600, 400);
    page.call("Emulation.setScriptExecutionDisabled", &json!({ "value": true }));
    page.call("Page.navigate", &json!({ "url": console.stop }));
    page.wait_for("the stop", "document.getElementById('stop') !== null && document.readyState === 'complete'");
    // Of the document that is there before; that of the answer is another one.
    page.value("document.documentElement.id = 'before'; 0");
    let n_before = wait_for(instance, "moving", is_moving).n_stops;
    page.press(300.0, 200.0);
    wait_for(instance, "stopped by the form alone", |state| {
        state.n_stops > n_before && state.operating() == Some(OperatingState::Paused)
    });
    page.wait_for(
        "it says so",
        "document.documentElement.id === '' && document.getElementById('say').textContent.includes('the drives confirmed it')",
    );
}

/// The middle of the stop's frame.
fn place_of_stop(page: &mut BrowserPage) -> [f64; 2] {
    let place = page.value("(frame => [frame.x + frame.width / 2, frame.y + frame.height / 2])(document.getElementById('stop').getBoundingClientRect())");
    [0, 1].map(|at| place[at].as_f64().expect("a place"))
}
