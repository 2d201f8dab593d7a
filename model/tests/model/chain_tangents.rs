//! Derivatives with respect to parameters, carried along a history, against central differences of whole histories.

use crate::chains::{bends, chain, circumstances, strong};
use krait_model::effects::EffectKind;
use krait_model::{Chain, ChainSettings, Circumstances, EffectSetting};
use nalgebra::{Vector2, Vector3};

const EVERY: usize = 3;

/// A command history that excites everything; the same for every chain, as encoders are.
fn readings() -> Vec<(Vector3<f64>, Circumstances)> {
    let chain = chain(&[EffectSetting::new(EffectKind::StiffnessScale)], ChainSettings::default());
    let mut compensator = chain.compensator().unwrap();
    let one = |(k, b): (usize, Vector2<f64>)| (compensator.step(b, &circumstances(k)).q_tilde_m, circumstances(k));
    bends().enumerate().step_by(EVERY).map(one).collect()
}

fn predictions(chain: &Chain) -> Vec<Vector2<f64>> {
    let mut predictor = chain.predictor();
    readings().iter().map(|(q, at)| predictor.step(*q, at).observed_bend_rad).collect()
}

/// The effect, and three others around it so that its tangents pass through them. A preload shows in friction only.
fn around(effect: EffectSetting) -> Vec<EffectSetting> {
    let second =
        if effect.kind() == EffectKind::Preload { EffectKind::ConeFriction } else { EffectKind::CrossCoupling };
    let others = [EffectKind::StiffnessScale, second, EffectKind::CameraScale];
    let own = effect.kind();
    core::iter::once(effect).chain(others.into_iter().filter(|kind| *kind != own).map(strong)).collect()
}

#[test]
fn predictions_have_the_tangents_of_every_parameter_of_every_effect() {
    for kind in EffectKind::ALL {
        let effects = around(strong(kind));
        let names: Vec<String> = effects[0].parameter_names().map(str::to_owned).collect();
        for name in &names {
            let chain_at = |value: f64| {
                let mut effects = effects.clone();
                effects[0] = if kind == EffectKind::Formula {
                    let mut formula = effects[0].formula_text().unwrap().clone();
                    formula.parameters[0].value = value;
                    EffectSetting::formula(formula)
                } else {
                    effects[0].clone().with(name, value).unwrap()
                };
                chain(&effects, ChainSettings::default())
            };
            let value = effects[0].value(name).unwrap();
            let spec = kind.definition().parameters.iter().find(|p| p.name == name);
            let range = spec.map_or(1e-3, |p| p.high - p.low);
            let h = (1e-5 * range).min(if value == 0.0 { 1e-5 * range } else { 1e-4 * value.abs() });
            let (low, high) = spec.map_or((f64::MIN, f64::MAX), |p| (p.low, p.high));
            let (below, above) = ((value - h).max(low), (value + h).min(high));
            if below == value || above == value {
                // One-sided differences at a bound would only be half as exact.
                continue;
            }
            let quotients: Vec<Vector2<f64>> = predictions(&chain_at(above))
                .iter()
                .zip(predictions(&chain_at(below)))
                .map(|(a, b)| (a - b) / (above - below))
                .collect();
            let scale = quotients.iter().map(|q| q.norm()).fold(0.0, f64::max);
            let mut tangents = chain_at(value).predictor_with_tangents::<1>(&[(0, name)]).unwrap();
            let mut n_agree = 0;
            for ((q, at), quotient) in readings().iter().zip(&quotients) {
                let found = tangents.step(*q, at);
                n_agree += usize::from((found.by_parameter.column(0) - quotient).norm() <= 2e-4 * scale + 1e-13 / h);
            }
            let unseen = scale < 1e-11;
            println!("{:30} {name:22} agree {n_agree} of {} scale {scale:.1e}", kind.name(), quotients.len());
            assert!(n_agree * 100 >= quotients.len() * 90, "{} {name}: {n_agree} of {}", kind.name(), quotients.len());
            assert!(!unseen || is_unseen(kind, name), "{} {name} changes nothing", kind.name());
        }
    }
}

/// Parameters without effect here: the temperature is a column.
fn is_unseen(kind: EffectKind, name: &str) -> bool {
    matches!((kind, name), (EffectKind::ThermalDrift, "rise_k" | "rise_time_s"))
}

#[test]
fn commands_have_the_tangents_of_several_parameters_at_once() {
    use EffectKind as K;
    let effects: Vec<EffectSetting> =
        [K::StiffnessScale, K::Backlash, K::StaticFriction, K::ConeFriction].map(EffectSetting::new).to_vec();
    let names = [(0, "eta"), (1, "half_width_m"), (2, "f_s_n"), (3, "mu")];
    let mut tangents = chain(&effects, ChainSettings::default()).compensator_with_tangents::<4>(&names).unwrap();
    let steps = [1e-5, 1e-9, 1e-5, 1e-6];
    let mut shifted: Vec<_> = (0..4)
        .map(|k| {
            [1.0, -1.0].map(|side| {
                let mut effects = effects.clone();
                let value = effects[k].value(names[k].1).unwrap() + side * steps[k];
                effects[k] = effects[k].clone().with(names[k].1, value).unwrap();
                chain(&effects, ChainSettings::default()).compensator().unwrap()
            })
        })
        .collect();
    let (mut n, mut n_agree) = (0, [0; 4]);
    for (k, bend) in bends().enumerate() {
        let at = circumstances(k);
        let (command, by_parameter) = tangents.step(bend, &at);
        let settled = command.signs.iter().all(|s| s.abs() == 1.0);
        for (j, pair) in shifted.iter_mut().enumerate() {
            let [up, down] = pair.each_mut().map(|c| c.step(bend, &at).q_tilde_m);
            let quotient = (up - down) / (2.0 * steps[j]);
            let found: Vector3<f64> = by_parameter.column(j).into();
            n_agree[j] += usize::from(settled && (found - quotient).norm() <= 1e-6 * (found.norm() + 1e-6));
        }
        n += usize::from(settled);
    }
    assert!(n > 3000 && n_agree.iter().all(|agree| agree * 100 >= n * 97), "{n_agree:?} of {n}");
}
