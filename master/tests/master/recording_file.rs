//! Recordings: written and read the same, and every broken file refused in one sentence that names file, line and remedy.

use krait_master::{
    HidRecording, HidRecordingWriter, Layout, MasterError, Plug, RecordingHeader, RecordingSource, ReportSource,
    SourceEvent,
};

const GOOD: &str = "krait-report-recording 1\ndevice 046d:c626\nlayout split\nnote a\nreports\n0 01000000000000\nnote b\n8000000 0301\nend 2\n";

fn refused(text: &str) -> String {
    let error = HidRecording::parse("x.krr", text.as_bytes()).expect_err("refused");
    assert!(matches!(error, MasterError::Recording { .. }));
    let sentence = error.to_string();
    assert!(sentence.starts_with("report recording x.krr, line ") && !sentence.contains('\n'), "{sentence}");
    sentence
}

#[test]
fn what_is_written_is_read_the_same_with_stamps_from_the_first_report() {
    let header = RecordingHeader {
        vendor_id: 0x256f,
        product_id: 0xc652,
        layout: Some(Layout::Combined),
        beside: Vec::new(),
        notes: vec!["n".into()],
    };
    let mut writer = HidRecordingWriter::new(Vec::new(), &header).expect("header");
    for (stamp_ns, bytes) in [(5_000, &[1_u8, 2, 3][..]), (5_016, &[0xff; 64]), (5_010, &[3, 0]), (5_020, &[])] {
        writer.push(stamp_ns, bytes).expect("report");
    }
    writer.note(&"long\nnote ".repeat(60)).expect("note");
    let text = writer.finish().expect("end");
    let recording = HidRecording::parse("x", &text).expect("read");
    assert_eq!((recording.header().vendor_id, recording.header().layout), (0x256f, Some(Layout::Combined)));
    let reports: Vec<_> = recording.reports().collect();
    assert_eq!(reports, [(0, &[1_u8, 2, 3][..]), (16, &[0xff; 64]), (16, &[3, 0])], "a clock that steps back is held");
    assert_eq!((recording.n_reports(), recording.duration_ns()), (3, 16));
}

#[test]
fn notes_may_stand_between_reports_and_a_part_can_be_cut_off() {
    let recording = HidRecording::parse("x", GOOD.as_bytes()).expect("read");
    assert_eq!((recording.header().notes.join(","), recording.n_reports()), ("a,b".to_owned(), 2));
    assert_eq!(recording.first_s(0.005).n_reports(), 1);
}

#[test]
fn a_recording_cut_at_any_byte_is_refused_as_cut() {
    for n_bytes in GOOD.find("note a").expect("note")..GOOD.len() {
        let sentence = refused(&GOOD[..n_bytes]);
        assert!(sentence.contains("cut short"), "{n_bytes}: {sentence}");
    }
    for n_bytes in 0..GOOD.len() {
        refused(&GOOD[..n_bytes]);
    }
}

#[test]
fn foreign_and_other_versions_are_told_apart() {
    let foreign = refused("\u{7f}ELF\u{1}\u{0}stuff");
    assert!(
        foreign.contains("line 1: expected `krait-report-recording 1`, found \"\\x7fELF\\x01\\x00stuff\""),
        "{foreign}"
    );
    assert!(foreign.contains("--record-reports"), "{foreign}");
    let newer = refused(&GOOD.replacen("recording 1", "recording 2", 1));
    assert!(newer.contains("read it with the krait that wrote it"), "{newer}");
}

#[test]
fn each_damage_is_named_with_its_line_what_was_expected_and_what_was_found() {
    let long = format!("0 {}", "00".repeat(200));
    for (from, to, named) in [
        ("046d:c626", "46d:c626", "line 2: expected `device <vid>:<pid>` in hexadecimal, found \"device 46d:c626\""),
        ("layout split", "layout odd", "line 3: expected `layout split`"),
        ("note a", "nota", "line 4: expected `note ...`, `beside <vid>:<pid>` or `reports`"),
        ("0 0100", "1 0100", "line 6: expected 0 as the first stamp, found 1 ns"),
        ("0 0100", "+0 0100", "line 6: expected `stamp_ns hexbytes`"),
        ("8000000 0301", "-5 0301", "line 8: expected `stamp_ns hexbytes`"),
        ("8000000 0301", "8000000 030", "line 8: expected `stamp_ns hexbytes`"),
        ("8000000 0301", "8000000 03G1", "line 8: expected `stamp_ns hexbytes`"),
        ("8000000 0301", "99999999999999999999 0301", "line 8: expected `stamp_ns hexbytes`"),
        ("note b", "7000000 0301\n6000000 0301", "line 8: expected a stamp of at least 7000000 ns"),
        ("0 01000000000000", &long, "line 6: expected a line of at most 200 bytes"),
        ("end 2", "end 3", "line 9: expected `end 2`, the number of reports above, found \"3\""),
        ("end 2\n", "end 2\n0 01\n", "line 9: expected nothing after `end`, found 5 more bytes"),
    ] {
        let sentence = refused(&GOOD.replacen(from, to, 1));
        assert!(sentence.contains(named), "{sentence}\nshould contain {named}");
    }
    assert!(
        refused("krait-report-recording 1\ndevice 046d:c626\nlayout split\nreports\nend 0\n").contains("at least one")
    );
}

#[test]
fn a_missing_file_and_a_folder_are_refused_by_path() {
    for path in ["/nonexistent/x.krr", "/"] {
        let sentence = HidRecording::load(path.as_ref()).expect_err("refused").to_string();
        assert!(sentence.starts_with(&format!("{path} could not be read: ")), "{sentence}");
    }
}

#[test]
fn an_endless_file_is_refused_before_it_fills_the_memory() {
    let error = HidRecording::load("/dev/zero".as_ref()).expect_err("refused");
    assert!(error.to_string().contains("it is a device, expected a regular file"), "{error}");
}

#[test]
fn reports_of_devices_beside_the_hand_controller_say_whose_they_are_and_only_where_the_header_names_them() {
    let text = "krait-report-recording 1\ndevice 256f:c635\nlayout split\nbeside 05f3:00ff\nbeside 046d:c215\nreports\n0 0301\n8 1:0301\n9 2:0300\nend 3\n";
    let recording = HidRecording::parse("x.krr", text.as_bytes()).expect("read");
    assert_eq!(recording.header().beside, [(0x05f3, 0x00ff), (0x046d, 0xc215)]);
    let devices: Vec<usize> = recording.events().map(|(_, device, _)| device).collect();
    assert_eq!(devices, [0, 1, 2]);
    for (from, to, words) in [
        ("9 2:", "9 3:", "there are 2, found device 3"),
        ("9 2:", "9 0:", "`stamp_ns hexbytes`"),
        ("9 2:", "9 :", "`stamp_ns hexbytes`"),
        ("9 2:", "9 12:", "`stamp_ns hexbytes`"),
        ("beside 05f3:00ff", "beside 05f3", "`beside <vid>:<pid>`"),
        ("reports\n", "beside 1:1\nreports\n", "`beside <vid>:<pid>`"),
        ("reports\n", "beside 0001:0001\nbeside 0001:0002\nreports\n", "at most 3 lines `beside`"),
    ] {
        assert!(text.contains(from));
        let error = HidRecording::parse("x.krr", text.replacen(from, to, 1).as_bytes()).expect_err(words).to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    }
}

#[test]
fn what_is_unplugged_and_plugged_in_is_played_again_and_is_no_report() {
    let head = "krait-report-recording 1\ndevice 256f:c635\nlayout split\nbeside 05f3:00ff\nreports\n";
    let text = head.to_owned() + "0 0301\n8 1:unplugged\n9 unplugged\n11 1:plugged\n12 plugged\n12 0300\nend 2\n";
    let recording = HidRecording::parse("x.krr", text.as_bytes()).expect("read");
    assert_eq!((recording.n_reports(), recording.reports().count(), recording.duration_ns()), (2, 2, 12));
    let mut source = RecordingSource::new(recording.clone(), false);
    source.start(100);
    let told: Vec<_> = std::iter::from_fn(|| source.next_event(112))
        .filter_map(|event| match event {
            SourceEvent::Plug { device, plug, .. } => Some((device, plug)),
            _ => None,
        })
        .collect();
    assert_eq!(told, [(1, Plug::Out), (0, Plug::Out), (1, Plug::In), (0, Plug::In)]);
    let mut writer = HidRecordingWriter::new(Vec::new(), recording.header()).expect("header");
    for (stamp_ns, device, event) in recording.events() {
        writer.push_of(device, stamp_ns, &event).expect("written");
    }
    assert_eq!(String::from_utf8(writer.finish().expect("end")).expect("text"), text);
    for (from, to) in [("9 unplugged", "9 unplug"), ("9 unplugged", "9 unplugged "), ("12 plugged", "12 3:plugged")] {
        assert!(text.contains(from));
        let error = HidRecording::parse("x.krr", text.replacen(from, to, 1).as_bytes()).expect_err(to).to_string();
        assert!(error.contains("line ") && !error.contains('\n'), "{error}");
    }
}
