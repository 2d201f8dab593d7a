//! The page's glance as lines for a terminal of 80 columns: state, error, plane, lines, latency, losses, recording, marks, and
//! what holds the motion back, worst first.

use crate::fitted::{GlanceLine, GlanceWeight};
use crate::observer::Observer;
use crate::words::{Level, Shown, fault_sentence};
use krait_ipc::Reason;
use krait_ipc::message::{JointValues, OperatorInput, Shape, SlaveState};

/// Below this bend there is no plane to speak of, degrees.
const PLANE_FROM_DEG: f64 = 2.0;
/// Reasons that are shown at most.
const MOST_REASONS: usize = 6;

/// What a chain does at this instant, line by line.
pub fn glance(observer: &mut Observer, now_ns: i64) -> Vec<GlanceLine> {
    let of = |weight| move |text| GlanceLine::new(weight, text);
    let (error, rest) = (of(GlanceWeight::Error), of(GlanceWeight::Rest));
    let shown = observer.shown(now_ns);
    let failed = observer
        .newest()
        .fresh_state(now_ns)
        .filter(|_| matches!(shown, Shown::Fault | Shown::Emergency))
        .map(fault_sentence);
    let sentence = failed.unwrap_or_else(|| shown.sentence().to_owned());
    let word = shown.word().to_uppercase() + " ";
    let mut lines = vec![GlanceLine::new(GlanceWeight::State, format!("{word:<12}{sentence}"))];
    let recording_s = observer.recording_s(&observer.members(), now_ns);
    let newest = observer.newest();
    let off_deg = observer.tracking().rms(now_ns).map(f64::to_degrees);
    lines.push(rest(operator_line(newest.fresh_input(now_ns))));
    if let Some(setpoint) =
        newest.setpoint.filter(|setpoint| newest.fresh_state(now_ns).is_some() && setpoint.n_joints == 0)
    {
        lines.push(error(bend_line(setpoint.bend_rad, newest.fresh_shape(now_ns), off_deg)));
        lines.extend(setpoint.jaw_rad().map(|jaw_rad| rest(jaw_line(jaw_rad, newest.fresh_shape(now_ns)))));
    }
    if let Some(state) = newest.fresh_state(now_ns) {
        let n_segments = newest.setpoint.map_or(0, |setpoint| setpoint.n_segments());
        let of_each = match n_segments {
            0 => joint_lines(state, newest.fresh_shape(now_ns), observer.tracking().rms_of_each(now_ns)),
            n => segment_lines(n, state, newest.fresh_shape(now_ns)),
        };
        lines.extend(of_each.into_iter().map(error));
        lines.extend(actuator_lines(state).into_iter().map(rest));
    }
    lines.push(rest(latency_line(observer)));
    lines.push(rest(format!("recording   {}", recording_words(recording_s, observer.marks()))));
    if let Some(command) = observer.newest().command {
        lines.push(rest(format!("model       {:016x}", command.model_hash)));
    }
    lines.extend(reason_lines(observer, now_ns));
    lines
}

/// A value with so many digits behind the point; a dash where there is none.
pub fn number(value: Option<f64>, digits: usize) -> String {
    value.filter(|value| value.is_finite()).map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
}

fn operator_line(input: Option<&OperatorInput>) -> String {
    let Some(input) = input else { return "operator    nothing is known of the hand".to_owned() };
    let mut words = vec![if input.operator_present() { "present" } else { "absent" }.to_owned()];
    if input.clutch_pressed() {
        words.push("clutch pressed".to_owned());
    }
    words.extend(input.scale().filter(|scale| *scale != 1.0).map(|scale| format!("scale {scale}")));
    words.extend(input.locked().map(|what| format!("{what} locked")));
    format!("operator    {}", words.join(", "))
}

/// Size of a bend, deg.
pub fn bend_deg([x, y]: [f64; 2]) -> f64 {
    x.hypot(y).to_degrees()
}

/// The plane of a bend as the page shows it: anticlockwise from the camera's right (minus the paper's delta), whole degrees from 0 to 359;
/// nothing where there is too little bend to have one.
pub fn plane_deg(bend_rad: [f64; 2]) -> Option<f64> {
    let [x, y] = bend_rad;
    (bend_deg(bend_rad) >= PLANE_FROM_DEG).then(|| ((-y).atan2(x).to_degrees() + 360.0).round() % 360.0)
}

fn bend_line(wanted: [f64; 2], shape: Option<&Shape>, off_deg: Option<f64>) -> String {
    let measured = shape.and_then(Shape::valid_bend_rad);
    format!(
        "bend        {} of {} deg, off {} (rms of 1 s), plane {} deg",
        number(measured.map(bend_deg), 1),
        number(Some(bend_deg(wanted)), 1),
        number(off_deg, 2),
        number(measured.and_then(plane_deg), 0),
    )
}

/// Where the jaw of a gripper is and shall be.
fn jaw_line(wanted_rad: f64, shape: Option<&Shape>) -> String {
    let measured_deg = shape.and_then(Shape::valid_jaw_rad).map(f64::to_degrees);
    format!("jaw         {} of {} deg open", number(measured_deg, 1), number(Some(wanted_rad.to_degrees()), 1))
}

fn joint_lines(state: &SlaveState, shape: Option<&Shape>, off: Option<JointValues>) -> Vec<String> {
    let measured = shape.and_then(Shape::valid_joints_rad).unwrap_or(&[]);
    let wanted = state.setpoint_joints_rad.iter().take(state.n_joints as usize);
    let line = |(at, wanted): (usize, &f64)| {
        let measured = measured.get(at).copied();
        let name = format!("joint {}", at + 1);
        format!(
            "{name:<12}{} of {} rad, off {} (rms of 1 s; m where it slides)",
            number(measured, 4),
            number(Some(*wanted), 4),
            number(off.and_then(|off| off.get(at).copied()), 4)
        )
    };
    wanted.enumerate().map(line).collect()
}

fn segment_lines(n_segments: usize, state: &SlaveState, shape: Option<&Shape>) -> Vec<String> {
    let of = |values: &[f64], at: usize| Some([*values.get(2 * at)?, *values.get(2 * at + 1)?]);
    let measured = shape.and_then(Shape::valid_joints_rad).unwrap_or(&[]);
    let line = |at: usize| {
        let (measured, wanted) = (of(measured, at), of(&state.setpoint_joints_rad, at));
        let off = measured.zip(wanted).map(|([x, y], [a, b])| bend_deg([x - a, y - b]));
        let name = format!("segment {}", at + 1);
        format!(
            "{name:<12}{} of {} deg, off {}, plane {} deg",
            number(measured.map(bend_deg), 1),
            number(wanted.map(bend_deg), 1),
            number(off, 2),
            number(measured.and_then(plane_deg), 0),
        )
    };
    (0..n_segments).map(line).collect()
}

fn actuator_lines(state: &SlaveState) -> Vec<String> {
    let n = state.n_actuators as usize;
    let line = |(at, (q_m, tau_n)): (usize, (&f64, &f64))| {
        let name = format!("actuator {}", at + 1);
        format!("{name:<12}{:>8} mm {:>8} N", number(Some(q_m * 1e3), 3), number(Some(*tau_n), 1))
    };
    state.measured_q_m.iter().zip(&state.measured_tau_n).take(n).enumerate().map(line).collect()
}

fn latency_line(observer: &Observer) -> String {
    let latency = observer.latency();
    let n_lost: u64 =
        observer.newest().healths.iter().filter_map(|(_, health)| *health).map(|health| health.n_lost).sum();
    let way = latency.stretches.last().filter(|_| latency.n > 0);
    let us = |value: fn(&crate::latency::StretchReport) -> f64| number(way.map(value), 0);
    let (p50, p99, worst) = (us(|way| way.p50_us), us(|way| way.p99_us), us(|way| way.worst_us));
    format!("latency     p50 {p50}, p99 {p99}, worst {worst} us; {} late, {n_lost} lost", latency.n_late)
}

fn recording_words(recording_s: Option<f64>, marks: Option<(u64, &str)>) -> String {
    let recorder = recording_s.map_or("none".to_owned(), |seconds| format!("{seconds:.0} s"));
    let marks = marks.map(|(n, last)| format!("; {n} marks seen, the last: {last}"));
    recorder + &marks.unwrap_or_default()
}

fn reason_lines(observer: &Observer, now_ns: i64) -> Vec<GlanceLine> {
    let mut reasons: Vec<Reason> = observer.reasons(now_ns).iter().collect();
    let newest = observer.newest();
    reasons.sort_by_key(|reason| newest.words_of(*reason, now_ns).level);
    let line = |reason: &Reason| {
        let words = newest.words_of(*reason, now_ns);
        let level = match words.level {
            Level::Fault => "FAULT",
            Level::Warn => "WARNING",
            Level::Hold => "holds",
            Level::Info => "note",
        };
        format!("{level:<12}{} {}", words.say, words.todo).trim_end().to_owned()
    };
    let further = |text, n_reasons| GlanceLine { weight: GlanceWeight::FurtherReason, text, n_reasons };
    let n_more = reasons.len().saturating_sub(MOST_REASONS);
    let more =
        (n_more > 0).then(|| further(format!("            and {n_more} more: `krait state` has them all"), n_more));
    let mut lines: Vec<_> =
        reasons.iter().take(MOST_REASONS).map(|reason| further(line(reason), 1)).chain(more).collect();
    if let Some(worst) = lines.first_mut() {
        worst.weight = GlanceWeight::Reason;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fitted::fitted;
    use krait_ipc::Bus;

    #[test]
    fn silence_is_said_and_no_line_is_too_long() {
        let bus = Bus::open(&format!("glance-{}", std::process::id()), "glance").expect("joined");
        let mut observer = Observer::open(bus).expect("an observer");
        observer.look(f64::INFINITY).expect("looked");
        let lines = fitted(glance(&mut observer, krait_ipc::clock::monotonic_ns()), [usize::MAX; 2]);
        assert!(lines[0].starts_with("NO PICTURE"), "{lines:?}");
        assert!(lines.iter().any(|line| line == "latency     p50 -, p99 -, worst - us; 0 late, 0 lost"), "{lines:?}");
        assert!(lines.iter().all(|line| line.chars().count() < 80), "{lines:?}");
    }

    #[test]
    fn what_is_not_measured_is_a_dash_and_never_zero() {
        let mut state = SlaveState { n_actuators: 3, ..SlaveState::default() };
        state.measured_tau_n = [f64::NAN; krait_ipc::message::MAX_ACTUATORS];
        state.measured_q_m[1] = -2.3456e-3;
        let lines = actuator_lines(&state);
        assert_eq!(lines.len(), 3);
        assert_eq!(lines[1], "actuator 2    -2.346 mm        - N");
    }

    #[test]
    fn each_segment_has_a_line_with_its_bend_error_and_plane() {
        let mut state = SlaveState { n_joints: 4, n_actuators: 6, ..SlaveState::default() };
        state.setpoint_joints_rad[..4].copy_from_slice(&[0.5, 0.0, 0.0, 0.4]);
        let lines = segment_lines(2, &state, Some(&Shape::of_joints(1, 1, 1, &[0.5, 0.0, 0.0, 0.39])));
        assert_eq!(lines[0], "segment 1   28.6 of 28.6 deg, off 0.00, plane 0 deg");
        assert_eq!(lines[1], "segment 2   22.3 of 22.9 deg, off 0.57, plane 270 deg");
        assert_eq!(segment_lines(1, &state, None)[0], "segment 1   - of 28.6 deg, off -, plane - deg");
    }

    #[test]
    fn each_joint_has_a_line_with_its_error() {
        let mut state = SlaveState { n_joints: 2, ..SlaveState::default() };
        state.setpoint_joints_rad[..2].copy_from_slice(&[0.5, -0.1]);
        let mut off = JointValues::default();
        off[..2].copy_from_slice(&[0.0021, 0.0]);
        let lines = joint_lines(&state, Some(&Shape::of_joints(1, 1, 1, &[0.502, -0.1])), Some(off));
        assert_eq!(lines[0], "joint 1     0.5020 of 0.5000 rad, off 0.0021 (rms of 1 s; m where it slides)");
        assert_eq!(lines[1], "joint 2     -0.1000 of -0.1000 rad, off 0.0000 (rms of 1 s; m where it slides)");
        assert!(joint_lines(&state, None, None)[1].contains(" - of -0.1000 rad, off - ("));
    }

    #[test]
    fn a_jaw_is_told_beside_where_it_shall_be_and_with_a_dash_where_nobody_sees_it() {
        let shape = Shape::of_bend(1, 1, 1, [0.5, 0.5]);
        assert_eq!(jaw_line(0.5, Some(&shape.with_jaw(0.48, 0.01))), "jaw         27.5 of 28.6 deg open");
        assert_eq!(jaw_line(0.5, Some(&shape)), "jaw         - of 28.6 deg open");
    }

    #[test]
    fn a_plane_is_told_only_where_there_is_a_bend() {
        let wanted = [0.5, 0.5];
        let shape = |bend| Shape::of_bend(1, 1, 1, bend);
        let line = bend_line(wanted, Some(&shape([0.5, 0.5])), Some(0.456));
        assert_eq!(line, "bend        40.5 of 40.5 deg, off 0.46 (rms of 1 s), plane 315 deg");
        let planes = [[0.5, 0.0], [0.5, 1e-4], [0.5, -1e-4], [0.0, -0.5], [-0.5, -1e-4], [-0.5, 1e-4]].map(plane_deg);
        assert_eq!(planes, [0.0, 0.0, 0.0, 90.0, 180.0, 180.0].map(Some));
        assert!(bend_line(wanted, Some(&shape([0.01, 0.0])), None).ends_with("off - (rms of 1 s), plane - deg"));
        assert!(bend_line(wanted, None, None).contains(" - of 40.5 deg"));
    }
}
