//! How steadily an emulated bus of three servos is told and asked: cycles, unanswered questions, own time of a cycle.
//! `cargo run --release -p krait-drives --example serial_rate -- SECONDS [xl330]`
#![allow(clippy::print_stdout, reason = "what an example finds is told on standard output")]

use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_drives::{ActuatorBus, Goals, ServoBus, ServoMake};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{ActuatorConfig, DriveConfig, DriveKind};
use rustix::time::{ClockId, clock_gettime};
use std::error::Error;
use std::time::Duration;

const PERIOD_NS: i64 = 5_000_000;

fn own_ns() -> i64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

fn main() -> Result<(), Box<dyn Error>> {
    let seconds: i64 = std::env::args().nth(1).map_or(Ok(6), |text| text.parse())?;
    let (make, kind) = match std::env::args().nth(2).as_deref() {
        None => (ServoMake::Sts3215, DriveKind::Sts3215),
        Some("xl330") => (ServoMake::Xl330, DriveKind::Xl330),
        Some(other) => return Err(format!("{other}: expected xl330, or nothing for sts3215").into()),
    };
    let mut wire = ServoWire::new((1..=3).map(|id| Servo::of(make, id, 2048.0)).collect());
    wire.usb_latency = Duration::from_millis(1);
    let emulator = Emulator::start(wire)?;
    let actuator = (1..=3).map(|id| ActuatorConfig { id, ..ActuatorConfig::default() }).collect();
    let port = Some(emulator.path().to_owned());
    // Its answers are waited for 4 ms.
    let (mut bus, mut seen) = ServoBus::open(&DriveConfig { kind, port, actuator, ..DriveConfig::default() })?;
    let mut goals = Goals { counts: [2048; 12], counts_per_s: [1000.0; 12] };
    bus.switch(true, &goals)?;
    bus.ask(&mut seen)?;
    let (n, mut n_unanswered, mut n_overrun) = (seconds * 1_000_000_000 / PERIOD_NS, 0, 0);
    let begun_ns = monotonic_ns();
    let mut due_ns = begun_ns;
    let (own_before_ns, mut round_trips_ns) = (own_ns(), Vec::new());
    for k in 0..n {
        let left_ns = due_ns - monotonic_ns();
        if left_ns > 0 {
            std::thread::sleep(Duration::from_nanos(left_ns.unsigned_abs()));
        }
        goals.counts = [2048 + ((k as f64 * 0.03).sin() * 300.0) as i32; 12];
        let asked_ns = monotonic_ns();
        bus.tell(&goals)?;
        bus.ask(&mut seen)?;
        round_trips_ns.push(monotonic_ns() - asked_ns);
        n_unanswered += usize::from(!seen.has_answered[..3].iter().all(|answered| *answered));
        due_ns += PERIOD_NS;
        n_overrun += usize::from(monotonic_ns() > due_ns);
        due_ns = due_ns.max(monotonic_ns());
    }
    let took_s = (monotonic_ns() - begun_ns) as f64 * 1e-9;
    round_trips_ns.sort_unstable();
    let quantile_ms = |part: f64| round_trips_ns[(part * (round_trips_ns.len() - 1) as f64) as usize] as f64 * 1e-6;
    println!(
        "{n} cycles in {took_s:.2} s ({:.1} Hz), {n_unanswered} unanswered, {n_overrun} longer than a period",
        n as f64 / took_s
    );
    println!(
        "round trip p50 {:.2} ms, p99 {:.2} ms, max {:.2} ms",
        quantile_ms(0.5),
        quantile_ms(0.99),
        quantile_ms(1.0)
    );
    println!("own time of a cycle {:.1} us", (own_ns() - own_before_ns) as f64 * 1e-3 / n as f64);
    Ok(())
}
