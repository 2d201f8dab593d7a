//! Driving from the page in a real Chromium: pointer, touch, keyboard and gamepad, in the directions that the picture shows; what a
//! page does that hangs or dies. Skipped aloud where there is no Chromium.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::cell::Cell;
use core::time::Duration;
use krait_tests::{
    Browser, BrowserPage, Console, Ended, Krait, PadPage, Scrolls, TempFolder, canvas_points, instance_name,
    next_of_kind, pad_losses, seen_in_operate_room, wait_until, watch_operate_room,
};
use rustix::process::Signal;
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(240);
/// The lease, in ticks of the master, and two more.
const MOST_INPUTS: usize = 150 + 2;
/// The camera is turned, so that what forgets its roll is seen.
const ROLL_RAD: f64 = 0.5;

const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];

const READY: &str = "document.documentElement.dataset.shown === 'ready'";
const LOST: &str = "document.documentElement.dataset.shown === 'lost'";
const MOVES: &str = "['following', 'limited'].includes(document.documentElement.dataset.shown)";

fn says(text: &str) -> String {
    format!("document.getElementById('pad-says').textContent.startsWith({})", json!(text))
}

#[test]
fn a_person_drives_from_the_page_and_the_picture_the_dial_and_the_pad_agree() {
    let Some(browser) = Browser::start() else { return };
    let folder = TempFolder::new("drive");
    let (recording, config, instance) = (folder.file("drive.mcap"), folder.file("krait.toml"), instance_name("drive"));
    std::fs::write(&config, format!("[resolve]\nview_roll_rad = {ROLL_RAD}\n")).expect("written");
    let mut krait = Krait::start(&[
        "run",
        "--master",
        "browser",
        "--instance",
        &instance,
        "--config",
        &config,
        "--recording",
        &recording,
    ]);
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for(
        "the pad is there and nothing is engaged",
        &format!("{READY} && !document.getElementById('pad').hidden"),
    );
    assert_eq!(page.value("document.getElementById('pad-jaw').hidden"), json!(true), "without a gripper, no jaw");
    see_who_drives_and_take_over(&mut page, &console);

    let facts = next_of_kind(&mut console.page(), "hello")["facts"].clone();
    watch_operate_room(&mut page, &facts);
    let centre_of_pad = centre(&mut page);
    let mut hand = Hand { centre: centre_of_pad, page: &mut page, is_touching: false };
    hand.look_through_camera();
    for direction in DIRECTIONS {
        hand.drive(direction, &format!("by pointer {direction:?}"), Hand::pointer);
    }
    for direction in DIRECTIONS {
        hand.drive(direction, &format!("by keyboard {direction:?}"), Hand::keyboard);
    }
    for direction in DIRECTIONS {
        hand.drive(direction, &format!("by gamepad {direction:?}"), Hand::gamepad);
    }
    page.value("document.documentElement.style.removeProperty('--axis-z')");
    page.value("document.querySelector('[data-view=oblique]').click()");
    page.keep_right_everywhere("drive", Scrolls::Nowhere);
    page.resize(1280, 800);
    assert_row_and_bars_are_the_frames(&mut page);

    // A page that hangs with the pad held: the motion stops, and begins anew only after the hand was off the pad.
    let place = centre(&mut page);
    hold(&mut page, place);
    let mut seen = PadPage::open(&console);
    page.value("setTimeout(() => { const end = performance.now() + 2500; while (performance.now() < end); }, 20); 0");
    seen.until("lost while it hangs", |_, frame| frame["operator"]["device"] == "lost");
    // Whether it kept the pad or has just got it back: the hand has to be taken off.
    page.wait_for(
        "the page says so",
        "document.getElementById('pad-says').textContent.includes('et go, then hold anew.')",
    );
    assert_holds_still(&console);
    page.mouse_half(false, place);
    page.wait_for("let go", READY);
    hold(&mut page, place);

    // A page that dies with the pad held; others that go meanwhile stop nothing.
    drop(PadPage::open(&console));
    let complaints: Vec<_> = page.complaints.iter().filter(|said| !said.contains("WebSocket")).cloned().collect();
    drop(page);
    drop(browser);
    seen.until("it stops and the pad is free", |_, frame| {
        frame["operator"]["present"] == false && frame["pad"]["driver"].is_null() && frame["state"]["engaged"] == false
    });
    assert!(complaints.is_empty(), "{complaints:?}");
    krait.signal(Signal::TERM);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let (losses, n_without_hand) = pad_losses(&recording);
    assert!(!losses.is_empty() && losses.iter().all(|n_inputs| *n_inputs <= MOST_INPUTS), "{losses:?}");
    assert_eq!(n_without_hand, 0, "commands that follow nobody");
    let verified = Ended::of(&["verify", &recording], PATIENCE);
    assert_eq!(verified.code, Some(0), "{}\n{}", verified.stdout, verified.stderr);
}

/// A finger presses the pad, drags, and lets go, in four directions; and a finger stops, also while another one drives.
#[test]
fn a_finger_drives_in_four_directions_and_a_finger_stops() {
    let Some(browser) = Browser::start() else { return };
    let (folder, instance) = (TempFolder::new("touch"), instance_name("touch"));
    let config = folder.file("krait.toml");
    std::fs::write(&config, format!("[resolve]\nview_roll_rad = {ROLL_RAD}\n")).expect("written");
    let run = ["run", "--master", "browser", "--no-recording", "--config", &config, "--instance", &instance];
    let mut krait = Krait::start(&run);
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    page.call("Emulation.setTouchEmulationEnabled", &json!({ "enabled": true, "maxTouchPoints": 5 }));
    page.wait_for("the pad is there", &format!("{READY} && !document.getElementById('pad').hidden"));
    page.value("window.kinds = new Set(); document.getElementById('pad-field').addEventListener('pointerdown', event => kinds.add(event.pointerType)); 0");
    page.value("document.getElementById('pad-take').click()");
    page.wait_for("it has the pad", &says("Yours."));
    let place = centre(&mut page);
    let mut hand = Hand { centre: place, page: &mut page, is_touching: false };
    hand.look_through_camera();
    for direction in DIRECTIONS {
        hand.drive(direction, &format!("by touch {direction:?}"), Hand::touch);
    }
    assert_eq!(page.value("[...kinds].join()"), json!("touch"), "by touch and nothing else");
    assert_eq!(
        page.value("[scrollX, scrollY, visualViewport.scale].join()"),
        json!("0,0,1"),
        "nothing scrolls or zooms"
    );

    let stop = page.value("(() => { const r = document.getElementById('stop').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()");
    let stop = pair(&stop);
    let mut seen = console.page();
    let mut stops = |page: &mut BrowserPage, fingers: &[[f64; 2]], what: &str| {
        page.touch("touchStart", fingers);
        page.wait_for(what, "document.documentElement.dataset.shown === 'paused'");
        page.touch("touchEnd", &[]);
        let is_paused = wait_until(PATIENCE, || next_of_kind(&mut seen, "frame")["state"]["operating"] == "PAUSED");
        assert!(is_paused, "{what}: the drives say so");
        page.wait_for(
            "resume is offered",
            "document.querySelector('.command[data-wish=resume][aria-disabled=false]') !== null",
        );
        page.value("document.querySelector('.command[data-wish=resume]').click()");
        page.wait_for("ready again", READY);
    };
    stops(&mut page, &[stop], "one finger stops");
    page.touch("touchStart", &[place]);
    page.wait_for("held", "document.getElementById('pad').classList.contains('held')");
    stops(&mut page, &[place, stop], "a second finger stops while the first one drives");
    let complaints: Vec<_> = page.complaints.iter().filter(|said| !said.contains("WebSocket")).collect();
    assert!(complaints.is_empty(), "{complaints:?}");
    krait.signal(Signal::TERM);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
}

/// A jaw opens and closes while one of its buttons is held: by pointer, beside a finger on the pad, by key and by gamepad; the picture
/// has its two fingers at the measured angle, and the snake does not bend.
#[test]
fn a_jaw_moves_while_its_button_is_held_and_the_picture_shows_how_far_it_is_open() {
    let Some(browser) = Browser::start() else { return };
    let (folder, instance) = (TempFolder::new("pad-jaw"), instance_name("pad-jaw"));
    let recording = folder.file("jaw.mcap");
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/gripper/snake.toml");
    let run = ["run", "--master", "browser", "--instance", &instance, "--recording", &recording, "--model", model];
    let mut krait = Krait::start(&run);
    let console = Console::of(&mut krait);
    let mut page = browser.page(&console.address, 1280, 800);
    page.call("Emulation.setTouchEmulationEnabled", &json!({ "enabled": true, "maxTouchPoints": 5 }));
    page.wait_for("the jaw has buttons", &format!("{READY} && !document.getElementById('pad-jaw').hidden"));
    page.value("document.getElementById('pad-take').click()");
    page.wait_for("it has the pad", &says("Yours."));
    let [opens, closes] = ["1", "-1"].map(|jaw| middle(&mut page, &format!("[data-jaw=\"{jaw}\"]")));
    let field = centre(&mut page);

    let mut jaw = Jaw { page: &mut page, console: &console };
    jaw.moves("by pointer", true, &|page, is_down| page.mouse_half(is_down, opens));
    jaw.page.wait_for("ready", READY);
    for (width, height) in [(1920, 1080), (1280, 800), (1024, 768)] {
        jaw.page.resize(width, height);
        for theme in ["light", "dark"] {
            jaw.page.value(&format!(
                "if (document.documentElement.dataset.theme !== '{theme}') document.getElementById('theme').click()"
            ));
            jaw.page.value("new Promise(done => setTimeout(done, 500))");
            jaw.page.keep(&format!("jaw-{theme}-{width}"));
            let bars = "document.querySelector('#bars .bar:last-child').getBoundingClientRect().bottom <= document.querySelector('.lines').getBoundingClientRect().bottom";
            jaw.page.wait_for(&format!("all bars fit into {width} x {height}"), bars);
            let fits = "['#pad', '.strip'].map(name => document.querySelector(name).getBoundingClientRect()).every((r, _, [pad, strip]) => pad.bottom <= strip.top && pad.top >= document.getElementById('stage').getBoundingClientRect().top)";
            jaw.page.wait_for(&format!("the pad fits into {width} x {height}"), fits);
        }
    }
    jaw.page.resize(1280, 800);
    let is_touching = Cell::new(false);
    jaw.moves("by a second finger", false, &|page, is_down| match (is_down, is_touching.replace(is_down)) {
        (true, _) => {
            page.touch("touchStart", &[field]);
            page.touch("touchStart", &[field, closes]);
        }
        (false, true) => page.touch("touchEnd", &[]),
        (false, false) => {}
    });
    let by_key = |letter: &'static str| {
        move |page: &mut BrowserPage, is_down: bool| {
            page.value("document.getElementById('pad-field').focus()");
            page.key_half(is_down, " ", 32);
            page.key_half(is_down, letter, u32::from(letter.to_ascii_uppercase().as_bytes()[0]));
        }
    };
    jaw.moves("by key", true, &by_key("o"));
    jaw.moves("by key", false, &by_key("c"));
    jaw.moves("by Space on its button", true, &|page, is_down| {
        page.value("document.querySelector('[data-jaw=\"1\"]').focus()");
        page.key_half(is_down, " ", 32);
    });
    for (how, opens) in [("by a gamepad's lowest button", false), ("by a gamepad's highest button", true)] {
        jaw.moves(how, opens, &|page, is_down| plug_in(page, [0.0; 2], is_down, Some(if opens { 3 } else { 0 })));
    }

    // A key of the jaw without Space is no hand on the pad.
    page.value("document.getElementById('pad-field').focus()");
    page.key_half(true, "c", u32::from(b'C'));
    assert_holds_still(&console);
    page.key_half(false, "c", u32::from(b'C'));
    let complaints: Vec<_> = page.complaints.iter().filter(|said| !said.contains("WebSocket")).collect();
    assert!(complaints.is_empty(), "{complaints:?}");
    the_picture_has_its_fingers(&mut page);
    the_pad_covers_nothing(&mut page);
    krait.signal(Signal::TERM);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let verified = Ended::of(&["verify", &recording], PATIENCE);
    assert_eq!(verified.code, Some(0), "{}\n{}", verified.stdout, verified.stderr);
    assert_eq!(pad_losses(&recording).1, 0, "commands that follow nobody");
    the_recorded_jaw_is_drawn(&browser, &recording, &instance);
}

/// The jaw of docs/gripper/snake.toml is open, deg; closed it is at zero.
const OPEN_DEG: f64 = 60.0;

/// A person at the jaw.
struct Jaw<'a> {
    page: &'a mut BrowserPage,
    console: &'a Console,
}

impl Jaw<'_> {
    /// Holds until the measured jaw has moved the wanted way, lets go, and sees it stand still.
    fn moves(&mut self, how: &str, opens: bool, act: &dyn Fn(&mut BrowserPage, bool)) {
        let mut seen = PadPage::open(self.console);
        let angle = |frame: &Value| frame["jaw"]["measured"].as_f64().map(f64::to_degrees);
        let bend = |frame: &Value| pair(&frame["bend"]).map(f64::to_degrees);
        let before = seen.until("measured", |_, frame| angle(frame).is_some() && frame["shown"] == "ready");
        let from_deg = angle(&before).expect("measured");
        // Half of the way to the end at most: on a busy machine it goes on for a while before it is let go.
        let room_deg = if opens { OPEN_DEG - from_deg } else { from_deg };
        let (wanted_deg, mut moved_deg) = ((0.5 * room_deg).min(20.0), 0.0_f64);
        assert!(wanted_deg > 3.0, "{how}: the jaw stands at {from_deg} deg");
        // Half a minute of pictures: a busy machine may take the button from the page between two of them.
        for _ in 0..1800 {
            let now = seen.until("measured", |_, frame| angle(frame).is_some());
            moved_deg = angle(&now).expect("measured") - from_deg;
            if moved_deg.abs() > wanted_deg {
                break;
            }
            if !matches!(now["shown"].as_str(), Some("following" | "limited")) {
                act(self.page, false);
                self.page.wait_for("off the pad", READY);
                act(self.page, true);
                self.page.wait_for("held or lost", &format!("{MOVES} || {LOST}"));
                // Pictures that came meanwhile are old.
                seen = PadPage::open(self.console);
            }
        }
        act(self.page, false);
        self.page.wait_for("let go", READY);
        let way_deg = if opens { moved_deg } else { -moved_deg };
        assert!(way_deg > wanted_deg, "{how}: it moved by {moved_deg} deg");
        let mut after = PadPage::open(self.console);
        // What a busy machine has still to do of the motion takes a moment; then half a second of pictures in one place.
        let mut rests: Vec<f64> = Vec::new();
        let later = after.until("at rest", |_, frame| {
            rests.extend(angle(frame).filter(|_| frame["shown"] == "ready"));
            let newest = &rests[rests.len().saturating_sub(30)..];
            newest.len() == 30 && newest.iter().all(|own| (own - newest[0]).abs() < 1.0)
        });
        let rest_deg = angle(&later).expect("measured");
        let room_deg = if opens { OPEN_DEG - rest_deg } else { rest_deg };
        assert!(
            room_deg > 1.0,
            "{how}: let go at {moved_deg} deg it went on to its end, from {from_deg} to {rest_deg} deg"
        );
        let [[x, y], [a, b]] = [bend(&later), bend(&before)];
        assert!((x - a).hypot(y - b) < 3.0, "{how}: the snake bent from {before} to {later}");
    }
}

/// The pad with the jaw's buttons, which is the highest one, lies within the picture and over neither views nor legend.
fn the_pad_covers_nothing(page: &mut BrowserPage) {
    for (width, height) in [(1920, 1080), (1280, 800), (1024, 768)] {
        page.resize(width, height);
        page.value("new Promise(done => setTimeout(done, 300))");
        page.keep(&format!("pad-{width}"));
        let lies = "(() => {
            const [stage, pad, strip, ...others] = ['#stage', '#pad', '.strip', '.views', '.legend'].map(own => document.querySelector(own).getBoundingClientRect());
            const apart = other => other.right <= pad.left || other.left >= pad.right || other.bottom <= pad.top || other.top >= pad.bottom;
            return pad.top >= stage.top && pad.bottom <= strip.top && others.every(apart);
        })()";
        page.wait_for(&format!("the pad has its own place at {width} x {height}"), lies);
    }
}

/// The painter itself, on a canvas that a test can read: with a jaw the ends of both fingers are painted, and nothing else of a picture
/// without one is there.
fn the_picture_has_its_fingers(page: &mut BrowserPage) {
    let painted = page.value(
        "(async () => {
            const [{ Scene }, { VIEWS, cameraFor, fingers, frameAt, machineOf }] = [await import('/js/scene.js'), await import('/js/snake.js')];
            const style = getComputedStyle(document.documentElement), metal = style.getPropertyValue('--metal').trim();
            const colours = new Proxy({}, { get: () => metal });
            const machine = machineOf({ joints: null, l_m: 0.025, r_m: 0.003, max_bend_rad: 1.2 }), bend = [0.3, 0.2];
            const pixels = jaw => {
                const scene = new Scene(new OffscreenCanvas(800, 800));
                scene.resize(800, 800, 1);
                scene.draw({ bends: [bend], wanted: null, jaw, machine, colours, isLimited: false });
                return scene;
            };
            const of = opening => {
                const [without, seen] = [null, { measured: opening, wanted: null }].map(pixels);
                const camera = cameraFor({ ...VIEWS.oblique, distance: VIEWS.oblique.distance * 1.25 }, [0, 0, 11.2], 800, 800);
                const ends = fingers(frameAt(bend, 1, 25), opening).map(points => camera.project(points.at(-1)));
                const at = (scene, [x, y]) => scene.g.getImageData(Math.round(x), Math.round(y), 1, 1).data.join();
                return { differ: ends.map(end => at(without, end) !== at(seen, end)), apart: Math.hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]) };
            };
            const [open, shut] = [of(0.8), of(0.0)];
            return { differ: [...open.differ, ...shut.differ], wider: open.apart > 2 * shut.apart };
        })()",
    );
    assert_eq!(painted, json!({ "differ": [true, true, true, true], "wider": true }));
}

/// The film of a recording has the jaw's angles, measured and wanted.
fn the_recorded_jaw_is_drawn(browser: &Browser, recording: &str, instance: &str) {
    let mut krait = Krait::start(&["console", recording, "--instance", instance]);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the recording is open", "document.querySelector('.ribbon')?.textContent.includes('not live')");
    let opened = page.value("fetch('/recordings/jaw.mcap').then(answer => answer.json()).then(film => [Math.max(...film.jaw), Math.max(...film.jaw_wanted), film.jaw.length === film.t_s.length])");
    assert!(opened[0].as_f64() > Some(0.2) && opened[1].as_f64() > Some(0.2) && opened[2] == true, "{opened}");
    page.value("(() => { const scrub = document.querySelector('.scrub input'); scrub.value = Math.floor(scrub.max / 4); scrub.dispatchEvent(new Event('input')); })()");
    page.value("new Promise(done => setTimeout(done, 500))");
    page.keep("jaw-recorded");
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// Of every frame of the drive the page has shown what the frame says, and there was something to be shown.
fn assert_row_and_bars_are_the_frames(page: &mut BrowserPage) {
    let seen = seen_in_operate_room(page);
    let count = |name: &str| seen[name].as_u64().expect("a number");
    assert!(count("n_placed") > 20 && count("n_told") > 20 && count("n_loaded") > 20, "{seen:#}");
    assert_eq!(seen["wrong"], json!([]), "{seen:#}");
    let words = seen["words"].as_array().expect("words");
    for word in ["drives enabled", "operator present", "operator absent", "clutch released", "scale 100 %"] {
        assert!(words.contains(&json!(word)), "{word}: {seen:#}");
    }
    let widest: Vec<f64> =
        seen["widest"].as_array().expect("bars").iter().filter_map(serde_json::Value::as_f64).collect();
    assert!(widest.len() == 3 && widest.iter().all(|part| *part > 0.02), "each line has moved: {widest:?}");
}

/// For half a second of pictures from now on nobody is present.
fn assert_holds_still(console: &Console) {
    let mut now = PadPage::open(console);
    for _ in 0..30 {
        let frame = now.frame();
        assert_eq!(frame["operator"]["present"], false, "{frame}");
    }
}

/// The page sees that another one drives and cannot take over before that one has let go; then by a deliberate act, by key.
fn see_who_drives_and_take_over(page: &mut BrowserPage, console: &Console) {
    let mut first = PadPage::open(console);
    let number = first.page;
    assert_eq!(first.take()["is_done"], true);
    first.let_go_until("off the pad", |frame| frame["pad"]["driver"] == number);
    let mut is_said = false;
    first.hold_until("seen to drive", [0.0, 0.0], |frame| {
        is_said |=
            frame["operator"]["present"] == true && page.value(&says(&format!("Page {number} drives."))) == json!(true);
        is_said
    });
    first.let_go_until("let go", |frame| frame["operator"]["present"] == false);
    page.wait_for("the first has let go", &says(&format!("Page {number} has the pad and has let go.")));
    // The pad of another is no pad: it is pressed in vain.
    let place = centre(page);
    page.mouse_half(true, place);
    assert_holds_still(console);
    page.mouse_half(false, place);
    page.value("document.getElementById('pad-take').focus()");
    page.key_half(true, "Enter", 13);
    page.key_half(false, "Enter", 13);
    page.wait_for("it has the pad", &says("Yours."));
}

/// Presses the pad's middle until the snake follows; where the machine is too busy for the lease, anew.
fn hold(page: &mut BrowserPage, place: [f64; 2]) {
    for _ in 0..5 {
        page.mouse_half(true, place);
        page.wait_for("held or lost", &format!("{MOVES} || {LOST}"));
        if page.value(MOVES) == json!(true) {
            return;
        }
        page.mouse_half(false, place);
        page.wait_for("let go", READY);
    }
    panic!("never held for long enough to follow");
}

fn centre(page: &mut BrowserPage) -> [f64; 2] {
    middle(page, "#pad-field")
}

/// The middle of an element.
fn middle(page: &mut BrowserPage, selector: &str) -> [f64; 2] {
    let script = "(r => [r.x + r.width / 2, r.y + r.height / 2])(document.querySelector(".to_owned()
        + &json!(selector).to_string()
        + ").getBoundingClientRect())";
    pair(&page.value(&script))
}

/// No gamepad can be plugged in here: the browser's function says what one would whose right shoulder button is held, and perhaps
/// another one.
fn plug_in(page: &mut BrowserPage, axes: [f64; 2], is_held: bool, button: Option<usize>) {
    page.call("Emulation.setFocusEmulationEnabled", &json!({ "enabled": true }));
    let down = if is_held { json!([5, button]) } else { json!([]) };
    page.value(&format!(
        "navigator.getGamepads = () => [null, {{ connected: true, mapping: 'standard', axes: [{}, {}, 0, 0], buttons: Array.from({{ length: 17 }}, (_, i) => ({{ pressed: {down}.includes(i) }})) }}]; 0",
        axes[0], axes[1]
    ));
}

fn pair(value: &Value) -> [f64; 2] {
    [0, 1].map(|i| value[i].as_f64().expect("a number"))
}

/// A person at the page.
struct Hand<'a> {
    page: &'a mut BrowserPage,
    centre: [f64; 2],
    /// Whether a finger is on the glass.
    is_touching: bool,
}

impl Hand<'_> {
    /// Drives until the camera's picture has moved visibly, lets go, and holds picture and dial against the direction.
    fn drive(&mut self, direction: [f64; 2], how: &str, act: fn(&mut Self, [f64; 2], bool)) {
        self.page.wait_for("ready", READY);
        let dial_before = self.settled("the dial", Self::dial);
        let tip_before = self.settled("the picture", Self::tip);
        let moved = |now: [f64; 2], before: [f64; 2]| [now[0] - before[0], now[1] - before[1]];
        let mut is_far = false;
        for _ in 0..200 {
            if self.page.value("document.getElementById('pad').classList.contains('held')") != json!(true)
                || self.page.value(MOVES) != json!(true)
            {
                // Not held yet, or held up for longer than the lease.
                act(self, direction, false);
                self.page.wait_for("off the pad", READY);
                act(self, direction, true);
            }
            let [x, y] = moved(self.dial(), dial_before);
            is_far = x.hypot(y) > 12.0;
            if is_far {
                break;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        act(self, direction, false);
        self.page.wait_for("let go", READY);
        assert!(is_far, "{how}: it moved by {:?} from {dial_before:?}", moved(self.dial(), dial_before));
        let dial_now = self.settled("the dial", Self::dial);
        let tip_now = self.settled("the picture", Self::tip);
        for (what, moved) in [("dial", moved(dial_now, dial_before)), ("picture", moved(tip_now, tip_before))] {
            let along = (moved[0] * direction[0] + moved[1] * direction[1]) / moved[0].hypot(moved[1]);
            assert!(along > 0.8, "{how}: the {what} moved by {moved:?}");
        }
    }

    /// The measured bend on the dial: to the right and down.
    fn dial(&mut self) -> [f64; 2] {
        let script = "(document.querySelector('#dial .seen').getAttribute('transform') ?? '(0 0)').match(/\\((\\S+) (\\S+)\\)/).slice(1).map(Number)";
        pair(&self.page.value(script))
    }

    /// The tip in the camera's picture, as it is painted: the middle of the points of its third axis, which begins at the tip and points
    /// where the snake bends to; to the right and down.
    fn tip(&mut self) -> [f64; 2] {
        let points = canvas_points("#scene");
        let script = format!(
            "(() => {{
                const data = {points}, width = document.getElementById('scene').clientWidth;
                let [n, right, down] = [0, 0, 0];
                for (let at = 0; at < data.length; at += 4) {{
                    if (data[at + 3] < 60 || data[at] - data[at + 1] < 120 || data[at + 2] - data[at + 1] < 120) continue;
                    [n, right, down] = [n + 1, right + at / 4 % width, down + Math.floor(at / 4 / width)];
                }}
                return [right / n, down / n, n];
            }})()"
        );
        let mut seen = json!(null);
        let is_painted = wait_until(PATIENCE, || {
            self.page.painted();
            seen = self.page.value(&script);
            seen[2].as_f64().is_some_and(|n| n >= 3.0)
        });
        assert!(is_painted, "the tip's axis is painted: {seen}");
        pair(&seen)
    }

    /// Looks through the camera, and waits until the picture has turned there. The tip's third axis gets a colour that nothing else has.
    fn look_through_camera(&mut self) {
        self.page.value("document.documentElement.style.setProperty('--axis-z', '#ff00ff')");
        ["light", "dark"].into_iter().for_each(|theme| self.page.in_theme(theme));
        self.page.value("document.querySelector('[data-view=camera]').click()");
        self.page.wait_for("it is the view", "document.querySelector('[data-view=camera]').ariaPressed === 'true'");
        self.settled("the picture", Self::tip);
    }

    /// What is painted, once it stands: that is after the state that says so, on a busy machine long after.
    fn settled(&mut self, what: &str, look: fn(&mut Self) -> [f64; 2]) -> [f64; 2] {
        let mut before = look(self);
        for _ in 0..100 {
            std::thread::sleep(Duration::from_millis(100));
            self.page.painted();
            let now = look(self);
            if (now[0] - before[0]).hypot(now[1] - before[1]) < 2.0 {
                return now;
            }
            before = now;
        }
        panic!("{what} never stood");
    }

    fn pointer(&mut self, [x, y]: [f64; 2], is_down: bool) {
        const PIXELS: f64 = 40.0;
        self.page.mouse_half(is_down, [self.centre[0] + PIXELS * x, self.centre[1] + PIXELS * y]);
    }

    /// Presses the middle and drags to the direction, or lets go there.
    fn touch(&mut self, [x, y]: [f64; 2], is_down: bool) {
        const PIXELS: f64 = 40.0;
        match (is_down, std::mem::replace(&mut self.is_touching, is_down)) {
            (true, _) => {
                self.page.touch("touchStart", &[self.centre]);
                for part in [0.25, 0.5, 0.75, 1.0] {
                    let way = PIXELS * part;
                    self.page.touch("touchMove", &[[self.centre[0] + way * x, self.centre[1] + way * y]]);
                }
            }
            (false, true) => self.page.touch("touchEnd", &[]),
            (false, false) => {}
        }
    }

    fn keyboard(&mut self, [x, y]: [f64; 2], is_down: bool) {
        let (arrow, code) = match (x, y) {
            (1.0, _) => ("ArrowRight", 39),
            (-1.0, _) => ("ArrowLeft", 37),
            (_, 1.0) => ("ArrowDown", 40),
            _ => ("ArrowUp", 38),
        };
        self.page.value("document.getElementById('pad-field').focus()");
        self.page.key_half(is_down, " ", 32);
        self.page.key_half(is_down, arrow, code);
    }

    fn gamepad(&mut self, [x, y]: [f64; 2], is_down: bool) {
        plug_in(self.page, [0.8 * x, 0.8 * y], is_down, None);
    }
}
