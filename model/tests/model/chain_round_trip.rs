//! Inverse, then forward, gives the setpoint back: through reversals and plane rotations, for every effect and for chains of four.

use crate::chains::{bends, chain, circumstances, strong};
use krait_model::effects::{EffectKind, Inverse};
use krait_model::{Chain, ChainSettings, ChainStatus, EffectSetting};

/// Largest and rms error, rad, of the arc's shape against the setpoint as the arc shall take it.
fn round_trip(chain: &Chain) -> (f64, f64) {
    let (mut compensator, mut predictor) = (chain.compensator().unwrap(), chain.predictor());
    let in_snake = chain.effects().iter().all(|e| !matches!(e.kind().definition().inverse, Inverse::NotNeeded(_)));
    let (mut largest, mut sum, mut n) = (0.0_f64, 0.0, 0);
    for (k, wanted) in bends().enumerate() {
        let at = circumstances(k);
        let command = compensator.step(wanted, &at);
        assert_eq!(command.status, ChainStatus::Good);
        let found = predictor.step(command.q_tilde_m, &at);
        assert_eq!(found.status, ChainStatus::Good, "step {k}: {found:?}");
        let reached = if in_snake { found.observed_bend_rad } else { found.bend_rad };
        let error = (reached - wanted).norm();
        (largest, sum, n) = (largest.max(error), sum + error * error, n + 1);
    }
    (largest, (sum / f64::from(n)).sqrt())
}

fn exact_settings() -> ChainSettings {
    ChainSettings { transition_m: 1e-9, ..ChainSettings::default() }
}

#[test]
fn an_empty_chain_closes_to_rounding() {
    let (largest, _) = round_trip(&chain(&[], ChainSettings::default()));
    assert!(largest < 1e-13, "{largest:e}");
}

#[test]
fn every_effect_with_an_inverse_closes_when_directions_are_followed_at_once() {
    for kind in EffectKind::ALL {
        if matches!(kind.definition().inverse, Inverse::None(_)) {
            continue;
        }
        let (largest, rms) = round_trip(&chain(&[strong(kind)], exact_settings()));
        println!("{:30} max {largest:.1e} rms {rms:.1e}", kind.name());
        let limit = if kind.definition().inverse == Inverse::Smoothed { 2e-6 } else { 1e-11 };
        assert!(largest < limit, "{}: {largest:e}", kind.name());
    }
}

fn four() -> Vec<EffectSetting> {
    [EffectKind::StiffnessScale, EffectKind::Backlash, EffectKind::StaticFriction, EffectKind::ConeFriction]
        .map(EffectSetting::new)
        .to_vec()
}

/// Chains of four, so that each effect is behind and before others of another hook.
fn chains_of_four() -> Vec<Vec<EffectSetting>> {
    use EffectKind as K;
    let kinds = [
        [K::StaticFriction, K::ConeFriction, K::Backlash, K::StiffnessScale],
        [K::DiskFriction, K::ConeFriction, K::Backlash, K::EncoderZero],
        [K::BendFriction, K::Creep, K::Backlash, K::Twist],
        [K::SuperelasticSoftening, K::ConeFriction, K::LeadScrewError, K::NonConstantCurvature],
        [K::BoucWen, K::StribeckFriction, K::LineBuckling, K::PlaneOffset],
        [K::PrandtlIshlinskii, K::ViscousFriction, K::TensionCompressionAsymmetry, K::RadiusError],
        [K::UnequalLines, K::CrossCoupling, K::Backlash, K::EncoderScale],
        [K::HoleClearance, K::ActuatorCompliance, K::ConeFriction, K::Preload],
        [K::LateralTipForce, K::AxialTipForce, K::StemCoupling, K::Backlash],
        [K::ThermalDrift, K::Formula, K::StaticFriction, K::Latency],
        [K::InsideExtension, K::DiskFriction, K::ConeFriction, K::Preload],
        [K::StaticFriction, K::DistributedCapstan, K::TensionCompressionAsymmetry, K::Backlash],
        [K::StemCoupling, K::DistributedCapstan, K::InsideExtension, K::Preload],
    ];
    kinds.into_iter().map(|four| four.map(strong).to_vec()).collect()
}

#[test]
fn chains_of_four_close_when_directions_are_followed_at_once() {
    for effects in chains_of_four() {
        let names: Vec<_> = effects.iter().map(EffectSetting::label).collect();
        let (largest, rms) = round_trip(&chain(&effects, exact_settings()));
        println!("{names:?} max {largest:.1e} rms {rms:.1e}");
        assert!(largest < 3e-6, "{names:?}: {largest:e}");
    }
}

#[test]
fn with_the_transition_the_error_stays_below_its_travel() {
    for effects in chains_of_four() {
        let names: Vec<_> = effects.iter().map(EffectSetting::label).collect();
        let (largest, rms) = round_trip(&chain(&effects, ChainSettings::default()));
        println!("{names:?} max {largest:.1e} rms {rms:.1e}");
        // 20 micrometres of one line are 12 mrad of bend in its direction; two lines can turn at a time. A bend that sticks
        // keeps the error until the lines have built up the moment that frees it.
        let stick = if effects.iter().any(|effect| effect.kind() == EffectKind::BendFriction) { 2.0 } else { 1.0 };
        assert!(largest < stick * 2.0 * 20e-6 / 1.684e-3, "{names:?}: {largest:e}");
    }
}

#[test]
fn uncompensated_the_same_chains_miss_by_degrees() {
    for effects in [four(), chains_of_four()[1].clone()] {
        let mut predictor = chain(&effects, ChainSettings::default()).predictor();
        let mut plain = chain(&[], ChainSettings::default()).compensator().unwrap();
        let mut largest = 0.0_f64;
        for (k, wanted) in bends().enumerate() {
            let at = circumstances(k);
            let found = predictor.step(plain.step(wanted, &at).q_tilde_m, &at);
            largest = largest.max((found.observed_bend_rad - wanted).norm());
        }
        assert!(largest > 5_f64.to_radians(), "{largest}");
    }
}

#[test]
fn an_effect_that_no_command_undoes_is_refused_with_its_reason() {
    let error =
        chain(&[EffectSetting::new(EffectKind::Saturation)], ChainSettings::default()).compensator().unwrap_err();
    let text = error.to_string();
    assert!(text.contains("saturation") && text.contains("limit the workspace"), "{text}");
}
