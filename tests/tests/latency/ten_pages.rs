//! What ten pages cost the chain, and how fast they are: one Chromium and nine readers of the live connection, measured beside
//! the same chain without a console, turn by turn in one run. It prints figures for docs/bench and asserts counts and ratios.

use super::PATIENCE;
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{OperatingState, SlaveState};
use krait_tests::{
    Browser, BrowserPage, Console, Krait, TempFolder, cpu_ticks, instance_name, next_of_kind, states_in, wait_until,
};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Turns; each has a stretch without a console, another one to tell the spread, one with nine readers, one with a browser at nice 10
/// besides, one with a browser as it comes in its place, one with a diagnosis besides, one with a hundred connections that hang besides.
const TURNS: usize = 6;
/// Environment variable with another number of turns, for a look that takes less than six minutes.
const OTHER_TURNS: &str = "KRAIT_TURNS";
const STRETCH: Duration = Duration::from_secs(5);
/// What has just begun or ended on the machine is over by then.
const SETTLE: Duration = Duration::from_secs(2);
/// Pages besides the one in the browser.
const READERS: usize = 9;
/// Connections that hang; a fifth of them are pages that never read.
const STALLED: usize = 100;
/// Environment variable with the chain's SCHED_FIFO priority; without it that which a chain has by itself, for which its user needs the
/// right; 0: it shares time as every other process.
const PRIORITY: &str = "KRAIT_PRIORITY";
/// Environment variable that is 1 where the chain's cores are kept from sleeping.
const KEEP_AWAKE: &str = "KRAIT_KEEP_AWAKE";
/// With a priority whatever is beside the chain makes its p50 at most so many times that of the slower of two runs without a console (1.1
/// is wanted; 1.34 was measured on two quiet cores, whose caches the browser takes), and its p99 so many times their largest (1 is wanted;
/// 1.02).
const MOST_P50_RATIO: f64 = 1.6;
const MOST_P99_RATIO: f64 = 1.5;
/// Of the pictures that the server sends the browser paints so many at least, beside a chain on the same cores.
const LEAST_PAINTED: f64 = 0.5;
const STOPS: usize = 60;
/// Nice value of the second browser.
const NICE: u8 = 10;
const NICE_WAY: &str = "ten pages, browser at nice 10";
const TICKS_PER_S: f64 = 100.0;

const WAYS: [&str; 7] = [
    "without",
    "without, again",
    "nine readers",
    NICE_WAY,
    "ten pages",
    "ten pages and a diagnosis",
    "all that and a hundred stalled",
];

/// When a stretch of a way began and ended, ns.
pub(super) type Stretches = Vec<(&'static str, i64, i64)>;

#[test]
#[ignore = "a benchmark of minutes; .ci/long runs it"]
fn ten_pages_and_a_diagnosis_beside_a_chain() {
    let (Some(browser), Some(nice_browser)) = (Browser::start(), Browser::start_at(NICE)) else { return };
    let (instance, folder) = (instance_name("ten"), TempFolder::new("ten"));
    let (recording, lab) = (folder.file("ten.mcap"), folder.file("lab"));
    let n_turns = std::env::var(OTHER_TURNS).map_or(TURNS, |turns| turns.parse().expect("a number of turns"));
    println!("load before: {}", load());
    let config = folder.file("config.toml");
    let priority = std::env::var(PRIORITY).unwrap_or_else(|_| "\"auto\"".to_owned());
    let realtime = format!(
        "[realtime]\npriority = {priority}\nkeep_awake = {}\n",
        std::env::var(KEEP_AWAKE).is_ok_and(|own| own == "1")
    );
    println!("{realtime}");
    std::fs::write(&config, realtime).expect("written");
    let arguments = ["run", "--engage=again", "--instance", &instance, "--config", &config, "--recording", &recording];
    let chain = Krait::start(&arguments);
    let mut stretches = Stretches::new();
    let (mut shares, mut firsts) = (BTreeMap::<&str, Vec<f64>>::new(), Vec::new());
    let mut painted = Painted::default();
    for turn in 0..n_turns {
        std::thread::sleep(SETTLE);
        for way in &WAYS[..2] {
            stretches.push(stretch(way));
        }
        let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
        let console = Console::of(&mut server);
        let mut page = browser.page("about:blank", 1280, 800);
        let ended = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let _at_the_end_or_at_a_panic = Ending(&ended);
            let mut measured = |way: &'static str| {
                let ticks = cpu_ticks(server.pid());
                let own = stretch(way);
                shares.entry(way).or_default().push(share(&own, cpu_ticks(server.pid()) - ticks));
                stretches.push(own);
            };
            for _ in 0..READERS {
                scope.spawn(|| read_until(&console, &ended));
            }
            std::thread::sleep(SETTLE);
            measured(WAYS[2]);
            let mut nice_page = nice_browser.page(&console.address, 1280, 800);
            nice_page.wait_for("the snake", "document.documentElement.dataset.shown === 'following'");
            std::thread::sleep(SETTLE);
            measured(WAYS[3]);
            nice_page.call("Page.close", &json!({}));
            firsts.push(first_picture_ms(&mut page, &console));
            std::thread::sleep(SETTLE);
            painted.begin(&mut page);
            measured(WAYS[4]);
            painted.end(&mut page);
            riddle(&console);
            scope.spawn(|| diagnose_until(&console, &ended));
            std::thread::sleep(SETTLE);
            measured(WAYS[5]);
            let stalled = console.stalled(STALLED);
            measured(WAYS[6]);
            drop(stalled);
            if turn == n_turns - 1 {
                stretches.extend(stops(&mut page, &console));
            }
        });
        page.call("Page.close", &json!({}));
        server.signal(Signal::TERM);
        server.end(PATIENCE);
    }
    println!("load after: {}", load());
    chain.signal(Signal::INT);
    let ended = chain.end(PATIENCE);
    assert!(ended.stdout.contains(" 0 lost"), "{ended:?}");
    let chain = print_chain(&recording, &stretches, n_turns);
    let [one, other] = [&chain["without"], &chain["without, again"]];
    let (slower, widest) = (f64::max(one.p50, other.p50), f64::max(one.widest, other.widest));
    for way in &WAYS[2..] {
        let (ratio, p99) = (chain[way].p50 / slower, chain[way].p99);
        println!(
            "p50 with {way}: {ratio:.3} of that without a console; p99 {p99:.1} us, of equal runs {widest:.1} us at most"
        );
        // Without one a browser on the chain's own cores costs it more (docs/bench/2026-11-23-console.md).
        let is_held = ratio < MOST_P50_RATIO && p99 <= MOST_P99_RATIO * widest;
        assert!(priority == "0" || is_held, "{way} makes the chain slower: p50 {ratio:.3}, p99 {p99} us of {widest}");
    }
    for (way, shares) in &shares {
        println!("server, {way}: {} % of a core", list(shares.iter().map(|share| 100.0 * share)));
        assert!(shares.iter().all(|share| *share < 0.5), "the server takes half a core: {shares:?}");
    }
    println!("first picture after opening, ms: {}", list(firsts.into_iter()));
    let Painted { found: (glass, per_s), parts, .. } = painted;
    println!(
        "part of the pictures sent that were painted: {}",
        parts.iter().map(|part| format!("{part:.2}")).collect::<Vec<_>>().join(", ")
    );
    assert!(parts.len() == n_turns && parts.iter().all(|part| *part >= LEAST_PAINTED), "the browser paints: {parts:?}");
    println!("glass latency, median, ms: {}; pictures a second: {}", list(glass.into_iter()), list(per_s.into_iter()));
    println!("{}", first_load());
}

/// Tells the other threads that it is over.
pub(super) struct Ending<'a>(pub(super) &'a AtomicBool);

impl Drop for Ending<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn stretch(way: &'static str) -> (&'static str, i64, i64) {
    stretch_of(way, STRETCH)
}

pub(super) fn stretch_of(way: &'static str, length: Duration) -> (&'static str, i64, i64) {
    let from_ns = monotonic_ns();
    std::thread::sleep(length);
    (way, from_ns, monotonic_ns())
}

/// A page without a picture: it takes every frame.
pub(super) fn read_until(console: &Console, ended: &AtomicBool) {
    let mut live = console.page();
    while !ended.load(Ordering::Relaxed) {
        next_of_kind(&mut live, "frame");
    }
}

fn ordered(console: &Console, order: &Value) -> Value {
    let (origin, cookie) = (console.origin(), console.cookie());
    let own = [("Origin", origin.as_str()), ("Cookie", cookie.as_str())];
    let started = console.request("POST", "/lab/job", &own, &order.to_string());
    assert_eq!(started.status, 200, "{started:?}");
    let job = || serde_json::from_str(&console.request("GET", "/lab/job", &own, "").body).expect("JSON");
    let mut answer: Value = job();
    assert!(wait_until(PATIENCE, || {
        answer = job();
        answer["stage"] != "running"
    }));
    answer
}

/// Hides an effect, for the lab to look for.
fn riddle(console: &Console) {
    let made = ordered(console, &json!({ "verb": "quiz", "level": "easy", "seed": 3 }));
    assert_eq!(made["stage"], "done", "{made}");
}

fn diagnose_until(console: &Console, ended: &AtomicBool) {
    while !ended.load(Ordering::Relaxed) {
        let solved = ordered(console, &json!({ "verb": "solve", "riddle": "riddle-easy-3.csv" }));
        assert_eq!(solved["stage"], "done", "{solved}");
    }
}

/// From the navigation to the first picture that the page says was painted, ms.
fn first_picture_ms(page: &mut BrowserPage, console: &Console) -> f64 {
    let watch = "new MutationObserver(() => { if (!window.firstPicture && / ms$/.test(document.querySelector('#fact-live b')?.textContent ?? '')) window.firstPicture = performance.now(); })
        .observe(document, { subtree: true, childList: true, characterData: true });";
    page.call("Page.addScriptToEvaluateOnNewDocument", &json!({ "source": watch }));
    page.call("Page.navigate", &json!({ "url": console.address }));
    page.wait_for("a picture", "window.firstPicture > 0");
    page.value("window.firstPicture").as_f64().expect("ms")
}

/// What the page says of the pictures that it painted.
#[derive(Default)]
struct Painted {
    begun_ns: i64,
    found: (Vec<f64>, Vec<f64>),
    /// Of the pictures that the server sent, by their numbers.
    parts: Vec<f64>,
}

impl Painted {
    fn begin(&mut self, page: &mut BrowserPage) {
        page.value("import('/js/link.js').then(({ on }) => { window.glasses = []; window.numbers = []; on('frame', ({ frame, glass, isPainted }) => { window.numbers.push(frame.n); if (isPainted) window.glasses.push(glass); }); return 0; })");
        self.begun_ns = monotonic_ns();
    }

    fn end(&mut self, page: &mut BrowserPage) {
        let found = page.value("[...window.glasses]");
        let seconds = (monotonic_ns() - self.begun_ns) as f64 * 1e-9;
        let glasses: Vec<f64> = found.as_array().expect("a list").iter().filter_map(Value::as_f64).collect();
        self.found.0.push(quantile(&glasses, 0.5));
        self.found.1.push(glasses.len() as f64 / seconds);
        let numbers = page.value("[window.numbers[0], window.numbers.at(-1)]");
        let n_sent = numbers[1].as_f64().zip(numbers[0].as_f64()).map(|(last, first)| last - first + 1.0);
        self.parts.push(glasses.len() as f64 / n_sent.expect("pictures"));
    }
}

/// Presses the stop again and again; each stretch begins with the press and ends when the chain follows again.
fn stops(page: &mut BrowserPage, console: &Console) -> Stretches {
    let mut live = console.page();
    let session = next_of_kind(&mut live, "hello")["session"].clone();
    let place = page.value("(() => { const r = document.getElementById('stop').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()");
    let place = [0, 1].map(|axis| place[axis].as_f64().expect("a place"));
    let mut pressed = Stretches::new();
    for id in 1..=STOPS {
        assert!(wait_until(PATIENCE, || next_of_kind(&mut live, "frame")["shown"] == "following"), "it follows");
        // Not always at the same point of the browser's and the drives' periods.
        std::thread::sleep(Duration::from_millis(200 + (id as u64 * 7) % 17));
        let from_ns = monotonic_ns();
        page.mouse_half(true, place);
        page.mouse_half(false, place);
        assert!(wait_until(PATIENCE, || next_of_kind(&mut live, "frame")["shown"] == "paused"), "it stops");
        pressed.push(("stop", from_ns, monotonic_ns()));
        live.send(tungstenite::Message::text(r#"{"k":"ping","t":0}"#)).expect("sent");
        let now_ms = next_of_kind(&mut live, "pong")["now_ms"].clone();
        let wish = json!({ "k": "wish", "id": id, "wish": "resume", "session": session, "at_ms": now_ms });
        live.send(tungstenite::Message::text(wish.to_string())).expect("sent");
        assert_eq!(next_of_kind(&mut live, "ack")["is_done"], true);
    }
    pressed
}

/// The way of a chain's samples, us.
struct Way {
    p50: f64,
    p99: f64,
    /// The largest p99 of a turn.
    widest: f64,
}

/// The states of a recording, of which none is missing.
pub(super) fn all_states_in(recording: &str) -> Vec<SlaveState> {
    let states = states_in(recording);
    let n_missing: u64 = states.windows(2).map(|pair| pair[1].sequence - pair[0].sequence - 1).sum();
    assert_eq!(n_missing, 0, "states that the recording lacks");
    states
}

/// What the samples of each way took end to end, stretch by stretch, us.
pub(super) fn latencies_us(states: &[SlaveState], stretches: &Stretches) -> BTreeMap<&'static str, Vec<Vec<f64>>> {
    let mut sequence = 0;
    let mut of_way: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
    for (way, from_ns, to_ns) in stretches.iter().filter(|(way, ..)| *way != "stop") {
        let inside = states.iter().filter(|state| (*from_ns..*to_ns).contains(&state.stamps.device_ns));
        let fresh =
            inside.filter(|state| core::mem::replace(&mut sequence, state.command_sequence) != state.command_sequence);
        let latencies = fresh.filter(|state| state.stamps.drive_written_ns > 0);
        of_way
            .entry(way)
            .or_default()
            .push(latencies.map(|state| state.stamps.end_to_end_ns() as f64 * 1e-3).collect());
    }
    of_way
}

/// Prints what each way cost the chain. No state is missing, and no stop needed more than a pause.
fn print_chain(recording: &str, stretches: &Stretches, n_turns: usize) -> BTreeMap<&'static str, Way> {
    let states = all_states_in(recording);
    let of_way = latencies_us(&states, stretches);
    let mut ways = BTreeMap::new();
    for way in WAYS {
        let each = |q: f64| list(of_way[way].iter().map(|own| quantile(own, q)));
        let all: Vec<f64> = of_way[way].iter().flatten().copied().collect();
        println!(
            "chain, {way}: p50 {:.1} us ({}), p99 {:.1} us ({}), {} samples",
            quantile(&all, 0.5),
            each(0.5),
            quantile(&all, 0.99),
            each(0.99),
            all.len()
        );
        assert!(all.len() > n_turns * 1000, "a chain that runs: {} samples", all.len());
        let widest = of_way[way].iter().map(|own| quantile(own, 0.99)).fold(0.0, f64::max);
        ways.insert(way, Way { p50: quantile(&all, 0.5), p99: quantile(&all, 0.99), widest });
    }
    let first_held = |from_ns: i64| {
        let held = |state: &&SlaveState| state.operating() == Some(OperatingState::Paused);
        states
            .iter()
            .filter(|state| state.sample_ns >= from_ns)
            .find(held)
            .map(|state| (state.sample_ns - from_ns) as f64 * 1e-6)
    };
    let stops = stretches.iter().filter(|(way, ..)| *way == "stop");
    let stops: Vec<f64> = stops.map(|(_, from_ns, _)| first_held(*from_ns).expect("it was held")).collect();
    let n_off = stretches.iter().filter(|(way, ..)| *way == "stop").filter(|(_, from_ns, to_ns)| {
        let mut own = states.iter().filter(|state| (*from_ns..*to_ns).contains(&state.sample_ns));
        own.any(|state| state.operating() == Some(OperatingState::Disabled))
    });
    assert_eq!((stops.len(), n_off.count()), (STOPS, 0), "every press holds, and none needs the server's disable");
    let at = |q| quantile(&stops, q);
    let mut slowest: Vec<(f64, usize)> = stops.iter().enumerate().map(|(i, ms)| (*ms, i + 1)).collect();
    slowest.sort_by(|a, b| b.0.total_cmp(&a.0));
    let told = slowest[..5].iter().map(|(ms, n)| format!("{ms:.1} (press {n})")).collect::<Vec<_>>().join(", ");
    println!(
        "stop, press to first held state: p50 {:.1} ms, p99 {:.1} ms, {} presses, slowest {told}",
        at(0.5),
        at(0.99),
        stops.len()
    );
    ways
}

/// Bytes of the files that a page loads first, as they are and as gzip packs them.
fn first_load() -> String {
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("../console/web");
    let files = [web.join("index.html"), web.join("icon.svg"), web.join("stop.html")].into_iter();
    let folders = ["css", "js"].map(|folder| std::fs::read_dir(web.join(folder)).expect("a folder"));
    let files = files.chain(folders.into_iter().flatten().map(|entry| entry.expect("an entry").path()));
    let (mut n, mut plain, mut packed) = (0, 0, 0);
    for file in files {
        let gzip = Command::new("gzip").arg("-9c").arg(&file).stderr(Stdio::null()).output().expect("gzip");
        (n, plain, packed) =
            (n + 1, plain + std::fs::metadata(&file).expect("a file").len(), packed + gzip.stdout.len());
    }
    assert!(packed < 150_000, "the first load has {packed} bytes");
    format!("first load: {n} files, {plain} bytes as they are, {packed} packed one by one with gzip -9")
}

fn share(&(_, from_ns, to_ns): &(&str, i64, i64), ticks: f64) -> f64 {
    ticks / TICKS_PER_S / ((to_ns - from_ns) as f64 * 1e-9)
}

pub(super) fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len() as f64 * q) as usize).min(sorted.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

fn list(values: impl Iterator<Item = f64>) -> String {
    values.map(|value| format!("{value:.1}")).collect::<Vec<_>>().join(", ")
}

fn load() -> String {
    std::fs::read_to_string("/proc/loadavg").unwrap_or_default().trim().to_owned()
}
