//! The console against strangers: each is refused or bounded, and the chain never notices.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::message::{OperatingState, RequestOutcome, StateAnswer, StateRequest, Transition};
use krait_ipc::{Bus, ReadOptions};
use krait_tests::{
    Console, Ended, Krait, Live, TempFolder, answer_on, cpu_ticks, instance_name, is_closed, next_of_kind,
    processes_of, wait_until,
};
use rustix::process::{Pid, Signal, kill_process};
use std::io::Read;
use tungstenite::Message;

const PATIENCE: Duration = Duration::from_secs(240);

/// A console alone: no chain runs in its instance, and none is needed to refuse strangers.
fn lonely() -> (Krait, Console) {
    let mut krait = Krait::start(&["console", "--instance", &instance_name("console")]);
    let console = Console::of(&mut krait);
    (krait, console)
}

fn end(krait: Krait) -> Ended {
    krait.signal(Signal::TERM);
    krait.end(PATIENCE)
}

#[test]
fn strangers_are_refused_each_for_what_it_lacks() {
    let (krait, console) = lonely();
    let (own, cookie) = (console.origin(), console.cookie());
    let foreign = Some("http://evil.example");
    assert_eq!(console.live(foreign, Some(&cookie)).err(), Some(403), "a foreign page with the cookie");
    assert_eq!(console.live(Some("null"), Some(&cookie)).err(), Some(403), "a page without an origin");
    assert_eq!(console.live(None, Some(&cookie)).err(), Some(403), "no page at all");
    assert_eq!(console.live(Some(&own), None).err(), Some(403), "the own page without the token");
    let wrong = cookie.rsplit_once('=').expect("a pair").0.to_owned() + "=00000000000000000000000000000000";
    assert_eq!(console.live(Some(&own), Some(&wrong)).err(), Some(403), "the own page with another token");
    assert!(console.live(Some(&own), Some(&cookie)).is_ok(), "the own page with the token");

    let rebound = [("Host", "rebound.example")];
    assert_eq!(console.request("GET", "/", &rebound, "").status, 403, "another name that leads here");
    assert_eq!(console.request("POST", "/token", &[("Origin", "http://evil.example")], &console.token).status, 403);
    assert_eq!(console.request("POST", "/token", &[("Origin", &own)], "guess").status, 403);
    assert_eq!(console.request("POST", "/token", &[("Origin", &own)], &"x".repeat(5000)).status, 413);
    for path in ["/../Cargo.toml", "/js/../../src/lib.rs", "/js/%2e%2e/%2e%2e/src/lib.rs", "//etc/passwd", "/js/"] {
        assert_eq!(
            console.request("GET", path, &[], "").status,
            403,
            "{path}: what is no page asks for the token first"
        );
        let known = console.request("GET", path, &[("Origin", &own), ("Cookie", &cookie)], "");
        assert!([400, 404].contains(&known.status), "{path} with the token: {known:?}");
    }
    assert_eq!(console.request("DELETE", "/", &[("Origin", &own)], "").status, 405);
    assert_eq!(end(krait).code, Some(0));
}

/// Both ports are of this machine alone: they listen at 127.0.0.1, and no other address of the machine leads to them.
#[test]
fn no_address_but_that_of_this_machine_alone_leads_to_the_console() {
    let (krait, console) = lonely();
    let ports = [console.port, console.stop_port()];
    for (table, own) in [("/proc/net/tcp", "0100007F"), ("/proc/net/tcp6", "00000000000000000000000001000000")] {
        let listening = std::fs::read_to_string(table).expect("the kernel's list");
        let at: Vec<(&str, u16)> = listening.lines().skip(1).filter_map(listens_at).collect();
        let ours: Vec<_> = at.iter().filter(|(_, port)| ports.contains(port)).collect();
        assert!(table.ends_with('6') || ports.iter().all(|port| ours.iter().any(|(_, of)| of == port)), "{at:?}");
        assert!(ours.iter().all(|(address, _)| *address == own), "{table}: {ours:?}");
    }
    let all = std::fs::read_to_string("/proc/net/fib_trie").expect("the kernel's addresses");
    let local = all.lines().zip(all.lines().skip(1)).filter(|(_, kind)| kind.contains("/32 host LOCAL"));
    let local = local.filter_map(|(address, _)| address.rsplit(' ').next()?.parse::<std::net::Ipv4Addr>().ok());
    let others: std::collections::BTreeSet<_> = local.filter(|address| !address.is_loopback()).collect();
    if others.is_empty() {
        krait_tests::say_aloud("SKIPPED ALOUD: this machine has no address but 127.0.0.1 to knock at");
    }
    // Of the loopback network too there is one address only.
    for address in others.into_iter().chain([std::net::Ipv4Addr::new(127, 0, 0, 2)]) {
        for port in ports {
            let knocked = std::net::TcpStream::connect_timeout(&(address, port).into(), Duration::from_secs(20));
            let refused = knocked.map(|_| "let in").map_err(|error| error.kind());
            assert_eq!(refused, Err(std::io::ErrorKind::ConnectionRefused), "{address}:{port}");
        }
    }
    assert_eq!(console.request("GET", "/", &[], "").status, 200, "while it answers here");
    assert_eq!(end(krait).code, Some(0));
}

/// Where a line of the kernel's list listens: the address as it stands there, and the port.
fn listens_at(line: &str) -> Option<(&str, u16)> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let (address, port) = fields.get(1)?.split_once(':')?;
    (fields.get(3) == Some(&"0A")).then_some((address, u16::from_str_radix(port, 16).ok()?))
}

#[test]
fn every_answer_forbids_what_the_page_does_not_need() {
    let (krait, console) = lonely();
    for (path, status) in [("/", 200), ("/js/main.js", 200), ("/nothing", 403)] {
        let answer = console.request("GET", path, &[], "");
        assert_eq!(answer.status, status);
        let policy = answer.header("content-security-policy").expect("a policy");
        for part in ["default-src 'none'", "script-src 'self'", "frame-ancestors 'none'", "base-uri 'none'"] {
            assert!(policy.contains(part), "{part} in {policy}");
        }
        assert!(!policy.contains("unsafe"), "{policy}");
        assert_eq!(answer.header("x-content-type-options"), Some("nosniff"));
    }
    let page = console.request("GET", "/", &[], "").body;
    assert!(!page.contains("style=") && !page.contains("onclick") && !page.contains("https://"), "nothing inline");
    assert_eq!(end(krait).code, Some(0));
}

#[test]
fn what_is_too_large_too_often_or_not_understood_ends_that_page_alone() {
    let (krait, console) = lonely();
    let mut large = console.page();
    large.send(Message::text("x".repeat(5000))).expect("sent");
    assert!(is_closed(&mut large, PATIENCE), "5000 bytes where 4096 may be");
    let mut often = console.page();
    for _ in 0..1000 {
        if often.send(Message::text(r#"{"k":"ping","t":1}"#)).is_err() {
            break;
        }
    }
    assert!(is_closed(&mut often, PATIENCE), "a thousand messages in a moment");
    let mut confused = console.page();
    confused.send(Message::text(r#"{"k":"open the gate"}"#)).expect("sent");
    confused.send(Message::text(r#"{"k":"ping","t":7}"#)).expect("sent");
    assert_eq!(next_of_kind(&mut confused, "pong")["t"], 7.0, "what is not understood is passed over");
    let pages: Vec<_> = (0..31).map(|_| console.page()).collect();
    let refused = console.live(Some(&console.origin()), Some(&console.cookie()));
    assert_eq!(refused.err(), Some(403), "a 33rd page");
    drop(pages);
    drop(confused);
    assert!(
        wait_until(PATIENCE, || console.live(Some(&console.origin()), Some(&console.cookie())).is_ok()),
        "places are given back"
    );
    assert_eq!(end(krait).code, Some(0));
}

/// Whether a page's live connection answers.
fn answers(page: &mut Live, t: u32) -> bool {
    page.send(Message::text(format!(r#"{{"k":"ping","t":{t}}}"#))).expect("sent");
    next_of_kind(page, "pong")["t"] == f64::from(t)
}

#[test]
fn a_body_that_never_comes_is_answered_and_hung_up_on_while_the_page_goes_on() {
    let (krait, console) = lonely();
    let (origin, cookie) = (console.origin(), console.cookie());
    let mut page = console.page();
    let known = [("Origin", origin.as_str()), ("Cookie", cookie.as_str())];
    let begin = |n: usize| match n.is_multiple_of(2) {
        true => console.post_in_part("/token", &known[..1]),
        false => console.post_in_part("/lab/job", &known),
    };
    let begun: Vec<_> = (0..20).map(begin).collect();
    let waiting = std::thread::spawn(|| begun.into_iter().map(answer_on).collect::<Vec<_>>());
    let mut n_answered = 0;
    while !waiting.is_finished() {
        assert!(answers(&mut page, n_answered), "beside {n_answered} answers");
        n_answered += 1;
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(n_answered > 0, "the page was answered meanwhile");
    for answer in waiting.join().expect("answers") {
        assert_eq!(answer.status, 408, "{answer:?}");
        assert!(answer.body.contains("body did not come") && answer.body.lines().count() == 1, "{answer:?}");
    }
    assert_eq!(answer_on(console.post_in_part("/token", &[])).status, 403, "a stranger's is not waited for");
    assert_eq!(answer_on(console.stop_in_part()).status, 200, "the stop needs no body and waits for none");
    assert_eq!(end(krait).code, Some(0));
}

#[test]
fn a_flood_of_requests_is_refused_in_a_sentence_and_the_stop_never_is() {
    const N: usize = 1000;
    let (krait, console) = lonely();
    let mut page = console.page();
    let n_served = |heard: &str| heard.matches("HTTP/1.1 200").count();
    let heard = console.flood("/icon.svg", N, |heard| heard.contains("ask again"));
    assert!((256..N).contains(&n_served(&heard)), "{} were served", n_served(&heard));
    let refused = heard.split("HTTP/1.1 429").nth(1).and_then(|refusal| refusal.split_once("\r\n\r\n"));
    let (headers, rest) = refused.expect("a refusal");
    let sentence = rest.split("HTTP/1.1").next().expect("a body");
    assert!(headers.contains("content-security-policy"), "{headers}");
    assert!(sentence.starts_with("the console was asked too often") && !sentence.contains('\n'), "{sentence}");
    // Another connection is served, the page's live one goes on, and the stop's port has no such bound.
    assert_eq!(console.request("GET", "/", &[], "").status, 200);
    assert!(answers(&mut page, 1));
    let of_stop = console.flood_stop(N, |heard| n_served(heard) >= N);
    assert_eq!((n_served(&of_stop), of_stop.contains("HTTP/1.1 429")), (N, false));
    assert_eq!(console.at_stop("GET", &console.stop_path(), &[]).status, 200);
    assert_eq!(end(krait).code, Some(0));
}

#[test]
fn a_hundred_stalled_connections_and_a_thousand_more_cost_the_chain_no_sample_and_the_page_no_freshness() {
    let (instance, folder) = (instance_name("stalled"), TempFolder::new("stalled"));
    let recording = folder.file("run.mcap");
    let arguments =
        ["run", "--engage=again", "--instance", &instance, "--console", "--seconds", "8", "--recording", &recording];
    let mut krait = Krait::start(&arguments);
    let console = Console::of(&mut krait);
    let stalled = console.stalled(100);
    let mut pages: Vec<Live> = (0..10).map(|_| console.page()).collect();
    let processes = processes_of(&instance);
    let server = processes.iter().find(|(name, _)| name == "console").expect("the server").1;
    let (from_ticks, from_ns) = (cpu_ticks(server), krait_ipc::clock::monotonic_ns());
    let mut numbers = vec![Vec::new(); pages.len()];
    for _ in 0..120 {
        for (page, numbers) in pages.iter_mut().zip(&mut numbers) {
            numbers.push(next_of_kind(page, "frame")["n"].as_u64().expect("a number"));
        }
    }
    let share = 0.01 * (cpu_ticks(server) - from_ticks) / ((krait_ipc::clock::monotonic_ns() - from_ns) as f64 * 1e-9);
    assert!(share < 0.5, "the server takes {share} of a core");
    for numbers in &numbers {
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "newer and newer: {numbers:?}");
        let n_made = numbers[numbers.len() - 1] - numbers[0] + 1;
        assert!(n_made < 2 * numbers.len() as u64, "a page gets most of the {n_made} pictures: {}", numbers.len());
    }
    // A thousand more while it moves, of which 300 stay: beyond 256 the page's port has no place.
    let full = console.filled(1000, 300);
    assert_eq!(console.request("GET", "/", &[], "").status, 0, "the page's port is full");
    let frame = next_of_kind(&mut pages[0], "frame");
    assert_eq!(frame["state"]["operating"], "ENABLED", "{frame}");
    drop((full, stalled, pages));
    let ended = krait.end(PATIENCE);
    assert!(ended.stdout.contains(" 0 lost"), "{ended:?}");
    assert!(processes_of(&instance).is_empty(), "the console ends with its chain");
}

/// Bytes of pictures that a page which never reads may have got by the time it is hung up on: what the kernel keeps for it on both sides.
const MOST_STALE_BYTES: usize = 1 << 20;

#[test]
fn a_page_that_never_reads_is_hung_up_on_and_no_long_row_of_old_pictures_waits_for_it() {
    let instance = instance_name("never-reads");
    let mut krait = Krait::start(&["run", "--instance", &instance, "--engage", "--console", "--no-recording"]);
    let console = Console::of(&mut krait);
    let server = processes_of(&instance).iter().find(|(name, _)| name == "console").expect("the server").1;
    let mut reading = console.page();
    next_of_kind(&mut reading, "frame");
    let n_before = n_open_files(server);
    let never_reads = console.page();
    assert!(wait_until(PATIENCE, || n_open_files(server) > n_before), "it is served");
    // Who reads goes on meanwhile.
    let is_hung_up = wait_until(PATIENCE, || {
        next_of_kind(&mut reading, "frame");
        n_open_files(server) <= n_before
    });
    assert!(is_hung_up, "nobody waits for it forever");
    let mut n_bytes = 0;
    let mut socket = never_reads.get_ref();
    let mut bytes = vec![0; 64 * 1024];
    // The end, or a reset: the connection is closed.
    while let Ok(n @ 1..) = socket.read(&mut bytes) {
        n_bytes += n;
    }
    println!("{n_bytes} bytes had come to a page that never read");
    assert!((1..MOST_STALE_BYTES).contains(&n_bytes), "{n_bytes} bytes");
    assert_eq!(end(krait).code, Some(0));
}

/// Files and sockets that a process has open.
fn n_open_files(pid: u32) -> usize {
    std::fs::read_dir(format!("/proc/{pid}/fd")).map_or(0, Iterator::count)
}

#[test]
fn a_stop_needs_its_own_token_and_origin_and_nothing_else_and_the_drives_confirm_it() {
    let instance = instance_name("stop");
    let mut krait = Krait::start(&["run", "--instance", &instance, "--engage", "--console", "--no-recording"]);
    let console = Console::of(&mut krait);
    let (path, origin) = (console.stop_path(), console.stop_origin());
    let foreign = [("Origin", "http://evil.example")];
    assert_eq!(console.at_stop("POST", &path, &foreign).status, 403, "a foreign page");
    assert_eq!(console.at_stop("POST", &path, &[("Origin", "null")]).status, 403, "a page without an origin");
    assert_eq!(console.at_stop("POST", &path, &[]).status, 403, "no page at all");
    let rebound = [("Host", "rebound.example"), ("Origin", &origin)];
    assert_eq!(console.at_stop("POST", &path, &rebound).status, 403, "another name that leads here");
    assert_eq!(console.at_stop("GET", &path, &rebound).status, 403, "another name that leads here");
    let guess = format!("/stop/{}", console.token);
    assert_eq!(console.at_stop("POST", &guess, &[("Origin", &origin)]).status, 403, "the page's token stops nothing");
    let token = path.rsplit_once('/').expect("a token").1;
    let answer = console.request("POST", "/token", &[("Origin", &console.origin())], token);
    assert_eq!(answer.status, 403, "the stop's token opens nothing");

    let document = console.at_stop("GET", &path, &[]);
    assert_eq!(document.header("origin-agent-cluster"), Some("?1"));
    assert_eq!(document.header("referrer-policy"), Some("same-origin"));
    let policy = document.header("content-security-policy").expect("a policy");
    let framed = format!("frame-ancestors {};", console.origin());
    assert!(
        policy.contains(&framed) && policy.contains("default-src 'none'") && !policy.contains("unsafe"),
        "{policy}"
    );
    let cookie = console.cookie();
    assert!(cookie.contains(&instance), "{cookie}: two consoles of one browser keep each other's");
    assert!(document.body.contains("method=\"post\""), "a plain form");
    let mut page = console.page();
    assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["state"]["operating"] == "ENABLED"));
    // A thousand connections to the page's port, of which it keeps a quarter: it has no place left, and the stop has its own.
    let full = console.filled(1000, 300);
    assert_eq!(console.request("GET", "/", &[], "").status, 0, "the page's port is full");
    let stopped = console.at_stop("POST", &path, &[("Origin", &origin)]);
    assert!(stopped.status == 200 && stopped.body.contains("the drives confirmed it"), "{stopped:?}");
    assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["state"]["operating"] == "PAUSED"));
    drop(full);
    assert!(wait_until(PATIENCE, || console.request("GET", "/", &[], "").status == 200), "its places are given back");

    let session = hello(&console)["session"].as_str().expect("a session").to_owned();
    let mut id = 0;
    let mut wish = |wish: &str, session: &str, same_id: bool, late_ms: f64| {
        id += u64::from(!same_id);
        page.send(Message::text(r#"{"k":"ping","t":0}"#)).expect("sent");
        let now_ms = next_of_kind(&mut page, "pong")["now_ms"].as_f64().expect("an instant");
        let asked =
            serde_json::json!({ "k": "wish", "id": id, "wish": wish, "session": session, "at_ms": now_ms - late_ms });
        page.send(Message::text(asked.to_string())).expect("sent");
        next_of_kind(&mut page, "ack")
    };
    assert_eq!(wish("resume", "another", false, 0.0)["is_done"], false, "a page of another console");
    assert_eq!(wish("resume", &session, false, 2000.0)["is_done"], false, "a command that lay in a queue");
    let resumed = wish("resume", &session, false, 0.0);
    assert_eq!(resumed["is_done"], true, "{resumed}");
    let again = wish("resume", &session, true, 0.0);
    assert!(again["is_done"] == false && again["say"].as_str().is_some_and(|say| say.contains("before")), "{again}");
    let disabled = wish("disable", &session, false, 0.0);
    assert_eq!(disabled["is_done"], true, "{disabled}");
    let refused = wish("resume", &session, false, 0.0);
    assert_eq!(refused["is_done"], false, "{refused}");
    drop(page);
    assert_eq!(end(krait).code, Some(0));
}

/// A slave that hangs obeys no stop. The server itself, not the page, then asks the supervisor for power off, once more where no
/// answer comes; where that fails too it says what is left to do. When the slave wakes up it stops and its power is off.
#[test]
fn a_stop_that_the_slave_does_not_confirm_becomes_a_disable_and_is_never_called_confirmed() {
    let instance = instance_name("escalate");
    let run = ["run", "--instance", &instance, "--engage=again", "--console", "--no-recording"];
    let mut krait = Krait::start(&run);
    let console = Console::of(&mut krait);
    let mut page = console.page();
    assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["shown"] == "following"));
    let bus = Bus::open(&instance, "test").expect("bus");
    let mut requests = bus.reader::<StateRequest>(ReadOptions::observing()).expect("a reader");
    let mut asked = move || {
        let mut all = Vec::new();
        while let Some(request) = requests.take().expect("taken") {
            all.push(request.transition());
        }
        all
    };
    let _of_before = asked();
    assert!(console.press_stop().contains("the drives confirmed it"), "a slave that lives");
    assert_eq!(asked(), [], "a stop that is confirmed asks for nothing more");

    let slave = processes_of(&instance).into_iter().find(|(name, _)| name == "slave").expect("a slave").1;
    let slave = Pid::from_raw(slave.cast_signed()).expect("a process");
    kill_process(slave, Signal::STOP).expect("frozen");
    let said = console.press_stop();
    let escalated = asked();
    kill_process(slave, Signal::CONT).expect("awake");
    assert!(said.contains("NOT CONFIRMED. Use the emergency stop of the machine."), "{said}");
    assert!((1..=2).contains(&escalated.len()), "once, and once more: {escalated:?}");
    assert!(escalated.iter().all(|transition| *transition == Some(Transition::Disable)), "{escalated:?}");
    let mut page = console.page();
    let is_off = wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["state"]["operating"] == "DISABLED");
    assert!(is_off, "awake, its power is off");

    // Who presses and closes the page, or presses again, is obeyed too.
    let _of_before = asked();
    kill_process(slave, Signal::STOP).expect("frozen");
    console.press_stop_and_leave();
    let mut left = Vec::new();
    let is_asked = wait_until(Duration::from_secs(1), || {
        left.extend(asked());
        !left.is_empty()
    });
    kill_process(slave, Signal::CONT).expect("awake");
    assert!(is_asked, "nothing was asked for once the page had gone");
    assert!(left.iter().all(|transition| *transition == Some(Transition::Disable)), "{left:?}");
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
    assert_eq!(processes_of(&instance), [], "no process is left");
}

/// The same with drives that obey no stop and do as the supervisor says: power is off and the page says so; nothing but a disable
/// was asked for, and only after the stop. This test is the supervisor.
#[test]
fn a_stop_that_only_a_disable_ends_says_that_power_was_turned_off() {
    let instance = instance_name("disable");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let bus = Bus::open(&instance, "launch").expect("bus");
    let switch = bus.stop_switch().expect("the stop");
    let mut requests = bus.reader::<StateRequest>(ReadOptions::observing()).expect("a reader");
    let mut answers = bus.writer::<StateAnswer>().expect("the authority");
    let before = switch.asked();
    let said = std::thread::scope(|scope| {
        let document = scope.spawn(|| console.press_stop());
        let mut n_asked = 0;
        while !document.is_finished() {
            while let Some(request) = requests.take().expect("taken") {
                assert_eq!(request.transition(), Some(Transition::Disable));
                assert_eq!(switch.asked(), before.wrapping_add(1), "after one stop that was asked for");
                n_asked += 1;
                let answer = StateAnswer {
                    sequence: n_asked,
                    sample_ns: request.sample_ns,
                    sender_pid: request.sender_pid,
                    outcome: RequestOutcome::Done as u32,
                    operating_state: OperatingState::Disabled as u32,
                    flags: 0,
                };
                answers.send(&answer).expect("answered");
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        assert!((1..=2).contains(&n_asked), "{n_asked} requests");
        document.join().expect("an answer")
    });
    assert!(said.contains("power was turned off after") && !said.contains("confirmed it"), "{said}");
    assert_eq!(end(krait).code, Some(0));
}

fn hello(console: &Console) -> serde_json::Value {
    next_of_kind(&mut console.page(), "hello")
}

/// A chain keeps its configuration in its instance: a console that is started beside it without one tells that machine's facts. What the
/// user names stays as he says, and without a chain the defaults count.
#[test]
fn a_console_started_beside_a_chain_tells_that_chains_facts() {
    const WRIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml");
    const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.csv");
    let (instance, folder) = (instance_name("beside"), TempFolder::new("beside"));
    let config = folder.file("krait.toml");
    std::fs::write(&config, "[resolve]\nmax_bend_rad = 0.7\n").expect("written");
    let console = |more: &[&str]| {
        let mut krait = Krait::start(&[&["console", "--instance", &instance][..], more].concat());
        let mut page = Console::of(&mut krait).page();
        let facts = next_of_kind(&mut page, "hello")["facts"].clone();
        (krait, facts, page)
    };
    let run = ["run", "--engage=again", "--master", "script", "--input", SCRIPT, "--model", WRIST, "--no-recording"];
    let chain = Krait::start(&[&run[..], &["--instance", &instance]].concat());
    // Its configuration is kept before any of its processes starts.
    let has_master = || processes_of(&instance).iter().any(|(name, _)| name == "master");
    assert!(wait_until(PATIENCE, has_master), "{:?}", processes_of(&instance));
    let (beside, facts, mut page) = console(&[]);
    assert_eq!(facts["joints"]["low"].as_array().map(Vec::len), Some(3), "{facts}");
    assert_eq!(facts["joints"]["segments"], serde_json::json!([]), "{facts}");
    assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["shown"] == "following"));
    let (named, facts, _) = console(&["--config", &config]);
    assert!(facts["joints"].is_null() && facts["max_bend_rad"] == 0.7, "{facts}");
    assert_eq!(end(named).code, Some(0));
    assert_eq!(end(chain).code, Some(0));
    // The first console keeps the instance's folder; what the chain kept there is gone.
    let (alone, facts, _) = console(&[]);
    assert!(facts["joints"].is_null(), "{facts}");
    assert_eq!([end(alone).code, end(beside).code], [Some(0); 2]);
}

/// A console that is there first: each chain that is started there later is the one that its pages show. One whose machine is the page's
/// own leaves the page alone.
#[test]
fn a_console_started_before_its_chain_tells_the_machine_of_each_chain_that_comes() {
    const WRIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml");
    const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.csv");
    let instance = instance_name("before");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let run = |more: &[&str]| {
        Krait::start(&[&["run", "--engage=again", "--no-recording", "--instance", &instance][..], more].concat())
    };
    let mut page = console.page();
    let session = next_of_kind(&mut page, "hello")["session"].clone();
    for (more, n_joints) in
        [(&["--master", "script", "--input", SCRIPT, "--model", WRIST][..], Some(3)), (&[][..], None)]
    {
        let chain = run(more);
        assert!(is_closed(&mut page, PATIENCE), "the page shall come again");
        page = console.page();
        let hello = next_of_kind(&mut page, "hello");
        assert_eq!(hello["facts"]["joints"]["low"].as_array().map(Vec::len), n_joints, "{hello}");
        assert_eq!(hello["session"], session, "the console is the same");
        follows(&mut page);
        assert_eq!(end(chain).code, Some(0));
        // What it showed last stays until the next chain; the same machine once more is nothing new.
        let again = run(more);
        assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["shown"] != "following"));
        follows(&mut page);
        assert_eq!(end(again).code, Some(0));
        assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["shown"] != "following"));
    }
    assert_eq!(end(krait).code, Some(0));
}

/// Until the chain has followed for a second: one that is ended in the very moment at which it begins says that it was stopped before it
/// was ready.
fn follows(page: &mut Live) {
    assert!(wait_until(PATIENCE, || next_of_kind(page, "frame")["shown"] == "following"));
    for _ in 0..60 {
        next_of_kind(page, "frame");
    }
}

#[test]
fn recordings_and_jobs_are_named_from_lists_and_open_to_the_token_alone() {
    let folder = TempFolder::new("library");
    std::fs::write(folder.path().join("secret.txt"), "secret").expect("written");
    std::fs::create_dir(folder.path().join("recordings")).expect("made");
    std::fs::write(folder.path().join("recordings/broken.mcap"), "no recording").expect("written");
    let (recordings, lab) = (folder.file("recordings"), folder.file("lab"));
    let instance = instance_name("library");
    let mut krait = Krait::start(&["console", "--instance", &instance, "--recordings", &recordings, "--lab", &lab]);
    let console = Console::of(&mut krait);
    let (origin, cookie) = (console.origin(), console.cookie());
    let own = [("Origin", origin.as_str()), ("Cookie", cookie.as_str())];
    assert_eq!(console.request("GET", "/recordings", &[], "").status, 403, "without the token");
    let list = console.request("GET", "/recordings", &own, "");
    assert!(list.status == 200 && list.body.contains("broken.mcap"), "{list:?}");
    for name in ["..%2fsecret.txt", "%2e%2e/secret.txt", "secret.txt", "nothing.mcap"] {
        assert_eq!(console.request("GET", &format!("/recordings/{name}"), &own, "").status, 404, "{name}");
    }
    assert_eq!(console.request("GET", "/recordings/broken.mcap", &own, "").status, 422);
    for order in [
        r#"{"verb":"verify","data":"../secret.txt"}"#,
        r#"{"verb":"compare","model":"../../etc/passwd","data":"broken.mcap"}"#,
        r#"{"verb":"add","model":"base.toml","data":"broken.mcap","effect":"--out","out":"x.toml"}"#,
        r#"{"verb":"add","model":"base.toml","data":"broken.mcap","effect":"backlash","out":"../x.toml"}"#,
        r#"{"verb":"quiz","level":"--force","seed":1}"#,
        r#"{"verb":"quiz","level":"easy","seed":1000000}"#,
        r#"{"verb":"look","riddle":"../../secret.txt"}"#,
        r#"{"verb":"guess","riddle":"riddle-easy-1.csv","guess":null}"#,
    ] {
        assert_eq!(console.request("POST", "/lab/job", &own, order).status, 409, "{order}");
    }
    assert_eq!(console.request("POST", "/lab/job", &own, r#"{"verb":"rm"}"#).status, 400);
    assert_eq!(console.request("POST", "/lab/job", &[("Cookie", &cookie)], "{}").status, 403, "no origin");
    assert_eq!(console.request("POST", "/lab/data/..%2fx.csv", &own, "t").status, 400);
    for (text, given) in [("time_s\n0\n", "x.csv"), ("time_s\n1\n", "x-2.csv"), ("time_s\n0\n", "x.csv")] {
        let taken = console.request("POST", "/lab/data/x.csv", &own, text);
        assert!(taken.status == 200 && taken.body.contains(&format!("\"name\":\"{given}\"")), "{taken:?}");
    }
    assert!(console.request("GET", "/lab", &own, "").body.contains("x.csv"));
    let started = console.request("POST", "/lab/job", &own, r#"{"verb":"compare","model":"base.toml","data":"x.csv"}"#);
    assert_eq!(started.status, 200, "{started:?}");
    let job = || console.request("GET", "/lab/job", &own, "").body;
    assert!(wait_until(PATIENCE, || job().contains("\"failed\"")), "{}", job());
    assert!(job().contains("x.csv"), "its sentence names the file: {}", job());
    assert_eq!(end(krait).code, Some(0));
}
