//! Viewers of engineers, Foxglove and Lichtblick: what they may read, that they can do nothing else, and that none disturbs the chain.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::clock;
use krait_schema::{Channel, Sample};
use krait_tests::{Console, Ended, Krait, TempFolder, instance_name, is_closed, wait_until};
use rustix::process::Signal;
use std::collections::BTreeMap;
use tungstenite::Message;

const PATIENCE: Duration = Duration::from_secs(240);

/// A viewer of engineers: what Foxglove and Lichtblick say when they connect.
const VIEWER: (&str, &str) = ("Sec-WebSocket-Protocol", "foxglove.sdk.v1, foxglove.websocket.v1");

#[test]
fn a_viewer_reads_what_a_recording_has_and_the_figures_and_can_do_nothing_else() {
    let (instance, folder) = (instance_name("viewer"), TempFolder::new("viewer"));
    let recording = folder.file("run.mcap");
    // The chain's own console: the same process as `krait console --foxglove`, asked for on the chain's command line.
    let run = ["run", "--engage=again", "--instance", &instance, "--recording", &recording, "--foxglove"];
    let allowed = ["--foxglove-origin", "https://viewer.example", "--foxglove-origin", "http://lab.example:8080"];
    let mut chain = Krait::start(&[&run[..], &allowed].concat());
    let console = Console::of(&mut chain);
    let address = chain.line();
    let address = address.strip_prefix("Foxglove: ").expect("a third address");
    let path = address.strip_prefix(&format!("ws://127.0.0.1:{}", console.port)).expect("the same port");
    let (own, token) = (console.origin(), path.rsplit_once('/').expect("a token").1);

    // Four take nothing of what they asked for; that costs nobody anything.
    let mut others: Vec<_> = (0..4).map(|_| stalled_viewer(&console, path)).collect();
    for headers in [
        &[][..],
        &[("Origin", "https://app.foxglove.dev")],
        &[("Origin", own.as_str())],
        &[("Origin", "https://viewer.example")],
        &[("Origin", "http://lab.example:8080")],
    ] {
        assert!(console.open(path, &[headers, &[VIEWER]].concat()).is_ok(), "{headers:?}");
    }
    for origin in [
        "http://evil.example",
        "null",
        "https://app.foxglove.dev.evil.example",
        "http://viewer.example",
        "https://viewer.example:8443",
        "https://viewer.example.evil.example",
        "http://lab.example",
    ] {
        assert_eq!(console.open(path, &[VIEWER, ("Origin", origin)]).err(), Some(403), "{origin}");
    }
    assert_eq!(
        console.open(path, &[VIEWER, ("Host", "rebound.example")]).err(),
        Some(403),
        "another name that leads here"
    );
    assert_eq!(console.open(path, &[]).err(), Some(400), "no protocol");
    assert_eq!(console.open(path, &[("Sec-WebSocket-Protocol", "rosbridge")]).err(), Some(400), "another protocol");
    for other in ["/foxglove", "/foxglove/", &format!("/foxglove/{}", console.token)] {
        assert_eq!(console.open(other, &[VIEWER]).err(), Some(403), "{other}: no token, and the page's");
    }
    assert_eq!(console.request("POST", "/token", &[("Origin", &own)], token).status, 403, "it opens no page");
    assert_eq!(console.request("POST", path, &[("Origin", &own)], "{}").status, 405);

    let (mut live, advertised) = viewer(&console, path);
    let topics: Vec<&str> = advertised.iter().filter_map(|channel| channel["topic"].as_str()).collect();
    let layout =
        std::fs::read_to_string(format!("{}/../docs/krait.layout.json", env!("CARGO_MANIFEST_DIR"))).expect("a layout");
    let shown: Vec<&str> = layout
        .split('"')
        .filter(|text| text.starts_with('/'))
        .filter_map(|path| path.split(['.', '[']).next())
        .collect();
    let missing: Vec<_> =
        shown.iter().filter(|topic| !topics.contains(topic) && **topic != "/krait/recorder").collect();
    assert!(shown.len() > 20 && missing.is_empty(), "the layout shows {missing:?}, which are not among {topics:?}");
    let refused = loop {
        match console.open(path, &[VIEWER]) {
            Ok(other) => others.push(other),
            Err(status) => break status,
        }
    };
    assert!(refused == 403 && others.len() <= 7, "eight viewers are as many as there may be: {}", others.len());

    let id_of =
        |topic: &str| advertised.iter().find(|channel| channel["topic"] == topic).expect("a topic")["id"].clone();
    let (shape, error, bends) = (id_of("/krait/shape"), id_of("/krait/tracking_error"), id_of("/krait/bends"));
    let asked = serde_json::json!({ "op": "subscribe", "subscriptions": [
        { "id": 1, "channelId": shape }, { "id": 2, "channelId": error }, { "id": 3, "channelId": bends },
    ] });
    live.send(Message::text(asked.to_string())).expect("sent");
    let mut sequences = Vec::new();
    let mut figures = [serde_json::Value::Null, serde_json::Value::Null];
    while sequences.len() < 30 {
        let (subscription, payload) = next_data(&mut live);
        match subscription {
            1 => match krait_schema::decode(Channel::Shape, &payload) {
                Ok(Sample::Shape(shape)) => sequences.push(shape.sequence),
                other => panic!("a shape, found {other:?}"),
            },
            own => figures[own as usize - 2] = serde_json::from_slice(&payload).expect("JSON"),
        }
    }
    assert!(sequences.windows(2).all(|pair| pair[1] == pair[0] + 1), "every one: {sequences:?}");
    assert!(figures[0]["newest_deg"].as_f64().is_some_and(|error| (0.0..20.0).contains(&error)), "{figures:?}");
    let (x, y) = (figures[1]["measured_x_deg"].as_f64(), figures[1]["measured_y_deg"].as_f64());
    let length = x.zip(y).map(|(x, y)| x.hypot(y)).expect("a bend");
    assert!((figures[1]["measured_deg"].as_f64().expect("a bend") - length).abs() < 1e-9, "{figures:?}");

    // What publishes, asks for parameters, calls services or is no message is refused, each in a sentence.
    let publish = serde_json::json!({ "op": "advertise", "channels": [
        { "id": 1, "topic": "/krait/state_command", "encoding": "protobuf", "schemaName": "krait.StateCommand" },
    ] });
    let wrongs = [
        r#"{"op":"setParameters","parameters":[]}"#,
        "no JSON",
        r#"{"op":"subscribe","subscriptions":[{"id":9,"channelId":999}]}"#,
    ];
    for wrong in wrongs.into_iter().chain([publish.to_string().as_str()]) {
        live.send(Message::text(wrong)).expect("sent");
        assert!(next_status(&mut live).starts_with("Refused: "), "{wrong}");
    }
    live.send(Message::binary(vec![1, 1, 0, 0, 0, 8, 1])).expect("sent");
    assert!(next_status(&mut live).contains("read-only"), "a publishing client");
    live.send(Message::text("x".repeat(17_000))).expect("sent");
    assert!(is_closed(&mut live, PATIENCE), "17000 bytes where 16384 may be");
    assert!(wait_until(PATIENCE, || console.open(path, &[VIEWER]).is_ok()), "its place is free again");
    drop(others);
    chain.signal(Signal::INT);
    let ended = chain.end(PATIENCE);
    assert!(ended.stdout.contains(" 0 lost"), "{ended:?}");
}

/// The slow viewer takes 500 messages a second for so long: longer than what the console keeps for it (8192 messages) and what the
/// kernel does (some MB) last.
const SLOW_FOR_NS: i64 = 8_000_000_000;

/// Topics of a thousand messages a second, each of which is numbered.
const FAST: [&str; 4] = ["/krait/input", "/krait/setpoint", "/krait/command", "/krait/state"];

/// A viewer that takes a message now and then is told of all that it lost, to the last one, once it keeps up; the chain loses nothing.
#[test]
fn a_viewer_that_reads_too_slowly_is_told_of_every_message_that_it_lost() {
    let (instance, folder) = (instance_name("slow"), TempFolder::new("slow"));
    let recording = folder.file("run.mcap");
    let run = ["run", "--engage=again", "--instance", &instance, "--recording", &recording, "--foxglove"];
    let mut chain = Krait::start(&run);
    let console = Console::of(&mut chain);
    let address = chain.line();
    let path = address.strip_prefix(&format!("Foxglove: ws://127.0.0.1:{}", console.port)).expect("a third address");
    let (mut live, advertised) = viewer(&console, path);
    let asked: Vec<_> = FAST
        .iter()
        .map(|topic| {
            let id = &advertised.iter().find(|own| own["topic"] == *topic).expect("a topic")["id"];
            serde_json::json!({ "id": id, "channelId": id })
        })
        .collect();
    let channel_of: BTreeMap<u64, Channel> = asked
        .iter()
        .map(|own| own["id"].as_u64().expect("a number"))
        .zip([Channel::Input, Channel::Setpoint, Channel::Command, Channel::State])
        .collect();
    live.send(Message::text(serde_json::json!({ "op": "subscribe", "subscriptions": asked }).to_string()))
        .expect("sent");

    let (mut newest, mut n_lost, mut n_told, mut n_since) = (BTreeMap::new(), 0, 0, 0);
    let begun_ns = clock::monotonic_ns();
    // The last sentence comes within a second, and a second has 4000 messages.
    while n_lost == 0 || n_told != n_lost || n_since < 8000 {
        let since_ns = clock::monotonic_ns() - begun_ns;
        assert!(since_ns < PATIENCE.as_nanos() as i64, "told of {n_told}, and {n_lost} were lost");
        if since_ns < SLOW_FOR_NS {
            std::thread::sleep(Duration::from_millis(2));
        }
        match live.read().expect("the connection lives") {
            Message::Binary(bytes) => {
                let id = u64::from(u32::from_le_bytes(bytes[1..5].try_into().expect("four bytes")));
                let sequence = match krait_schema::decode(channel_of[&id], &bytes[13..]).expect("a message") {
                    Sample::Input(own) => own.sequence,
                    Sample::Setpoint(own) => own.sequence,
                    Sample::Command(own) => own.sequence,
                    Sample::State(own) => own.sequence,
                    other => panic!("not asked for: {other:?}"),
                };
                let gap = newest.insert(id, sequence).map_or(0, |before: u64| sequence - before - 1);
                n_lost += gap;
                n_since = if gap == 0 { n_since + 1 } else { 0 };
            }
            Message::Text(text) => {
                let status: serde_json::Value = serde_json::from_str(&text).expect("JSON");
                let said = status["message"]
                    .as_str()
                    .and_then(|said| said.strip_prefix("Slow: this viewer reads too slowly; "));
                let n = said.and_then(|said| said.split(' ').next()).and_then(|n| n.parse().ok());
                n_told = n.unwrap_or_else(|| panic!("no number in {text}"));
            }
            other => panic!("found {other:?}"),
        }
    }
    drop(live);
    chain.signal(Signal::INT);
    let ended = chain.end(PATIENCE);
    assert!(ended.stdout.contains(" 0 lost"), "{ended:?}");
}

/// Without a wish of the operator no page elsewhere reads, and what is no origin is refused in a sentence.
#[test]
fn a_page_elsewhere_reads_only_where_it_was_asked_for() {
    let mut server = Krait::start(&["console", "--instance", &instance_name("elsewhere"), "--foxglove"]);
    let console = Console::of(&mut server);
    let address = server.line();
    let path = address.strip_prefix(&format!("Foxglove: ws://127.0.0.1:{}", console.port)).expect("a third address");
    assert_eq!(console.open(path, &[VIEWER, ("Origin", "https://viewer.example")]).err(), Some(403), "not asked for");
    assert!(console.open(path, &[VIEWER]).is_ok(), "a program has no origin");
    let wrong = Ended::of(&["console", "--foxglove", "--foxglove-origin", "viewer.example"], PATIENCE);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("https://viewer.example"), "{wrong:?}");
    server.signal(Signal::TERM);
    assert_eq!(server.end(PATIENCE).code, Some(0));
}

/// States of a chain in motion: a second of them.
const N_ENGAGED: usize = 1000;

/// A console that outlives its chain: viewers are told that the machine is another one, and who connects anew reads that one's figures
/// and sees it drawn.
#[test]
fn viewers_are_served_the_machine_of_each_chain_that_comes() {
    const WRIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml");
    const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.csv");
    let instance = instance_name("viewed");
    let mut server = Krait::start(&["console", "--instance", &instance, "--foxglove"]);
    let console = Console::of(&mut server);
    let address = server.line();
    let path = address.strip_prefix(&format!("Foxglove: ws://127.0.0.1:{}", console.port)).expect("a third address");
    let (mut live, _) = viewer(&console, path);
    for (more, figure) in [
        (&["--master", "script", "--input", SCRIPT, "--model", WRIST][..], "measured_joint3_deg"),
        (&[][..], "measured_x_deg"),
    ] {
        let chain =
            Krait::start(&[&["run", "--engage=again", "--no-recording", "--instance", &instance][..], more].concat());
        assert!(next_status(&mut live).contains("another machine's"));
        assert!(is_closed(&mut live, PATIENCE), "{figure}: whoever shows the other machine connects anew");
        let advertised;
        (live, advertised) = viewer(&console, path);
        let of = |topic: &str| advertised.iter().find(|own| own["topic"] == topic).expect("a topic");
        let (own, state) = (of("/krait/bends"), of("/krait/state"));
        assert!(own["schema"].as_str().is_some_and(|schema| schema.contains(figure)), "{own}");
        let asked = serde_json::json!({ "op": "subscribe", "subscriptions": [
            { "id": 1, "channelId": own["id"] }, { "id": 2, "channelId": state["id"] },
        ] });
        live.send(Message::text(asked.to_string())).expect("sent");
        // One that is ended in the very moment at which it begins says that it was stopped before it was ready.
        let (mut n_engaged, mut payload) = (0, Vec::new());
        while n_engaged < N_ENGAGED || payload.is_empty() {
            match next_data(&mut live) {
                (1, newest) => payload = newest,
                (_, newest) => match krait_schema::decode(Channel::State, &newest) {
                    Ok(Sample::State(state)) => n_engaged += usize::from(state.is_engaged()),
                    other => panic!("a state, found {other:?}"),
                },
            }
        }
        let figures: serde_json::Value = serde_json::from_slice(&payload).expect("JSON");
        assert!(figures[figure].is_number(), "{figures}");
        if more.is_empty() {
            let id = &of("/snake/scene")["id"];
            let asked = serde_json::json!({ "op": "subscribe", "subscriptions": [{ "id": 3, "channelId": id }] });
            live.send(Message::text(asked.to_string())).expect("sent");
            assert!((0..20_000).any(|_| next_data(&mut live).0 == 3), "the snake is drawn");
        }
        chain.signal(Signal::INT);
        assert_eq!(chain.end(PATIENCE).code, Some(0));
    }
    server.signal(Signal::TERM);
    assert_eq!(server.end(PATIENCE).code, Some(0));
}

/// Connects as a viewer; what is advertised to it.
fn viewer(console: &Console, path: &str) -> (krait_tests::Live, Vec<serde_json::Value>) {
    let mut live = console.open(path, &[VIEWER]).expect("a viewer with its token");
    let mut next = || match live.read().expect("a message") {
        Message::Text(text) => serde_json::from_str::<serde_json::Value>(&text).expect("JSON"),
        other => panic!("a text, found {other:?}"),
    };
    let (info, advertised) = (next(), next());
    assert!(info["op"] == "serverInfo" && info["capabilities"] == serde_json::json!([]), "nothing but reading: {info}");
    (live, advertised["channels"].as_array().expect("channels").clone())
}

/// A viewer that asks for everything and takes nothing of it.
fn stalled_viewer(console: &Console, path: &str) -> krait_tests::Live {
    let (mut live, channels) = viewer(console, path);
    let all = channels.iter().map(|channel| serde_json::json!({ "id": channel["id"], "channelId": channel["id"] }));
    let asked = serde_json::json!({ "op": "subscribe", "subscriptions": all.collect::<Vec<_>>() });
    live.send(Message::text(asked.to_string())).expect("sent");
    live
}

/// The next message of a topic: the subscription and its bytes.
fn next_data(live: &mut krait_tests::Live) -> (u32, Vec<u8>) {
    loop {
        if let Message::Binary(bytes) = live.read().expect("the connection lives") {
            assert_eq!(bytes[0], 1, "a message's data");
            let of_year = u64::from_le_bytes(bytes[5..13].try_into().expect("eight bytes")) / 31_557_600_000_000_000;
            assert!((50..80).contains(&of_year), "a time of this century, {of_year} years after 1970");
            return (u32::from_le_bytes(bytes[1..5].try_into().expect("four bytes")), bytes[13..].to_vec());
        }
    }
}

/// The next sentence for whoever sits at the viewer.
fn next_status(live: &mut krait_tests::Live) -> String {
    loop {
        if let Message::Text(text) = live.read().expect("the connection lives") {
            let status: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            assert_eq!(status["op"], "status");
            return status["message"].as_str().expect("a sentence").to_owned();
        }
    }
}
