//! The page in a real Chromium: what a person sees and presses. Skipped aloud where there is no Chromium.
//!
//! With KRAIT_SHOTS=FOLDER the pictures of every size and theme are kept there.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::Reason;
use krait_ipc::message::{DeviceState, OperatingState, OperatorInput, Phase, Shape, SlaveState};
use krait_tests::{
    Browser, BrowserPage, ChainScene, ChainSender, Console, Ended, Krait, Scrolls, TempFolder, canvas_points,
    instance_name, next_of_kind, wait_for, wait_until,
};
use rustix::process::Signal;
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(240);
const SIZES: [(u32, u32); 3] = [(1920, 1080), (1280, 800), (1024, 768)];

#[test]
fn a_person_sees_the_robot_stops_it_from_a_page_that_hangs_and_goes_on() {
    let Some(browser) = Browser::start() else { return };
    let instance = instance_name("page");
    let mut krait = Krait::start(&["run", "--instance", &instance, "--engage=again", "--console", "--no-recording"]);
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    page.wait_for("the word says so", "document.getElementById('word').textContent === 'Following'");
    assert_eq!(page.value("location.hash"), json!(""), "the token leaves the address bar");
    page.wait_for("the bend is a number", "/^[0-9.]+°$/.test(document.getElementById('bend-now').textContent)");
    page.wait_for("the stop is there", "document.getElementById('stop') !== null");

    for (width, height) in SIZES {
        for theme in ["dark", "light"] {
            page.resize(width, height);
            page.value(&format!(
                "if (document.documentElement.dataset.theme !== '{theme}') document.getElementById('theme').click()"
            ));
            for tab in ["operate", "latency", "lab", "recordings"] {
                page.value(&format!("document.querySelector('[data-go={tab}]').click()"));
                page.value("new Promise(done => setTimeout(done, 700))");
                let scrolls = if tab == "operate" { Scrolls::Nowhere } else { Scrolls::Within };
                page.keep_right(&format!("{tab}-{theme}-{width}"), scrolls);
                if tab == "operate" {
                    assert_readable_at_two_metres(&mut page, width);
                }
                page.wait_for(
                    &format!("{tab} fits into {width} x {height}"),
                    "document.documentElement.scrollWidth <= innerWidth && document.documentElement.scrollHeight <= innerHeight",
                );
            }
            assert_contrast(&mut page, theme);
        }
    }
    page.value("document.querySelector('[data-go=operate]').click()");

    // The page hangs; its stop is another document of another origin and works.
    let place = page.value("(() => { const r = document.getElementById('stop').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()");
    let mut seen = console.page();
    page.value("setTimeout(() => { const end = performance.now() + 8000; while (performance.now() < end); }, 50); 0");
    std::thread::sleep(Duration::from_millis(300));
    page.press(place[0].as_f64().expect("x"), place[1].as_f64().expect("y"));
    assert!(
        wait_until(Duration::from_secs(7), || next_of_kind(&mut seen, "frame")["shown"] == "paused"),
        "while it hangs"
    );
    page.wait_for("the page says so", "document.documentElement.dataset.shown === 'paused'");
    page.keep("paused");

    // By key, although the stop has the keyboard: the commands, acknowledged by the drives' own state.
    page.wait_for(
        "resume is offered",
        "document.querySelector('.command[data-wish=resume][aria-disabled=false]') !== null",
    );
    page.key("p", 80);
    page.wait_for("resumed", "document.getElementById('ack-title').textContent.startsWith('Resumed')");
    page.wait_for(
        "pause is offered",
        "document.querySelector('.command[data-wish=pause][aria-disabled=false]') !== null",
    );
    page.key("p", 80);
    page.wait_for("paused by key", "document.getElementById('ack-title').textContent.startsWith('Paused')");
    // The page's own keys too.
    for (key, room) in [("4", "recordings"), ("1", "operate")] {
        page.key(key, u32::from(key.as_bytes()[0]));
        page.wait_for(room, &format!("document.documentElement.dataset.tab === '{room}'"));
    }

    // Power off and on again, by button and by key; the operator, who is seen anew each time, is followed again.
    for by_key in [false, true] {
        command(&mut page, "disable", by_key.then_some("d"), &OFF);
        page.wait_for("off", "document.documentElement.dataset.shown === 'disabled'");
        command(&mut page, "enable", by_key.then_some("e"), &["Enabled \u{2013} confirmed by the drives."]);
        page.wait_for("it follows again", "document.documentElement.dataset.shown === 'following'");
    }

    krait.signal(Signal::TERM);
    page.wait_for("a picture that is not live is not shown", "!document.getElementById('blank').hidden");
    page.wait_for("since when", "document.getElementById('blank-title').textContent.startsWith('No picture since')");
    page.keep("stale");
    krait.end(PATIENCE);
    let complaints: Vec<_> =
        page.complaints.iter().filter(|said| !said.contains("ERR_CONNECTION") && !said.contains("WebSocket")).collect();
    assert!(complaints.is_empty(), "{complaints:?}");
}

/// What is said of a disable: where lines are loaded, power goes a moment later.
const OFF: [&str; 2] = ["Disabled \u{2013} confirmed by the drives.", "Relaxing, then power goes off."];

/// Presses a command that is offered, by its button or by its key, and waits for one of the answers that the page may give.
fn command(page: &mut BrowserPage, wish: &str, key: Option<&str>, answers: &[&str]) {
    let button = format!("document.querySelector('.command[data-wish={wish}][aria-disabled=false]')");
    page.wait_for(&format!("{wish} is offered"), &format!("{button} !== null"));
    match key {
        Some(key) => page.key(key, u32::from(key.to_ascii_uppercase().as_bytes()[0])),
        None => {
            let place = page
                .value(&format!("(r => [r.x + r.width / 2, r.y + r.height / 2])({button}.getBoundingClientRect())"));
            let [x, y] = [0, 1].map(|axis| place[axis].as_f64().expect("a place"));
            page.press(x, y);
        }
    }
    let is_told = format!("{}.includes(document.getElementById('ack-title').textContent)", json!(answers));
    page.wait_for(&format!("{wish}: {answers:?}"), &is_told);
}

/// Minutes of arc that the capitals of a letter of one pixel have at two metres, on a 24-inch screen of 1920 x 1080 (0.277 mm a pixel),
/// in the font of the page's list whose capitals are lowest (Liberation Sans, 0.688 of the size): 16 are asked for, 20 to 22 are
/// comfortable (ISO 9241-303). What `docs/console.md` says of it stands here: 49 px.
const ARC_MINUTES_PER_PX: f64 = 0.688 * 0.277 / 2000.0 * 180.0 / core::f64::consts::PI * 60.0;

/// The state and the worst of what holds the motion back have 16 minutes in every window; sentence, numbers, operator, clutch and
/// scale in the large one.
fn assert_readable_at_two_metres(page: &mut BrowserPage, width: u32) {
    let least = match width {
        1920 => [22.0, 16.0, 16.0, 16.0, 16.0],
        1280 => [16.0, 16.0, 8.0, 9.5, 5.5],
        _ => [16.0, 16.0, 6.5, 8.0, 5.0],
    };
    assert_ne!(page.text("#worst span"), "", "at {width}");
    for (element, least) in ["#word", "#worst span", "#sentence", "#bend-now", ".needs dd"].into_iter().zip(least) {
        let size = page.value(&format!("parseFloat(getComputedStyle(document.querySelector('{element}')).fontSize)"));
        let minutes = ARC_MINUTES_PER_PX * size.as_f64().expect("a size");
        assert!(minutes >= least, "{element} at {width}: {minutes} minutes of arc, expected {least}");
    }
}

/// A fault says which drive failed and whether the others hold, by the state's own flags; the machine's own emergency stop is
/// another state in word, sentence and shape, and the page's STOP says that it is none.
#[test]
fn the_machines_emergency_stop_is_a_state_of_its_own_and_a_fault_names_its_drive() {
    let Some(browser) = Browser::start() else { return };
    let instance = instance_name("estop");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let stop = console.at_stop("GET", &console.stop_path(), &[]);
    assert!(stop.status == 200 && stop.body.contains("no emergency stop"), "{stop:?}");
    // The slave's own message, as a slave with real drives sends it.
    let sender = ChainSender::start(&instance);
    let mut page = browser.page(&console.address, 1280, 800);
    let second = SlaveState::failed_drive_flags(2);
    let others = SlaveState::power_flag(0) | SlaveState::power_flag(2);
    let mut shapes = Vec::new();
    for (own, shown, word, sentence) in [
        (second | others | SlaveState::OTHERS_HOLD, "fault", "Fault", "Drive 2 failed; the others hold."),
        (second, "fault", "Fault", "Drive 2 failed; the others do not hold."),
        (
            second | SlaveState::HARDWARE_STOP | SlaveState::OTHERS_HOLD,
            "emergency",
            "Emergency stop",
            "Hardware cut drive 2 off; the others hold.",
        ),
        (
            second | SlaveState::HARDWARE_STOP,
            "emergency",
            "Emergency stop",
            "The machine’s own stop cut the drives’ power.",
        ),
    ] {
        sender.say_fault(own, &[Reason::DriveFault]);
        page.wait_for(
            sentence,
            &format!(
                "document.documentElement.dataset.shown === '{shown}' && document.getElementById('word').textContent === '{word}' \
                 && document.getElementById('sentence').textContent === '{sentence}'"
            ),
        );
        shapes.push(page.value("document.getElementById('glyph').innerHTML").to_string());
        // Only where others have power it is told of one that it has none.
        let told = page
            .value("[...document.querySelectorAll('.newton')].map(own => own.textContent === 'no power told').join()");
        assert_eq!(told, if own & others != 0 { "false,true,false" } else { "false,false,false" }, "{sentence}");
        for (width, height) in SIZES {
            page.resize(width, height);
            page.value("new Promise(done => setTimeout(done, 300))");
            // Of each state one.
            if shapes.len() % 2 == 1 {
                page.keep_in_themes(&format!("{shown}-{width}"));
            }
            for id in ["word", "sentence"] {
                let fits = format!(
                    "(() => {{ const e = document.getElementById('{id}'); return e.scrollWidth <= e.clientWidth; }})()"
                );
                page.wait_for(&format!("{word}: the {id} fits into {width}"), &fits);
            }
        }
    }
    assert!(shapes[0] == shapes[1] && shapes[1] != shapes[2], "told apart without colour");
    page.wait_for(
        "what to do first",
        "document.getElementById('reasons').textContent.includes('Release the machine’s stop.')",
    );
    let watched = Ended::of(&["watch", "--once", "--instance", &instance], PATIENCE);
    assert!(watched.stdout.starts_with("EMERGENCY STOP The machine’s own stop"), "{watched:?}");
    drop(sender);
    krait.signal(Signal::TERM);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    clears_a_fault_enables_and_homes(&browser);
}

/// A drive whose encoder sticks soon after the motion begins: the fault is cleared, power comes, zero is looked for, and it follows.
fn clears_a_fault_enables_and_homes(browser: &Browser) {
    let (instance, folder) = (instance_name("clears"), TempFolder::new("clears"));
    let [config, script, truth] = ["krait.toml", "hand.csv", "truth.toml"].map(|name| folder.file(name));
    for (path, text) in [
        (&config, "[slave]\nhome_on_start = false\n"),
        (&script, "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0.008,0.002,0\n240,0.008,0.002,0\n"),
        (&truth, "[encoders]\nsticks_at_m = [1e-4, 0.0, 0.0]\n"),
    ] {
        std::fs::write(path, text).expect("written");
    }
    let run = ["run", "--instance", &instance, "--engage=again", "--console", "--no-recording", "--config", &config];
    let mut krait = Krait::start(&[&run[..], &["--master", "script", "--input", &script, "--truth", &truth]].concat());
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the fault", "document.documentElement.dataset.shown === 'fault'");
    command(&mut page, "clear-fault", None, &["The fault is cleared; power is off."]);
    page.wait_for("off", "document.documentElement.dataset.shown === 'disabled'");
    command(&mut page, "enable", Some("e"), &["Enabled \u{2013} confirmed by the drives."]);
    // It follows for a moment only, which no picture may show: the encoder sticks still, and stops what moves by another fault.
    page.value("window.shown = new Set(); import('/js/link.js').then(({ on }) => { on('frame', ({ frame }) => shown.add(frame.shown)); return 0; })");
    command(&mut page, "home", None, &["Homing \u{2013} the drives have begun."]);
    page.wait_for("it follows", "shown.has('following') || shown.has('fault')");
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// Power that is asked off where lines are loaded goes behind the load: a state of its own with a word and a sentence, in which
/// nothing but the stop has a meaning.
#[test]
fn lines_that_are_relaxed_before_power_goes_are_shown_and_only_the_stop_is_left() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("relaxed"), TempFolder::new("relaxed"));
    let (config, script) = (folder.file("krait.toml"), folder.file("hand.csv"));
    std::fs::write(&config, "[slave.drive]\nrelax_n = 0.5\ndisable_relax_m = 0.008\ndisable_relax_ms = 10000.0\n")
        .expect("written");
    std::fs::write(
        &script,
        "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0.008,0.002,0\n240,0.008,0.002,0\n",
    )
    .expect("written");
    let run = ["run", "--instance", &instance, "--engage=again", "--console", "--no-recording"];
    let more = ["--compensation=naive", "--config", &config, "--master", "script", "--input", &script];
    let mut krait = Krait::start(&[&run[..], &more].concat());
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    // A page that opens late finds it at its largest bend already.
    page.wait_for("following", "['following', 'limited'].includes(document.documentElement.dataset.shown)");
    wait_for(&instance, "bent", |state| state.measured_tau_n.iter().any(|tau| tau.abs() > 35.0));
    page.value("document.querySelector('.command[data-wish=disable]').click()");
    // All at once: it is over soon.
    page.wait_for(
        "relaxing: the word, why, the answer, and only the stop is left",
        "document.documentElement.dataset.shown === 'relaxing'
            && document.getElementById('word').textContent === 'Relaxing'
            && document.body.innerText.includes('The lines are being relaxed.')
            && document.body.innerText.includes('Relaxing, then power goes off.')
            && document.querySelectorAll('.command[aria-disabled=false]').length === 0",
    );
    page.keep("relaxing");
    console.press_stop();
    page.wait_for("off", "document.documentElement.dataset.shown === 'disabled'");
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// Every text colour beside the card it stands on: 4.5, and 3 for shapes, as the accessibility guidelines ask.
fn assert_contrast(page: &mut BrowserPage, theme: &str) {
    let ratios = page.value(
        "(() => {
            const style = getComputedStyle(document.documentElement), of = name => style.getPropertyValue('--' + name).trim();
            const light = hex => { const [r, g, b] = [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16) / 255).map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
            const ratio = (a, b) => { const [x, y] = [light(a), light(b)].sort((p, q) => q - p); return (x + 0.05) / (y + 0.05); };
            return ['t1', 't2', 't3', 'go', 'hold', 'warn', 'fault', 'act', 'line-1', 'line-2', 'line-3', 'trail'].map(name => [name, 4.5, ratio(of(name), of('s1'))])
                .concat([['control', 3, ratio(of('control'), of('s1'))], ['stop', 4.5, ratio(of('stop'), '#ffffff')], ['on-act', 4.5, ratio(of('act'), of('on-act'))]]);
        })()",
    );
    for row in ratios.as_array().expect("rows") {
        assert!(row[2].as_f64().expect("a ratio") >= row[1].as_f64().expect("a limit"), "{theme}: {row}");
    }
}

#[test]
fn joints_are_shown_as_bars_with_their_numbers_live_and_from_a_recording() {
    bars_of("joints", ["wrist.toml", "wrist.csv"], [3, 3]);
}

#[test]
fn segments_are_drawn_with_two_bars_each_and_their_numbers_live_and_from_a_recording() {
    bars_of("segments", ["two.toml", "tip.csv"], [4, 6]);
}

/// As many joints as a machine may have, each with a bar, its limits and its numbers, measured or not: nothing is cut off, nothing lies
/// over something else, and each bar shows its own joint.
#[test]
fn eight_joints_have_their_bars_in_every_window() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("eight"), TempFolder::new("eight"));
    let [config, model] = ["krait.toml", "eight.toml"].map(|name| folder.file(name));
    let (ones, zeros) = (["0.9"; 8].join(", "), ["0.0"; 8].join(", "));
    let machine =
        format!("kind = \"joints\"\nn = 8\nu_unit = \"rad\"\ny_unit = \"rad\"\ngain = [{ones}]\noffset = [{zeros}]");
    std::fs::write(&model, format!("format = 1\n[machine]\n{machine}\n")).expect("written");
    let rows = ["[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]"; 8].join(", ");
    std::fs::write(&config, format!("model = \"{model}\"\n[joints]\nrates = [{rows}]\n")).expect("written");
    let mut krait = Krait::start(&["console", "--instance", &instance, "--config", &config]);
    let console = Console::of(&mut krait);
    let sender = ChainSender::start(&instance);
    let wanted: [f64; 8] = core::array::from_fn(|k| 0.2 * k as f64 - 0.75);
    let mut scene = ChainScene::of(OperatingState::Enabled, SlaveState::IS_HOMED | SlaveState::ENGAGED, &[]);
    scene = scene.driven(OperatorInput::OPERATOR_PRESENT, DeviceState::Live, Phase::Following);
    let setpoint = scene.setpoint.as_mut().expect("a setpoint");
    (setpoint.n_joints, setpoint.n_actuators, setpoint.bend_rad) = (8, 8, [f64::NAN; 2]);
    setpoint.joints_rad[..8].copy_from_slice(&wanted);
    let state = scene.state.as_mut().expect("a state");
    (state.n_joints, state.n_actuators) = (8, 8);
    let mut page = browser.page(&console.address, 1280, 800);
    for is_measured in [false, true] {
        scene.shape = is_measured.then(|| Shape::of_joints(1, 1, 1, &wanted.map(|rad| rad + 0.05)));
        sender.say(scene);
        let shown = |k: usize| {
            if is_measured {
                format!("{:.2}\u{b0}", (wanted[k] + 0.05).to_degrees().abs())
            } else {
                "not measured".to_owned()
            }
        };
        let all: Vec<String> = (0..8).map(shown).collect();
        page.wait_for(
            &format!("each joint has its number: {all:?}"),
            &format!("JSON.stringify([...document.querySelectorAll('#joints .joint b')].map(b => b.textContent.replace(/^[^0-9n]/, ''))) === JSON.stringify({})", json!(all)),
        );
        let places = page.value(
            "[...document.querySelectorAll('#joints .joint')].map(joint => { const track = joint.querySelector('.track').getBoundingClientRect(); return ['told', 'seen'].map(name => { const e = joint.querySelector('.' + name), own = e.getBoundingClientRect(); return e.hidden ? null : (own.left + own.width / 2 - track.left) / track.width; }); })",
        );
        for (k, rad) in wanted.iter().enumerate() {
            // From -0.8 to 0.8 rad.
            let part = |rad: f64| (rad + 0.8) / 1.6;
            let found = |which: usize| places[k][which].as_f64();
            assert!((found(0).expect("wanted") - part(*rad)).abs() < 0.01, "joint {}: {places}", k + 1);
            let seen = found(1).map(|seen| (seen - part(rad + 0.05).min(1.0)).abs() < 0.01);
            assert_eq!(seen, is_measured.then_some(true), "joint {}: {places}", k + 1);
        }
        for (width, height) in SIZES {
            page.resize(width, height);
            page.value("new Promise(done => setTimeout(done, 300))");
            page.keep_in_themes(&format!("eight-{width}-{is_measured}"));
            page.wait_for(
                &format!("eight joints fit into {width} x {height}"),
                "(() => {
                    const place = e => e.getBoundingClientRect(), rows = [...document.querySelectorAll('#joints .joint')], bars = [...document.querySelectorAll('#bars .bar')];
                    const below = (all, end) => all.every((row, i) => place(row).bottom <= (all[i + 1] ? place(all[i + 1]).top : end) + 0.5);
                    const inside = (e, of) => place(e).left >= place(of).left - 0.5 && place(e).right <= place(of).right + 0.5;
                    const isCut = e => e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1;
                    return rows.length === 8 && bars.length === 8 && below(rows, place(document.querySelector('.strip')).top) && below(bars, place(document.querySelector('.lines')).bottom)
                        && rows.every(row => [...row.children].every(part => inside(part, row) && (part.matches('.track') || !isCut(part))) && place(row).top >= place(document.getElementById('stage')).top)
                        && !isCut(document.querySelector('.lines')) && !isCut(document.getElementById('joints'));
                })()",
            );
        }
    }
    drop(sender);
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// How many points of a canvas have the colour of each of the three kinds of lines, nearly.
fn painted(canvas: &str) -> String {
    let points = canvas_points(canvas);
    format!(
        "(() => {{
            const data = {points}, style = getComputedStyle(document.documentElement);
            return [1, 2, 3].map(line => {{
                const hex = style.getPropertyValue('--line-' + line).trim(), rgb = [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));
                let n = 0;
                for (let at = 0; at < data.length; at += 4) n += rgb.every((value, i) => Math.abs(value - data[at + i]) < 12) && data[at + 3] > 200;
                return n;
            }});
        }})()"
    )
}

/// A machine that is no snake: its model and script in `docs/`, how many bars it has and how many lines. Joints are bars in the place
/// of a picture, segments are drawn and have their bars beside it.
fn bars_of(kind: &str, [model, script]: [&str; 2], [n_bars, n_lines]: [usize; 2]) {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("bars"), TempFolder::new(&format!("bars-{kind}")));
    let recording = folder.file("bars.mcap");
    let shipped = |name: &str| format!("{}/../docs/{kind}/{name}", env!("CARGO_MANIFEST_DIR"));
    let (model, script) = (shipped(model), shipped(script));
    let run = ["run", "--instance", &instance, "--engage=again", "--console", "--recording", &recording];
    let mut krait = Krait::start(&[&run[..], &["--master", "script", "--input", &script, "--model", &model]].concat());
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the joints follow", "document.documentElement.dataset.shown === 'following'");
    let measured = |within: &str| {
        format!(
            "[...document.querySelectorAll('{within} .joint b')].filter(b => /^.[0-9.]+°$/.test(b.textContent)).length === {n_bars}"
        )
    };
    page.wait_for("every bar is measured", &measured("#joints"));
    page.wait_for(
        "and how far each is off",
        "[...document.querySelectorAll('#joints .joint .off')].every(off => /^off [0-9.]+$/.test(off.textContent))",
    );
    assert_eq!(page.value("document.querySelectorAll('#bars .bar').length"), json!(n_lines));
    let is_drawn = kind == "segments";
    let no_picture = "['scene', 'dial'].map(id => document.getElementById(id).getBoundingClientRect().width === 0)";
    assert_eq!(page.value(no_picture), json!([!is_drawn, true]), "what is not there is not drawn");
    if is_drawn {
        let lines = format!("{}.every(n => n > 100)", painted("#scene"));
        page.wait_for("lines of every colour are drawn", &lines);
        page.wait_for(
            "the picture says how far each bends",
            "/^The segments bend [0-9]+ and [0-9]+ degrees/.test(document.getElementById('scene').getAttribute('aria-label'))",
        );
    }
    let below = if is_drawn { "#bars" } else { ".strip" };
    for (width, height) in SIZES {
        page.resize(width, height);
        page.value("new Promise(done => setTimeout(done, 500))");
        page.keep_in_themes(&format!("{kind}-{width}"));
        let fits = format!(
            "[...document.querySelectorAll('#joints .joint')].every(joint => joint.getBoundingClientRect().bottom <= document.querySelector('{below}').getBoundingClientRect().top)"
        );
        page.wait_for(&format!("the bars fit into {width} x {height}"), &fits);
    }
    let marked = Ended::of(&["mark", "--instance", &instance, "a vessel"], PATIENCE);
    assert_eq!(marked.code, Some(0), "{}", marked.stderr);
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
    let mut krait = Krait::start(&["console", &recording, "--instance", &instance]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the recording is open", "document.querySelector('.ribbon')?.textContent.includes('not live')");
    page.value("(() => { const scrub = document.querySelector('.scrub input'); scrub.value = Math.floor(scrub.max / 2); scrub.dispatchEvent(new Event('input')); })()");
    page.wait_for("its bars are shown", &measured(".not-live"));
    let marks = "[...document.querySelectorAll('.marks span')].map(mark => [mark.textContent, mark.offsetWidth > 0])";
    assert_eq!(page.value(marks), json!([["a vessel", true]]), "what was marked");
    if is_drawn {
        let lines = format!("{}.every(n => n > 100)", painted(".not-live canvas"));
        page.wait_for("the recorded segments are drawn", &lines);
    }
    page.keep_in_themes(&format!("{kind}-recorded"));
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// How many points of a canvas look clearly other than when this was asked last.
fn changed(canvas: &str) -> String {
    let points = canvas_points(canvas);
    format!(
        "(() => {{
            const data = {points}, before = window.before ?? data;
            window.before = data;
            let n = 0;
            for (let at = 0; at < data.length; at += 4) n += [0, 1, 2, 3].some(i => Math.abs(data[at + i] - before[at + i]) > 40);
            return n;
        }})()"
    )
}

/// A picture that nothing else changes looks other once it was turned.
fn turns_by_key_and_by_pointer(page: &mut BrowserPage, canvas: &str) {
    let changed = changed(canvas);
    page.value(&changed);
    page.wait_for("nothing moves", &format!("{changed} === 0"));
    page.value(&format!("document.querySelector('{canvas}').focus(); 0"));
    page.key("ArrowLeft", 37);
    page.wait_for("turned by key", &format!("{changed} > 500"));
    let place = page.value(&format!(
        "(r => [r.x + r.width / 2, r.y + r.height / 2])(document.querySelector('{canvas}').getBoundingClientRect())"
    ));
    let [x, y] = [0, 1].map(|axis| place[axis].as_f64().expect("a place"));
    page.wait_for("nothing moves", &format!("{changed} === 0"));
    page.mouse_half(true, [x, y]);
    let moved = json!({ "type": "mouseMoved", "x": x + 60.0, "y": y, "button": "left", "buttons": 1 });
    page.call("Input.dispatchMouseEvent", &moved);
    page.mouse_half(false, [x + 60.0, y]);
    page.wait_for("turned by pointer", &format!("{changed} > 500"));
}

/// The film goes on from picture to picture while it plays, its time too, and stands once it is paused.
fn plays_and_pauses(page: &mut BrowserPage) {
    let place = "(r => [r.x + r.width / 2, r.y + r.height / 2])(document.querySelector('.player .prime').getBoundingClientRect())";
    let place = page.value(place);
    let [x, y] = [0, 1].map(|axis| place[axis].as_f64().expect("a place"));
    let time = page.text(".player .controls b");
    let at = "Number(document.querySelector('.scrub input').value)";
    let from = page.value(at);
    page.press(x, y);
    page.wait_for("it plays", &format!("{at} > {from}"));
    page.wait_for(
        "its time goes on",
        &format!("document.querySelector('.player .controls b').textContent !== {}", json!(time)),
    );
    page.press(x, y);
    page.wait_for("it is paused", "document.querySelector('.player .prime').textContent === '▶'");
    let stands =
        page.value(&format!("new Promise(done => {{ const at = {at}; setTimeout(() => done(at === {at}), 200); }})"));
    assert_eq!(stands, json!(true), "paused");
}

/// A hand drags the scrubber from the beginning to three quarters: instant, picture and what is written go with it, back and forth.
fn the_scrubber_is_dragged(page: &mut BrowserPage) {
    let film = page.value("fetch('/recordings/first.mcap').then(answer => answer.json())");
    let n = film["t_s"].as_array().expect("pictures").len();
    let place = page.value("(r => [r.left, r.right, r.top + r.height / 2])(document.querySelector('.scrub input').getBoundingClientRect())");
    let [left, right, y] = [0, 1, 2].map(|k| place[k].as_f64().expect("a place"));
    let changed = changed(".not-live canvas");
    let at = |part: f64| [left + part * (right - left), y];
    page.mouse_half(true, at(0.02));
    let mut before = usize::MAX;
    for part in [0.1, 0.3, 0.5, 0.75, 0.4, 0.75] {
        page.value(&changed);
        let [x, y] = at(part);
        page.call(
            "Input.dispatchMouseEvent",
            &json!({ "type": "mouseMoved", "x": x, "y": y, "button": "left", "buttons": 1 }),
        );
        let value =
            page.value("Number(document.querySelector('.scrub input').value)").as_u64().expect("a place") as usize;
        assert!(
            value != before && (value as f64 - part * n as f64).abs() < 0.05 * n as f64,
            "{value} of {n}, at {part}"
        );
        before = value;
        let t_s = film["t_s"][value].as_f64().expect("an instant");
        let said = page.text(".player .controls b");
        let (of_minute, tenths) = (said.rsplit(':').next().unwrap_or_default(), (t_s * 10.0).floor() / 10.0);
        assert_eq!(of_minute.parse::<f64>().ok(), Some(tenths), "{said} at {t_s} s");
        if let Some(off) = film["off"][value].as_f64() {
            assert_eq!(
                page.text(".player .controls b:last-child"),
                format!("{:.1}\u{b0}", off.to_degrees()),
                "{value} of {n}"
            );
        }
    }
    page.mouse_half(false, at(0.75));
    let stays = page.value("Number(document.querySelector('.scrub input').value)").as_u64();
    assert_eq!(stays, Some(before as u64), "where it was let go");
    page.value(&changed);
    page.wait_for("nothing moves", &format!("{changed} === 0"));
    page.press(at(0.05)[0], y);
    page.wait_for("another picture", &format!("{changed} > 100"));
}

/// Where a file cannot be read, the film before it is gone, and its sentence stands there.
fn a_broken_file_leaves_no_film(page: &mut BrowserPage, folder: &TempFolder) {
    std::fs::write(folder.file("broken.mcap"), "no recording").expect("written");
    page.value("document.querySelector('[data-go=recordings]').click()");
    let name = "document.querySelector('#recordings tr[data-name=\"broken.mcap\"] button')";
    page.wait_for("it is in the list", &format!("{name} !== null"));
    page.value(&format!("{name}.click()"));
    page.wait_for("its sentence", "/broken.mcap/.test(document.querySelector('.ribbon').textContent) && !/^Reading/.test(document.querySelector('.ribbon').textContent)");
    page.value("document.querySelector('.player .prime').click()");
    let left = "[document.querySelector('.scrub input').disabled, document.querySelector('.player .prime').textContent, document.querySelector('.scrub .curve').childElementCount]";
    assert_eq!(page.value(left), json!([true, "▶", 0]));
}

#[test]
fn a_recording_opens_by_itself_where_the_console_was_started_for_it() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("film"), TempFolder::new("film"));
    let path = folder.file("first.mcap");
    let run = ["run", "--engage=again", "--instance", &instance, "--recording", &path, "--seconds", "3"];
    assert!(matches!(Ended::of(&run, PATIENCE).code, Some(0 | 1)), "a recording is made");
    let mut krait = Krait::start(&["console", &path, "--instance", &instance]);
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for(
        "the recording is open",
        "document.querySelector('#recordings .ribbon')?.textContent === 'Recording first – not live'",
    );
    page.wait_for("it is the page in front", "document.documentElement.dataset.tab === 'recordings'");
    page.wait_for(
        "it is a film of some seconds",
        "Number(document.querySelector('#recordings input[type=range]').max) > 30",
    );
    turns_by_key_and_by_pointer(&mut page, ".not-live canvas");
    plays_and_pauses(&mut page);
    the_scrubber_is_dragged(&mut page);
    page.keep_right_everywhere("player", Scrolls::Within);
    a_broken_file_leaves_no_film(&mut page, &folder);
    page.value("document.querySelector('[data-go=operate]').click()");
    page.wait_for("nothing is taken for live", "document.documentElement.dataset.shown === 'stale'");
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));

    let none = Ended::of(&["console", &folder.file("none.mcap")], PATIENCE);
    assert_eq!(none.code, Some(2));
    assert!(none.sentence().contains("none.mcap"), "{none:?}");
}

#[test]
fn a_learner_finds_a_hidden_effect_by_keyboard_alone_and_is_told_nothing_before_the_guess() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("quiz"), TempFolder::new("quiz"));
    let lab = folder.file("lab");
    let mut krait = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the page is there", "location.hash === '' && document.querySelectorAll('#stop').length === 1");
    page.value("window.heard = ''; window.fetched = fetch; window.fetch = async (...order) => { const answer = await fetched(...order); heard += await answer.clone().text(); return answer; }; 0");
    page.key("3", u32::from(b'3'));
    tab_to(&mut page, "document.activeElement.textContent.startsWith('Quiz')");
    enter(&mut page);
    let seed = "document.activeElement.name === 'seed'";
    tab_to(&mut page, seed);
    page.call("Input.insertText", &json!({ "text": "4e3" }));
    enter(&mut page);
    page.wait_for("refused", "document.querySelector('#lab .complaint').textContent === '“4e3” is no number of a riddle; it has one to six digits.'");
    tab_to(&mut page, seed);
    page.call("Input.insertText", &json!({ "text": "3" }));
    enter(&mut page);
    page.wait_for(
        "what the model leaves is shown",
        "document.querySelector('#lab h1').textContent === 'Riddle 3, easy: which effect is hidden?' && document.activeElement.tagName === 'H1' && document.querySelectorAll('#lab .residuals path.trace').length === 2",
    );
    for (width, height) in SIZES {
        page.resize(width, height);
        for theme in ["light", "dark"] {
            if page.value("document.documentElement.dataset.theme") != json!(theme) {
                page.key("t", 84);
            }
            page.keep_right(&format!("quiz-{theme}-{width}"), Scrolls::Within);
            page.wait_for(
                &format!("the quiz fits into {width} x {height}"),
                "document.documentElement.scrollWidth <= innerWidth && (work => work.scrollWidth <= work.clientWidth)(document.querySelector('#lab .work'))",
            );
        }
    }
    let sealed = std::fs::read_to_string(format!("{lab}/quiz/riddle-easy-3.answer.json")).expect("the sealed answer");
    let sealed: serde_json::Value = serde_json::from_str(&sealed).expect("JSON");
    let (hidden, size) = (sealed[0]["right"][0][0].as_str().expect("a name"), sealed[0]["effect_rms_deg"].to_string());
    let is_told =
        |page: &mut BrowserPage| page.value(&format!("heard.includes('{size}') || heard.includes('hidden\":[')"));
    let names = page.value("[...document.querySelectorAll('#lab input[name=guess]')].map(input => input.value)");
    let names: Vec<&str> = names.as_array().expect("names").iter().filter_map(|name| name.as_str()).collect();
    assert!(names.len() == 4 && names.contains(&hidden), "{names:?}, hidden is {hidden}");
    let wrong = names.iter().find(|name| **name != hidden).expect("a wrong one");
    guess(&mut page, wrong);
    let refused =
        format!("document.querySelector('#lab h1').textContent.startsWith('No, it is not {wrong}. With it: ')");
    page.wait_for("a wrong guess is told so, and why", &refused);
    assert_eq!(is_told(&mut page), json!(false), "before the right guess the answer is with the server alone");
    guess(&mut page, hidden);
    let right = format!("document.querySelector('#lab h1').textContent === 'Right: it is {hidden}.'");
    page.wait_for("right", &right);
    page.wait_for("and why", "document.querySelectorAll('#lab .effect p').length === 2");
    assert_eq!(is_told(&mut page), json!(true));
    page.keep("quiz-told");
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// Presses Tab until a script says true.
fn tab_to(page: &mut BrowserPage, place: &str) {
    for _ in 0..60 {
        page.key("Tab", 9);
        if page.value(place) == json!(true) {
            return;
        }
    }
    panic!("Tab does not lead to {place}");
}

fn enter(page: &mut BrowserPage) {
    page.key_half(true, "Enter", 13);
    page.key_half(false, "Enter", 13);
}

/// Chooses a name with the arrow keys and sends it with Enter.
fn guess(page: &mut BrowserPage, name: &str) {
    tab_to(page, "document.activeElement.name === 'guess'");
    for _ in 0..8 {
        page.key("ArrowDown", 40);
        if page.value("document.querySelector('#lab input[name=guess]:checked')?.value") == json!(name) {
            return enter(page);
        }
    }
    panic!("the arrow keys do not lead to {name}");
}
