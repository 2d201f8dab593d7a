//! krait-can-vm: runs inside the virtual machine, lets drives live on a virtual CAN interface and judges krait's bus by them.

#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, reason = "the serial console is where the verdict is read")]

#[path = "../../vm/alarm.rs"]
mod alarm;
mod chain;
mod follow;
mod monitor;
mod program;
mod refusals;
mod returning;
mod serial;
mod single_steps;
mod stops;
mod threads;
#[path = "../../vm/verdict.rs"]
mod verdict;
mod world;

use anyhow::Context;
use krait_slave::DriveKind;
use std::process::ExitCode;
use verdict::PartVerdict;
use world::DriveMake;

/// One part's name and what it does.
type Part = (&'static str, Box<dyn Fn() -> anyhow::Result<PartVerdict>>);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let words: Vec<&str> = arguments.iter().skip(1).map(String::as_str).collect();
    let done = match words[..] {
        ["drive", id] => world::be_drive(id),
        ["master", period_ms] => period_ms.parse().context("the bus's period").and_then(chain::be_master),
        ["servos", word] => serial::be_servos(word),
        [n_cycles] => n_cycles.parse().context("the number of cycles").map(|n| judge(n, "")),
        [n_cycles, only] => n_cycles.parse().context("the number of cycles").map(|n| judge(n, only)),
        _ => Err(anyhow::anyhow!(
            "expected a number of cycles and a part, `drive ID`, `servos KIND` or `master PERIOD_MS`"
        )),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            println!("CAN-VM arguments FAIL {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// All parts, or those of these names.
fn judge(n_cycles: usize, only: &str) -> bool {
    let (mut all, mut n) = (true, 0);
    let mut told = |name: &str, part: &dyn Fn() -> anyhow::Result<PartVerdict>| {
        if only.is_empty() || only.split(',').any(|own| own == name) {
            (all, n) = (all & told(name, alarm::watched("CAN-VM", name, part)), n + 1);
        }
    };
    for kind in [DriveMake::Own, DriveMake::Independent, DriveMake::Canopen] {
        if !kind.is_there() {
            println!("CAN-VM {} SKIPPED these drives are not in this machine", kind.name());
            continue;
        }
        let parts: [Part; 10] = [
            ("csp_10ms", Box::new(move || follow::csp(kind, 10.0, n_cycles / 10))),
            // By a bare timer a third of the cycles, by the thread that a chain has all of them.
            ("csp_1ms", Box::new(move || follow::csp(kind, 1.0, n_cycles / 3))),
            ("csp_2ms", Box::new(move || follow::csp(kind, 2.0, n_cycles / 3))),
            ("thread", Box::new(move || threads::can(kind, 1.0, n_cycles))),
            ("thread_2ms", Box::new(move || threads::can(kind, 2.0, n_cycles))),
            ("frozen", Box::new(move || stops::frozen(kind))),
            ("power_loss", Box::new(move || stops::power_loss(kind))),
            ("master_killed", Box::new(move || stops::master_killed(kind))),
            ("trip", Box::new(move || stops::trip(kind))),
            ("jam", Box::new(move || stops::jam(kind))),
        ];
        for (name, part) in parts.into_iter().filter(|(name, _)| kind.can(name)) {
            told(&format!("{}_{name}", kind.name()), &part);
        }
    }
    told("refusals", &refusals::all);
    // The interface is down after them.
    told("program", &|| refusals::set("up").and_then(|()| program::all()));
    told("calibrate", &program::calibrate);
    told("returning", &returning::all);
    // 6 s of 5 ms where the first part has 6 s of 1 ms.
    for (name, kind) in [("serial", DriveKind::Sts3215), ("xl330", DriveKind::Xl330)] {
        told(&format!("{name}_rate"), &|| serial::rate(kind, n_cycles / 5));
        told(&format!("{name}_thread"), &|| serial::thread(kind, n_cycles / 5));
        told(&format!("{name}_unplugged"), &|| serial::unplugged(kind));
    }
    if n == 0 {
        println!("CAN-VM parts FAIL none is called {only}");
    }
    println!("CAN-VM verdict {}", if all && n > 0 { "PASS" } else { "FAIL" });
    all && n > 0
}

/// Says what a program said, line by line.
fn tell(said: &str) {
    said.lines().for_each(|line| println!("CAN-VM | {line}"));
}

fn told(name: &str, verdict: anyhow::Result<PartVerdict>) -> bool {
    match verdict {
        Ok(verdict) => {
            println!("CAN-VM {name} {verdict}");
            verdict.passed()
        }
        Err(error) => {
            println!("CAN-VM {name} FAIL {}", format!("{error:#}").replace('\n', " / "));
            false
        }
    }
}
