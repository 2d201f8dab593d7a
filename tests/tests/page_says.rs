//! What the page says is whole and true: every reason can be read in its card, and "Verified" is what was verified.
//! Skipped aloud where there is no Chromium.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::Reason;
use krait_ipc::message::{DeviceState, OperatingState, OperatorInput, Phase, SlaveState};
use krait_schema::Sample;
use krait_tests::{
    Browser, BrowserPage, ChainScene, ChainSender, Console, Ended, Krait, TempFolder, bars_shown, instance_name,
    needs_shown, next_of_kind, processes_of, rewrite, wait_until,
};
use rustix::process::Signal;
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(240);
const SIZES: [(u32, u32); 3] = [(1280, 800), (1024, 768), (1920, 1080)];

/// How far each card of the side column holds more than it shows, and whether what shows the state's reasons lies within it.
const CUT: &str = "(() => {
    const cards = [...document.querySelectorAll('.side > .card')].filter(card => card.clientHeight);
    const cut = cards.filter(card => card.scrollHeight > card.clientHeight || card.scrollWidth > card.clientWidth);
    const end = document.querySelector('.why').getBoundingClientRect().bottom;
    const below = [...document.querySelectorAll('#reasons li')].filter(row => row.getBoundingClientRect().bottom > end);
    const foot = document.querySelector('.foot').getBoundingClientRect().top;
    const under = cards.filter(card => card.getBoundingClientRect().bottom > foot);
    const wide = [...document.querySelectorAll('.big > div')].filter(row => row.scrollWidth > row.clientWidth);
    const name = element => `${element.className} ${element.scrollHeight} of ${element.clientHeight}: ${element.textContent}`;
    return [...cut, ...below, ...under, ...wide].map(name).join('; ');
})()";

/// Whether the card of the reasons says these, and no others.
fn are_reasons(says: &[impl AsRef<str>]) -> String {
    let says: Vec<&str> = says.iter().map(AsRef::as_ref).collect();
    let shown = "[...document.querySelectorAll('#reasons span')].map(span => span.textContent)";
    format!("JSON.stringify({shown}) === JSON.stringify({})", json!(says))
}

/// Those of some sentences for which the banner's line of the worst one is too short, with "+9" behind each.
fn too_wide(page: &mut BrowserPage, says: &[String]) -> serde_json::Value {
    page.value(&format!(
        "(() => {{
            const line = document.getElementById('worst'), kept = line.innerHTML;
            const wide = {}.filter(say => {{
                line.children[1].textContent = say;
                line.children[2].textContent = '+9';
                return line.children[2].getBoundingClientRect().right > line.getBoundingClientRect().right;
            }});
            line.innerHTML = kept;
            return wide;
        }})()",
        json!(says)
    ))
}

/// The longest sentences of the chain, three at a time, as drives say them: none is cut, none is left out, and no other card is
/// pushed off for them. More than there is room for are counted. The worst one stands in the banner too, and each fits into its line.
#[test]
fn three_reasons_are_read_whole_at_every_size_and_more_are_counted() {
    let Some(browser) = Browser::start() else { return };
    let instance = instance_name("reasons");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let hello = next_of_kind(&mut console.page(), "hello");
    let of = |reason: &Reason| {
        let named =
            hello["reasons"].as_array().expect("reasons").iter().find(|named| named["name"] == format!("{reason:?}"));
        named.and_then(|named| named["say"].as_str()).expect("a sentence").to_owned()
    };
    let level = |reason: &Reason| {
        let named =
            hello["reasons"].as_array().expect("reasons").iter().find(|named| named["name"] == format!("{reason:?}"));
        let level = named.and_then(|named| named["level"].as_str()).expect("a level");
        ["fault", "warn", "hold", "info"].iter().position(|own| *own == level).expect("a level that is known")
    };
    let mut reasons = Reason::ALL.to_vec();
    reasons.sort_by_key(|reason| core::cmp::Reverse(of(reason).chars().count()));
    let sender = ChainSender::start(&instance);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("a fault", "document.documentElement.dataset.shown === 'fault'");
    for three in reasons[..12].chunks(3) {
        sender.say_fault(SlaveState::failed_drive_flags(2), three);
        // Worst first: what failed, what needs attention, what holds still because it shall, what is good to know. One level by number.
        let mut worst_first = three.to_vec();
        worst_first.sort_by_key(|reason| (level(reason), *reason as u32));
        let says: Vec<String> = worst_first.iter().map(of).collect();
        let are_shown = are_reasons(&says);
        let n_others = three.iter().filter(|reason| level(reason) < 3).count().saturating_sub(1);
        let n_more = if n_others > 0 { format!("+{n_others}") } else { String::new() };
        for (width, height) in SIZES {
            page.resize(width, height);
            for theme in ["dark", "light"] {
                page.in_theme(theme);
                page.wait_for(&format!("all three at {width}: {says:?}"), &are_shown);
                page.painted();
                assert_eq!(page.value(CUT), json!(""), "{width} x {height}, {theme}: {says:?}");
                assert_eq!(page.text("#why-more"), "", "{width} x {height}, {theme}: {says:?}");
                assert_eq!(page.text("#worst span"), says[0], "{width} x {height}, {theme}");
                assert_eq!(page.text("#worst b"), n_more, "{width} x {height}, {theme}: {says:?}");
                page.keep(&format!("reasons-{theme}-{width}"));
            }
        }
    }
    let all: Vec<String> = reasons.iter().map(of).collect();
    for (width, height) in SIZES {
        page.resize(width, height);
        assert_eq!(too_wide(&mut page, &all), json!([]), "at {width}");
    }
    assert_ne!(too_wide(&mut page, &["W".repeat(60)]), json!([]), "what is too wide is seen");
    page.resize(1024, 768);
    sender.say_fault(SlaveState::failed_drive_flags(2), &reasons[..9]);
    page.wait_for(
        "what there is no room for is counted",
        "document.querySelectorAll('#reasons li').length + Number(/^and ([0-9]+) more$/.exec(document.getElementById('why-more').textContent)?.[1]) === 9",
    );
    assert_eq!(page.value(CUT), json!(""), "nine reasons");
    page.keep("reasons-nine");
    drop(sender);
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// What the operator has chosen at the hand is no reason to hold, and is said beside the reasons while the drives are enabled.
#[test]
fn the_scale_and_the_locks_of_the_hand_are_said_while_the_drives_are_enabled() {
    let Some(browser) = Browser::start() else { return };
    let instance = instance_name("hand-says");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let sender = ChainSender::start(&instance);
    let mut page = browser.page(&console.address, 1024, 768);
    sender.say_fault(SlaveState::failed_drive_flags(2) | SlaveState::HARDWARE_STOP, &[Reason::DriveFault]);
    let row = ["bad cut off", "unknown unknown", "unknown unknown", " \u{2013}"];
    wait_for_row(&mut page, "nothing but the drives has spoken", row);
    let locks = OperatorInput::TRANSLATION_LOCKED | OperatorInput::ROTATION_LOCKED;
    let scale = "The hand moves the tip at 0.25 of the configured speed.";
    let [translation, rotation] =
        ["translation", "rotation"].map(|what| format!("No {what} is taken from the hand: it is locked."));
    for (operating, flags, scale_permille, expected) in [
        (OperatingState::Enabled, 0, 1000, vec!["Nothing."]),
        (OperatingState::Enabled, 0, 250, vec!["Nothing.", scale]),
        (OperatingState::Enabled, 0, 700, vec!["Nothing.", "The hand moves the tip at 0.7 of the configured speed."]),
        (OperatingState::Enabled, OperatorInput::ROTATION_LOCKED, 250, vec!["Nothing.", scale, &rotation]),
        (OperatingState::Enabled, locks, 0, vec!["Nothing.", &translation, &rotation]),
        (OperatingState::Paused, locks, 250, vec!["Paused."]),
    ] {
        let scene = ChainScene::of(operating, SlaveState::IS_HOMED | SlaveState::ENGAGED, &[]);
        let mut scene = scene.driven(OperatorInput::OPERATOR_PRESENT | flags, DeviceState::Live, Phase::Following);
        scene.input.as_mut().expect("an input").scale_permille = scale_permille;
        sender.say(scene);
        page.wait_for(&format!("{operating:?}, {scale_permille} permille: {expected:?}"), &are_reasons(&expected));
        assert_eq!(page.value(CUT), json!(""), "{expected:?}");
    }
    the_row_and_the_bars_say_what_the_chain_says(&mut page, &sender);
    drop(sender);
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// Waits until the row of what following needs has these classes and words.
fn wait_for_row(page: &mut BrowserPage, what: &str, expected: [&str; 4]) {
    let mut shown = Vec::new();
    let is_shown = wait_until(PATIENCE, || {
        shown = needs_shown(page).map(|[class, word, _]| format!("{class} {word}")).to_vec();
        shown == expected
    });
    assert!(is_shown, "{what}: {shown:?}, expected {expected:?}");
}

/// The row of what following needs in each of its words, yes and no told apart by their marks; the bars at and beyond their limits, in the
/// colours of the backbones, and a load that nobody measures.
fn the_row_and_the_bars_say_what_the_chain_says(page: &mut BrowserPage, sender: &ChainSender) {
    use OperatingState::{Disabled, Enabled, Fault, Paused};
    let homed = SlaveState::IS_HOMED;
    let scene = |operating, slave, operator, device| {
        ChainScene::of(operating, slave, &[]).driven(operator, device, Phase::Holding)
    };
    let (present, live) = (OperatorInput::OPERATOR_PRESENT, DeviceState::Live);
    let mut slow = scene(Enabled, homed, present, live);
    slow.setpoint.as_mut().expect("a setpoint").motion_scale = 0.374;
    let mut marks = Vec::new();
    for (scene, drives, operator, clutch, motion) in [
        (scene(Fault, 0, present, live), "bad fault", " present", " released", " 100 %"),
        (scene(Disabled, homed, present, live), " disabled", " present", " released", " 100 %"),
        (scene(Enabled, SlaveState::IS_BUSY, present, live), " homing", " present", " released", " 100 %"),
        (scene(Enabled, 0, present, live), " not homed", " present", " released", " 100 %"),
        (scene(Paused, homed, present, live), " paused", " present", " released", " 100 %"),
        (scene(Enabled, homed, present, live), " enabled", " present", " released", " 100 %"),
        (slow, " enabled", " present", " released", " 37 %"),
        (scene(Paused, homed, OperatorInput::CLUTCH, live), " paused", " absent", " pressed", " 100 %"),
        (scene(Enabled, homed, present, DeviceState::Lost), " enabled", "odd lost", " released", " 100 %"),
    ] {
        sender.say(scene);
        wait_for_row(page, &format!("{:?}", scene.state), [drives, operator, clutch, motion]);
        marks.push(needs_shown(page).map(|[_, _, mark]| mark));
    }
    // Enabled, present, released; paused, absent, pressed.
    let [yes, no] = [&marks[5], &marks[7]];
    for k in 0..3 {
        assert!(!yes[k].is_empty() && !no[k].is_empty() && yes[k] != no[k], "told apart without colour: {marks:?}");
    }

    let mut beyond = scene(Enabled, homed, present, live);
    let state = beyond.state.as_mut().expect("a state");
    state.measured_q_m[..3].copy_from_slice(&[1.0, -1.0, 0.0]);
    state.measured_tau_n[..3].copy_from_slice(&[-1e4, f64::NAN, 0.0]);
    sender.say(beyond);
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    page.wait_for(
        "a load that nobody measures",
        "[...document.querySelectorAll('#bars .newton')].map(own => own.textContent)[1] === 'not measured'",
    );
    let shown = bars_shown(page);
    for (k, (bar, position, load, mm)) in [
        (&shown[0], [0.5, 1.0], 1.0, "+1000.00"),
        (&shown[1], [0.0, 0.5], 0.0, "\u{2212}1000.00"),
        (&shown[2], [0.5, 0.5], 0.0, "\u{2007}0.00"),
    ]
    .into_iter()
    .enumerate()
    {
        assert_eq!((&bar["name"], &bar["mm"]), (&json!((k + 1).to_string()), &json!(mm)), "{bar}");
        for (end, expected) in position.into_iter().enumerate() {
            assert!((number(&bar["position"][end]) - expected).abs() < 0.02, "at its limit, not beyond: {bar}");
        }
        assert!((number(&bar["load"]) - load).abs() < 0.02 && bar["told"].is_null(), "{bar}");
        let colour = format!(
            "(hex => `rgb(${{[1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16)).join(', ')}})`)(getComputedStyle(document.documentElement).getPropertyValue('--line-{}').trim())",
            k + 1
        );
        let own = page.value(&colour);
        assert_eq!(bar["colours"], json!([own, own, own]), "the colour of its backbone: {bar}");
    }
}

/// A recording as it was made, one with a command that is another by one bit, one with an input too few, and none at all.
#[test]
fn verify_on_the_page_tells_the_same_from_another_from_what_nobody_knows() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("verdict"), TempFolder::new("verdict"));
    let shipped = format!("{}/recordings/flick.mcap", env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(&shipped, folder.file("same.mcap")).expect("copied");
    rewrite(&shipped, &folder.file("bit.mcap"), |sample| match sample {
        Sample::Command(command) if command.sequence == 400 => {
            command.q_tilde_m[1] = f64::from_bits(command.q_tilde_m[1].to_bits() ^ 1);
        }
        _ => {}
    });
    rewrite(&shipped, &folder.file("gap.mcap"), |sample| match sample {
        Sample::Input(input) if input.sequence == 300 => input.sequence = 299,
        _ => {}
    });
    let (recordings, lab) = (folder.path().display().to_string(), folder.file("lab"));
    let mut krait = Krait::start(&["console", "--instance", &instance, "--recordings", &recordings, "--lab", &lab]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the page is there", "location.hash === '' && document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=recordings]').click()");
    page.wait_for("the list", "document.querySelectorAll('#recordings tbody tr').length === 3");
    press_verify(&mut page);
    page.wait_for(
        "nothing is chosen",
        "document.querySelector('.verdict-says').textContent.includes('Choose a recording')",
    );
    for (name, mark, verdict, why) in [
        (
            "same",
            "ok",
            "Verified. same: ",
            "setpoints, [0-9\u{202f}]+ commands and [0-9]+ model updates came out of fresh processes byte for byte[.]$",
        ),
        (
            "bit",
            "fault",
            "Differs. bit: First in output 400 of compensate, run 1: q_tilde_m was ",
            "message.* before it came out the same",
        ),
        ("gap", "warn", "Could not be verified. gap: ", "message 300 of channel \"input\""),
    ] {
        page.value(&format!("document.querySelector('#recordings tr[data-name=\"{name}.mcap\"] button').click()"));
        page.wait_for(
            "it is chosen",
            &format!("document.querySelector('#recordings tr.chosen')?.dataset.name === '{name}.mcap'"),
        );
        press_verify(&mut page);
        page.wait_for(
            "a verdict",
            "/^(Verified|Differs|Could not)/.test(document.querySelector('.verdict-says').textContent)",
        );
        let said = page.text(".verdict-says");
        assert!(said.starts_with(verdict), "{name}: {said}");
        assert_eq!(
            page.value(&format!("new RegExp({}).test({})", json!(why), json!(said))),
            json!(true),
            "{name}: {said}"
        );
        assert_eq!(page.value("document.querySelector('.verdict-says i').className"), json!(mark), "{name}: {said}");
        let is_cut = "(says => says.scrollHeight > says.clientHeight || says.scrollWidth > says.clientWidth)(document.querySelector('.verdict-says'))";
        assert_eq!(page.value(is_cut), json!(false), "{name}: {said}");
        page.keep(&format!("verdict-{name}"));
    }
    // What is no answer of a verification is never taken for one.
    let strange = "import('/js/verdict.js').then(({ verdictOf }) => [{}, null, { identical: true }, { setpoints_identical: 9 },
        { setpoints_identical: 0, commands_identical: 0, updates_identical: 0, not_repeated: 0, behind_cut: 0, first_difference: null, missing: [] },
        { setpoints_identical: 9, commands_identical: 9, updates_identical: 0, not_repeated: 2, behind_cut: 0, first_difference: null, missing: [] }]
        .map(answer => verdictOf({ stage: 'done', said: '', answer }).word).concat(['cancelled', 'failed', 'refused'].map(stage => verdictOf({ stage, said: '', answer: null }).word)))";
    assert_eq!(page.value(strange), json!(vec!["Could not be verified."; 9]));
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

fn press_verify(page: &mut BrowserPage) {
    page.value(
        "[...document.querySelectorAll('#recordings button')].find(button => button.textContent === 'Verify').click()",
    );
}

/// A page that was open before its chain was started, without a machine named by anybody: it loads anew and shows the one that runs.
#[test]
fn a_page_that_was_there_before_its_chain_loads_anew_and_shows_that_machine() {
    const WRIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml");
    const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.csv");
    let Some(browser) = Browser::start() else { return };
    let instance = instance_name("later");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the default machine", "document.documentElement.dataset.machine === 'snake'");
    page.value("document.documentElement.id = 'before'; 0");
    let run = ["run", "--engage=again", "--master", "script", "--input", SCRIPT, "--model", WRIST, "--no-recording"];
    let chain = Krait::start(&[&run[..], &["--instance", &instance]].concat());
    page.wait_for(
        "the machine that came",
        "document.documentElement.id === '' && document.documentElement.dataset.machine === 'joints' \
         && document.documentElement.dataset.shown === 'following' && document.querySelector('#stop') !== null",
    );
    assert!(!page.text("#reasons").contains("another machine"), "{}", page.text("#reasons"));
    for program in [chain, krait] {
        program.signal(Signal::TERM);
        program.end(PATIENCE);
    }
}

/// A console with another configuration than the chain beside it: what it cannot draw keeps no sentence from being said, and one of them
/// is that.
#[test]
fn a_page_of_another_machine_says_so_and_goes_on_saying_what_holds_the_motion_back() {
    const WRIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml");
    const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.csv");
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("another"), TempFolder::new("another"));
    let config = folder.file("krait.toml");
    std::fs::write(&config, "[resolve]\nmax_bend_rad = 0.7\n").expect("written");
    let run = ["run", "--engage=again", "--master", "script", "--input", SCRIPT, "--model", WRIST, "--no-recording"];
    let chain = Krait::start(&[&run[..], &["--instance", &instance]].concat());
    let has_master = || processes_of(&instance).iter().any(|(name, _)| name == "master");
    assert!(wait_until(PATIENCE, has_master), "{:?}", processes_of(&instance));
    let mut krait = Krait::start(&["console", "--instance", &instance, "--config", &config]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    let says = "[...document.querySelectorAll('#reasons span')].map(span => span.textContent)";
    page.wait_for("it says so", &format!("{says}.includes('This page is of another machine.')"));
    page.wait_for("it follows", "document.documentElement.dataset.shown === 'following'");
    assert_eq!(too_wide(&mut page, &["This page is of another machine.".to_owned()]), json!([]), "in the banner");
    let paused = Ended::of(&["state", "pause", "--instance", &instance], PATIENCE);
    assert_eq!(paused.code, Some(0), "{}", paused.stderr);
    page.wait_for(
        "sentences follow the chain",
        "document.getElementById('need-drives').textContent.includes('paused')",
    );
    for program in [krait, chain] {
        program.signal(Signal::TERM);
        program.end(PATIENCE);
    }
}

/// Lines may bear 60 N and the gripper's wire 15 N: half of each fills half of its bar, and the sentence has the limit of the one it is of.
#[test]
fn the_load_of_a_grippers_wire_is_shown_by_its_own_limit() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("wire"), TempFolder::new("wire"));
    let config = folder.file("krait.toml");
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/gripper/snake.toml");
    std::fs::write(&config, format!("model = \"{model}\"\n")).expect("written");
    let mut krait = Krait::start(&["console", "--instance", &instance, "--config", &config]);
    let console = Console::of(&mut krait);
    let sender = ChainSender::start(&instance);
    let mut page = browser.page(&console.address, 1280, 800);
    let flags = SlaveState::IS_HOMED | SlaveState::ENGAGED | SlaveState::FOLLOWING;
    let scene = ChainScene::of(OperatingState::Enabled, flags, &[Reason::ForceLimit]);
    let mut scene = scene.driven(OperatorInput::OPERATOR_PRESENT, DeviceState::Live, Phase::Following);
    let state = scene.state.as_mut().expect("a state");
    state.n_actuators = 4;
    state.measured_tau_n[..4].copy_from_slice(&[-30.0, 30.0, 0.0, 7.5]);
    sender.say(scene);
    page.wait_for("its value", "document.getElementById('reasons').textContent.includes('Its wire: 8 of 15 N.')");
    page.wait_for(
        "its load",
        "[...document.querySelectorAll('#bars .newton')].map(own => own.textContent)[3] === '+7.5 N'",
    );
    let shown = bars_shown(&mut page);
    assert_eq!(shown.len(), 4, "{shown:?}");
    for (bar, (name, load)) in shown.iter().zip([("1", 0.5), ("2", 0.5), ("3", 0.0), ("J", 0.5)]) {
        assert_eq!(bar["name"], name, "{bar}");
        assert!((bar["load"].as_f64().expect("a number") - load).abs() < 0.02, "{bar}");
    }
    drop(sender);
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// The unit of a model file and the name of an effect are any text: the lab's bars write it as it stands, and make nothing of it.
#[test]
fn a_unit_or_a_name_in_the_labs_bars_is_text_and_never_markup() {
    let Some(browser) = Browser::start() else { return };
    let mut krait = Krait::start(&["console", "--instance", &instance_name("markup")]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the page is there", "location.hash === ''");
    let seen = page.value(
        "import('/js/waterfall.js').then(({ waterfall }) => {
            const [bars, says] = [document.createElement('div'), document.createElement('p')], odd = '</text></svg><b>N</b>';
            waterfall(bars, says, [{ name: '<b>play</b>', value: 1.5 }], odd);
            const value = bars.querySelector('text.value'), name = [...bars.querySelectorAll('text.name')];
            return [bars.querySelectorAll('b').length, value.textContent === `1.50${odd}`, name.map(own => own.textContent).join('')];
        })",
    );
    assert_eq!(seen, json!([0, true, "<b>play</b>"]));
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}
