//! `krait watch`: the page's glance in a terminal, with keys for stop, pause and mark.
//!
//! The stop has a thread of its own that does nothing but read keys: a terminal that hangs, or a supervisor that does not
//! answer, never holds it up.

mod keys;

use crate::cli::Common;
use crate::cli_console::WatchArgs;
use crate::commands::{mark, state, stop};
use crate::config::Config;
use crate::terminal::Terminal;
use crate::{commands, print, signals};
use core::time::Duration;
use keys::{KeyOrder, Keys};
use krait_console::{GlanceLine, GlanceWeight, Observer, fitted, glance};
use krait_ipc::message::Transition;
use krait_ipc::{Bus, StopSwitch, clock};
use std::io::Read;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Its name among the members of an instance; it is no part of a chain, and a chain may start beside it.
pub const NAME: &str = "watch";
/// Channels are emptied so often that none overflows.
const LOOK_EVERY: Duration = Duration::from_millis(16);
/// Pictures on a terminal, ns.
const TERMINAL_PERIOD_NS: i64 = 100_000_000;
/// Words into a file or pipe, ns.
const FILE_PERIOD_NS: i64 = 1_000_000_000;
const HELP: &str = "s or space: stop   p: pause   m: mark   q: end the watch, the chain goes on";

/// Shows a chain until `q`, Ctrl-C, or with `--once` after a second.
pub fn run(common: &Common, args: &WatchArgs) -> anyhow::Result<ExitCode> {
    let quit = signals::stop_flag()?;
    let config = Config::load(common.config.as_deref())?;
    let bus = Bus::open(&common.instance, NAME)?;
    commands::refuse_without(&bus, "slave", "watch")?;
    let mut observer = Observer::open(bus)?;
    let terminal = if args.once { None } else { Terminal::take()? };
    let said = Arc::new(Mutex::new(Said::default()));
    if terminal.is_some() {
        listen(&common.instance, &said, &quit)?;
    }
    let period_ns = if terminal.is_some() { TERMINAL_PERIOD_NS } else { FILE_PERIOD_NS };
    let mut due_ns = clock::monotonic_ns() + period_ns;
    while !quit.load(Ordering::Relaxed) {
        observer.look(config.budget.end_to_end.worst_us)?;
        let now_ns = clock::monotonic_ns();
        if now_ns < due_ns {
            std::thread::sleep(LOOK_EVERY);
            continue;
        }
        due_ns = now_ns + period_ns;
        let mut lines = glance(&mut observer, now_ns);
        let Some(terminal) = &terminal else {
            print::out(&format!("{}\n\n", fitted(lines, [usize::MAX; 2]).join("\n")))?;
            if args.once {
                break;
            }
            continue;
        };
        let told = locked(&said).line(now_ns);
        let weight = if told.is_some() { GlanceWeight::Keys } else { GlanceWeight::Frame };
        lines.insert(0, GlanceLine::new(GlanceWeight::Frame, format!("krait watch: {}", common.instance)));
        lines.push(GlanceLine::new(GlanceWeight::Frame, String::new()));
        lines.push(GlanceLine::new(weight, told.unwrap_or_else(|| HELP.to_owned())));
        if terminal.show(&fitted(lines, terminal.size())).is_err() {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What the keys have led to, for the last line of the picture.
#[derive(Default)]
struct Said {
    /// What became of the last key; empty before the first.
    outcome: String,
    /// The mark that is being written.
    writing: Option<String>,
    /// A stop on its way.
    stop: Option<Pressed>,
}

struct Pressed {
    switch: Arc<StopSwitch>,
    number: u32,
    at_ns: i64,
}

impl Said {
    /// The mark that is being written, else what became of the last key, else nothing.
    fn line(&mut self, now_ns: i64) -> Option<String> {
        if let Some(outcome) = self.stop.as_ref().and_then(|stop| stop.outcome(now_ns)) {
            (self.outcome, self.stop) = (outcome.to_owned(), None);
        }
        if let Some(text) = &self.writing {
            return Some(format!("mark (Enter sets it, Escape leaves it): {text}_"));
        }
        (!self.outcome.is_empty()).then(|| self.outcome.chars().take(79).collect())
    }
}

impl Pressed {
    fn outcome(&self, now_ns: i64) -> Option<&'static str> {
        if self.switch.is_obeyed(self.number) {
            return Some("STOPPED: the actuators stand still; `krait state resume` lets them go on");
        }
        (now_ns - self.at_ns > stop::PATIENCE_NS)
            .then_some("NOT ACKNOWLEDGED: the slave has not stopped within 3 s; take the power away")
    }
}

/// Nobody holds it for longer than a line takes to be made.
fn locked(said: &Mutex<Said>) -> MutexGuard<'_, Said> {
    said.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Two threads: one takes keys and presses the stop, one asks for everything else and waits for the answers.
fn listen(instance: &str, said: &Arc<Mutex<Said>>, quit: &Arc<AtomicBool>) -> anyhow::Result<()> {
    let bus = Bus::open(instance, NAME)?;
    let switch = Arc::new(bus.stop_switch()?);
    let (sender, orders) = std::sync::mpsc::channel();
    let (told, said, quit) = (Arc::clone(said), Arc::clone(said), Arc::clone(quit));
    std::thread::spawn(move || {
        for order in orders {
            let outcome = match order {
                KeyOrder::Mark { at_ns, text } => mark::set(&bus, &text, at_ns),
                KeyOrder::Pause => state::ask(&bus, Transition::Pause)
                    .map(|()| "PAUSED, power on; `krait state resume` lets it go on".to_owned()),
                KeyOrder::Stop | KeyOrder::Quit => continue,
            };
            locked(&told).outcome = outcome.unwrap_or_else(|error| format!("not done: {error:#}"));
        }
    });
    std::thread::spawn(move || {
        let mut keys = Keys::default();
        for byte in std::io::stdin().lock().bytes().map_while(Result::ok) {
            let now_ns = clock::monotonic_ns();
            match keys.take(byte, now_ns) {
                Some(KeyOrder::Stop) => {
                    let number = switch.press();
                    let mut said = locked(&said);
                    said.outcome = "stop asked for".to_owned();
                    said.stop = Some(Pressed { switch: Arc::clone(&switch), number, at_ns: now_ns });
                }
                Some(KeyOrder::Quit) => quit.store(true, Ordering::Relaxed),
                // The other thread ends with the program only.
                Some(order) => drop(sender.send(order)),
                None => {}
            }
            locked(&said).writing = keys.mark();
        }
        // A terminal that has gone ends the watch.
        quit.store(true, Ordering::Relaxed);
    });
    Ok(())
}
