//! The decoder as a device, a broken device and an attacker meet it.

use krait_master::{AXIS_LIMIT_COUNTS, AXIS_MARGIN_COUNTS, Decoder, HidReport, Layout, RawReport, Refusal, led_report};
use proptest::prelude::*;

fn axis() -> impl Strategy<Value = i16> {
    -(AXIS_LIMIT_COUNTS + AXIS_MARGIN_COUNTS)..=AXIS_LIMIT_COUNTS + AXIS_MARGIN_COUNTS
}

fn report() -> impl Strategy<Value = HidReport> {
    prop_oneof![
        prop::array::uniform3(axis()).prop_map(HidReport::Translation),
        prop::array::uniform3(axis()).prop_map(HidReport::Rotation),
        prop::array::uniform6(axis()).prop_map(HidReport::Motion),
        any::<u32>().prop_map(HidReport::Buttons),
        (0_u8..=100).prop_map(|charge_percent| HidReport::Battery { charge_percent }),
    ]
}

proptest! {
    #[test]
    fn no_byte_string_panics_and_each_is_counted_once(strings in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..80), 0..20)) {
        let mut decoder = Decoder::default();
        for bytes in &strings {
            let before = decoder.axes();
            if decoder.on_report(bytes).is_err() {
                prop_assert_eq!(decoder.axes(), before, "a refused report changes nothing");
            }
        }
        prop_assert_eq!(decoder.counts().n_decoded + decoder.counts().n_refused(), strings.len() as u64);
    }

    #[test]
    fn no_string_with_a_known_id_panics(id in prop::sample::select(vec![1_u8, 2, 3, 4, 0x17]), body in prop::collection::vec(any::<u8>(), 0..80)) {
        let bytes: Vec<u8> = std::iter::once(id).chain(body).collect();
        let accepted = HidReport::decode(&bytes).is_ok();
        let fits = matches!((id, bytes.len()), (1, 7 | 13) | (2, 7) | (3, 2..=7) | (0x17, 2 | 3));
        prop_assert!(fits || !accepted);
    }

    #[test]
    fn what_is_encoded_decodes_to_the_same(report in report()) {
        prop_assert_eq!(HidReport::decode(report.encode().as_bytes()), Ok(report));
    }
}

#[test]
fn both_layouts_fill_the_same_axes_and_are_told_by_length() {
    let mut split = Decoder::default();
    // X = 81 (right), Y = -205 (away from the user), Z = -202 (up).
    split.on_report(&[1, 0x51, 0, 0x33, 0xff, 0x36, 0xff]).expect("translation");
    assert_eq!((split.axes(), split.layout()), ([81, -205, -202, 0, 0, 0], Some(Layout::Split)), "newest half at once");
    split.on_report(&[2, 1, 0, 2, 0, 3, 0]).expect("rotation");
    let mut combined = Decoder::default();
    combined.on_report(&[1, 0x51, 0, 0x33, 0xff, 0x36, 0xff, 1, 0, 2, 0, 3, 0]).expect("motion");
    assert_eq!((combined.axes(), combined.layout()), (split.axes(), Some(Layout::Combined)));
}

#[test]
fn short_long_unknown_and_wild_reports_are_refused_by_name() {
    let mut decoder = Decoder::default();
    let cases: [(&[u8], Refusal); 9] = [
        (&[], Refusal::Empty),
        (&[9, 0, 0], Refusal::UnknownId { id: 9 }),
        (&[4, 1], Refusal::UnknownId { id: 4 }),
        (&[1, 0, 0], Refusal::Short { id: 1, n_bytes: 3 }),
        (&[1, 0, 0, 0, 0, 0, 0, 0, 0], Refusal::Short { id: 1, n_bytes: 9 }),
        (&[2, 0, 0, 0, 0, 0, 0, 0], Refusal::Long { id: 2, n_bytes: 8 }),
        (&[3], Refusal::Short { id: 3, n_bytes: 1 }),
        (&[1, 0x91, 0x01, 0, 0, 0, 0], Refusal::OutOfRange { id: 1, value: 401 }),
        (&[0x17, 101], Refusal::OutOfRange { id: 0x17, value: 101 }),
    ];
    for (bytes, refusal) in cases {
        assert_eq!(decoder.on_report(bytes), Err(refusal));
    }
    let c = decoder.counts();
    assert_eq!((c.n_empty, c.n_unknown, c.n_short, c.n_long, c.n_out_of_range, c.n_decoded), (1, 2, 3, 1, 2, 0));
    let endless = RawReport::clipped(&[1; 500]);
    assert_eq!(HidReport::decode(endless.as_bytes()), Err(Refusal::Long { id: 1, n_bytes: RawReport::MAX_BYTES }));
    assert_eq!(decoder.on_report(&[1, 0x00, 0x80, 0, 0, 0, 0]), Err(Refusal::OutOfRange { id: 1, value: i16::MIN }));
}

#[test]
fn buttons_battery_and_light_follow_the_devices_bytes() {
    let mut decoder = Decoder::default();
    assert_eq!(decoder.on_report(&[3, 2, 0]), Ok(HidReport::Buttons(2)));
    assert_eq!(
        decoder.on_report(&[3, 0, 0, 0, 0x20, 0xff, 0xff]),
        Ok(HidReport::Buttons(1 << 29)),
        "past 32 is ignored"
    );
    assert_eq!(decoder.on_report(&[0x17, 87, 1]), Ok(HidReport::Battery { charge_percent: 87 }));
    assert_eq!((decoder.buttons(), decoder.charge_percent()), (1 << 29, Some(87)));
    assert_eq!((led_report(true), led_report(false)), ([4, 1], [4, 0]));
}
