//! An emulated bus of servos behind a pseudo-terminal, or of drives on a CAN interface, and the configuration that drives it.

use crate::{print, signals};
use core::time::Duration;
use krait_drives::emulator::{CanBus, CanDrive, Coupling, Emulator, Servo, ServoWire, look_at_can, serve_can};
use krait_drives::{ServoMake, Units};
use krait_sim::{CableSnake, Truth};
use krait_slave::ActuatorConfig;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

const LOOK_EVERY: Duration = Duration::from_millis(50);
/// USB adapters hold bytes for at least that long.
const USB_LATENCY: Duration = Duration::from_millis(1);
/// Where the emulated servos begin, straight and under tension, counts.
const ZERO_COUNT: f64 = 2048.0;
/// Lead of the emulated CAN drives' screws, m.
const CAN_LEAD_M: f64 = 0.002;

/// Plugs in so many servos, prints their configuration on standard output, and runs until Ctrl-C.
pub(super) fn run(n: u8, make: ServoMake) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    // Largest torque, N m: of an STS3215 at 7.4 V, of an XL330-M288 at 5 V.
    let (kind, stall_nm) = match make {
        ServoMake::Sts3215 => ("sts3215", 1.91),
        ServoMake::Xl330 => ("xl330", 0.52),
    };
    let mut wire = ServoWire::new((1..=n).map(|id| Servo::of(make, id, ZERO_COUNT)).collect());
    wire.usb_latency = USB_LATENCY;
    let spool = ActuatorConfig::default();
    let counts_per_m = Units::new(&spool, 1, ServoMake::COUNTS_PER_TURN)?.magnitude_counts(1.0);
    wire.coupling = Some(snakes(n, ZERO_COUNT, counts_per_m, stall_nm / spool.spool_radius_m));
    let emulator = Emulator::start(wire)?;
    let port = emulator.path().display();
    let mut text = format!(
        "# {n} emulated servos at {port}, until Ctrl-C; three each bend a simulated snake, and feel it. Save these lines as servos.toml, then in another terminal:\n\
         #   krait run --engage --config servos.toml\n\
         [slave.limits]\nrate_m_per_s = 0.02\nfollowing_error_m = 0.001\npull_n = inf\npush_n = inf\n\n\
         [slave.drive]\nkind = \"{kind}\"\nport = \"{port}\"\n"
    );
    for id in 1..=n {
        text += &format!("\n[[slave.drive.actuator]]\nid = {id}\nzero_count = 2048\n");
    }
    print::out(&text)?;
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK_EVERY);
    }
    Ok(ExitCode::SUCCESS)
}

/// Three actuators each bend a simulated snake on cables, from their zero and with so many counts a metre; loads are parts of the largest
/// one. Counts grow where cables are pushed.
fn snakes(n: u8, zero: f64, counts_per_m: f64, largest_n: f64) -> Coupling {
    let mut snakes = vec![CableSnake::new(Truth::default()); usize::from(n) / 3];
    Coupling::new(move |places| {
        let groups = snakes.iter_mut().zip(places.chunks_exact(3));
        let loads_n =
            groups.flat_map(|(snake, group)| snake.loads_n(core::array::from_fn(|k| (group[k] - zero) / counts_per_m)));
        loads_n.map(|load_n| load_n / largest_n).collect()
    })
}

/// Lets so many drives live on a CAN interface, prints their configuration on standard output, and runs until Ctrl-C.
pub(super) fn run_can(n: u8, interface: &str) -> anyhow::Result<ExitCode> {
    look_at_can(interface)?;
    let stop = signals::stop_flag()?;
    let mut text = format!(
        "# {n} emulated drives on {interface}, until Ctrl-C; three each bend a simulated snake, and feel it. Save these lines as can.toml, then in another terminal:\n\
         #   krait drives --zero --config can.toml\n\
         #   krait run --engage --config can.toml\n\
         [slave.drive]\nkind = \"cia402\"\ninterface = \"{interface}\"\nperiod_ms = 2.0\ntimeout_ms = 1.5\n\
         speed_counts_per_s = 200000.0\n"
    );
    for id in 1..=n {
        text += &format!(
            "\n[[slave.drive.actuator]]\nid = {id}\nvendor = 0x555\nproduct = 1\nzero_count = 1000000\nlead_m = {CAN_LEAD_M}\n"
        );
    }
    print::out(&text)?;
    let bus = CanBus::new((1..=n).map(|id| CanDrive::new(id, 0.0)).collect());
    let screw = ActuatorConfig { lead_m: Some(CAN_LEAD_M), ..ActuatorConfig::default() };
    let units = Units::endless(&screw, 1)?;
    let largest_n = CanDrive::RATED_NM * units.newton_per_newton_metre.abs();
    bus.lock().coupling = Some(snakes(n, 0.0, units.magnitude_counts(1.0), largest_n));
    serve_can(interface, &bus, &stop)?;
    Ok(ExitCode::SUCCESS)
}
