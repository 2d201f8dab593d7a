//! The gate between foreign lines and the channel: what is published, what is refused, what is counted.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use krait_ipc::message::Validity;
use krait_shape::{
    Arrival, GateConfig, Header, Measured, ShapeFinding, ShapeGate, ShapeLine, ShapeRefusal, SourceClock, Value,
};
use proptest::prelude::*;

const MS: i64 = 1_000_000;
const T0_NS: i64 = 50_000 * MS;
const FRAME_NS: i64 = 16_666_667;

fn at(monotonic_ns: i64) -> Arrival {
    Arrival { monotonic_ns, realtime_ns: monotonic_ns + 1_700_000_000_000_000_000 }
}

fn header(clock: SourceClock) -> Header {
    Header { krait_shapes: 1, clock, offset_ns: None, source: String::new() }
}

fn gate() -> ShapeGate {
    let mut gate = ShapeGate::new(GateConfig::default());
    gate.begin(&header(SourceClock::Monotonic));
    gate
}

fn bend(frame: u64, exposure_ns: i64, bend_rad: [f64; 2]) -> Measured {
    let value = Some(Value::Bend { bend_rad, covariance_rad2: None });
    Measured { exposure_ns, sent_ns: None, frame: Some(frame), value }
}

fn good(gate: &mut ShapeGate, frame: u64) {
    let exposure_ns = T0_NS + frame as i64 * FRAME_NS;
    let passed = gate.pass(&bend(frame, exposure_ns, [0.2, 0.1]), &at(exposure_ns + 3 * MS)).expect("a good shape");
    assert_eq!(passed.shape.valid_bend_rad(), Some([0.2, 0.1]));
    assert_eq!(passed.findings, [None; 3]);
}

#[test]
fn good_shapes_are_numbered_and_keep_their_instants() {
    let mut gate = gate();
    for frame in 1..=5 {
        let exposure_ns = T0_NS + frame * FRAME_NS;
        let shape = bend(frame as u64, exposure_ns, [0.2, -0.1]);
        let passed = gate.pass(&shape, &at(exposure_ns + 2 * MS)).expect("good");
        assert_eq!((passed.shape.sequence, passed.shape.sample_ns), (frame as u64, exposure_ns));
        assert!(passed.shape.sigma_bend_rad().is_nan(), "none was stated");
    }
    let counts = *gate.counts();
    assert_eq!((counts.lines, counts.headers, counts.published, counts.refused()), (6, 1, 5, 0));
    assert_eq!(counts.named(), []);
}

#[test]
fn what_is_wrong_is_refused_by_name_and_the_next_good_shape_passes() {
    let covariance = |covariance_rad2| {
        let value = Some(Value::Bend { bend_rad: [0.2, 0.1], covariance_rad2: Some(covariance_rad2) });
        move |exposure_ns| Measured { exposure_ns, sent_ns: None, frame: None, value }
    };
    let now_ns = T0_NS + 10 * FRAME_NS;
    let cases: Vec<(Measured, ShapeRefusal)> = vec![
        (bend(11, now_ns, [f64::NAN, 0.0]), ShapeRefusal::NotFinite),
        (bend(11, now_ns, [0.0, f64::INFINITY]), ShapeRefusal::NotFinite),
        (bend(11, now_ns, [3.2, 0.0]), ShapeRefusal::OutOfRange),
        (covariance([1e-5, 1e-3, 1e-5])(now_ns), ShapeRefusal::OutOfRange),
        (covariance([0.0, 0.0, 1e-5])(now_ns), ShapeRefusal::OutOfRange),
        (covariance([-1e-5, 0.0, 1e-5])(now_ns), ShapeRefusal::OutOfRange),
        (covariance([f64::NAN, 0.0, 1e-5])(now_ns), ShapeRefusal::NotFinite),
        (bend(11, now_ns + 2 * MS, [0.2, 0.1]), ShapeRefusal::Future),
        (bend(11, i64::MAX, [0.2, 0.1]), ShapeRefusal::Future),
        (bend(11, now_ns - 1001 * MS, [0.2, 0.1]), ShapeRefusal::Stale),
        (bend(11, 0, [0.2, 0.1]), ShapeRefusal::Stale),
        (bend(11, i64::MIN, [0.2, 0.1]), ShapeRefusal::OutOfRange),
        (bend(11, T0_NS + 9 * FRAME_NS, [0.2, 0.1]), ShapeRefusal::OutOfOrder),
        (bend(9, now_ns, [0.2, 0.1]), ShapeRefusal::OutOfOrder),
    ];
    for (measured, expected) in cases {
        let mut gate = gate();
        good(&mut gate, 9);
        let (refusal, ..) = gate.pass(&measured, &at(now_ns)).expect_err("wrong");
        assert_eq!(refusal, expected, "{measured:?}");
        let counts = *gate.counts();
        assert_eq!((counts.refused(), counts.published, counts.named().len()), (1, 1, 1), "{counts:?}");
        good(&mut gate, 10);
    }
}

#[test]
fn late_missing_lost_and_outlying_shapes_are_published_with_their_names() {
    let mut gate = gate();
    good(&mut gate, 1);
    let exposure_ns = T0_NS + 5 * FRAME_NS;
    let found = |gate: &mut ShapeGate, measured: &Measured, age_ms: i64| {
        let passed = gate.pass(measured, &at(measured.exposure_ns + age_ms * MS)).expect("published");
        let findings: Vec<ShapeFinding> = passed.findings.iter().flatten().map(|(finding, ..)| *finding).collect();
        (passed.shape, findings)
    };
    let (shape, findings) = found(&mut gate, &bend(5, exposure_ns, [0.21, 0.1]), 250);
    assert_eq!(findings, [ShapeFinding::Late, ShapeFinding::Dropped]);
    assert!(shape.valid_bend_rad().is_some());
    let lost = Measured { value: None, ..bend(6, exposure_ns + FRAME_NS, [0.0; 2]) };
    let (shape, findings) = found(&mut gate, &lost, 3);
    assert_eq!((findings, shape.validity), (vec![ShapeFinding::Lost], Validity::Lost as u32));
    // 0.1 rad and 5 rad/s for two frames is 0.27 rad.
    let (shape, findings) = found(&mut gate, &bend(7, exposure_ns + 2 * FRAME_NS, [0.6, 0.1]), 3);
    assert_eq!((findings, shape.validity), (vec![ShapeFinding::Outlying], Validity::Outlying as u32));
    assert_eq!((shape.bend_rad, shape.valid_bend_rad()), ([0.6, 0.1], None), "kept as evidence");
    let (shape, findings) = found(&mut gate, &bend(8, exposure_ns + 3 * FRAME_NS, [0.22, 0.1]), 3);
    assert_eq!((findings, shape.valid_bend_rad()), (vec![], Some([0.22, 0.1])));
    let counts = *gate.counts();
    assert_eq!((counts.late, counts.dropped, counts.lost_view, counts.outlying, counts.published), (1, 3, 1, 1, 5));
}

/// A first shape that was wrong does not shut out the right ones for ever.
#[test]
fn a_wrong_beginning_is_forgotten_in_time() {
    let mut gate = gate();
    let mut first_valid = None;
    for frame in 0..60 {
        let exposure_ns = T0_NS + frame * FRAME_NS;
        let bend_rad = if frame == 0 { [1.5, 0.0] } else { [-0.5, 0.0] };
        let passed = gate.pass(&bend(frame as u64, exposure_ns, bend_rad), &at(exposure_ns)).expect("published");
        if frame > 0 && passed.shape.valid_bend_rad().is_some() {
            first_valid.get_or_insert(frame);
        }
    }
    // 2 rad less 0.1 at 5 rad/s are 0.38 s, 23 frames.
    assert_eq!(first_valid, Some(23));
    assert_eq!(gate.counts().outlying, 22);
}

#[test]
fn a_clock_of_its_own_needs_a_word_about_when_a_line_was_sent() {
    let mut gate = ShapeGate::new(GateConfig::default());
    let measured = bend(1, 700 * MS, [0.1, 0.0]);
    assert_eq!(gate.pass(&measured, &at(T0_NS)).expect_err("no header").0, ShapeRefusal::NoHeader);
    gate.begin(&header(SourceClock::Own));
    assert_eq!(gate.pass(&measured, &at(T0_NS)).expect_err("no clock").0, ShapeRefusal::NoClock);
    let sent = |ms: i64| Measured { sent_ns: Some((704 + ms) * MS), ..bend(1, (700 + ms) * MS, [0.1, 0.0]) };
    assert_eq!(gate.pass(&sent(0), &at(T0_NS)).expect_err("it has just begun").0, ShapeRefusal::NoClock);
    let shape = gate.pass(&sent(1000), &at(T0_NS + 1000 * MS)).expect("mapped").shape;
    assert_eq!(shape.sample_ns, T0_NS + 996 * MS);
    // The program starts anew and counts from 1 again; its clock has begun at zero.
    gate.begin(&header(SourceClock::Own));
    let again = |ms: i64| Measured { sent_ns: Some((4 + ms) * MS), ..bend(1, (3 + ms) * MS, [0.1, 0.0]) };
    assert_eq!(gate.pass(&again(0), &at(T0_NS + 2000 * MS)).expect_err("anew").0, ShapeRefusal::NoClock);
    let shape = gate.pass(&again(1000), &at(T0_NS + 3000 * MS)).expect("mapped anew").shape;
    assert_eq!((shape.sequence, shape.sample_ns), (2, T0_NS + 2999 * MS));
}

#[test]
fn joints_pass_as_bends_do() {
    let joints = |exposure_ns, position_rad: f64| {
        let mut positions_rad = [0.0; 8];
        positions_rad[..2].copy_from_slice(&[position_rad, -0.3]);
        let value = Some(Value::Joints { n: 2, positions_rad, variances_rad2: None });
        Measured { exposure_ns, sent_ns: None, frame: None, value }
    };
    let mut gate = gate();
    let first = gate.pass(&joints(T0_NS, 0.5), &at(T0_NS)).expect("good").shape;
    assert_eq!(first.valid_joints_rad(), Some(&[0.5, -0.3][..]));
    let far = gate.pass(&joints(T0_NS + MS, 0.9), &at(T0_NS + MS)).expect("published").shape;
    assert_eq!(far.validity, Validity::Outlying as u32);
    let snake = gate.pass(&bend(1, T0_NS + 2 * MS, [0.0; 2]), &at(T0_NS + 2 * MS)).expect("published").shape;
    assert_eq!(snake.validity, Validity::Outlying as u32, "a machine of joints does not become a snake");
}

#[test]
fn a_configuration_out_of_range_is_named() {
    for (config, key) in [
        (GateConfig { late_ms: f64::NAN, ..GateConfig::default() }, "late_ms"),
        (GateConfig { stale_ms: 100.0, ..GateConfig::default() }, "stale_ms"),
        (GateConfig { margin_rad: 0.0, ..GateConfig::default() }, "margin_rad"),
    ] {
        assert!(config.check().expect_err(key).to_string().contains(key));
    }
    GateConfig::default().check().expect("in range");
}

proptest! {
    /// Whatever a program says: instants rise, lie in the past, are not too old, numbers are finite, and every line counts.
    #[test]
    fn whatever_comes_only_sound_shapes_leave(
        lines in proptest::collection::vec((any::<i64>(), any::<Option<i64>>(), any::<f64>(), any::<f64>(), 0_u64..50), 1..60),
        plausible in proptest::collection::vec((-2_000_i64..20, -4.0_f64..4.0), 1..60),
        clock in prop_oneof![Just(SourceClock::Monotonic), Just(SourceClock::Realtime), Just(SourceClock::Own)],
    ) {
        let mut gate = ShapeGate::new(GateConfig::default());
        gate.begin(&header(clock));
        let wild = lines.into_iter().map(|(exposure_ns, sent_ns, x, y, frame)| {
            Measured { exposure_ns, sent_ns, ..bend(frame, 0, [x, y]) }
        });
        let near = plausible.into_iter().enumerate().map(|(k, (late_ms, x))| {
            let now_ns = T0_NS + k as i64 * FRAME_NS;
            Measured { frame: None, sent_ns: Some(now_ns), ..bend(0, now_ns + late_ms * MS, [x, 0.0]) }
        });
        let mut last_ns = i64::MIN;
        let mut n_lines = 1;
        for (k, measured) in wild.chain(near).enumerate() {
            let now_ns = T0_NS + k as i64 * FRAME_NS;
            n_lines += 1;
            if let Ok(passed) = gate.pass(&measured, &at(now_ns)) {
                let shape = passed.shape;
                prop_assert!(shape.sample_ns > last_ns && shape.sample_ns <= now_ns, "{shape:?}");
                prop_assert!(now_ns - shape.sample_ns <= 1000 * MS, "{shape:?}");
                prop_assert!(shape.bend_rad.iter().all(|b| b.is_finite() && b.abs() <= core::f64::consts::PI));
                last_ns = shape.sample_ns;
            }
        }
        let counts = gate.counts();
        prop_assert_eq!(counts.lines, n_lines);
        prop_assert_eq!(counts.headers + counts.published + counts.refused(), n_lines);
    }

    #[test]
    fn no_bytes_break_the_reader(bytes in proptest::collection::vec(any::<u8>(), 0..200), text in "\\PC{0,80}") {
        let _any_answer_will_do = (ShapeLine::parse(&bytes), ShapeLine::parse(text.as_bytes()));
    }
}
