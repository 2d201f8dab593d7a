//! No step of a chain allocates, formulas included: counted by the allocator itself.

use crate::allocations::allocations_of;
use crate::chains::{bends, chain, circumstances, formula, strong};
use krait_model::ChainSettings;
use krait_model::effects::{EffectKind, Hook, Inverse};
use nalgebra::Vector2;

#[test]
fn no_step_of_any_effect_allocates() {
    // As long as a formula may be: every word counts.
    let sum = (0..30).map(|k| format!("bend_x * {k}")).collect::<Vec<_>>().join(" + ");
    let longest = formula(Hook::Eps, &format!("a * ({})", &sum[..sum.match_indices(" + ").nth(14).unwrap().0]), 1e-6);
    let effects = EffectKind::ALL.into_iter().filter(|kind| !matches!(kind.definition().inverse, Inverse::None(_)));
    for effect in effects.map(strong).chain([longest]) {
        let label = effect.label().to_owned();
        let chain = chain(&[effect], ChainSettings::default());
        let (mut compensator, mut predictor) = (chain.compensator().unwrap(), chain.predictor());
        let mut tangents = chain.predictor_with_tangents::<0>(&[]).unwrap();
        let wanted: Vec<Vector2<f64>> = bends().step_by(20).collect();
        let n = allocations_of(|| {
            for (k, b) in wanted.iter().enumerate() {
                let at = circumstances(k);
                let command = compensator.step(*b, &at);
                std::hint::black_box(predictor.step(command.q_tilde_m, &at));
                std::hint::black_box(tangents.step(command.q_tilde_m, &at));
            }
            compensator.step(Vector2::new(f64::NAN, 0.0), &circumstances(0));
            compensator.restart(Vector2::new(0.3, 0.1), nalgebra::Vector3::zeros(), &circumstances(0));
        });
        assert_eq!(n, 0, "{label}");
    }
}
