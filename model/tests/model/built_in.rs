//! The model files that are built in say what the paper's equations do, and values that are set in place are those of a new chain.

use crate::allocations::allocations_of;
use crate::chains::{bends, chain, circumstances, strong};
use krait_model::effects::{EffectKind, Inverse};
use krait_model::model_file::{ModelFile, built_in};
use krait_model::{
    Chain, ChainSettings, Circumstances, EffectSetting, KnownColumns, Learn, MAX_LEARNT, MachineParameters, Snake,
};
use nalgebra::Vector2;

fn of(name: &str) -> Chain {
    ModelFile::parse(built_in(name).unwrap()).unwrap().chain(KnownColumns::default()).unwrap().unwrap()
}

#[test]
fn off_tells_the_actuators_what_an_inextensible_snake_needs() {
    let (snake, chain) = (Snake::new(&MachineParameters::default()).unwrap(), of("off"));
    let (mut off, mut forward) = (chain.compensator().unwrap(), chain.predictor());
    for (k, bend) in bends().enumerate().step_by(10) {
        let command = off.step(bend, &circumstances(k));
        assert_eq!(command.q_tilde_m, command.q_m);
        assert!((command.q_m - snake.q(bend)).amax() < 1e-17 && (command.tau_n - snake.tau_n(bend)).amax() < 1e-10);
        assert_eq!(command.alpha_m_per_rad.amax(), 0.0);
        let seen = forward.step(command.q_tilde_m, &circumstances(k));
        assert!((seen.bend_rad - bend).amax() < 1e-12, "{seen:?}");
    }
}

#[test]
fn naive_is_eq_16_with_the_loading_branch_on_every_line() {
    let snake = Snake::new(&MachineParameters::default()).unwrap();
    let mut naive = of("naive").compensator().unwrap();
    for (k, bend) in bends().enumerate().step_by(10) {
        let (command, known) = (naive.step(bend, &circumstances(k)), snake.extension_naive(bend));
        assert!((command.eps_m - known.eps_m).amax() < 1e-15, "{command:?} {known:?}");
        assert!((command.alpha_m_per_rad - known.alpha_m_per_rad).amax() < 1e-13);
    }
}

/// The effect with its last parameter that can be learnt set to be learnt, and another value for it.
fn with_another_value(kind: EffectKind) -> Option<(EffectSetting, EffectSetting)> {
    let effect = strong(kind);
    let spec = *kind.definition().parameters.iter().rev().find(|spec| spec.not_learnt.is_none())?;
    let before = effect.value(spec.name).unwrap();
    let sd = if before == 0.0 { 0.02 * (spec.high - spec.low) } else { 0.2 * before.abs() };
    let other = if before + sd <= spec.high { before + sd } else { before - sd };
    let learn = |e: EffectSetting| e.with_learn(spec.name, Learn { sd, memory_s: 60.0 }).unwrap();
    Some((learn(effect.clone()), learn(effect.with(spec.name, other).unwrap())))
}

#[test]
fn a_value_set_in_place_gives_the_commands_of_a_chain_that_was_built_with_it() {
    let kinds = EffectKind::ALL.into_iter().filter(|k| !matches!(k.definition().inverse, Inverse::None(_)));
    let mut n = 0;
    for (effect, other) in kinds.filter_map(with_another_value) {
        let label = effect.label().to_owned();
        let neighbours = [strong(EffectKind::StiffnessScale), strong(EffectKind::ConeFriction)];
        let [old, new] = [effect, other].map(|effect| {
            let others =
                neighbours.iter().filter(|e| e.kind() != effect.kind() && effect.kind().excludes() != Some(e.kind()));
            let effects: Vec<_> = others.chain([&effect]).cloned().collect();
            chain(&effects, ChainSettings::default())
        });
        let (mut set, mut built) = (old.compensator().unwrap(), new.compensator().unwrap());
        let mut values = [f64::NAN; MAX_LEARNT];
        values[0] = new.learnt()[0].start;
        let allocated = allocations_of(|| set.set_learnt(&values));
        assert_eq!(allocated, 0, "{label}");
        assert_eq!(set.learnt()[0], values[0], "{label}");
        // How far a line travels while its sign turns was measured with the start values.
        let (mut largest, mut scale) = (0.0_f64, 0.0_f64);
        for (k, bend) in bends().enumerate().take(2000) {
            let (a, b) = (set.step(bend, &circumstances(k)), built.step(bend, &circumstances(k)));
            largest = largest.max((a.q_tilde_m - b.q_tilde_m).amax());
            scale = scale.max(b.q_tilde_m.amax());
        }
        assert!(largest < 0.004 * scale, "{label}: {largest:e} of {scale:e}");
        n += 1;
    }
    assert!(n > 20, "{n}");
}

#[test]
fn values_that_were_set_since_are_forgotten_with_the_steps() {
    let mut chain = of("estimated").compensator().unwrap();
    let mut undisturbed = chain.clone();
    for (k, bend) in bends().enumerate().take(1000) {
        let memory = chain.memory();
        let mut values = *chain.learnt();
        (values[0], values[1]) = (1.3, 1e-4);
        chain.set_learnt(&values);
        chain.step(Vector2::new(0.2, -0.3), &circumstances(k));
        chain.restore(&memory);
        assert_eq!(chain.step(bend, &circumstances(k)), undisturbed.step(bend, &circumstances(k)), "{k}");
    }
}

#[test]
fn a_predictor_whose_values_are_set_is_where_a_predictor_built_with_them_would_be() {
    let chain = of("estimated");
    let mut learning = chain.learning_predictor().unwrap();
    let effects: Vec<EffectSetting> = chain.effects().to_vec();
    let other: Vec<_> = effects
        .iter()
        .map(|e| match e.kind() {
            EffectKind::StiffnessScale => e.clone().with("eta", 1.002).unwrap(),
            EffectKind::Backlash => e.clone().with("half_width_m", 1e-6).unwrap(),
            _ => e.clone(),
        })
        .collect();
    let mut built = crate::chains::chain(&other, chain.settings()).predictor();
    let mut plan = of("estimated").compensator().unwrap();
    let at = |k: usize| Circumstances::at(k as f64 * 0.01);
    let mut before = Vector2::zeros();
    for (k, bend) in bends().enumerate().take(1500) {
        let readings = plan.step(bend, &at(k)).q_tilde_m;
        let (seen, known) = (learning.step(readings, &at(k)), built.step(readings, &at(k)));
        match k {
            1300 => {
                before = seen.prediction.bend_rad - known.bend_rad;
                let mut values = [f64::NAN; MAX_LEARNT];
                (values[0], values[1]) = (1.002, 1e-6);
                learning.set_parameters(&values);
            }
            1301.. => {
                let now = seen.prediction.bend_rad - known.bend_rad;
                assert!(now.norm() < 0.02 * before.norm(), "{k}: {:e} {:e}", now.norm(), before.norm());
            }
            _ => {}
        }
    }
    assert!(before.norm() > 1e-4, "{before}");
}
