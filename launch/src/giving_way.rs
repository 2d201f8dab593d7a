//! A process that gives way to every other one: what the console starts beside a chain and the operator's browser.

use rustix::process::{nice, setsid};

/// Added to the nice value that it was started with.
const NICE: i32 = 15;
/// Where the kernel keeps the nice value of a session; a kernel without such groups has no such file.
const OF_SESSION: &str = "/proc/self/autogroup";

/// Gives way where [`krait_console::GIVES_WAY`] is set. Linux shares a processor out between sessions first and within each by nice
/// values (sched(7)), so it takes a session of its own. No part of it is needed for the work: what the kernel refuses is left out.
///
/// To be called before any thread is started: a thread has the nice value of the one that started it.
pub(crate) fn if_asked() {
    if std::env::var_os(krait_console::GIVES_WAY).is_none() {
        return;
    }
    let _refused_is_fine = nice(NICE);
    if setsid().is_ok() {
        let _refused_is_fine = std::fs::write(OF_SESSION, NICE.to_string());
    }
}
