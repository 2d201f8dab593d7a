//! Estimation in closed loop with the compensator, on a plant of its own formulation, with a noisy camera.

use crate::common::{Errors, Noise, Plant, Truth, operator_bend};
use krait_model::oracle::{
    Compensator, CompensatorParameters, Estimate, EstimateOutcome, Estimator, EstimatorParameters, LeftOutReason,
};
use krait_model::{MachineParameters, Snake};
use nalgebra::{Vector2, Vector3};

const AT_REST: EstimateOutcome = EstimateOutcome::LeftOut(LeftOutReason::AtRest);
const NO_DIRECTION: EstimateOutcome = EstimateOutcome::LeftOut(LeftOutReason::NoDirection);
const OUTLIER: EstimateOutcome = EstimateOutcome::LeftOut(LeftOutReason::Outlier);
const NOT_FINITE: EstimateOutcome = EstimateOutcome::LeftOut(LeftOutReason::NotFinite);

const ENCODER_NOISE_M: f64 = 0.5e-6;
/// A camera of about 60 Hz on a plant of 1 kHz.
const STEPS_PER_SHAPE: u32 = 17;
const SHAPE_PERIOD_S: f64 = 0.017;

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

/// Plant, compensator that follows the estimate with a time constant of half a second, and estimator.
struct Loop {
    plant: Plant,
    compensator: Compensator,
    estimator: Estimator,
    noise: Noise,
    camera_sigma_rad: f64,
    step: u32,
}

impl Loop {
    fn new(parameters: EstimatorParameters, camera_sigma_deg: f64, seed: u64) -> Self {
        Self {
            plant: Plant::new(Truth::default()),
            compensator: Compensator::new(snake(), CompensatorParameters::default()).unwrap(),
            estimator: Estimator::new(snake(), parameters).unwrap(),
            noise: Noise::new(seed),
            camera_sigma_rad: camera_sigma_deg.to_radians(),
            step: 0,
        }
    }

    /// Runs to a time and gives the error over that part, and what became of each shape.
    fn run_to(&mut self, t_s: u32) -> (Errors, Vec<EstimateOutcome>) {
        let (mut errors, mut outcomes) = (Errors::default(), Vec::new());
        while self.step < t_s * 1000 {
            let wanted = operator_bend(f64::from(self.step) * 1e-3);
            let (reached, measured_q_m) = self.move_to(wanted);
            errors.add(wanted, reached);
            if self.step.is_multiple_of(STEPS_PER_SHAPE) {
                let noise = Vector2::new(self.noise.next(), self.noise.next()) * self.camera_sigma_rad;
                outcomes.push(self.estimator.observe_shape(reached + noise, measured_q_m, SHAPE_PERIOD_S));
            }
            self.step += 1;
        }
        (errors, outcomes)
    }

    fn move_to(&mut self, wanted: Vector2<f64>) -> (Vector2<f64>, Vector3<f64>) {
        let (target, used) = (self.estimator.estimate(), *self.compensator.parameters());
        let follow = |from: f64, to: f64| from + (to - from) * 0.002;
        let (eta, lambda_m) = (follow(used.eta, target.eta), follow(used.lambda_m, target.lambda_m));
        self.compensator.set_parameters(eta, lambda_m).unwrap();
        let q_tilde_m = self.compensator.step(wanted).q_tilde_m;
        let reached = self.plant.step(q_tilde_m);
        let measured_q_m = q_tilde_m.map(|q| q + ENCODER_NOISE_M * self.noise.next());
        self.estimator.observe_encoders(measured_q_m);
        (reached, measured_q_m)
    }
}

#[test]
fn estimate_converges_in_eight_seconds_and_the_loop_tracks_after_ten() {
    for seed in 1..=4 {
        let mut chain = Loop::new(EstimatorParameters::default(), 0.3, seed);
        chain.run_to(8);
        let Estimate { eta, lambda_m, .. } = chain.estimator.estimate();
        assert!((eta - 1.22).abs() < 0.015 && (lambda_m - 0.089e-3).abs() < 0.004e-3, "{eta} {lambda_m}");
        chain.run_to(10);
        let (errors, _) = chain.run_to(35);
        let estimate = chain.estimator.estimate();
        println!(
            "seed {seed}: rms {:.3} p95 {:.3} max {:.3} deg; {estimate:?}",
            errors.rms(),
            errors.quantile(0.95),
            errors.quantile(1.0)
        );
        assert!(errors.rms() < 0.2, "{}", errors.rms());
        assert!((estimate.eta - 1.22).abs() < 5.0 * estimate.eta_sd);
    }
}

/// The camera's noise enters the loads and the line displacements together and pulls eta down.
#[test]
fn bias_by_the_cameras_noise_grows_with_its_square_and_is_one_part_in_a_thousand_at_0_3_deg() {
    let bias = |sigma_deg: f64| {
        let parameters = EstimatorParameters {
            sigma_bend_rad: sigma_deg.to_radians(),
            memory_s: f64::INFINITY,
            ..EstimatorParameters::default()
        };
        let n = 6;
        let sum: f64 = (0..n)
            .map(|seed| {
                let mut chain = Loop::new(parameters, sigma_deg, 100 + seed);
                chain.run_to(20);
                chain.estimator.estimate().eta - 1.22
            })
            .sum();
        sum / n as f64
    };
    let [fine, coarse] = [0.3, 1.0].map(bias);
    println!("bias of eta: {fine:.5} at 0.3 deg, {coarse:.5} at 1 deg");
    assert!(fine.abs() < 0.0025 && coarse < 0.0 && coarse.abs() < 0.02, "{fine} {coarse}");
}

#[test]
fn without_noise_the_estimate_is_the_truth() {
    let parameters = EstimatorParameters { sigma_bend_rad: 0.01_f64.to_radians(), ..EstimatorParameters::default() };
    let mut chain = Loop::new(parameters, 0.0, 1);
    chain.run_to(20);
    let Estimate { eta, lambda_m, .. } = chain.estimator.estimate();
    assert!((eta - 1.22).abs() < 5e-4 && (lambda_m - 0.089e-3).abs() < 5e-7, "{eta} {lambda_m}");
}

#[test]
fn nothing_is_learnt_or_forgotten_at_rest() {
    let mut chain = Loop::new(EstimatorParameters::default(), 0.3, 5);
    chain.run_to(10);
    let before = chain.estimator.estimate();
    let (bend, q_m) = chain.move_to(operator_bend(9.999));
    chain.estimator.observe_shape(bend, q_m, SHAPE_PERIOD_S);
    let settled = chain.estimator.estimate();
    for k in 0..10_000_u32 {
        let q_m = q_m.map(|q| q + ENCODER_NOISE_M * chain.noise.next());
        chain.estimator.observe_encoders(q_m);
        let noise = Vector2::new(chain.noise.next(), chain.noise.next()) * chain.camera_sigma_rad;
        assert_eq!(chain.estimator.observe_shape(bend + noise, q_m, SHAPE_PERIOD_S), AT_REST, "{k}");
    }
    let after = chain.estimator.estimate();
    assert_eq!((after.eta, after.lambda_m, after.eta_sd), (settled.eta, settled.lambda_m, settled.eta_sd));
    assert!(before.n_used > 0 && after.n_left_out == settled.n_left_out + 10_000);
}

#[test]
fn a_shape_before_any_motion_has_no_direction() {
    let mut estimator = Estimator::new(snake(), EstimatorParameters::default()).unwrap();
    assert_eq!(estimator.observe_shape(Vector2::zeros(), Vector3::zeros(), 0.017), NO_DIRECTION);
    estimator.observe_encoders(Vector3::zeros());
    assert_eq!(estimator.observe_shape(Vector2::zeros(), Vector3::zeros(), 0.017), NO_DIRECTION);
    assert_eq!(estimator.estimate().n_left_out, 2);
}

#[test]
fn numbers_that_are_not_finite_are_refused_and_change_nothing() {
    let mut chain = Loop::new(EstimatorParameters::default(), 0.3, 6);
    chain.run_to(5);
    let before = chain.estimator.estimate();
    let (bend, q_m) = (chain.plant.bend(), Vector3::zeros());
    chain.estimator.observe_encoders(Vector3::repeat(f64::NAN));
    let bad = [
        (Vector2::new(f64::NAN, 0.0), q_m, 0.017),
        (Vector2::new(4.0, 0.0), q_m, 0.017),
        (bend, Vector3::repeat(f64::INFINITY), 0.017),
        (bend, q_m, f64::NAN),
        (bend, q_m, -1.0),
    ];
    for (bend, q_m, dt_s) in bad {
        assert_eq!(chain.estimator.observe_shape(bend, q_m, dt_s), NOT_FINITE);
    }
    let after = chain.estimator.estimate();
    assert_eq!(Estimate { n_left_out: before.n_left_out, ..after }, before);
    assert!(chain.run_to(6).1.contains(&EstimateOutcome::Used));
}

#[test]
fn a_single_wild_shape_is_an_outlier() {
    let mut chain = Loop::new(EstimatorParameters::default(), 0.3, 7);
    let (_, outcomes) = chain.run_to(10);
    let before = chain.estimator.estimate();
    assert!(outcomes.iter().filter(|o| **o == OUTLIER).count() * 50 < outcomes.len());
    let (bend, q_m) = chain.move_to(operator_bend(10.3));
    assert_eq!(chain.estimator.observe_shape(bend + Vector2::new(0.3, 0.3), q_m, 0.017), OUTLIER);
    assert_eq!(chain.estimator.estimate().eta, before.eta);
}

#[test]
fn a_machine_that_has_changed_is_learnt_anew() {
    let mut chain = Loop::new(EstimatorParameters::default(), 0.3, 8);
    chain.run_to(10);
    chain.plant = Plant::new(Truth { load_scale: 1.8, ..Truth::default() });
    chain.run_to(24);
    let Estimate { eta, .. } = chain.estimator.estimate();
    assert!((eta - 1.8).abs() < 0.05, "{eta}");
}

#[test]
fn fading_memory_follows_a_small_change_that_a_full_memory_averages() {
    let [fading, full] = [2.0, f64::INFINITY].map(|memory_s| {
        let mut chain = Loop::new(EstimatorParameters { memory_s, ..EstimatorParameters::default() }, 0.3, 10);
        chain.run_to(10);
        chain.plant = Plant::new(Truth { load_scale: 1.25, ..Truth::default() });
        chain.run_to(20);
        (chain.estimator.estimate().eta - 1.25).abs()
    });
    assert!(fading < 0.01 && full > 1.5 * fading, "{fading} {full}");
}

#[test]
fn estimate_stays_within_its_bounds() {
    let parameters = EstimatorParameters { eta_max: 1.1, lambda_max_m: 0.05e-3, ..EstimatorParameters::default() };
    let mut chain = Loop::new(parameters, 0.3, 9);
    chain.run_to(10);
    let estimate = chain.estimator.estimate();
    assert!(estimate.eta <= 1.1 && (0.0..=0.05e-3).contains(&estimate.lambda_m), "{estimate:?}");
    assert!(estimate.n_used > 0);
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let refused = |parameters: EstimatorParameters| Estimator::new(snake(), parameters).unwrap_err().to_string();
    let d = EstimatorParameters::default();
    assert!(refused(EstimatorParameters { eta: 3.0, ..d }).contains("parameter eta is 3"));
    assert!(refused(EstimatorParameters { memory_s: f64::NAN, ..d }).contains("memory_s"));
    assert!(refused(EstimatorParameters { sigma_bend_rad: 0.0, ..d }).contains("sigma_bend_rad"));
    assert!(refused(EstimatorParameters { eta_max: 0.4, ..d }).contains("eta_max"));
}
