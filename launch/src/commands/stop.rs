//! `krait stop`: stops the snake of a chain that runs, from anywhere, and says whether that was acknowledged.

use crate::cli::Common;
use crate::commands;
use crate::print;
use core::time::Duration;
use krait_ipc::{Bus, StopSwitch, clock};
use std::process::ExitCode;

/// Its name among the members of an instance.
pub const NAME: &str = "stop";
/// A slave brakes within its watchdog's time, some tens of milliseconds; one that has not answered by then cannot.
pub const PATIENCE_NS: i64 = 3_000_000_000;
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// Asks for the stop first and for everything else afterwards: where a chain runs, its stop is pressed without joining it, because
/// that needs memory and a lock.
pub fn run(common: &Common) -> anyhow::Result<ExitCode> {
    let stop = match StopSwitch::of(&common.instance)? {
        Some(stop) => stop,
        None => {
            let bus = Bus::open(&common.instance, NAME)?;
            commands::refuse_without(&bus, "slave", NAME)?;
            bus.stop_switch()?
        }
    };
    let (number, pressed_ns) = (stop.press(), clock::monotonic_ns());
    while !stop.is_obeyed(number) {
        if clock::monotonic_ns() - pressed_ns > PATIENCE_NS {
            // Whoever cannot be looked for may well be there.
            if let Ok(bus) = Bus::open(&common.instance, NAME) {
                commands::refuse_without(&bus, "slave", NAME)?;
            }
            print::out(&format!(
                "NOT ACKNOWLEDGED: the slave of instance {:?} has not stopped within 3 s; take the power away\n",
                common.instance
            ))?;
            return Ok(ExitCode::FAILURE);
        }
        std::thread::sleep(LOOK_EVERY);
    }
    let took_ms = (clock::monotonic_ns() - pressed_ns) as f64 * 1e-6;
    print::out(&format!(
        "stopped: the actuators of instance {:?} stand still ({took_ms:.0} ms); `krait state resume` lets the operator engage anew\n",
        common.instance
    ))?;
    Ok(ExitCode::SUCCESS)
}
