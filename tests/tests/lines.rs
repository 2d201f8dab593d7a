//! What lines do inside the snake and round the cone: the simulated snake, by code of its own, against chains with and without it.
//!
//! Errors that a model without the effect makes are golden numbers of a third bench (`model/tests/golden/lines.json`).

#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

use krait_model::effects::EffectKind;
use krait_model::{
    Chain, ChainCompensator, ChainSettings, Circumstances, EffectSetting, KnownColumns, MachineParameters,
};
use krait_sim::{EffectsTruth, LinesTruth, SimulatedSnake, Truth};
use krait_slave::{Drive, lines};
use nalgebra::Vector2;

const GOLDEN: &str = include_str!("../../model/tests/golden/lines.json");
/// What the bench's sub-steps and the golden numbers' six digits leave, deg.
const FLOOR_DEG: f64 = 2e-4;
/// The same where its cone is made of nine points, deg.
const FLOOR_OF_POINTS_DEG: f64 = 5e-4;

fn golden(part: &str) -> serde_json::Value {
    serde_json::from_str::<serde_json::Value>(GOLDEN).unwrap()[part].clone()
}

fn chain(effects: &[EffectSetting]) -> Chain {
    let machine = MachineParameters::default();
    Chain::new(&machine, ChainSettings::default(), effects, KnownColumns::default()).unwrap()
}

/// What the default truth is made of, with one law of the cone.
fn four(cone: EffectKind) -> Vec<EffectSetting> {
    use EffectKind as K;
    [K::StiffnessScale, K::StaticFriction, cone, K::Backlash].map(EffectSetting::new).to_vec()
}

/// A simulated snake and what it is told.
struct Bench {
    snake: SimulatedSnake,
    compensator: ChainCompensator,
    at: Vector2<f64>,
}

impl Bench {
    fn new(lines: LinesTruth, model: &[EffectSetting]) -> Self {
        let truth = Truth { lines, ..Truth::default() };
        truth.check("test").unwrap();
        let mut snake = SimulatedSnake::new(&truth);
        snake.set_power(0, true).unwrap();
        Self { snake, compensator: chain(model).compensator().unwrap(), at: Vector2::zeros() }
    }

    /// Goes to a bend and direction, deg, in steps of a quarter of a degree; gives how far the snake bends too much, and its plane is
    /// turned, deg.
    fn go(&mut self, bend_deg: f64, delta_deg: f64) -> [f64; 2] {
        let (sin, cos) = delta_deg.to_radians().sin_cos();
        let to = Vector2::new(cos, sin) * bend_deg.to_radians();
        let from = self.at;
        let n = ((to - from).norm().to_degrees() * 4.0).ceil();
        for k in 1..=n as u32 {
            self.at = from + (to - from) * (f64::from(k) / n);
            let command = self.compensator.step(self.at, &Circumstances::at(0.0));
            self.snake.write(0, lines(command.q_tilde_m.into())).unwrap();
        }
        assert_eq!(self.snake.n_unsolved(), 0);
        let found = Vector2::from(self.snake.bend_rad());
        [(found.norm() - to.norm()).to_degrees(), to.perp(&found).atan2(to.dot(&found)).to_degrees()]
    }
}

#[test]
fn lines_that_give_inside_the_snake_cost_a_model_without_it_what_the_golden_numbers_say() {
    let truth = || LinesTruth { inside: 1.0, ..LinesTruth::default() };
    let without = four(EffectKind::ConeFriction);
    let with = [without.clone(), vec![EffectSetting::new(EffectKind::InsideExtension)]].concat();
    for row in golden("a_in_snake")["rows"].as_array().unwrap() {
        let of = |key: &str| row[key].as_f64().unwrap();
        let pose = (of("bend_deg"), of("delta_deg"));
        let neglected = Bench::new(truth(), &without).go(pose.0, pose.1);
        let expected = [of("bend_error_if_neglected_deg"), of("plane_error_deg")];
        println!("{pose:?}: {neglected:?}, golden {expected:?}");
        assert!((0..2).all(|k| (neglected[k] - expected[k]).abs() < FLOOR_DEG), "{neglected:?} {expected:?}");
        let known = Bench::new(truth(), &with).go(pose.0, pose.1);
        assert!(known[0].hypot(known[1]) < FLOOR_DEG, "{known:?}");
    }
}

fn spread() -> LinesTruth {
    LinesTruth { cone_radius_m: 0.02, ..LinesTruth::default() }
}

#[test]
fn friction_spread_along_the_cone_costs_the_lumped_law_what_the_golden_numbers_say() {
    for row in golden("b_distributed")["bend_error_of_lumped_inverse_deg"]["rows"].as_array().unwrap() {
        let [bend_deg, way, expected_deg] = [0, 1, 2].map(|k| row[k].as_f64().unwrap());
        for (cone, expected_deg) in [(EffectKind::ConeFriction, expected_deg), (EffectKind::DistributedCapstan, 0.0)] {
            let mut bench = Bench::new(spread(), &four(cone));
            if way < 0.0 {
                bench.go(bend_deg + 10.0, 0.0);
            }
            let [error_deg, _] = bench.go(bend_deg, 0.0);
            println!("{bend_deg} {way} {cone:?}: {error_deg}, golden {expected_deg}");
            assert!((error_deg - expected_deg).abs() < FLOOR_OF_POINTS_DEG, "{error_deg} {expected_deg}");
        }
    }
}

/// The bend at one command on the way up and on the way back, deg apart, with friction in the cone and nothing else that makes a loop.
fn loop_deg(lines_truth: LinesTruth) -> f64 {
    let effects = EffectsTruth { load_scale: 1.22, mu: 0.1727, ..EffectsTruth::none() };
    let mut snake = SimulatedSnake::new(&Truth { effects, lines: lines_truth, ..Truth::default() });
    snake.set_power(0, true).unwrap();
    let mut at = |part: f64| {
        snake.write(0, lines([-4e-3 * part, 2e-3 * part, 2e-3 * part])).unwrap();
        snake.bend_rad()[0].to_degrees()
    };
    let up: Vec<f64> = (0..=200).map(|k| at(f64::from(k) / 200.0)).collect();
    let back: Vec<f64> = (0..=200).rev().map(|k| at(f64::from(k) / 200.0)).collect();
    back[100] - up[100]
}

#[test]
fn the_loop_of_friction_at_one_place_is_twice_as_wide_as_of_friction_spread_along_the_cone() {
    let (lumped, spread) = (loop_deg(LinesTruth::default()), loop_deg(spread()));
    let golden = golden("b_distributed")["loop_ratio_lumped_over_distributed"].as_f64().unwrap();
    println!("lumped {lumped} deg, spread {spread} deg, ratio {}, golden {golden}", lumped / spread);
    assert!(spread > 0.3 && (lumped / spread / golden - 1.0).abs() < 0.02, "{lumped} {spread}");
}
