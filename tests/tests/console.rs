//! The console against strangers: each is refused or bounded, and the chain never notices.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{Console, Ended, Krait, TempFolder, instance_name, next_of_kind, processes_of, wait_until};
use rustix::process::Signal;
use std::io::Write;
use std::net::TcpStream;
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
        assert_eq!(console.request("GET", path, &[], "").status, 404, "{path}");
    }
    assert_eq!(console.request("DELETE", "/", &[("Origin", &own)], "").status, 405);
    assert_eq!(end(krait).code, Some(0));
}

#[test]
fn every_answer_forbids_what_the_page_does_not_need() {
    let (krait, console) = lonely();
    for (path, status) in [("/", 200), ("/js/main.js", 200), ("/nothing", 404)] {
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
    assert!(is_closed(&mut large), "5000 bytes where 4096 may be");
    let mut often = console.page();
    for _ in 0..1000 {
        if often.send(Message::text(r#"{"k":"ping","t":1}"#)).is_err() {
            break;
        }
    }
    assert!(is_closed(&mut often), "a thousand messages in a moment");
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

fn is_closed(live: &mut krait_tests::Live) -> bool {
    live.get_ref().set_read_timeout(Some(PATIENCE)).expect("a timeout");
    loop {
        match live.read() {
            Ok(Message::Close(_)) | Err(_) => return true,
            Ok(_) => {}
        }
    }
}

#[test]
fn a_hundred_stalled_connections_cost_the_chain_no_sample_and_the_page_no_freshness() {
    let (instance, folder) = (instance_name("stalled"), TempFolder::new("stalled"));
    let recording = folder.file("run.mcap");
    let arguments = [
        "run",
        "--engage=again",
        "--instance",
        &instance,
        "--console",
        "--seconds",
        "8",
        "--recording",
        &recording,
        "--json",
    ];
    let mut krait = Krait::start(&arguments);
    let console = Console::of(&mut krait);
    // Pages that never read, connections that say half of what they want, and such that say nothing.
    let pages: Vec<_> = (0..20).map(|_| console.page()).collect();
    let halves: Vec<_> = (0..80).map(|idx| stalled(&console, idx % 2 == 0)).collect();
    let mut reading = console.page();
    let numbers: Vec<u64> =
        (0..120).map(|_| next_of_kind(&mut reading, "frame")["n"].as_u64().expect("a number")).collect();
    assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "newer and newer");
    let frame = next_of_kind(&mut reading, "frame");
    assert_eq!(frame["state"]["operating"], "ENABLED", "{frame}");
    drop((pages, halves, reading));
    let ended = krait.end(PATIENCE);
    let figures = ended.json();
    assert_eq!(figures["samples"]["lost"], 0, "{figures}");
    assert!(processes_of(&instance).is_empty(), "the console ends with its chain");
}

fn stalled(console: &Console, says_half: bool) -> TcpStream {
    let mut stream = TcpStream::connect(("127.0.0.1", console.port)).expect("it listens");
    if says_half {
        stream.write_all(b"GET / HTTP/1.1\r\nHost: ").expect("half a request");
    }
    stream
}
