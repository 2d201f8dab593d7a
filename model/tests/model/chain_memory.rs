//! A step that is taken back leaves no trace, whatever the effects remember.

use crate::chains::{bends, chain, circumstances, strong};
use krait_model::ChainSettings;
use krait_model::effects::{EffectKind, Inverse};
use nalgebra::Vector2;

#[test]
fn a_step_that_is_taken_back_changes_no_later_command() {
    let mut n_that_remember = 0;
    for kind in EffectKind::ALL {
        if matches!(kind.definition().inverse, Inverse::None(_)) {
            continue;
        }
        let chain = chain(&[strong(kind)], ChainSettings::default());
        let [mut plain, mut warmed_up, mut disturbed] = [(); 3].map(|()| chain.compensator().unwrap());
        let mut was_disturbed = false;
        for (k, wanted) in bends().take(3000).enumerate() {
            let at = circumstances(k);
            let elsewhere = Vector2::new(-wanted.y, wanted.x) + Vector2::repeat(0.3);
            let memory = warmed_up.memory();
            warmed_up.step(elsewhere, &at);
            warmed_up.restore(&memory);
            disturbed.step(elsewhere, &at);
            let command = plain.step(wanted, &at);
            assert_eq!(warmed_up.step(wanted, &at), command, "{} at step {k}", kind.name());
            was_disturbed |= disturbed.step(wanted, &at) != command;
        }
        n_that_remember += u32::from(was_disturbed);
    }
    assert!(n_that_remember > 5, "without taking it back it shows: {n_that_remember}");
}
