//! A chain may be right in every number and still be nonsense as a whole: such a one is refused, and every usual one is not.

use crate::chains::{chain, formula, strong};
use krait_model::effects::{EffectKind, Hook, Inverse};
use krait_model::joints::JointImplausible;
use krait_model::model_file::ModelFile;
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

/// A wrist of three joints, each with one effect or none, within 0.8 rad.
fn wrist(effect: &str) -> Result<(), JointImplausible> {
    let machine = "format = 1\n[machine]\nkind = \"joints\"\nn = 3\nu_unit = \"rad\"\ny_unit = \"rad\"\n\
                   gain = [0.9, 0.9, 0.9]\noffset = [0.02, 0.02, 0.02]\n";
    let file = ModelFile::parse(&format!("{machine}{effect}")).expect("a model file");
    let chain = file.joint_chain(KnownColumns { time: true, ..KnownColumns::default() }).expect("a chain");
    chain.expect("joints").plausible(&[-0.8; 3], &[0.8; 3]).expect("a compensator")
}

fn effect(kind: &str, keys: &str) -> String {
    format!("[[effect]]\nkind = \"{kind}\"\n{keys}")
}

fn joint_formula(text: &str) -> String {
    effect("formula", &format!("name = \"own\"\nhook = \"joint\"\nformula = \"{text}\"\n"))
}

#[test]
fn joints_are_refused_where_an_effect_is_worth_too_much_jumps_or_folds_back() {
    let worth = [effect("backlash", "half_width = 3.0\n"), joint_formula("3")];
    for text in worth {
        let refused = wrist(&text).expect_err("nonsense");
        assert!(matches!(refused, JointImplausible::Correction { found, .. } if found > 2.25), "{refused}");
    }
    let refused = wrist(&joint_formula("0.1 * sign(u_i - 0.3)")).expect_err("a jump");
    assert!(matches!(refused, JointImplausible::Jump { .. } | JointImplausible::NoInverse { .. }), "{refused}");
    wrist(&joint_formula("-0.9 * u_i")).expect_err("nothing moves any more");
}

#[test]
fn joints_with_usual_effects_pass() {
    let usual = [
        ("scale", "scale = 0.1\n"),
        ("offset", "offset = 0.1\n"),
        ("backlash", "half_width = 0.2\n"),
        ("dead-zone", "half_width = 0.1\ncentre = 0.2\n"),
        ("bouc-wen", "amplitude = 0.1\ntravel = 0.1\n"),
        ("prandtl-ishlinskii", "weight1 = 0.2\nhalf_width1 = 0.1\n"),
        ("cone-friction", "friction = 0.2\n"),
        ("load-friction", "share = 0.5\nfriction = 0.2\n"),
        ("creep", "a1 = 0.1\n"),
        ("cubic", "cubic = 0.1\n"),
        ("quadratic", "quadratic = 0.1\n"),
        ("periodic-error", "amplitude = 0.01\nperiod = 0.2\n"),
        ("cross-coupling", "from = 1\nk = 0.2\n"),
        ("drift", "size = 0.1\n"),
        ("linear-drift", "rate = 0.001\n"),
    ];
    wrist("").expect("no effect at all");
    for (kind, keys) in usual {
        let found = wrist(&effect(kind, keys));
        assert!(found.is_ok(), "{kind}: {found:?}");
    }
}
