//! Mice and keyboards: ways that are speeds, keys that are axes, and a keyboard that its user takes back.

use super::*;
use crate::LightRole;
use crate::lights::{HandState, LightShow};
use crate::{DeviceMonitor, HidRecording, HidRecordingWriter, Layout, RecordingHeader};
use std::path::Path;

const KEY_SPACE: u16 = 57;
const KEY_LEFT: u16 = 105;
const KEY_RIGHT: u16 = 106;
const KEY_ESC: u16 = 1;

fn shipped(name: &str) -> (PipeWriter, Now, EvdevPort<Node>) {
    opened(&Profile::load(Path::new(name)).expect("built in"))
}

/// What a port has to tell until it is silent.
fn told(port: &mut EvdevPort<Node>) -> Vec<HidReport> {
    let mut reports = Vec::new();
    loop {
        match read(port) {
            Some(report) => reports.push(report),
            None if port.decoder.waits_for_silence() => {}
            None => return reports,
        }
    }
}

fn x(counts: i16) -> HidReport {
    HidReport::Motion([counts, 0, 0, 0, 0, 0])
}

#[test]
fn a_way_is_a_speed_that_ends_with_it_and_no_count_is_lost() {
    let (mut writer, _, mut port) = shipped("mouse");
    let mut reports = Vec::new();
    // 125 reports a second of 1 to 4 counts; at 2000 counts/s a count in a window of 16 ms is 350/32 of the hand's.
    for k in 0..400_i64 {
        let counts = (1 + k % 4) as i32;
        writer.write_all(&bytes_at(k * 8000, &[(2, 0, counts), (2, 1, -counts), SYN])).expect("written");
        if port.next_frame().expect("it lives") {
            reports.extend(port.ready.iter_mut().filter_map(Option::take));
        }
        while port.reader.wait(Duration::ZERO).expect("it lives") {
            if port.next_frame().expect("it lives") {
                reports.extend(port.ready.iter_mut().filter_map(Option::take));
            }
        }
    }
    assert_eq!(reports.len(), 199, "one of each whole window");
    reports.extend(told(&mut port));
    assert_eq!(reports.last(), Some(&HidReport::Motion([0; 6])), "held still, it holds still");
    let sums = reports.iter().fold([0.0; 6], |sums, report| {
        let HidReport::Motion(counts) = report else { panic!("{report:?}") };
        assert!(counts.iter().all(|counts| counts.abs() <= 350));
        core::array::from_fn(|idx| sums[idx] + f64::from(counts[idx]))
    });
    // 1000 counts each way: within the rounding of 200 windows to the hand's counts.
    assert!((sums[0] - 1000.0 * 350.0 / 32.0).abs() < 100.0, "{sums:?}");
    assert_eq!([sums[1], sums[2], sums[3]], [0.0, -sums[0], 0.0], "towards the operator is down");
    assert_eq!(read(&mut port), None);
}

#[test]
fn a_window_that_silence_ended_is_told_once_whatever_comes_next() {
    let (mut writer, _, mut port) = shipped("mouse");
    let mut reports = Vec::new();
    // A count every 20 ms: no window is followed by another, and none is at rest.
    for k in 0..10_i64 {
        writer.write_all(&bytes_at(k * 20_000, &[(2, 0, 1), SYN])).expect("written");
        reports.extend([read(&mut port), read(&mut port)]);
    }
    assert_eq!(reports, [None, Some(x(11))].repeat(10));
}

#[test]
fn a_speed_is_bounded_and_a_wheel_counts_once_whatever_twin_of_it_speaks() {
    let (mut writer, _, mut port) = shipped("mouse");
    writer.write_all(&bytes_at(0, &[(2, 0, i32::MAX), (2, 0, i32::MAX), SYN])).expect("written");
    assert_eq!(told(&mut port), [x(350), HidReport::Motion([0; 6])]);
    writer.write_all(&bytes_at(1_000_000, &[(2, 0, -70_000), SYN])).expect("written");
    assert_eq!(told(&mut port), [x(-350), HidReport::Motion([0; 6])]);
    // A notch of a fine wheel: eight eighths, and the whole one with the last.
    let (mut coarse, mut fine) = (Vec::new(), Vec::new());
    for eighth in 0..8 {
        let events = [(2, 8, 1), (2, 11, 15), SYN];
        fine.extend(bytes_at(2_000_000 + eighth * 1000, &events[usize::from(eighth < 7)..]));
    }
    coarse.extend(bytes_at(3_000_000, &[(2, 8, 1), SYN]));
    writer.write_all(&fine).expect("written");
    let of_fine = told(&mut port);
    writer.write_all(&coarse).expect("written");
    assert_eq!((of_fine.len(), &of_fine), (2, &told(&mut port)));
    assert_eq!(of_fine[0], HidReport::Motion([0, -350, 0, 0, 0, 0]), "away from the operator");
}

#[test]
fn a_steady_way_never_looks_like_a_lost_device_and_a_mouse_that_rests_looks_like_one_at_rest() {
    let (mut writer, _, mut port) = shipped("mouse");
    let (mut monitor, mut last_us) = (DeviceMonitor::new(100_000_000), 0);
    for k in 0..500_i64 {
        writer.write_all(&bytes_at(k * 1000, &[(2, 0, 1), SYN])).expect("written");
        port.reader.wait(Duration::ZERO).expect("it lives");
        if port.next_frame().expect("it lives") {
            let report = port.ready.iter_mut().find_map(Option::take).expect("ready");
            assert_eq!(report, x(175), "1000 counts a second");
            assert!(k * 1000 - last_us <= 16_000, "told at {last_us} and {k} ms");
            last_us = k * 1000;
            monitor.on_motion(true, last_us * 1000);
        }
    }
    assert_eq!(monitor.state(500_000_000), krait_ipc::message::DeviceState::Live);
    assert_eq!(told(&mut port).last(), Some(&HidReport::Motion([0; 6])));
}

#[test]
fn two_keys_are_an_axis_both_are_none_and_a_repeating_key_is_not_pressed_again() {
    let (mut writer, _, mut port) = shipped("keyboard");
    let mut after = |events: &[(u16, u16, i32)]| {
        writer.write_all(&[bytes_of(events), bytes_of(&[SYN])].concat()).expect("written");
        let mut buffer = [0; RawReport::MAX_BYTES];
        assert!(port.reader.wait(Duration::ZERO).expect("it lives"));
        if !port.next_frame().expect("it lives") {
            return None;
        }
        let n_bytes = port.read(&mut buffer, Duration::ZERO).expect("it lives");
        Some(HidReport::decode(&buffer[..n_bytes]).expect("a report"))
    };
    assert_eq!(after(&[(1, KEY_RIGHT, 1)]), Some(x(175)), "half of the full deflection");
    assert_eq!(after(&[(1, KEY_RIGHT, 2)]), None);
    assert_eq!(after(&[(1, KEY_LEFT, 1)]), Some(x(0)));
    assert_eq!(after(&[(1, KEY_RIGHT, 0)]), Some(x(-175)));
    assert_eq!(after(&[(1, KEY_LEFT, 0)]), Some(x(0)));
    assert_eq!(after(&[(1, 108, 1)]), Some(HidReport::Motion([0, 0, 175, 0, 0, 0])), "down");
    assert_eq!(after(&[(1, 108, 0)]), Some(x(0)));
    assert_eq!(after(&[(1, KEY_SPACE, 1)]), Some(HidReport::Buttons(1)));
    for _ in 0..3 {
        assert_eq!(after(&[(1, KEY_SPACE, 2)]), None);
    }
    assert_eq!(after(&[(1, 20, 1)]), None, "a key that is nobody's");
    assert_eq!(after(&[(1, KEY_SPACE, 0)]), Some(HidReport::Buttons(0)));
}

#[test]
fn keys_are_asked_for_after_dropped_events_and_at_the_beginning_and_a_held_button_is_no_press() {
    let (mut writer, now, mut port) = shipped("keyboard");
    writer.write_all(&bytes_of(&[(1, KEY_RIGHT, 1), (1, KEY_SPACE, 1), SYN])).expect("written");
    assert_eq!([read(&mut port), read(&mut port)], [Some(x(175)), Some(HidReport::Buttons(1))]);
    // The kernel dropped that one key was let go and another pressed; the space bar is still down.
    now.lock().expect("now").1 = vec![KEY_LEFT, KEY_SPACE];
    writer.write_all(&bytes_of(&[(0, 3, 0), (1, KEY_RIGHT, 1), SYN])).expect("written");
    let mut buffer = [0; RawReport::MAX_BYTES];
    assert!(matches!(port.read(&mut buffer, Duration::ZERO), Err(ReadFailure::Dropped)));
    assert_eq!([read(&mut port), read(&mut port)], [Some(x(-175)), Some(HidReport::Buttons(0))]);
    writer.write_all(&bytes_of(&[(1, KEY_SPACE, 2), SYN])).expect("written");
    assert_eq!([read(&mut port), read(&mut port)], [None, Some(x(-175))], "the deflection once more, and no press");
    // Another port on the same keys begins with them.
    let profile = Profile::load(Path::new("keyboard")).expect("built in");
    let (reader, _writer) = pipe().expect("a pipe");
    let node = Node { pipe: reader, now, lights: Arc::default(), effects: Arc::default() };
    let decoder = EvdevDecoder::new(&profile, &node).expect("a decoder");
    assert_eq!(read(&mut EvdevPort::new(node, decoder, &Profile { lights: Vec::new(), ..profile })), Some(x(-175)));
}

#[test]
fn a_keyboard_is_given_back_by_its_key_also_where_the_press_was_dropped_and_unplugged_it_is_gone() {
    let mut buffer = [0; RawReport::MAX_BYTES];
    let (mut writer, _, mut port) = shipped("keyboard");
    writer.write_all(&bytes_of(&[(1, KEY_RIGHT, 1), SYN, (1, KEY_ESC, 1), SYN])).expect("written");
    assert_eq!(read(&mut port), Some(x(175)));
    assert!(matches!(port.read(&mut buffer, Duration::ZERO), Err(ReadFailure::GivenBack)));
    let (mut writer, now, mut port) = shipped("keyboard");
    now.lock().expect("now").1 = vec![KEY_ESC];
    writer.write_all(&bytes_of(&[(0, 3, 0)])).expect("written");
    assert!(matches!(port.read(&mut buffer, Duration::ZERO), Err(ReadFailure::GivenBack)));
    for name in ["mouse", "keyboard"] {
        let (writer, _, mut port) = shipped(name);
        drop(writer);
        assert!(matches!(port.read(&mut buffer, Duration::ZERO), Err(ReadFailure::Gone(_))));
    }
}

#[test]
fn the_lights_of_the_profile_are_the_ports_and_are_left_as_they_were() {
    const STATES: [HandState; 4] = [HandState::Taken, HandState::Engaged, HandState::Limit, HandState::Fault];
    let switched = |profile: &Profile| {
        let (_writer, _, mut port) = opened(profile);
        let mut show = LightShow::new(1000);
        for state in STATES {
            port.show(show.look(Some(state.into())));
        }
        port.rest_lights();
        let all = port.reader.file().lights.lock().expect("lights").clone();
        all.chunks(profile.lights.len().max(1)).map(<[_]>::to_vec).collect::<Vec<_>>()
    };
    let keyboard = Profile::load(Path::new("keyboard")).expect("built in");
    let due =
        [[true, false, false], [true, false, false], [true, true, false], [false, false, true], [true, false, false]];
    let due = due.map(|lit| (0..3_u16).zip(lit).collect::<Vec<_>>());
    assert_eq!(switched(&keyboard), due, "Num Lock was on before and is again");
    let one = Profile { lights: vec![(LightRole::All, 2)], ..keyboard };
    assert_eq!(switched(&one), [true, true, false, true, false].map(|is_on| vec![(2, is_on)]));
    assert!(switched(&Profile::load(Path::new("mouse")).expect("built in")).is_empty());
}

#[test]
fn the_reports_of_a_mouse_and_a_keyboard_replay_byte_for_byte() {
    for name in ["mouse", "keyboard"] {
        let (mut writer, _, mut port) = shipped(name);
        let mut sent = Vec::new();
        let layout = Some(Layout::Combined);
        let header =
            RecordingHeader { vendor_id: 0x0627, product_id: 1, layout, beside: Vec::new(), notes: Vec::new() };
        let mut file = HidRecordingWriter::new(Vec::new(), &header).expect("written");
        for k in 0..200_i64 {
            let press = i32::from(k % 10 < 5);
            let events =
                [(2, 0, (k % 7) as i32 - 3), (1, KEY_RIGHT, press), (1, KEY_SPACE, press), (1, 0x110, press), SYN];
            writer.write_all(&bytes_at(k * 4000, &events)).expect("written");
            while let Some(bytes) = read_bytes(&mut port) {
                let is_repeat = sent.last().is_some_and(|(_, last)| *last == bytes);
                file.push(k * 4_000_000, &bytes).expect("written");
                sent.push((k * 4_000_000, bytes));
                if is_repeat {
                    break;
                }
            }
        }
        assert!(sent.len() > 100, "{name}: {}", sent.len());
        let bytes = file.finish().expect("whole");
        let recording = HidRecording::parse("recorded", &bytes).expect("a recording");
        let first_ns = sent[0].0;
        let replayed: Vec<(i64, Vec<u8>)> =
            recording.reports().map(|(stamp_ns, bytes)| (first_ns + stamp_ns, bytes.to_vec())).collect();
        assert_eq!(replayed, sent, "{name}");
        let inputs = |reports: &[(i64, Vec<u8>)]| {
            let config = MasterConfig { engage: Engage::Once, ..MasterConfig::default() };
            let mut core = MasterCore::new(&config).expect("a configuration");
            let all = reports.iter().map(|(stamp_ns, bytes)| {
                core.on_report(bytes, *stamp_ns).expect("a report");
                core.on_tick(*stamp_ns)
            });
            all.collect::<Vec<_>>()
        };
        let first = inputs(&sent);
        assert_eq!(first, inputs(&replayed), "{name}");
        assert!(first.iter().any(|input| input.tip_vel_in_view_m_per_s[0] != 0.0), "{name} has moved something");
    }
}
