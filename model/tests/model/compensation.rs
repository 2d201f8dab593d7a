//! Compensation against a plant of its own formulation: what each mode reaches, and that nothing but the sequence counts.

use crate::common::{Errors, Plant, Truth, operator_bend};
use krait_model::oracle::{CompensationMode, Compensator, CompensatorParameters};
use krait_model::{MachineParameters, Snake};
use nalgebra::{Vector2, Vector3};

const ETA: f64 = 1.22;
const LAMBDA_M: f64 = 0.089e-3;
const N_STEPS: u32 = 42_000;

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

fn compensator(parameters: CompensatorParameters) -> Compensator {
    Compensator::new(snake(), parameters).unwrap()
}

fn estimated() -> CompensatorParameters {
    CompensatorParameters { eta: ETA, lambda_m: LAMBDA_M, ..CompensatorParameters::default() }
}

fn operator_bends() -> impl Iterator<Item = Vector2<f64>> {
    (0..N_STEPS).map(|k| operator_bend(f64::from(k) * 1e-3))
}

/// Error and largest internal load, N, of a run at 1 kHz; `command` turns (q, eps) into what the plant is told.
fn run(
    parameters: CompensatorParameters,
    command: impl Fn(Vector3<f64>, Vector3<f64>) -> Vector3<f64>,
) -> (Errors, f64) {
    let mut compensator = compensator(parameters);
    let mut plant = Plant::new(Truth::default());
    let (mut errors, mut largest_common_n) = (Errors::default(), 0.0_f64);
    for wanted in operator_bends() {
        let step = compensator.step(wanted);
        errors.add(wanted, plant.step(command(step.q_m, step.eps_m)));
        largest_common_n = largest_common_n.max(plant.state.z.abs());
    }
    (errors, largest_common_n)
}

fn rms_deg(parameters: CompensatorParameters) -> f64 {
    run(parameters, |q, eps| q + eps).0.rms()
}

#[test]
fn each_mode_is_better_than_the_one_before() {
    let off = rms_deg(CompensatorParameters { mode: CompensationMode::Off, ..estimated() });
    let naive = rms_deg(CompensatorParameters { mode: CompensationMode::Naive, ..estimated() });
    let scaled = rms_deg(CompensatorParameters { lambda_m: 0.0, ..estimated() });
    let full = rms_deg(estimated());
    println!("rms, deg: off {off:.3}, naive {naive:.3}, eta {scaled:.3}, eta and lambda {full:.3}");
    assert!(off > 8.0 && naive > 1.0 && naive < off / 2.0, "{off} {naive}");
    assert!(scaled < naive / 1.5 && full < scaled / 5.0 && full < 0.15, "{scaled} {full}");
}

#[test]
fn a_shorter_transition_comes_closer_to_the_exact_inverse() {
    let [short, default] =
        [1e-6, 20e-6].map(|transition_m| rms_deg(CompensatorParameters { transition_m, ..estimated() }));
    assert!(short < 0.01 && short < default / 5.0, "{short} {default}");
}

#[test]
fn projecting_the_common_mode_out_preloads_the_lines_and_costs_accuracy() {
    let (kept, kept_n) = run(estimated(), |q, eps| q + eps);
    let (projected, projected_n) = run(estimated(), |q, eps| q + eps.add_scalar(-eps.mean()));
    assert!(projected.rms() > 2.0 * kept.rms() && projected_n > 3.0 * kept_n);
}

#[test]
fn the_same_bends_give_the_same_bytes() {
    let commands = || {
        let mut c = compensator(estimated());
        operator_bends().flat_map(|b| c.step(b).q_tilde_m.data.0[0].map(f64::to_bits)).collect::<Vec<_>>()
    };
    assert_eq!(commands(), commands());
}

#[test]
fn repeated_setpoints_change_nothing() {
    let mut c = compensator(estimated());
    for wanted in operator_bends() {
        let first = c.step(wanted);
        assert_eq!(c.step(wanted), first);
    }
}

#[test]
fn command_never_jumps_while_the_setpoint_does_not() {
    let mut c = compensator(estimated());
    let mut last = c.step(Vector2::zeros());
    let s = snake();
    // In a transition the play of 2 lambda and the stick range are crossed over its travel; elsewhere stretch doubles q.
    let gain = |tau_n: f64| 3.0 + (2.0 * LAMBDA_M + s.cone_stick_travel_m(tau_n)) / 20e-6;
    for wanted in operator_bends() {
        let now = c.step(wanted);
        for i in 0..3 {
            let (dq, planned) = ((now.q_tilde_m - last.q_tilde_m)[i].abs(), (now.q_m - last.q_m).amax());
            assert!(dq <= gain(now.tau_n[i].abs() + 1.0) * planned, "{dq} {planned}");
        }
        last = now;
    }
}

#[test]
fn off_and_naive_are_the_printed_equations() {
    let s = snake();
    let bend = Vector2::new(0.7, -0.3);
    let off = compensator(CompensatorParameters { mode: CompensationMode::Off, ..estimated() }).step(bend);
    assert_eq!((off.q_tilde_m, off.eps_m), (s.q(bend), Vector3::zeros()));
    let naive = compensator(CompensatorParameters { mode: CompensationMode::Naive, ..estimated() }).step(bend);
    assert_eq!((naive.eps_m, naive.tau_n), (s.extension_naive(bend).eps_m, s.tau_n(bend)));
}

#[test]
fn restart_begins_with_the_given_directions() {
    let (mut through, mut restarted) = (compensator(estimated()), compensator(estimated()));
    for wanted in operator_bends().take(3000) {
        through.step(wanted);
    }
    let at = operator_bend(2.999);
    restarted.restart(at, through.signs());
    assert_eq!(restarted.step(at), through.step(at));
    restarted.restart(at, Vector3::zeros());
    assert_ne!(restarted.step(at).q_tilde_m, through.step(at).q_tilde_m);
}

#[test]
fn a_bend_that_is_not_finite_leaves_the_memory_as_it_was() {
    let mut c = compensator(estimated());
    c.step(Vector2::new(0.3, 0.1));
    let before = c;
    assert!(!c.step(Vector2::new(f64::NAN, f64::INFINITY)).q_tilde_m.iter().any(|q| q.is_finite()));
    assert_eq!(c, before);
}

#[test]
fn parameters_out_of_range_are_refused_and_the_old_ones_stay() {
    let mut c = compensator(estimated());
    for (eta, lambda_m, key) in
        [(f64::NAN, 0.0, "eta"), (0.0, 0.0, "eta"), (1.0, -1e-6, "lambda_m"), (1.0, 1.0, "lambda_m")]
    {
        let error = c.set_parameters(eta, lambda_m).unwrap_err().to_string();
        assert!(error.contains(key), "{error}");
    }
    assert_eq!(*c.parameters(), estimated());
    c.set_parameters(1.1, 1e-5).unwrap();
    assert_eq!((c.parameters().eta, c.parameters().lambda_m), (1.1, 1e-5));
    let standing = CompensatorParameters { transition_m: 0.0, ..estimated() };
    assert!(Compensator::new(snake(), standing).unwrap_err().to_string().contains("transition_m"));
}
