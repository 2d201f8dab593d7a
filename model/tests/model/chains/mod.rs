//! Chains, motions and effects with visible parameters that several tests share.

#![allow(dead_code, reason = "each test file uses its own part")]

use krait_model::effects::{EffectKind, FormulaParameter, FormulaText, Hook};
use krait_model::{Chain, ChainSettings, Circumstances, EffectSetting, KnownColumns, MachineParameters};
use nalgebra::Vector2;
use std::f64::consts::PI;

pub const ALL_COLUMNS: KnownColumns = KnownColumns { time: true, stem_angle: true, temperature: true, named: false };

pub fn chain(effects: &[EffectSetting], settings: ChainSettings) -> Chain {
    Chain::new(&MachineParameters::default(), settings, effects, ALL_COLUMNS).unwrap()
}

pub fn effect(kind: EffectKind, values: &[(&str, f64)]) -> EffectSetting {
    values.iter().fold(EffectSetting::new(kind), |e, (name, value)| e.with(name, *value).unwrap())
}

/// A formula of one parameter `a`.
pub fn formula(hook: Hook, text: &str, a: f64) -> EffectSetting {
    EffectSetting::formula(FormulaText {
        name: format!("test-{}", hook.word()),
        hook,
        text: text.to_owned(),
        parameters: vec![FormulaParameter { name: "a".to_owned(), value: a, unit: "m".to_owned() }],
        columns: Vec::new(),
    })
}

/// An effect with parameters large enough to be seen: the defaults where they are, others where the default is zero.
pub fn strong(kind: EffectKind) -> EffectSetting {
    use EffectKind as K;
    match kind {
        K::RadiusError | K::CameraScale => effect(kind, &[("relative", 0.03)]),
        K::BendFriction => effect(kind, &[("per_load_m", 1e-5)]),
        K::SuperelasticSoftening => effect(kind, &[("flag", 0.2)]),
        K::BoucWen => effect(kind, &[("gamma", 0.2)]),
        K::PlaneOffset => effect(kind, &[("angle_rad", 0.05)]),
        K::EncoderZero => effect(kind, &[("zero1_m", 5e-5), ("zero2_m", -2e-5), ("zero3_m", 1e-5)]),
        K::EncoderScale => effect(kind, &[("scale1", 0.01), ("scale2", -0.005), ("scale3", 0.002)]),
        K::CameraOffset => effect(kind, &[("offset_x_rad", 0.02), ("offset_y_rad", -0.01)]),
        K::LateralTipForce => effect(kind, &[("force_y_n", -0.07)]),
        K::Creep => effect(kind, &[("a2", 0.03), ("a3", 0.02)]),
        K::UnequalLines => effect(
            kind,
            &[
                ("angle2_rad", 0.04),
                ("angle3_rad", -0.02),
                ("radius2", 0.02),
                ("radius3", -0.03),
                ("compliance2", 0.05),
                ("compliance3", -0.04),
            ],
        ),
        K::CrossCoupling => effect(kind, &[("k12", 0.05), ("k21", -0.02), ("k23", 0.1), ("k31", 0.01)]),
        K::ThermalDrift => effect(kind, &[("line1_m_per_k", 1e-5)]),
        K::Formula => formula(Hook::Eps, "a * tanh(bend / 0.2) * cos(delta - 0.3) + 0.1 * a * direction", 1e-4),
        _ => EffectSetting::new(kind),
    }
}

/// Reversals, nested loops, plane rotations both ways, straight poses, rests; bends up to 80 degrees.
pub fn bends() -> impl Iterator<Item = Vector2<f64>> {
    (0..6000).map(|k| bend_at(f64::from(k) * 0.01))
}

pub fn bend_at(t_s: f64) -> Vector2<f64> {
    let polar = |b: f64, d: f64| Vector2::new(d.cos(), d.sin()) * b;
    let max = 80_f64.to_radians();
    match t_s {
        t if t < 20.0 => polar(max * (0.5 - 0.5 * (2.0 * PI * t / 5.0).cos()), (t / 5.0).floor() * 1.1),
        t if t < 24.0 => Vector2::zeros(),
        t if t < 40.0 => {
            let u = t - 24.0;
            polar(max * (u / 6.0).min(1.0) * (0.6 + 0.3 * (1.7 * u).cos()), 1.5 * (0.7 * u).sin())
        }
        t if t < 44.0 => bend_at(39.99),
        t => {
            let u = t - 44.0;
            let from = bend_at(39.99);
            from * (1.0 - u / 16.0) + polar(0.5, 1.3 * u) * (u / 16.0 * (1.0 - u / 16.0) * 4.0)
        }
    }
}

/// Time at 100 Hz, a stem that bends and a temperature that rises.
pub fn circumstances(k: usize) -> Circumstances {
    let t = k as f64 * 0.01;
    Circumstances { stem_angle_rad: 0.3 * (0.2 * t).sin(), temperature_c: 20.0 + 0.2 * t, ..Circumstances::at(t) }
}
