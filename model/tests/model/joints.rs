//! Joints: every effect does nothing at its neutral value, and is a known closed form on a small input.

use krait_model::joints::JointEffect;
use krait_model::model_file::ModelFile;
use krait_model::{Circumstances, KnownColumns};

const COLUMNS: KnownColumns = KnownColumns { time: true, stem_angle: false, temperature: true, named: false };

/// Positions of joint 1 for commands of it, a second apart; joint 2 stays at 2.
fn run(effects: &str, u: &[f64]) -> Vec<f64> {
    run_both(effects, &u.iter().map(|&u| [u, 2.0]).collect::<Vec<_>>()).iter().map(|y| y[0]).collect()
}

fn run_both(effects: &str, u: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let text = format!("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n{effects}");
    let file = ModelFile::parse(&text).unwrap();
    assert_eq!(ModelFile::parse(&file.to_toml()).unwrap(), file, "a model of joints reads back as it was written");
    assert_eq!(ModelFile::parse(&file.to_documented_toml()).unwrap(), file);
    let mut predictor = file.joint_chain(COLUMNS).unwrap().unwrap().predictor();
    let step = |(k, u): (usize, &[f64; 2])| {
        let at = Circumstances { temperature_c: 20.0, ..Circumstances::at(k as f64) };
        let y = predictor.step(u, &at);
        [y[0], y[1]]
    };
    u.iter().enumerate().map(step).collect()
}

fn effect(kind: &str, parameters: &str) -> String {
    format!("[[effect]]\nkind = \"{kind}\"\n{parameters}\n")
}

fn near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-12, "{found:?} instead of {expected:?}");
    }
}

#[test]
fn every_effect_at_its_defaults_changes_nothing() {
    let u = [0.0, 0.3, 1.0, 0.8, -2.0, -2.0, 5.0];
    for kind in JointEffect::ALL {
        near(&run(&effect(kind.name(), ""), &u), &u);
        assert_eq!(JointEffect::from_name(kind.name()), Some(kind));
    }
}

#[test]
fn effects_without_memory_are_their_formulas() {
    let u = [0.0, 0.5, -2.0];
    near(&run(&effect("scale", "scale = 0.1"), &u), &[0.0, 0.55, -2.2]);
    near(&run(&effect("offset", "offset = -0.25"), &u), &[-0.25, 0.25, -2.25]);
    near(&run(&effect("cubic", "cubic = 0.5"), &u), &[0.0, 0.5625, -6.0]);
    near(&run(&effect("dead-zone", "half_width = 0.2"), &u), &[0.0, 0.3, -1.8]);
    near(&run(&effect("saturation", "limit = 1.5"), &u), &[0.0, 0.5, -1.5]);
    let screw = "amplitude = 0.1\nperiod = 2.0\nphase_rad = 0.0";
    near(&run(&effect("periodic-error", screw), &u), &[0.0, 0.6, -2.0]);
    near(&run(&effect("cross-coupling", "from = 2\nk = 0.25"), &u), &[0.5, 1.0, -1.5]);
    let formula = "name = \"own\"\nhook = \"joint\"\nformula = \"a * u_i^2 + motion_i * joint\"\nparams = { a = 0.5 }";
    near(&run(&effect("formula", formula), &u), &[0.0, 0.5 + 0.125 + 1.0, -2.0 + 2.0 - 1.0]);
}

#[test]
fn one_joint_alone_can_have_an_effect() {
    let both = [[1.0, 1.0]];
    assert_eq!(run_both(&effect("scale", "scale = 0.5"), &both), [[1.5, 1.5]]);
    assert_eq!(run_both(&effect("scale", "joint = 2\nscale = 0.5"), &both), [[1.0, 1.5]]);
    let each = effect("scale", "joint = 1\nscale = 0.5") + &effect("scale", "joint = 2\nscale = -0.5");
    assert_eq!(run_both(&each, &both), [[1.5, 0.5]]);
}

#[test]
fn hysteresis_follows_its_operators() {
    let u = [0.0, 1.0, 0.9, 0.5, 0.9];
    near(&run(&effect("backlash", "half_width = 0.1"), &u), &[0.0, 0.9, 0.9, 0.6, 0.8]);
    let plays = "weight1 = 0.5\nhalf_width1 = 0.1\nweight2 = 0.25\nhalf_width2 = 0.2";
    // p1: 0, 0.9, 0.9, 0.6, 0.8; p2: 0, 0.8, 0.8, 0.7, 0.7.
    let expected = [0.0, 1.0 - 0.05 - 0.05, 0.9 - 0.0 - 0.025, 0.5 + 0.05 + 0.05, 0.9 - 0.05 - 0.05];
    near(&run(&effect("prandtl-ishlinskii", plays), &u), &expected);
    let h = 0.2_f64;
    // Loading it lags by e^-h, unloading it holds until x e^h is below it.
    let expected = [0.0, (-h).exp(), (-h).exp(), 0.5 * h.exp(), 0.9 * (-h).exp()];
    near(&run(&effect("cone-friction", "friction = 0.2"), &u), &expected);
    // From rest z = 1 - e^(-travel); back with gamma = 0.5 it falls by the travel until it is zero.
    let z = 1.0 - (-1.0_f64).exp();
    let found = run(&effect("bouc-wen", "amplitude = 0.3\ntravel = 1.0\ngamma = 0.5"), &u[..3]);
    near(&found, &[0.0, 1.0 - 0.3 * z, 0.9 - 0.3 * (z - 0.1)]);
}

#[test]
fn time_acts_as_it_is_said_to() {
    let step = [0.0, 1.0, 1.0, 1.0];
    let decay = |t: f64| 1.0 - (-t).exp();
    // Between rows the command goes straight: behind a ramp of one second e^-1 is reached, and from there on what is held.
    let reached = 1.0 - decay(1.0);
    let held = |t: f64| 1.0 - (1.0 - reached) * (-t).exp();
    near(&run(&effect("first-order-lag", "time_s = 1.0"), &step), &[0.0, reached, held(1.0), held(2.0)]);
    // A critically damped second order, the same ramp: 1 - 2 + (2 + t) e^-t at t = 1.
    let critical = run(&effect("second-order", "frequency_rad_per_s = 1.0\ndamping = 1.0"), &step[..2]);
    near(&critical, &[0.0, 3.0 * (-1.0_f64).exp() - 1.0]);
    let crept = "a1 = 0.2\nt1_s = 2.0";
    let expected: Vec<f64> = (0..4).map(|k| step[k] - 0.2 * decay(0.5 * k as f64)).collect();
    near(&run(&effect("creep", crept), &step), &expected);
    near(&run(&effect("latency", "delay_s = 1.5"), &[0.0, 1.0, 2.0, 4.0]), &[0.0, 0.0, 0.5, 1.5]);
    let expected: Vec<f64> = (0..4).map(|k| 1.0 + 0.5 * decay(k as f64 / 10.0)).collect();
    near(&run(&effect("drift", "size = 0.5\nrise_time_s = 10.0"), &[1.0; 4]), &expected);
}

#[test]
fn gain_and_offset_stand_between_transmission_and_sensor() {
    let machine = "gain = [[2.0, 1.0], [0.0, 1.0]]\noffset = [0.5, 0.0]\n";
    let both =
        machine.to_owned() + &effect("scale", "joint = 1\nscale = 1.0") + &effect("offset", "joint = 1\noffset = 1.0");
    assert_eq!(run_both(&both, &[[1.0, 1.0]]), [[2.0 * 2.0 + 1.0 + 0.5 + 1.0, 1.0]]);
}

#[test]
fn what_is_no_joint_is_refused_with_its_line() {
    let refused = |effects: &str| {
        let text = format!("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n{effects}");
        ModelFile::parse(&text).unwrap_err().to_string()
    };
    let sentence = refused(&effect("scale", "joint = 3"));
    assert!(
        sentence.contains("line 5") && sentence.contains("joint is 3") && sentence.contains("0 to 2"),
        "{sentence}"
    );
    let sentence = refused(&effect("twist", ""));
    assert!(sentence.contains("twist") && sentence.contains("cross-coupling"), "{sentence}");
    let sentence = refused(&effect("backlasch", ""));
    assert!(sentence.contains("backlash"), "{sentence}");
    let formula = "name = \"a\"\nhook = \"eps\"\nformula = \"1\"";
    assert!(refused(&effect("formula", formula)).contains("eps"));
    let text = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"dead-zone\"\n";
    assert!(ModelFile::parse(text).unwrap_err().to_string().contains("dead-zone"));
}

#[test]
fn commands_that_are_not_finite_repeat_the_last_position() {
    let found = run(&effect("backlash", "half_width = 0.1"), &[1.0, f64::NAN, 2.0]);
    near(&found, &[1.0, 1.0, 1.9]);
}

#[test]
fn a_curve_and_a_gap_may_be_centred_and_drifts_and_rates_are_what_they_say() {
    let u = [0.0, 1.0, -2.0];
    near(&run(&effect("quadratic", "quadratic = 0.5\ncentre = 1.0"), &u), &[0.5, 1.0, 2.5]);
    near(&run(&effect("cubic", "cubic = 0.5\ncentre = 1.0"), &u), &[-0.5, 1.0, -15.5]);
    near(&run(&effect("dead-zone", "half_width = 0.5\ncentre = 1.0"), &u), &[0.5, 1.0, -1.5]);
    near(&run(&effect("linear-drift", "rate = 0.25"), &u), &[0.0, 1.25, -1.5]);
    near(&run(&effect("rate-limit", "rate = 0.75"), &u), &[0.0, 0.75, 0.0]);
    near(&run(&effect("load-friction", "share = 0.5\nfriction = 0.2"), &[0.0, 1.0, 0.9]), &[0.0, 0.9, 0.85]);
}

#[test]
fn a_second_order_lag_is_the_solution_of_its_equation() {
    let step = [0.0, 1.0, 1.0, 1.0];
    let of =
        |damping: f64| run(&effect("second-order", &format!("frequency_rad_per_s = 2.0\ndamping = {damping}")), &step);
    let (rate, decay) = (2.0 * 0.75_f64.sqrt(), |t: f64| (-t).exp());
    let expected = |t: f64| 1.0 - decay(t) * ((rate * t).cos() + (rate * t).sin() / rate);
    near(&of(0.5), &behind_a_ramp(expected));
    let critical = |t: f64| 1.0 - (1.0 + 2.0 * t) * (-2.0 * t).exp();
    near(&of(1.0), &behind_a_ramp(critical));
    let (fast, slow) = (2.0 * (2.0 + 3.0_f64.sqrt()), 2.0 * (2.0 - 3.0_f64.sqrt()));
    let over = |t: f64| 1.0 - (fast * (-slow * t).exp() - slow * (-fast * t).exp()) / (fast - slow);
    near(&of(2.0), &behind_a_ramp(over));
}

/// At 0, 1, 2 and 3 s what follows a ramp from 0 to 1 in the first second: the mean of the step's answer over a second (Simpson).
fn behind_a_ramp(step: impl Fn(f64) -> f64) -> [f64; 4] {
    const N: usize = 2000;
    let mean = |from: f64| {
        let at = |k: usize| {
            step(from + k as f64 / N as f64) * if k == 0 || k == N { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 }
        };
        (0..=N).map(at).sum::<f64>() / (3.0 * N as f64)
    };
    [0.0, mean(0.0), mean(1.0), mean(2.0)]
}

#[test]
fn plays_of_a_warped_position_are_wider_on_one_side() {
    let shape = "reach = 0.4\nbend = 0.5\nweight2 = 1.0";
    // w = x + x^2 / 2, one play of 0.1.
    let (w, x) = (|x: f64| x + 0.5 * x * x, [0.0, 1.0, 0.9]);
    let p = [0.0, w(1.0) - 0.1, w(0.9) + 0.1_f64.min(w(1.0) - 0.1 - w(0.9))];
    let expected: Vec<f64> = (0..3).map(|k| x[k] - (w(x[k]) - p[k])).collect();
    near(&run(&effect("generalised-prandtl-ishlinskii", shape), &x), &expected);
}

#[test]
fn what_adds_goes_around_what_stands_behind_it() {
    let list = effect("periodic-error", "amplitude = 0.1\nperiod = 2.0") + &effect("backlash", "half_width = 0.5");
    let u = [0.0, 0.5, 1.5];
    near(&run(&list, &u), &[0.0, 0.1, 1.0 - 0.1]);
}

#[test]
fn what_is_not_known_of_gain_and_offset_is_read_and_written_as_such() {
    use krait_model::model_file::{Known, Machine};
    let parse = |keys: &str| ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n{keys}"));
    let joints = |keys: &str| {
        let file = parse(keys).unwrap();
        assert_eq!(ModelFile::parse(&file.to_toml()).unwrap(), file, "{}", file.to_toml());
        let Machine::Joints(joints) = file.machine().clone() else { panic!("joints") };
        (joints, file.to_toml())
    };
    let (absent, text) = joints("");
    assert!(absent.gain_known.iter().all(|known| *known == Known::Absent) && !text.contains("gain"), "{text}");
    assert!(joints("gain = \"free\"").0.gain_known.iter().all(Known::is_open));
    let (mixed, _) = joints("gain = [-0.9, { value = 1.1, se = 0.02, from = \"a.csv\" }]\noffset = [\"free\", 2.0]");
    assert_eq!((mixed.gain[0][0], mixed.gain[1][1]), (-0.9, 1.1));
    assert!(
        matches!(&mixed.gain_known[1], Known::Fitted { se, from: Some(from), .. } if *se == 0.02 && from == "a.csv")
    );
    assert_eq!((&mixed.offset_known[0], &mixed.offset_known[1]), (&Known::Free, &Known::Held));
    for (keys, word) in [
        ("gain = [1.0]", "2"),
        ("gain = \"fee\"", "array"),
        ("gain = [1.0, \"fee\"]", "free"),
        ("offset = [0.0, { value = 1.0 }]", "se"),
        ("offset = [0.0, { value = 1.0, se = 0.0 }]", "se"),
        ("offset = [0.0, { value = nan, se = 1.0 }]", "value"),
    ] {
        let sentence = parse(keys).unwrap_err().to_string();
        assert!(sentence.contains("line 5") && sentence.contains(word), "{keys}: {sentence}");
    }
}
