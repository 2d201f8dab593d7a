//! The slave's side of a bus must not touch the heap, whatever the bus is doing: a counting allocator watches it.

use crate::allocations::allocations_of;
use crate::rig::Rig;
use krait_drives::ServoMake;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Command, Phase, Transition};
use krait_ipc::{Reason, Reasons};
use krait_slave::{Drive, SlaveConfig, SlaveCore, lines};
use std::time::Duration;

#[test]
fn commands_ticks_and_reports_of_a_slave_on_servos_allocate_nothing_also_when_one_fails() {
    let Rig { emulator, drive } = Rig::new(ServoMake::Sts3215);
    let mut config = SlaveConfig::default();
    (config.limits.following_error_m, config.limits.pull_n, config.limits.push_n) =
        (5e-3, f64::INFINITY, f64::INFINITY);
    let mut core = SlaveCore::new(drive, &config);
    let (mut n_following, mut n_cycles) = (0, 0);
    let n = allocations_of(|| {
        core.transition(Transition::Enable, monotonic_ns()).unwrap();
        let mut begin_m = [0.0; 12];
        for k in 1..=1500_u64 {
            std::thread::sleep(Duration::from_millis(1));
            let now_ns = monotonic_ns();
            if !core.is_busy() && k > 300 {
                let way_m = 1e-6 * (k - 300) as f64;
                let mut command =
                    Command { sequence: k, sample_ns: now_ns, n_actuators: 3, model_hash: 1, ..Command::default() };
                command.q_tilde_m =
                    core::array::from_fn(|i| begin_m[i] + lines([way_m, -0.5 * way_m, -0.5 * way_m])[i]);
                command.phase = Phase::Following as u32;
                if k < 320 {
                    (command.q_tilde_m, command.phase) = (begin_m, Phase::Holding as u32);
                    command.reasons =
                        if k < 310 { Reasons::NONE.with(Reason::OperatorAbsent).bits() } else { Reasons::NONE.bits() };
                }
                core.on_command(&command, now_ns);
            }
            core.on_tick(now_ns);
            let state = core.report(now_ns);
            if k < 320 {
                begin_m = state.setpoint_q_m;
            }
            n_following += u64::from(core.is_following());
            n_cycles += core::iter::from_fn(|| core.drive_mut().next_cycle()).count();
            if k == 1000 {
                emulator.wire().servos[1].faults.is_silent = true;
            }
        }
    });
    assert_eq!(n, 0);
    assert!(n_cycles > 20, "{n_cycles} cycles were fetched");
    assert!(n_following > 100, "it followed in {n_following} ticks");
    let error = core.drive_error().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.starts_with("Drive 2 failed"), "{error}");
}
