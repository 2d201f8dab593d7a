//! No control step allocates: counted by the allocator itself, with every reason, update and refusal on the way.

use crate::allocations::allocations_of;
use crate::common::{T0_NS, TICK_NS, chain, chain_of, compensate, input, ready_state, resolve};
use krait_bridge::{CompensateConfig, CompensateCore, EstimateConfig, EstimateCore, ResolveConfig};
use krait_ipc::message::{ModelUpdate, Setpoint, Shape, SlaveState};

fn shape(sequence: u64, bend_rad: [f64; 2]) -> Shape {
    Shape::of_bend(sequence, T0_NS + sequence as i64 * TICK_NS, 0, bend_rad).with_sigma(0.005)
}

#[test]
fn resolve_compensate_and_estimate_never_allocate() {
    let mut resolve = resolve(ResolveConfig { max_bend_rad: 0.7, ..ResolveConfig::default() });
    let mut compensate = compensate(CompensateConfig::default());
    let mut estimate = EstimateCore::new(&chain("estimated"), EstimateConfig::default()).expect("defaults");
    let lines = chain_of("format = 1\n[machine]\nkind = \"snake\"\n");
    let quick = EstimateConfig { learn_s: 2.0, ..EstimateConfig::default() };
    let mut watching = EstimateCore::new(&lines, quick).expect("defaults");
    let mut without_learning = CompensateCore::new(&lines, CompensateConfig::default()).expect("it can be inverted");
    let lines_hash = lines.hash().0;
    let mut n_changes = 0;
    let mut n_followed = 0;
    let n_allocations = allocations_of(|| {
        for n in 1..=20_000u64 {
            let phase = n as f64 * 1e-3;
            let velocity = [0.03 * phase.sin(), 0.03 * (1.3 * phase).cos(), if n % 1000 == 0 { f64::NAN } else { 0.0 }];
            let state = ready_state(n);
            resolve.note_state(&state);
            resolve.warm_up(&input(n, velocity), T0_NS + n as i64 * TICK_NS);
            let Ok(setpoint) = resolve.step(&input(n, velocity), T0_NS + n as i64 * TICK_NS) else { continue };
            compensate.note_state(&state);
            compensate.warm_up(&setpoint, setpoint.sample_ns);
            without_learning.warm_up(&Setpoint { model_hash: lines_hash, ..setpoint }, setpoint.sample_ns);
            let Ok(command) = compensate.step(&setpoint, setpoint.sample_ns) else { continue };
            let measured = SlaveState { measured_q_m: command.q_tilde_m, ..state };
            estimate.note_state(&measured);
            watching.note_state(&measured);
            if n % 17 == 0 {
                let glance_rad = (n as f64 * 7.3).sin() * 0.007 + if n > 12_000 { 0.05 } else { 0.0 };
                n_changes = watching.step(&shape(n, command.bend_rad.map(|b| b + glance_rad))).n_changes;
                let update: ModelUpdate = estimate.step(&shape(n, command.bend_rad));
                n_followed += u64::from(compensate.note_update(&update).is_ok());
            }
        }
    });
    assert!(n_changes > 0, "a change was seen on the way");
    assert!(n_followed > 500, "the loop really ran: {n_followed}");
    assert_eq!(n_allocations, 0);
}
