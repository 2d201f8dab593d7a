//! Friction spread along the cone against numbers of an independent bench (`golden/lines.json`), each within 1e-5 of its size.

use crate::chains::{chain, effect};
use krait_model::effects::EffectKind;
use krait_model::{
    Chain, ChainCommand, ChainSettings, Circumstances, EffectSetting, KnownColumns, MachineParameters, Snake,
};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

const GOLDEN: &str = include_str!("../golden/lines.json");

fn golden() -> Value {
    serde_json::from_str::<Value>(GOLDEN).unwrap()["b_distributed"].clone()
}

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap()
}

fn near(found: f64, expected: &Value) {
    let expected = number(expected);
    assert!((found - expected).abs() <= 1e-5 * expected.abs(), "{found} and {expected}");
}

/// Bends of 20 mm radius in a cone of 58 mm.
fn distributed() -> EffectSetting {
    let golden = golden();
    let share = 2.0 * 0.02 * MachineParameters::default().phi_rad / MachineParameters::default().l_c_m;
    near(2.0 * number(&golden["arc_mm"]) / 58.0, &Value::from(share));
    effect(EffectKind::DistributedCapstan, &[("arc_share", share)])
}

fn lumped() -> EffectSetting {
    EffectSetting::new(EffectKind::ConeFriction)
}

/// What is planned for lines that all carry a load, about to move in one direction.
fn loaded(cone: EffectSetting, load_n: f64, f_s_n: f64, direction: f64) -> ChainCommand {
    let effects = [
        effect(EffectKind::Preload, &[("load_n", load_n)]),
        effect(EffectKind::StaticFriction, &[("f_s_n", f_s_n)]),
        cone,
    ];
    let mut compensator = chain(&effects, ChainSettings::default()).compensator().unwrap();
    compensator.restart(Vector2::zeros(), Vector3::repeat(direction), &Circumstances::at(0.0));
    compensator.step(Vector2::zeros(), &Circumstances::at(0.0))
}

/// What the cone gives of that, m: the preload counts the elastic give of its whole line.
fn cone_m(command: &ChainCommand, load_n: f64) -> f64 {
    command.eps_m.x + load_n * snake().axial_stiffness_n().recip() * MachineParameters::default().l_c_m
}

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

#[test]
fn the_cone_gives_what_the_bench_says_and_the_actuator_carries_what_it_does_with_the_lumped_law() {
    let x = 0.1727 * MachineParameters::default().phi_rad;
    near(x, &golden()["x"]);
    for row in golden()["table"].as_array().unwrap() {
        let (load_n, direction) = (number(&row["tau_n"]), number(&row["direction"]));
        let spread = loaded(distributed(), load_n, 1.959, direction);
        let lumped = loaded(lumped(), load_n, 1.959, direction);
        near(cone_m(&spread, load_n) * 1e3, &row["extension_distributed_mm"]);
        near(cone_m(&lumped, load_n) * 1e3, &row["extension_lumped_mm"]);
        let pushed = load_n + direction * 1.959;
        let expected = pushed * (2.0 * x * direction * pushed.signum()).exp();
        assert!((spread.tau_tilde_n.x - expected).abs() < 1e-5, "{} {expected}", spread.tau_tilde_n.x);
        assert!((lumped.tau_tilde_n.x - expected).abs() < 1e-5);
    }
}

#[test]
fn the_mean_load_and_the_width_of_the_loop_are_the_bench_s() {
    let golden = golden();
    let give = snake().axial_stiffness_n().recip() * MachineParameters::default().l_c_m;
    let mean = |cone: fn() -> EffectSetting, direction: f64| {
        cone_m(&loaded(cone(), 10.0, 0.0, direction), 10.0) / (10.0 * give)
    };
    near(mean(distributed, 1.0), &golden["mean_loading"]);
    near(mean(distributed, -1.0), &golden["mean_unloading"]);
    near(mean(lumped, 1.0), &golden["lumped_loading"]);
    near(mean(lumped, -1.0), &golden["lumped_unloading"]);
    let width = |cone: fn() -> EffectSetting| mean(cone, 1.0) - mean(cone, -1.0);
    near(width(lumped) / width(distributed), &golden["loop_ratio_lumped_over_distributed"]);
    // Travel until a line turned round slides back, at the bench's load.
    let load_n = number(&golden["reversal_at_tau"]);
    near(width(distributed) * give * load_n * 1e3, &golden["stick_travel_closed_form_mm"]);
}

/// Table II gives the same line where f_s does not act at the snake's end but grows along the arcs, f' = mu F a radian: both give tau~ =
/// g (tau + f_s). krait has f_s at the end; these are the bench's numbers for the other place, by the mean loads of this model.
#[test]
fn static_friction_along_the_arcs_gives_what_the_bench_says_by_the_same_mean_loads() {
    let (golden, g, f_s_n, mu) = (golden(), snake().capstan(), 1.959, 0.1727);
    let along_n = g * f_s_n / (g - 1.0);
    near(along_n, &golden["F_n"]);
    near(mu * along_n, &golden["f_per_rad_n"]);
    let give = snake().axial_stiffness_n().recip() * MachineParameters::default().l_c_m;
    for row in golden["table"].as_array().unwrap() {
        let (load_n, direction) = (number(&row["tau_n"]), number(&row["direction"]));
        let side = load_n.signum();
        let held_n = load_n.abs() + along_n;
        let mean_m = cone_m(&loaded(distributed(), held_n, 0.0, side * direction), held_n);
        near(side * (mean_m - along_n * give) * 1e3, &row["extension_f_s_along_the_arcs_mm"]);
    }
}

/// Everything known but where the cone's friction is.
fn machine(cone: EffectSetting) -> Chain {
    let effects = [
        EffectSetting::new(EffectKind::StiffnessScale),
        EffectSetting::new(EffectKind::StaticFriction),
        cone,
        EffectSetting::new(EffectKind::Backlash),
    ];
    chain(&effects, ChainSettings { transition_m: 1e-9, ..ChainSettings::default() })
}

#[test]
fn the_lumped_inverse_on_spread_friction_misses_as_the_bench_says_and_its_own_inverse_does_not() {
    for row in golden()["bend_error_of_lumped_inverse_deg"]["rows"].as_array().unwrap() {
        let (bend_deg, way, expected_deg) = (number(&row[0]), number(&row[1]), number(&row[2]));
        for (model, expected_deg) in [(machine(lumped()), expected_deg), (machine(distributed()), 0.0)] {
            let (mut told, mut truth) = (model.compensator().unwrap(), machine(distributed()).predictor());
            let top_deg = if way > 0.0 { bend_deg } else { bend_deg + 10.0 };
            let up = (1..=400).map(|k| top_deg * f64::from(k) / 400.0);
            let back = (1..=100).map(|k| top_deg - 10.0 * f64::from(k) / 100.0).filter(|_| way < 0.0);
            let mut found = Vector2::zeros();
            for bend_deg in up.chain(back) {
                let at = Circumstances::at(0.0);
                let command = told.step(Vector2::new(bend_deg.to_radians(), 0.0), &at);
                found = truth.step(command.q_tilde_m, &at).bend_rad;
            }
            let error_deg = found.norm().to_degrees() - bend_deg;
            assert!((error_deg - expected_deg).abs() < 2e-5, "{bend_deg} {way}: {error_deg} and {expected_deg}");
        }
    }
}

#[test]
fn two_laws_of_the_cone_are_refused_in_one_sentence_and_without_friction_both_are_one() {
    for [first, second] in [[lumped(), distributed()], [distributed(), lumped()]] {
        let machine = MachineParameters::default();
        let effects = [first, EffectSetting::new(EffectKind::Backlash), second];
        let refused = Chain::new(&machine, ChainSettings::default(), &effects, KnownColumns::default()).unwrap_err();
        let sentence = refused.to_string();
        for part in ["cone-friction", "distributed-capstan", "places 1 and 3", "remove"] {
            assert!(sentence.contains(part), "{sentence}");
        }
        assert!(!sentence.contains('\n') && !sentence.contains(". "), "{sentence}");
    }
    let none = |kind| effect(kind, &[("mu", 0.0)]);
    let pair = [EffectKind::ConeFriction, EffectKind::DistributedCapstan].map(|kind| machine(none(kind)));
    let [mut a, mut b] = pair.each_ref().map(|chain| chain.compensator().unwrap());
    for (k, bend) in crate::chains::bends().enumerate().step_by(7) {
        let at = crate::chains::circumstances(k);
        let (a, b) = (a.step(bend, &at), b.step(bend, &at));
        assert!((a.q_tilde_m - b.q_tilde_m).norm() < 1e-15 && (a.tau_tilde_n - b.tau_tilde_n).norm() < 1e-11);
    }
}
