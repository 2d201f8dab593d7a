//! The inverse of joints: what it commands makes the forward model take the wanted positions, for every effect that can be undone.

use crate::allocations::allocations_of;
use core::f64::consts::TAU;
use krait_model::effects::Inverse;
use krait_model::joints::{JointChain, JointEffect, JointInverseSettings};
use krait_model::model_file::ModelFile;
use krait_model::{ChainError, Circumstances, KnownColumns};
use proptest::prelude::*;

const COLUMNS: KnownColumns = KnownColumns { time: true, stem_angle: false, temperature: true, named: false };
const STEP_S: f64 = 1e-3;

fn chain(machine: &str, effects: &str) -> JointChain {
    let text = format!("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n{machine}{effects}");
    ModelFile::parse(&text).unwrap().joint_chain(COLUMNS).unwrap().unwrap()
}

fn effect(kind: &str, parameters: &str) -> String {
    format!("[[effect]]\nkind = \"{kind}\"\n{parameters}\n")
}

fn at(k: usize) -> Circumstances {
    Circumstances { temperature_c: 20.0, ..Circumstances::at(k as f64 * STEP_S) }
}

/// Two joints that go to and fro at their own rates, with a rest in between: 4 s at 1 kHz, in degrees, say.
fn path() -> impl Iterator<Item = [f64; 2]> {
    (0..4000).map(|k| {
        let t = (k as f64 * STEP_S).min(2.0) + (k as f64 * STEP_S - 2.5).max(0.0);
        [20.0 * (TAU * 0.5 * t).sin(), 3.0 + 12.0 * (TAU * 0.4 * t).cos()]
    })
}

/// Largest distance of the forward model from what was wanted, and how large it is in the mean, with and without the inverse.
fn errors(chain: &JointChain) -> ([f64; 2], [f64; 2]) {
    let mut compensator = chain.compensator(JointInverseSettings::default()).unwrap();
    let (mut with, mut without) = (chain.predictor(), chain.predictor());
    let mut sums = [[0.0_f64; 2]; 2];
    let mut n = 0.0;
    for (k, wanted) in path().enumerate() {
        let command = compensator.step(&wanted, &at(k));
        assert!(command.is_finite && command.is_reachable, "{k}: {command:?}");
        let reached = with.step(&command.u[..2], &at(k));
        assert_eq!(reached, &command.y[..2], "the compensator knows where the joints are");
        let bare = without.step(&wanted, &at(k));
        n += 1.0;
        for (sum, y) in sums.iter_mut().zip([reached, bare]) {
            let error = y.iter().zip(&wanted).fold(0.0_f64, |worst, (y, wanted)| worst.max((y - wanted).abs()));
            *sum = [sum[0].max(error), sum[1] + error];
        }
    }
    let [with, without] = sums.map(|[max, sum]| [max, sum / n]);
    (with, without)
}

#[test]
fn what_has_no_play_is_undone_to_the_last_digits() {
    for (kind, parameters) in [
        ("scale", "scale = 0.2"),
        ("scale", "joint = 2\nscale = -0.3"),
        ("offset", "offset = -1.5"),
        ("cubic", "cubic = 2e-4"),
        ("periodic-error", "amplitude = 0.2\nperiod = 5.0\nphase_rad = 0.4"),
        ("cross-coupling", "from = 1\nk = 0.21"),
        ("creep", "a1 = 0.1\nt1_s = 0.5\na2 = 0.05\nt2_s = 3.0"),
        ("drift", "size = 2.0\nrise_time_s = 2.0"),
        ("formula", "name = \"own\"\nhook = \"joint\"\nformula = \"a * u_i^2\"\nparams = { a = 1e-3 }"),
    ] {
        let (with, without) = errors(&chain("", &effect(kind, parameters)));
        // What changes by itself is followed where the joints rest, not foreseen.
        let limit = if matches!(kind, "creep" | "drift") { 0.01 * without[0] } else { 1e-7 };
        assert!(with[0] < limit, "{kind}: {with:?} against {without:?}");
        assert!(without[0] > 0.1, "{kind} does something: {without:?}");
    }
}

/// Of play, only its crossing is left: at most its width, and a twentieth of the uncompensated error in the mean.
#[test]
fn play_is_crossed_quickly_and_then_gone() {
    for (kind, parameters, width) in [
        ("backlash", "half_width = 0.8", 1.6),
        ("bouc-wen", "amplitude = 0.8\ntravel = 1.0", 1.6),
        ("prandtl-ishlinskii", "weight1 = 0.2\nhalf_width1 = 0.5\nweight2 = 0.2\nhalf_width2 = 2.0", 1.0),
        ("cone-friction", "friction = 0.05", 2.2),
        ("dead-zone", "half_width = 0.5", 1.0),
    ] {
        let (with, without) = errors(&chain("", &effect(kind, parameters)));
        assert!(with[0] <= width && with[1] < 0.05 * without[1], "{kind}: {with:?} against {without:?}");
    }
}

#[test]
fn everything_together_with_a_gain_that_couples_the_joints() {
    let machine = "gain = [[1.1, 0.0], [-0.4, 0.9]]\noffset = [0.5, -2.0]\n";
    let effects = effect("cross-coupling", "joint = 2\nfrom = 1\nk = 0.13")
        + &effect("backlash", "joint = 1\nhalf_width = 0.4")
        + &effect("bouc-wen", "joint = 2\namplitude = 0.5\ntravel = 2.0")
        + &effect("creep", "a1 = 0.05\nt1_s = 1.0")
        + &effect("offset", "offset = 0.3");
    let (with, without) = errors(&chain(machine, &effects));
    assert!(with[0] < 1.7 && with[1] < 0.02 * without[1], "{with:?} against {without:?}");
}

#[test]
fn nothing_jumps_and_a_joint_that_rests_is_left_alone() {
    let chain = chain("", &effect("backlash", "half_width = 0.8"));
    let settings = JointInverseSettings::default();
    let mut compensator = chain.compensator(settings).unwrap();
    let (settled, faster) = (1.0 - (-STEP_S / settings.settle_s).exp(), (STEP_S / settings.settle_s).exp());
    let mut before: Option<([f64; 2], [f64; 2], [f64; 2])> = None;
    for (k, wanted) in path().enumerate() {
        let u = compensator.step(&wanted, &at(k)).u;
        let mut went = [0.0; 2];
        if let Some((wanted_before, u_before, went_before)) = before {
            let asked = (0..2).map(|j| f64::abs(wanted[j] - wanted_before[j])).fold(0.0_f64, f64::max);
            for j in 0..2 {
                went[j] = (u[j] - u_before[j]).abs();
                let allowed =
                    (settings.reversal_gain * asked).max(settled * (1.6 + asked)).max(faster * went_before[j]);
                assert!(went[j] <= allowed + 1e-9, "{k}: {went:?} {asked}");
            }
        }
        before = Some((wanted, [u[0], u[1]], went));
    }
    let resting = compensator.step(&[1.0, 1.0], &at(4000));
    let mut last = resting;
    for k in 4001..6000 {
        last = compensator.step(&[1.0, 1.0], &at(k));
    }
    assert!(last.to_go == 0.0 && (last.y[0] - 1.0).abs() < 1e-9, "{last:?}");
    assert_eq!(compensator.step(&[1.0, 1.0], &at(6000)).u, last.u, "not a bit moves");
}

#[test]
fn positions_that_are_not_finite_repeat_the_command_and_leave_no_trace() {
    let chain = chain("", &effect("backlash", "half_width = 0.8"));
    let (mut one, mut other) =
        (chain.compensator(Default::default()).unwrap(), chain.compensator(Default::default()).unwrap());
    for (k, wanted) in path().take(800).enumerate() {
        let command = one.step(&wanted, &at(k));
        assert_eq!(other.step(&wanted, &at(k)), command);
        let refused = other.step(&[f64::NAN, 0.0], &at(k));
        assert!(!refused.is_finite && refused.u == command.u);
        assert!(!other.step(&[1.0], &at(k)).is_finite, "one position for two joints");
    }
}

#[test]
fn what_no_command_undoes_is_refused_by_name() {
    for kind in JointEffect::ALL {
        let built = chain("", &effect(kind.name(), "")).compensator(Default::default());
        match kind.definition().inverse {
            Inverse::None(_) => assert!(built.unwrap_err().to_string().contains(kind.name())),
            _ => drop(built.unwrap()),
        }
    }
    let singular = chain("gain = [[1.0, 2.0], [0.5, 1.0]]\n", "").compensator(Default::default());
    assert_eq!(singular.unwrap_err(), ChainError::Gain);
    // A gain that a fit cannot tell from zero; one that is as small and well known asks for long ways, and may.
    let fitted = |se: f64| {
        let text = format!("gain = [1.0, {{ value = 1.9e-4, se = {se:e} }}]\n");
        chain(&text, "").compensator(Default::default())
    };
    let refused = fitted(9.4e-5).unwrap_err();
    assert!(matches!(refused, ChainError::NoGain { joint: 2, .. }), "{refused}");
    assert!(refused.to_string().contains("cannot be told from zero"), "{refused}");
    drop(fitted(1e-6).unwrap());
    for settings in [
        JointInverseSettings { reversal_gain: 0.5, ..Default::default() },
        JointInverseSettings { settle_s: f64::NAN, ..Default::default() },
    ] {
        assert!(matches!(chain("", "").compensator(settings), Err(ChainError::OutOfBounds { .. })));
    }
}

#[test]
fn no_step_allocates() {
    let effects = JointEffect::ALL.into_iter().filter(|kind| !matches!(kind.definition().inverse, Inverse::None(_)));
    let all: String = effects.map(|kind| effect(kind.name(), "")).collect();
    let chain = chain("", &(all + &effect("backlash", "half_width = 0.8")));
    let mut compensator = chain.compensator(Default::default()).unwrap();
    let wanted: Vec<[f64; 2]> = path().step_by(10).collect();
    let n = allocations_of(|| {
        for (k, wanted) in wanted.iter().enumerate() {
            std::hint::black_box(compensator.step(wanted, &at(k)));
        }
        compensator.step(&[f64::NAN; 2], &at(wanted.len()));
    });
    assert_eq!(n, 0);
}

/// The first small way back behind a play: nothing changes before its edge, and what was wanted lies just behind it.
#[test]
fn a_small_way_just_behind_the_edge_of_a_play_is_found() {
    let effects =
        effect("scale", "scale = -0.17686396730876047") + &effect("backlash", "half_width = 0.13419007223988405");
    let chain = chain("", &effects);
    let (mut compensator, mut joints) = (chain.compensator(Default::default()).unwrap(), chain.predictor());
    let (first, second) = ([23.37656406699776, 10.968518362888336], [-19.73289068504018, 10.96067258042269]);
    for (step, wanted) in round_trip([0.0; 2], &[first, second]).into_iter().enumerate() {
        let command = compensator.step(&wanted, &at(10 * step));
        let y = joints.step(&command.u[..2], &at(10 * step));
        let error = (y[0] - wanted[0]).abs().max((y[1] - wanted[1]).abs());
        assert!(command.is_reachable && error <= 1e-8 + 3.0 * command.to_go, "{step}: {error} {command:?}");
    }
}

/// Smooth ways from goal to goal, with a rest of 50 steps at each.
fn round_trip(mut place: [f64; 2], goals: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut all = Vec::new();
    for goal in goals {
        for j in 1..=200 {
            let part = if j >= 150 { 1.0 } else { 0.5 - 0.5 * (core::f64::consts::PI * f64::from(j) / 150.0).cos() };
            all.push([0, 1].map(|i| place[i] + part * (goal[i] - place[i])));
        }
        place = *goal;
    }
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the play, the coupling and the path: what is reached is what was wanted, but for a play that is being crossed.
    #[test]
    fn the_round_trip_holds(
        half_width in 0.0_f64..2.0, k in -0.3_f64..0.3, scale in -0.3_f64..0.5, amplitude in 0.0_f64..1.0,
        goals in proptest::collection::vec((-30.0_f64..30.0, -30.0_f64..30.0), 2..6),
    ) {
        let effects = effect("scale", &format!("scale = {scale}"))
            + &effect("backlash", &format!("half_width = {half_width}"))
            + &effect("bouc-wen", &format!("joint = 1\namplitude = {amplitude}\ntravel = 3.0"))
            + &effect("cross-coupling", &format!("joint = 1\nfrom = 2\nk = {k}"));
        let chain = chain("", &effects);
        let (mut compensator, mut joints) = (chain.compensator(Default::default()).unwrap(), chain.predictor());
        let goals: Vec<[f64; 2]> = goals.into_iter().map(|(a, b)| [a, b]).collect();
        for (step, wanted) in round_trip([0.0; 2], &goals).into_iter().enumerate() {
            let command = compensator.step(&wanted, &at(10 * step));
            let y = joints.step(&command.u[..2], &at(10 * step));
            let error = (y[0] - wanted[0]).abs().max((y[1] - wanted[1]).abs());
            prop_assert!(error <= 1e-6 + 3.0 * command.to_go, "{error} {command:?}");
            prop_assert!(step % 200 < 198 || command.to_go < 1e-3, "at rest the play is crossed: {command:?}");
        }
    }
}
