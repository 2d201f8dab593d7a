//! What a process can ask of the kernel to be on time: priority, memory that stays, cores of its own. Each wish is granted
//! or refused by itself; what is refused is told in a sentence that says how to mend it.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CpuSet, sched_setaffinity};
use serde::{Deserialize, Serialize};

/// Stack that is touched before the loop begins, bytes; the loops of krait use a few tens of kilobytes.
const PREFAULTED_BYTES: usize = 256 * 1024;
/// Highest SCHED_FIFO priority on Linux.
const HIGHEST_PRIORITY: u8 = 99;
/// Cores that a set can name.
const MOST_CORES: usize = 1024;
/// Bit of CAP_IPC_LOCK in a process's capabilities.
const CAP_IPC_LOCK: u64 = 1 << 14;

/// What the four processes between the hand and the drives ask of the kernel. Nothing by default: on shared cores a high
/// priority makes waker and woken compete.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Realtime {
    /// SCHED_FIFO priority, 1 to 99; 0: time sharing as every other process. Default 0.
    pub priority: u8,
    /// Whether all memory is kept in RAM and the stack is touched beforehand. Default false.
    pub lock_memory: bool,
    /// Cores for master, resolve, compensate and slave, in turn: [2, 3] gives 2 to master and compensate, 3 to the others.
    /// Default none: the kernel chooses.
    pub cores: Vec<usize>,
}

/// A setting that no machine can follow.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("[realtime] {key} = {found}: expected {expected}")]
pub struct RealtimeError {
    key: &'static str,
    found: String,
    expected: &'static str,
}

impl Realtime {
    /// Checks every range.
    ///
    /// # Errors
    /// [`RealtimeError`] names the first setting that is out of range.
    pub fn check(&self) -> Result<(), RealtimeError> {
        if self.priority > HIGHEST_PRIORITY {
            return Err(RealtimeError { key: "priority", found: self.priority.to_string(), expected: "0 to 99" });
        }
        match self.cores.iter().find(|core| **core >= MOST_CORES) {
            Some(core) => Err(RealtimeError { key: "cores", found: core.to_string(), expected: "cores 0 to 1023" }),
            None => Ok(()),
        }
    }

    /// Applies the wishes to the calling thread of the process that is the `idx`-th of the chain. Gives one sentence for each
    /// wish that was refused; the process can go on without.
    pub fn apply(&self, idx: usize) -> Vec<String> {
        let mut refused = Vec::new();
        if let Some(core) = self.cores.get(idx % self.cores.len().max(1)) {
            refused.extend(pin_to(*core).err());
        }
        if self.lock_memory {
            refused.extend(lock_memory().err());
        }
        // Last, so that what is slow above does not run at high priority.
        if self.priority > 0 {
            refused.extend(set_fifo(self.priority).err());
        }
        refused
    }
}

fn pin_to(core: usize) -> Result<(), String> {
    let mut cores = CpuSet::new();
    cores.set(core);
    sched_setaffinity(None, &cores).map_err(|error| {
        format!("core {core} could not be had: {error}; `krait doctor` lists the cores that this process may use")
    })
}

/// With a limit that later requests would exceed, locking now would make them fail: then nothing is locked.
fn lock_memory() -> Result<(), String> {
    if !may_lock_all() {
        return Err(
            "memory is not locked: the limit `memlock` would be exceeded; give the user `memlock unlimited` in \
                    /etc/security/limits.d and log in again"
                .to_owned(),
        );
    }
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
        .map_err(|error| format!("memory is not locked: {error}"))?;
    prefault_stack();
    Ok(())
}

/// Whether all memory of a process may be locked: no limit, or the right to ignore it.
pub fn may_lock_all() -> bool {
    let unlimited = getrlimit(Resource::Memlock).current.is_none();
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let rights = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    unlimited || rights.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()).is_some_and(|r| r & CAP_IPC_LOCK != 0)
}

#[inline(never)]
fn prefault_stack() {
    let mut stack = [0u8; PREFAULTED_BYTES];
    core::hint::black_box(&mut stack);
}

/// SCHED_FIFO for the calling thread; threads that it starts later are not given it.
fn set_fifo(priority: u8) -> Result<(), String> {
    let wanted = libc::sched_param { sched_priority: libc::c_int::from(priority) };
    #[allow(unsafe_code)]
    // SAFETY: the call reads the structure that it is given and changes nothing but the scheduling of this thread.
    let result =
        unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, &raw const wanted) };
    if result == 0 {
        return Ok(());
    }
    let error = std::io::Error::last_os_error();
    Err(format!(
        "priority {priority} (SCHED_FIFO) was refused: {error}; give the user `rtprio {priority}` in /etc/security/limits.d \
         and log in again"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_named() {
        let error = Realtime { priority: 100, ..Realtime::default() }.check().expect_err("too high").to_string();
        assert_eq!(error, "[realtime] priority = 100: expected 0 to 99");
        let error = Realtime { cores: vec![0, 4096], ..Realtime::default() }.check().expect_err("no such core");
        assert!(error.to_string().contains("4096"), "{error}");
        assert_eq!(Realtime::default().check(), Ok(()));
    }

    #[test]
    fn a_core_that_does_not_exist_is_refused_in_a_sentence_and_the_process_goes_on() {
        let refused = Realtime { cores: vec![1023], ..Realtime::default() }.apply(5);
        assert!(refused.len() == 1 && refused[0].starts_with("core 1023 could not be had"), "{refused:?}");
        assert_eq!(Realtime::default().apply(0), Vec::<String>::new(), "no wish, no refusal");
    }

    #[test]
    fn processes_take_the_cores_in_turn() {
        let both = Realtime { cores: vec![0, 1023], ..Realtime::default() };
        std::thread::spawn(move || {
            assert_eq!(both.apply(2), Vec::<String>::new(), "the third process gets the first core again");
            assert_eq!(both.apply(3).len(), 1);
        })
        .join()
        .expect("a thread of its own, because its core stays set");
    }
}
