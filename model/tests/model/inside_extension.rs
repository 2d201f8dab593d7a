//! Extension of the lines inside the snake against numbers of an independent bench (`golden/lines.json`), each within 1e-5 of its scale.

use crate::chains::{chain, effect};
use krait_model::effects::EffectKind;
use krait_model::{Chain, ChainCommand, ChainSettings, Circumstances, EffectSetting, MachineParameters, Snake};
use nalgebra::{Matrix2x3, Matrix3x2, Rotation2, Vector2, Vector3};
use serde_json::Value;

const GOLDEN: &str = include_str!("../golden/lines.json");
const TOLERANCE: f64 = 1e-5;

fn golden() -> Value {
    serde_json::from_str::<Value>(GOLDEN).unwrap()["a_in_snake"].clone()
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

/// Load scale and cone friction, without static friction, as the bench has them.
fn without() -> Chain {
    chain(&[EffectSetting::new(EffectKind::StiffnessScale), EffectSetting::new(EffectKind::ConeFriction)], settings())
}

fn with(share: f64) -> Chain {
    let inside = effect(EffectKind::InsideExtension, &[("share", share)]);
    chain(&[without().effects(), &[inside]].concat(), settings())
}

fn settings() -> ChainSettings {
    ChainSettings::default()
}

fn bend(row: &Value) -> Vector2<f64> {
    let of = |key: &str| row[key].as_f64().unwrap().to_radians();
    Rotation2::new(of("delta_deg")) * Vector2::new(of("bend_deg"), 0.0)
}

/// What is planned at the end of a ramp from straight.
fn ramp(chain: &Chain, to: Vector2<f64>) -> Vec<ChainCommand> {
    let mut compensator = chain.compensator().unwrap();
    (1..=200).map(|k| compensator.step(to * (f64::from(k) / 200.0), &Circumstances::at(0.0))).collect()
}

fn agrees(what: &str, found: &[f64], expected: &Value) {
    let expected = flat(expected);
    let scale = expected.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
    assert_eq!(found.len(), expected.len(), "{what}");
    for (f, e) in found.iter().zip(&expected) {
        assert!((f - e).abs() <= TOLERANCE * scale, "{what}: {found:?} and {expected:?}");
    }
}

fn rows_of<const R: usize, const C: usize>(matrix: nalgebra::SMatrix<f64, R, C>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

#[test]
fn extension_alpha_and_jacobian_are_the_bench_s() {
    for row in golden()["rows"].as_array().unwrap() {
        let (plain, own) = (ramp(&without(), bend(row)), ramp(&with(1.0), bend(row)));
        let (plain, own) = (plain.last().unwrap(), own.last().unwrap());
        agrees("tau_n", own.tau_n.as_slice(), &row["tau_n"]);
        let extension: Vector3<f64> = (own.eps_m - plain.eps_m) * 1e3;
        agrees("eps_in_snake_mm", extension.as_slice(), &row["eps_in_snake_mm"]);
        let alpha: Matrix3x2<f64> = (own.alpha_m_per_rad - plain.alpha_m_per_rad) * 1e3;
        agrees("alpha_in_snake_mm_per_rad", &rows_of(alpha), &row["alpha_in_snake_mm_per_rad"]);
        let j_tilde: Matrix2x3<f64> = own.j_tilde_rad_per_m;
        agrees("j_tilde_rad_per_m", &rows_of(j_tilde), &row["j_tilde_rad_per_m"]);
    }
}

#[test]
fn a_model_without_it_falls_short_as_the_bench_does_and_one_with_it_does_not() {
    for row in golden()["rows"].as_array().unwrap() {
        for (model, share) in [(without(), 0.0), (with(1.0), 1.0)] {
            let mut machine = with(1.0).predictor();
            let told = ramp(&model, bend(row));
            let found = told.iter().map(|c| machine.step(c.q_tilde_m, &Circumstances::at(0.0))).last().unwrap();
            let error_deg = (found.bend_rad.norm() - bend(row).norm()).to_degrees();
            let plane_deg = Rotation2::rotation_between(&bend(row), &found.bend_rad).angle().to_degrees();
            let expected = |key: &str| (1.0 - share) * row[key].as_f64().unwrap();
            assert!((error_deg - expected("bend_error_if_neglected_deg")).abs() < 2e-5, "{error_deg} {row}");
            assert!((plane_deg - expected("plane_error_deg")).abs() < 2e-5, "{plane_deg} {row}");
        }
    }
}

/// The common load stretches the lines inside the snake too: what the actuators travel for one newton in each line grows by L/(E A).
#[test]
fn a_common_load_needs_the_length_inside_the_snake_more() {
    let machine = MachineParameters::default();
    let ea = Snake::new(&machine).unwrap().axial_stiffness_n();
    let travel_m = |effects: &[EffectSetting]| {
        let common =
            |chain: &Chain| chain.predictor().step(Vector3::repeat(1e-4), &Circumstances::at(0.0)).tau_common_n;
        1e-4 / common(&chain(effects, settings()))
    };
    let inside = EffectSetting::new(EffectKind::InsideExtension);
    let more = travel_m(std::slice::from_ref(&inside)) - travel_m(&[]);
    assert!((more * ea / machine.l_m - 1.0).abs() < 1e-9, "{more}");
    let golden_mm = golden()["L_over_EA_mm_per_N"].as_f64().unwrap();
    assert!((more * 1e3 / golden_mm - 1.0).abs() < TOLERANCE, "{more} {golden_mm}");
    // C is what a line gives outside it while it is pushed: K_d, and K_c with the capstan's factor.
    let snake = Snake::new(&machine).unwrap();
    let c_mm = 1e3 * snake.loading_compliance_m_per_n();
    let golden = golden();
    agrees("C_mm_per_N", &[c_mm], &golden["C_mm_per_N"]);
    agrees("part_of_C", &[more * 1e3 / c_mm], &golden["part_of_C"]);
    // Lines that are taken for rigid give nothing anywhere.
    let rigid = MachineParameters { rigid_lines: true, ..machine };
    let chain = Chain::new(&rigid, settings(), &[inside], crate::chains::ALL_COLUMNS).unwrap();
    let command = ramp(&chain, Vector2::new(0.7, 0.2)).pop().unwrap();
    assert!(command.eps_m.norm() < 1e-15, "{command:?}");
}
