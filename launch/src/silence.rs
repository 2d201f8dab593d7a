//! How long a process has said nothing: its health comes ten times a second while its loop turns.

use krait_ipc::Process;
use std::collections::BTreeMap;

/// A process that has said nothing for so long hangs, ns: twenty healths are missing. What moves has stopped long before,
/// by the slave's own watchdog.
pub const HANGS_NS: i64 = 2_000_000_000;
/// A supervisor that was held up itself heard nothing from anybody: one look counts for at most this, ns.
const LONGEST_LOOK_NS: i64 = 100_000_000;

/// A process that was started again may take so long until its first word, ns.
const START_NS: i64 = 10_000_000_000;

/// Stands for the sequence number of the first word of a process that has said none; healths count from one.
const UNHEARD: u64 = 0;

/// Counts the time since each process was last heard.
#[derive(Debug, Default)]
pub struct Silence {
    silent_ns: BTreeMap<Process, (u64, i64)>,
    looked_ns: Option<i64>,
}

impl Silence {
    /// Time has passed.
    pub fn look(&mut self, now_ns: i64) {
        let passed_ns = self.looked_ns.map_or(0, |looked_ns| (now_ns - looked_ns).clamp(0, LONGEST_LOOK_NS));
        self.looked_ns = Some(now_ns);
        for (_, silent_ns) in self.silent_ns.values_mut() {
            *silent_ns += passed_ns;
        }
    }

    /// A process was heard; `sequence` is that of its newest health.
    pub fn heard(&mut self, process: Process, sequence: u64) {
        let known = self.silent_ns.entry(process).or_insert((sequence, 0));
        if known.0 != sequence {
            *known = (sequence, 0);
        }
    }

    /// A process is gone, and its silence with it.
    pub fn forget(&mut self, process: Process) {
        self.silent_ns.remove(&process);
    }

    /// A process was started again: from now on it is counted, with patience for its start.
    pub fn expect(&mut self, process: Process) {
        self.silent_ns.insert(process, (UNHEARD, HANGS_NS - START_NS));
    }

    /// Whether a process that was heard once, or is expected, hangs.
    pub fn hangs(&self, process: Process) -> bool {
        self.silent_ns.get(&process).is_some_and(|(_, silent_ns)| *silent_ns > HANGS_NS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks every 5 ms for so long; the process's health counts on every 20th look, or does not.
    fn after(ms: i64, speaks: bool) -> bool {
        let mut silence = Silence::default();
        for look in 0..ms / 5 {
            silence.look(look * 5_000_000);
            silence.heard(Process::Resolve, if speaks { look.unsigned_abs() / 20 } else { 1 });
        }
        silence.hangs(Process::Resolve)
    }

    #[test]
    fn a_process_that_speaks_does_not_hang_and_one_that_is_silent_does_after_two_seconds() {
        assert!(!after(60_000, true));
        assert!(!after(1_900, false));
        assert!(after(2_100, false));
    }

    #[test]
    fn a_process_that_was_started_again_and_never_speaks_hangs_after_its_start_patience() {
        let mut silence = Silence::default();
        silence.expect(Process::Resolve);
        let hangs_at = |silence: &mut Silence, s: i64| {
            (0..20).for_each(|tick| silence.look(s * 1_000_000_000 + tick * 50_000_000));
            silence.hangs(Process::Resolve)
        };
        let first = (0..20).find(|s| hangs_at(&mut silence, *s)).expect("it hangs at last");
        assert!((9..=11).contains(&first), "{first} s");
        silence.expect(Process::Resolve);
        silence.heard(Process::Resolve, 1);
        assert!(!silence.hangs(Process::Resolve));
    }

    #[test]
    fn a_supervisor_that_slept_blames_nobody() {
        let mut silence = Silence::default();
        for second in 0..10 {
            silence.look(second * 1_000_000_000);
            silence.heard(Process::Slave, 7);
        }
        assert!(!silence.hangs(Process::Slave), "ten looks stand for one second at most");
        silence.forget(Process::Slave);
        assert!(!silence.hangs(Process::Slave));
    }
}
