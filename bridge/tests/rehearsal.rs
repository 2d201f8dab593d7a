//! What a stage does in vain ahead of a sample changes nothing that it sends.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

mod common;

use common::{T0_NS, TICK_NS, compensate, input, ready_state, resolve, setpoint};
use krait_bridge::{CompensateConfig, CompensateCore, ResolveConfig};
use krait_ipc::message::{Compensation, ModelUpdate, OperatorInput, Setpoint};
use krait_model::effects::EffectKind;
use krait_model::{Chain, ChainSettings, Columns, EffectSetting, MachineParameters};

const N: u64 = 5_000;

fn bend_rad(n: u64) -> [f64; 2] {
    let phase = n as f64 * 2e-3;
    [0.6 * phase.sin(), 0.4 * (1.7 * phase).sin()]
}

fn update(n: u64) -> ModelUpdate {
    ModelUpdate {
        sequence: n,
        sample_ns: T0_NS + n as i64 * TICK_NS,
        shape_sequence: n,
        eta: 1.0 + 0.2 * (n as f64 * 1e-3).sin().abs(),
        lambda_m: 5e-5,
        eta_sd: 0.01,
        lambda_sd_m: 1e-6,
        innovation_rms_m: 1e-5,
        n_used: n,
        n_left_out: 0,
        n_changes: 0,
        changed_ns: 0,
        change_kind: 0,
        is_watching: 0,
    }
}

/// The commands as text, so that a value that is no number equals itself.
fn commands(mut core: CompensateCore, rehearses: bool) -> Vec<String> {
    let step = |n: u64| {
        core.note_state(&ready_state(n));
        if n.is_multiple_of(17) {
            core.note_update(&update(n)).expect("in range");
        }
        let setpoint = setpoint(n, bend_rad(n));
        if rehearses && n > 1 {
            let last = common::setpoint(n - 1, bend_rad(n - 1));
            let now_ns = setpoint.sample_ns - 200_000;
            core.rehearse(&Setpoint { sample_ns: now_ns, ..last }, now_ns);
            core.rehearse(&Setpoint { sample_ns: now_ns, bend_rad: bend_rad(n + 700), ..last }, now_ns);
        }
        format!("{:?}", core.step(&setpoint, setpoint.sample_ns))
    };
    (1..=N).map(step).collect()
}

#[test]
fn compensate_sends_the_same_whether_it_rehearses_or_not() {
    let machine = MachineParameters::default();
    let kinds = [EffectKind::StiffnessScale, EffectKind::Backlash, EffectKind::StaticFriction, EffectKind::Creep];
    let effects = kinds.map(EffectSetting::new);
    let columns = Columns { time: true, ..Columns::default() };
    let chain = Chain::new(&machine, ChainSettings::default(), &effects, columns).expect("a chain of four");
    let with_chain = || {
        let config = CompensateConfig { mode: Compensation::Model, ..CompensateConfig::default() };
        CompensateCore::new(&machine, config, Some(&chain)).expect("it can be inverted")
    };
    let with_paper = || compensate(CompensateConfig::default());
    let (paper, model) = (commands(with_paper(), false), commands(with_chain(), false));
    assert_ne!(paper, model);
    assert!(paper.iter().all(|command| command.starts_with("Ok")), "every setpoint is answered");
    assert_eq!(commands(with_paper(), true), paper);
    assert_eq!(commands(with_chain(), true), model);
}

#[test]
fn resolve_sends_the_same_whether_it_rehearses_or_not() {
    let setpoints = |rehearses: bool| -> Vec<String> {
        let mut core = resolve(ResolveConfig::default());
        let step = |n: u64| {
            core.note_state(&ready_state(n));
            let phase = n as f64 * 2e-3;
            let velocity = [0.02 * phase.sin(), 0.01 * phase.cos(), 0.0];
            let input = input(n, velocity);
            if rehearses {
                let last = OperatorInput { sample_ns: input.sample_ns - 200_000, ..input };
                core.rehearse(&last, last.sample_ns);
            }
            format!("{:?}", core.step(&input, input.sample_ns))
        };
        (1..=N).map(step).collect()
    };
    assert_eq!(setpoints(true), setpoints(false));
}
