//! The shipped recording is what its generator makes, what a device sends, and what the demonstration needs.

#![allow(clippy::expect_used, clippy::panic, reason = "the helpers of a test fail as the test does")]

use generate::shipped_recording_text;
use krait_ipc::message::{DeviceState, OperatorInput};
use krait_master::{AXIS_LIMIT_COUNTS, Engage, HidRecording, HidReport, MasterConfig, MasterCore};
use plan::{end_s, plan_at};

#[allow(dead_code, reason = "the generator uses what this test does not")]
#[path = "../examples/generate_recording/arc.rs"]
mod arc;
#[path = "../examples/generate_recording/generate.rs"]
mod generate;
#[allow(dead_code, reason = "the generator uses what this test does not")]
#[path = "../examples/generate_recording/plan.rs"]
mod plan;

const SHIPPED_TEXT: &str = include_str!("../recordings/default.krr");

const TICK_NS: i64 = 1_000_000;
/// Damping of the least squares as a part of the straight snake's gain; stronger than a resolver needs.
const DAMPING: f64 = 0.1;

fn shipped() -> HidRecording {
    HidRecording::shipped().expect("the built-in recording")
}

/// The inputs at every millisecond, as the process would publish them.
fn inputs() -> Vec<OperatorInput> {
    let recording = shipped();
    let mut reports = recording.reports().peekable();
    let mut core = MasterCore::new(&MasterConfig { engage: Engage::Once, ..MasterConfig::default() }).expect("default");
    let mut inputs = Vec::new();
    for now_ns in (0..=recording.duration_ns() + 500 * TICK_NS).step_by(TICK_NS as usize) {
        while let Some((stamp_ns, bytes)) = reports.next_if(|(stamp_ns, _)| *stamp_ns <= now_ns) {
            core.on_report(bytes, stamp_ns).expect("every shipped report is decoded");
        }
        inputs.push(core.on_tick(now_ns));
    }
    inputs
}

/// The bend vector (rad) at every millisecond, by a damped resolver that knows nothing of the plan. With `is_lateral_only`
/// it follows right and up and leaves the axial velocity aside.
fn resolved_bend_rad(inputs: &[OperatorInput], is_lateral_only: bool) -> Vec<[f64; 2]> {
    let mut bend_rad = [0.0_f64; 2];
    let damping = (DAMPING * arc::LENGTH_M / 2.0).powi(2);
    let resolve = |input: &OperatorInput| {
        let n_rows = if is_lateral_only { 2 } else { 3 };
        let [a, b] = arc::jacobian_m_per_rad(bend_rad);
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).take(n_rows).map(|(x, y)| x * y).sum::<f64>();
        let v = input.tip_vel_in_view_m_per_s;
        let (aa, ab, bb) = (dot(&a, &a) + damping, dot(&a, &b), dot(&b, &b) + damping);
        let det = aa * bb - ab * ab;
        bend_rad[0] += 1e-3 * (bb * dot(&a, &v) - ab * dot(&b, &v)) / det;
        bend_rad[1] += 1e-3 * (aa * dot(&b, &v) - ab * dot(&a, &v)) / det;
        bend_rad
    };
    inputs.iter().map(resolve).collect()
}

fn deg([x, y]: [f64; 2]) -> f64 {
    x.hypot(y).to_degrees()
}

fn delta_deg([x, y]: [f64; 2]) -> f64 {
    y.atan2(x).to_degrees()
}

#[test]
fn the_file_is_byte_for_byte_what_the_generator_makes() {
    let made = shipped_recording_text().expect("made");
    assert!(made == SHIPPED_TEXT.as_bytes(), "run `cargo run -p krait-master --example generate_recording`");
}

#[test]
fn it_sends_at_the_devices_pace_within_the_devices_range_and_rests_as_the_device_does() {
    let recording = shipped();
    assert!(recording.duration_ns() > 24_000_000_000);
    let (mut last_ns, mut n_zeros, mut n_silences) = (0, 0, 0);
    for (stamp_ns, bytes) in recording.reports() {
        let gap_ns = stamp_ns - last_ns;
        if gap_ns > 20 * TICK_NS {
            assert!(n_zeros >= 6, "silence only after three pairs of zeros, at {last_ns} ns");
            n_silences += 1;
        } else if stamp_ns > 0 {
            assert!(
                (7_800_000..=8_200_000).contains(&gap_ns),
                "one report per 8 ms slot: {gap_ns} ns at {stamp_ns} ns"
            );
        }
        let counts = match HidReport::decode(bytes).expect("decoded") {
            HidReport::Translation(counts) | HidReport::Rotation(counts) => counts,
            HidReport::Buttons(_) => [0; 3],
            other => panic!("a SpaceNavigator sends no {other:?}"),
        };
        assert!(counts.iter().all(|c| c.abs() <= AXIS_LIMIT_COUNTS));
        n_zeros = if counts == [0; 3] { n_zeros + 1 } else { 0 };
        last_ns = stamp_ns;
    }
    assert!(n_silences >= 5, "{n_silences}");
}

#[test]
fn the_default_operator_bends_the_snake_as_planned() {
    let inputs = inputs();
    for is_lateral_only in [false, true] {
        let bends = resolved_bend_rad(&inputs, is_lateral_only);
        let peak_deg = bends.iter().copied().map(deg).fold(0.0, f64::max);
        assert!((45.0..65.0).contains(&peak_deg), "peak {peak_deg} deg");
        for time_s in [5.9, 10.0, 17.0, end_s()] {
            let (planned, reached) = (plan_at(time_s).bend_rad, bends[(time_s * 1e3) as usize]);
            let error_deg = deg([planned[0] - reached[0], planned[1] - reached[1]]);
            assert!(error_deg < 2.0, "{error_deg} deg off the plan at {time_s} s, lateral only: {is_lateral_only}");
        }
    }
}

#[test]
fn the_first_ten_seconds_and_the_scored_part_each_hold_reversals_rotations_and_a_rest() {
    let inputs = inputs();
    let bends = resolved_bend_rad(&inputs, false);
    let mut turned_deg = [0.0_f64; 2];
    for (from_ms, to_ms, needs_both_ways) in [(700, 10_000, true), (10_000, 17_000, false)] {
        let part = &bends[from_ms..to_ms];
        let peak_deg = part.iter().copied().map(deg).fold(0.0, f64::max);
        assert!(peak_deg > 45.0, "{peak_deg} deg within {from_ms}..{to_ms} ms");
        let reverses = part.windows(2000).any(|w| {
            let (a, b) = (w[0], w[w.len() - 1]);
            deg(a) > 12.0 && deg(b) > 12.0 && a[0] * b[0] + a[1] * b[1] < -0.9 * a[0].hypot(a[1]) * b[0].hypot(b[1])
        });
        assert!(reverses, "a reversal through the straight pose within {from_ms}..{to_ms} ms");
        let mut here_deg = [0.0_f64; 2];
        for pair in part.windows(2).filter(|pair| deg(pair[0]) > 25.0) {
            let turn = (delta_deg(pair[1]) - delta_deg(pair[0]) + 540.0).rem_euclid(360.0) - 180.0;
            here_deg[usize::from(turn < 0.0)] += turn.abs();
        }
        assert!(here_deg[0].max(here_deg[1]) > 45.0, "a plane rotation within {from_ms}..{to_ms} ms: {here_deg:?}");
        assert!(!needs_both_ways || here_deg.iter().all(|d| *d > 45.0), "both ways: {here_deg:?}");
        turned_deg = [turned_deg[0] + here_deg[0], turned_deg[1] + here_deg[1]];
        let at_rest = |input: &OperatorInput| input.device() == Some(DeviceState::AtRest);
        assert!(
            inputs[from_ms..to_ms].windows(500).any(|w| w.iter().all(at_rest)),
            "at rest for half a second after 0.1 s"
        );
    }
    assert!(turned_deg.iter().all(|d| *d > 90.0), "{turned_deg:?}");
}

#[test]
fn presence_comes_first_the_clutch_is_used_and_the_device_is_never_lost() {
    let inputs = inputs();
    let ms_of = |want: &dyn Fn(&OperatorInput) -> bool| inputs.iter().position(want).expect("it happens");
    let present_ms = ms_of(&|i| i.operator_present());
    let moving_ms = ms_of(&|i| i.tip_vel_in_view_m_per_s != [0.0; 3]);
    assert!((390..=420).contains(&present_ms) && (700..900).contains(&moving_ms), "{present_ms} {moving_ms}");
    let clutched: Vec<_> = inputs.iter().filter(|i| i.clutch_pressed()).collect();
    assert!(
        (400..600).contains(&clutched.len()) && clutched.iter().any(|i| i.raw_axes[0] > 100),
        "hand moves, snake not"
    );
    assert!(inputs.iter().all(|i| i.device() != Some(DeviceState::Lost)));
    assert!(!inputs[inputs.len() - 1].operator_present(), "the operator leaves at the end");
    assert!(inputs.iter().all(|i| i.n_refused == 0));
}
