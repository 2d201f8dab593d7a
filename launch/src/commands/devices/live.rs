//! Axes and buttons of one device as they are: a line that is drawn anew on a terminal, lines one by one anywhere else.

use super::node_of;
use crate::cli_devices::DevicesArgs;
use crate::{print, signals};
use anyhow::ensure;
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_master::{
    AXIS_LIMIT_COUNTS, AXIS_NAMES, Decoder, DeviceChoice, HidSource, InputWatch, Plug, Profile, ProfileAxis,
    ReportSource, SourceEvent,
};
use std::io::IsTerminal;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// How often a line is drawn.
const DRAW_EVERY_NS: i64 = 100_000_000;
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Shows the device until Ctrl-C, its end, or the end of the time.
pub(super) fn run(args: &DevicesArgs) -> anyhow::Result<ExitCode> {
    let seconds = args.seconds.unwrap_or(f64::INFINITY);
    ensure!(seconds > 0.0, "--seconds {seconds}: expected more than 0; leave it out to go on until Ctrl-C");
    let stop = signals::stop_flag()?;
    let profile = args.profile.as_deref().map(Profile::load).transpose()?;
    let mut device: Box<dyn Shown> = match (&args.node, &profile) {
        (Some(node), _) => Box::new(Input { watch: InputWatch::open(node, false)?, profile }),
        (None, Some(known)) => Box::new(Input { watch: InputWatch::open(&node_of(None, known)?, false)?, profile }),
        (None, None) => Box::new(Cap { source: HidSource::open(&DeviceChoice::Any)?, decoder: Decoder::default() }),
    };
    let is_terminal = std::io::stdout().is_terminal();
    let begin_ns = monotonic_ns();
    let (mut drawn, mut drawn_ns) = (String::new(), None);
    loop {
        let goes_on =
            device.wait()? && !stop.load(Ordering::Relaxed) && ((monotonic_ns() - begin_ns) as f64) < seconds * 1e9;
        let is_due = drawn_ns.is_none_or(|at_ns| monotonic_ns() - at_ns >= DRAW_EVERY_NS) || !goes_on;
        let line = device.line();
        if is_due && line != drawn {
            print::out(&if is_terminal { format!("\r{line}\x1b[K") } else { format!("{line}\n") })?;
            (drawn, drawn_ns) = (line, Some(monotonic_ns()));
        }
        if !goes_on {
            break;
        }
    }
    if is_terminal {
        print::out("\n")?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A device that is looked at.
trait Shown {
    /// Waits a moment for what it tells; false when it has come to its end.
    fn wait(&mut self) -> anyhow::Result<bool>;

    /// How it is now.
    fn line(&self) -> String;
}

/// A device of the kernel's input system, in its own counts and, with a profile, as the hand's deflection.
struct Input {
    watch: InputWatch,
    profile: Option<Profile>,
}

impl Shown for Input {
    fn wait(&mut self) -> anyhow::Result<bool> {
        Ok(self.watch.wait(LOOK_EVERY, |_| {})?)
    }

    fn line(&self) -> String {
        let mut parts = Vec::new();
        let known = self.profile.iter().flat_map(|profile| &profile.axes);
        let part = |told: String, name: &str| {
            let deflection = known.clone().find(|known| known.name() == name);
            let deflection = deflection.and_then(|known| Some((known, self.watch.deflection_counts(known)?)));
            match deflection {
                Some((known, counts)) => format!("{told} = {} {}", AXIS_NAMES[known.axis_idx], percent(counts)),
                None => told,
            }
        };
        for axis in self.watch.axes() {
            let Some(value) = axis.value else { continue };
            parts.push(part(format!("{} {value:5}", axis.name()), &axis.name()));
        }
        for way in self.watch.ways() {
            parts.push(part(format!("{} {:+5}", way.name(), way.counts), &way.name()));
        }
        for keys in known.clone().filter(|known| known.keys().next().is_some()).map(ProfileAxis::name) {
            parts.push(part(keys.clone(), &keys));
        }
        parts.push(buttons(&self.watch.pressed()));
        parts.join("  ")
    }
}

/// A SpaceMouse.
struct Cap {
    source: HidSource,
    decoder: Decoder,
}

impl Shown for Cap {
    fn wait(&mut self) -> anyhow::Result<bool> {
        let look_ns = i64::try_from(LOOK_EVERY.as_nanos()).unwrap_or(i64::MAX);
        self.source.wait_until(monotonic_ns() + look_ns);
        while let Some(event) = self.source.next_event(monotonic_ns()) {
            match event {
                SourceEvent::HidReport { report, .. } => {
                    if let Err(refusal) = self.decoder.on_report(report.as_bytes()) {
                        tracing::warn!(?refusal, "a report was refused");
                    }
                }
                SourceEvent::Plug { plug: Plug::Out, .. } => self.decoder.forget_device(),
                _ => {}
            }
        }
        Ok(true)
    }

    fn line(&self) -> String {
        let axes = AXIS_NAMES.iter().zip(self.decoder.axes());
        let mut parts: Vec<String> = axes.map(|(name, counts)| format!("{name} {}", percent(counts))).collect();
        let pressed: Vec<String> =
            (0..32).filter(|bit| self.decoder.buttons() >> bit & 1 == 1).map(|bit: u32| bit.to_string()).collect();
        parts.push(buttons(&pressed));
        parts.join("  ")
    }
}

/// A deflection of -350 to 350 counts.
fn percent(counts: i16) -> String {
    format!("{:+4.0} %", 100.0 * f64::from(counts) / f64::from(AXIS_LIMIT_COUNTS))
}

fn buttons(pressed: &[String]) -> String {
    if pressed.is_empty() { "no button".to_owned() } else { format!("buttons {}", pressed.join(" ")) }
}
