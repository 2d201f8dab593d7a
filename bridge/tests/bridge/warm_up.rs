//! A warm-up step ahead of a sample changes nothing that a stage sends.

use crate::common::{chain, chain_of, input, ready_state, resolve, setpoint_of, update_of};
use krait_bridge::{CompensateConfig, CompensateCore, ResolveConfig};
use krait_ipc::message::{OperatorInput, Setpoint};
use krait_model::Chain;

const N: u64 = 5_000;

fn bend_rad(n: u64) -> [f64; 2] {
    let phase = n as f64 * 2e-3;
    [0.6 * phase.sin(), 0.4 * (1.7 * phase).sin()]
}

/// The commands as text, so that a value that is no number equals itself. The learnt values are being blended all the time.
fn commands(chain: &Chain, warms_up: bool) -> Vec<String> {
    let mut core = CompensateCore::new(chain, CompensateConfig::default()).expect("it can be inverted");
    let step = |n: u64| {
        core.note_state(&ready_state(n));
        if n.is_multiple_of(17) {
            let part = (n as f64 * 1e-3).sin().abs();
            let values: Vec<f64> = chain.learnt().iter().map(|p| p.start + part * p.learn.sd).collect();
            core.note_update(&update_of(chain, n, &values)).expect("in range");
        }
        let setpoint = setpoint_of(chain, n, bend_rad(n));
        if warms_up && n > 1 {
            let last = setpoint_of(chain, n - 1, bend_rad(n - 1));
            let now_ns = setpoint.sample_ns - 200_000;
            core.warm_up(&Setpoint { sample_ns: now_ns, ..last }, now_ns);
            core.warm_up(&Setpoint { sample_ns: now_ns, bend_rad: bend_rad(n + 700), ..last }, now_ns);
        }
        format!("{:?}", core.step(&setpoint, setpoint.sample_ns))
    };
    (1..=N).map(step).collect()
}

const FOUR: &str = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"stiffness-scale\"\n\
                    [[effect]]\nkind = \"backlash\"\n[[effect]]\nkind = \"static-friction\"\n\
                    [[effect]]\nkind = \"creep\"\na1 = { value = 0.05, learn = { sd = 0.02 } }\n\
                    t1_s = { value = 10.0, learn = { sd = 3.0 } }\n";

#[test]
fn compensate_sends_the_same_whether_it_rehearses_or_not_also_while_learnt_values_are_blended_in() {
    let (estimated, four) = (chain("estimated"), chain_of(FOUR));
    let plain = [&estimated, &four].map(|chain| commands(chain, false));
    assert_ne!(plain[0], plain[1]);
    assert!(plain.iter().flatten().all(|command| command.starts_with("Ok")), "every setpoint is answered");
    assert_eq!(commands(&estimated, true), plain[0]);
    assert_eq!(commands(&four, true), plain[1]);
}

#[test]
fn resolve_sends_the_same_whether_it_rehearses_or_not() {
    let setpoints = |warms_up: bool| -> Vec<String> {
        let mut core = resolve(ResolveConfig::default());
        let step = |n: u64| {
            core.note_state(&ready_state(n));
            let phase = n as f64 * 2e-3;
            let velocity = [0.02 * phase.sin(), 0.01 * phase.cos(), 0.0];
            let input = input(n, velocity);
            if warms_up {
                let last = OperatorInput { sample_ns: input.sample_ns - 200_000, ..input };
                core.warm_up(&last, last.sample_ns);
            }
            format!("{:?}", core.step(&input, input.sample_ns))
        };
        (1..=N).map(step).collect()
    };
    assert_eq!(setpoints(true), setpoints(false));
}
