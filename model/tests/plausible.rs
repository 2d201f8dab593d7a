//! A chain may be right in every number and still be nonsense as a whole: such a one is refused, and every usual one is not.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod chains;

use chains::{chain, formula, strong};
use krait_model::effects::{EffectKind, Hook, Inverse};
use krait_model::{Chain, ChainSettings, Implausible, KnownColumns, MachineParameters};

const MAX_BEND_RAD: f64 = 1.309;

/// A chain whose one effect is a formula, m, at the place where lines are lengthened.
fn with_formula(text: &str) -> Chain {
    chain(&[formula(Hook::Eps, text, 1.0)], ChainSettings::default())
}

fn refusal(chain: &Chain) -> Implausible {
    chain.plausible(MAX_BEND_RAD).expect("a compensator").expect_err("nonsense")
}

#[test]
fn a_correction_worth_a_metre_is_refused_with_its_size() {
    let refused = refusal(&with_formula("a"));
    assert!(matches!(refused, Implausible::Correction { found_mm, .. } if found_mm > 900.0), "{refused}");
    assert!(refused.to_string().contains("expected at most"), "{refused}");
}

#[test]
fn a_command_that_jumps_is_refused_and_a_steep_one_is_not() {
    let refused = refusal(&with_formula("a * 0.0004 * sign(q_i - 0.001)"));
    assert!(matches!(refused, Implausible::Jump { found_mm, .. } if found_mm > 0.3), "{refused}");
    with_formula("a * 0.0002 * tanh((q_i - 0.001) / 0.00002)")
        .plausible(MAX_BEND_RAD)
        .expect("one")
        .expect("steep, but smooth");
}

#[test]
fn a_correction_that_folds_the_motion_back_has_no_inverse() {
    let refused = refusal(&with_formula("-900 * a * q_i * abs(q_i)"));
    assert!(matches!(refused, Implausible::NoInverse { .. }), "{refused}");
}

#[test]
fn the_elastic_lines_and_every_effect_of_the_catalogue_pass() {
    let empty =
        Chain::new(&MachineParameters::default(), ChainSettings::default(), &[], KnownColumns::default()).unwrap();
    empty.plausible(MAX_BEND_RAD).unwrap().unwrap();
    for kind in EffectKind::ALL {
        if !matches!(kind.definition().inverse, Inverse::None(_)) && !matches!(kind, EffectKind::Joint(_)) {
            let chain = chain(&[strong(kind)], ChainSettings::default());
            let found = chain.plausible(MAX_BEND_RAD.min(chain.max_bend_rad())).unwrap();
            assert!(found.is_ok(), "{}: {found:?}", kind.name());
        }
    }
}
