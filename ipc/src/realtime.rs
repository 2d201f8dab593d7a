//! What a process can ask of the kernel to be on time: priority, memory that stays, cores of its own. Each wish is granted
//! or refused by itself; what is refused is told in a sentence that says how to mend it.

use crate::Priority;
use crate::setting::{SettingError, check};
use crate::settings;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getpriority_process, getrlimit};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::{Deserialize, Serialize};

/// Stack that is touched before the loop begins, bytes; the loops of krait use a few tens of kilobytes.
const PREFAULTED_BYTES: usize = 256 * 1024;
/// Shortest time slice that the kernel takes, us.
const SHORTEST_SLICE_US: u32 = 100;
/// Cores that a set can name.
const MOST_CORES: usize = 1024;
/// Longest slice that the kernel gives, us.
const LONGEST_SLICE_US: u32 = 100_000;
/// Turn of the slave among the processes between the hand and the drives.
const LAST_TURN: usize = 3;
/// Bit of CAP_IPC_LOCK in a process's capabilities.
const CAP_IPC_LOCK: u64 = 1 << 14;

settings! {
    /// What the four processes between the hand and the drives ask of the kernel.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Realtime in "realtime" {
        /// SCHED_FIFO priority of the slave, each process before it one less, so that a sample goes on to the drives before the
        /// processes behind it tidy up: 1 to 99; 0: time sharing as every other process; "auto": 40 where this user has the right,
        /// no process polls, and another core is left to whoever records and serves the drives.
        priority: Priority = Priority::Auto;
        /// Whether all memory is kept in RAM and the stack is touched beforehand.
        lock_memory: bool = false;
        /// Where the processes run: "one" (all on one core), "any", or a list such as [2, 3].
        cores: Cores = Cores::One;
        /// Time slice of the slave under time sharing, us, 0 (the kernel's own) or at least 100; each process before it has twice
        /// the slice of the next. A process with a short slice is let in before others that have longer ones, so that a sample
        /// goes on to the drives before the processes behind it tidy up (Linux 6.12 and newer, no right needed).
        slice_us: u32 = SHORTEST_SLICE_US, 0..=LONGEST_SLICE_US;
        /// Whether a thread that works only when nothing else will keeps the chain's cores from sleeping: a core that slept wakes
        /// late and has forgotten what it knew. It makes the core fully busy and warm.
        keep_awake: bool = false;
    }
}

/// Where master, resolve, compensate and slave run.
///
/// They work one after the other, never at once: on one core each hands over to the next without waking a second core, which
/// costs more than everything the chain computes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "WrittenCores", into = "WrittenCores")]
pub enum Cores {
    /// "one": all on one core, which the instance's name chooses, so that chains called `arm-1` and `arm-2` get different ones.
    #[default]
    One,
    /// "any": wherever the kernel likes.
    Any,
    /// In turn: [2, 3] gives 2 to master and compensate, 3 to the others.
    Named(Vec<usize>),
}

/// [`Cores`] as it stands in a file.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "expected \"one\", \"any\" or a list of cores such as [2, 3]")]
enum WrittenCores {
    Word(String),
    List(Vec<usize>),
}

impl TryFrom<WrittenCores> for Cores {
    type Error = String;
    fn try_from(written: WrittenCores) -> Result<Self, String> {
        match written {
            WrittenCores::Word(word) => word.parse(),
            WrittenCores::List(list) => Ok(Self::Named(list)),
        }
    }
}

impl From<Cores> for WrittenCores {
    fn from(cores: Cores) -> Self {
        match cores {
            Cores::Named(list) => Self::List(list),
            word => Self::Word(word.to_string()),
        }
    }
}

impl core::str::FromStr for Cores {
    type Err = String;
    /// Reads what a command line says: `one`, `any` or numbers with commas between.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "one" => Ok(Self::One),
            "any" => Ok(Self::Any),
            list => list.split(',').map(str::parse).collect::<Result<_, _>>().map(Self::Named).map_err(|error| {
                format!("cores {text:?}: expected \"one\", \"any\" or a list of cores such as [2, 3] ({error})")
            }),
        }
    }
}

impl core::fmt::Display for Cores {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::One => f.write_str("one"),
            Self::Any => f.write_str("any"),
            Self::Named(list) => f.write_str(&list.iter().map(usize::to_string).collect::<Vec<_>>().join(",")),
        }
    }
}

/// A setting that no machine can follow.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RealtimeError {
    /// A number is out of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A list of cores that no machine has.
    #[error("[realtime] cores = {0:?}: expected one or more cores of 0 to 1023, or \"one\" or \"any\"")]
    Cores(Vec<usize>),
}

impl Realtime {
    /// Asks for nothing: a process like every other.
    pub const ORDINARY: Self =
        Self { priority: Priority::NONE, lock_memory: false, cores: Cores::Any, slice_us: 0, keep_awake: false };

    /// Checks every range.
    ///
    /// # Errors
    /// [`RealtimeError`] names the first setting that is out of range.
    pub fn check(&self) -> Result<(), RealtimeError> {
        self.check_ranges()?;
        check((Self::TABLE, "priority"), f64::from(self.priority.number()), (0.0, 99.0), Priority::BY_ITSELF)?;
        if self.slice_us != 0 {
            check((Self::TABLE, "slice_us"), f64::from(self.slice_us), (f64::from(SHORTEST_SLICE_US), 1e5), 100)?;
        }
        match &self.cores {
            Cores::Named(cores) if cores.is_empty() || cores.iter().any(|core| *core >= MOST_CORES) => {
                Err(RealtimeError::Cores(cores.clone()))
            }
            _ => Ok(()),
        }
    }

    /// Applies the wishes to the calling thread of the process that is the `idx`-th of the chain of an instance. Gives one
    /// sentence for each wish that was refused; the process can go on without.
    pub fn apply(&self, idx: usize, instance: &str) -> Vec<String> {
        let mut refused = Vec::new();
        let core = match &self.cores {
            Cores::Any => None,
            Cores::One => core_of(instance),
            Cores::Named(cores) => cores.get(idx % cores.len().max(1)).copied(),
        };
        refused.extend(core.and_then(|core| pin_to(core).err()));
        // One for each core that the chain uses, by the first process that runs there.
        if self.keep_awake && idx < self.n_cores() {
            refused.extend(keep_awake().err());
        }
        if self.lock_memory {
            refused.extend(lock_memory().err());
        }
        // Last, so that what is slow above does not run at high priority.
        let asked = (self.priority.number() > 0).then(|| set_fifo(self.priority_of(idx), self.priority.number()));
        if self.slice_us > 0 && asked != Some(Ok(())) {
            refused.extend(set_slice(self.slice_of(idx)).err());
        }
        refused.extend(asked.and_then(Result::err).filter(|_| self.priority != Priority::Auto));
        refused
    }

    /// SCHED_FIFO priority of the `idx`-th of the chain's four processes.
    fn priority_of(&self, idx: usize) -> u8 {
        self.priority_before_slave(LAST_TURN.saturating_sub(idx))
    }

    /// SCHED_FIFO priority so many places before the slave: one less for each, at least 1; 0 where none is asked for.
    fn priority_before_slave(&self, n_places: usize) -> u8 {
        let highest = self.priority.number();
        highest.saturating_sub(n_places as u8).max(highest.min(1))
    }

    /// Slice of the `idx`-th of the chain's four processes, us: the last one's doubled for each process between.
    fn slice_of(&self, idx: usize) -> u32 {
        let n_behind = LAST_TURN.saturating_sub(idx);
        (self.slice_us << n_behind).min(LONGEST_SLICE_US)
    }

    fn n_cores(&self) -> usize {
        if let Cores::Named(cores) = &self.cores { cores.len() } else { 1 }
    }
}

/// How a thread runs that works beside the chain's own: on every core that the process was given, below the chain's priority.
///
/// Without it a thread that is started later is pinned to the chain's core, where a process that polls leaves it no time.
#[derive(Clone, Copy, Debug)]
pub struct Beside {
    cores: Option<CpuSet>,
    priority: u8,
    /// The slave's: what the user must be given.
    highest: Priority,
}

impl Beside {
    /// As the calling thread runs now, before [`Realtime::apply`], and below what that will ask for.
    pub fn before(wish: &Realtime) -> Self {
        let priority = wish.priority_before_slave(LAST_TURN + 1);
        Self { cores: sched_getaffinity(None).ok(), priority, highest: wish.priority }
    }

    /// Applies it to the calling thread; one sentence for each wish that was refused.
    pub fn apply(&self) -> Vec<String> {
        let cores = self.cores.as_ref().map(|cores| sched_setaffinity(None, cores));
        let refused = cores.and_then(Result::err).map(|error| format!("the cores of a thread stay one: {error}"));
        let below = (self.priority > 0).then(|| set_fifo(self.priority, self.highest.number())).and_then(Result::err);
        let below = below.filter(|_| self.highest != Priority::Auto);
        refused.into_iter().chain(below).collect()
    }
}

/// The cores that the calling thread may use; none where the kernel does not tell.
pub fn allowed_cores() -> Vec<usize> {
    let Ok(allowed) = sched_getaffinity(None) else { return Vec::new() };
    (0..MOST_CORES).filter(|core| allowed.is_set(*core)).collect()
}

/// The core of an instance among those that this process may use: names that end in consecutive numbers take turns.
fn core_of(instance: &str) -> Option<usize> {
    let allowed = allowed_cores();
    let sum: usize = instance.bytes().map(usize::from).sum();
    allowed.get(sum % allowed.len().max(1)).copied()
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

/// Keeps in RAM what the process touches from now on, where that is allowed; elsewhere it does nothing. Shared memory that is
/// reserved for readers which are not there stays untouched, so this costs what is used and no more. Returns whether memory is
/// locked.
pub fn lock_what_is_used() -> bool {
    let locked =
        may_lock_all() && mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT).is_ok();
    prefault_stack();
    locked
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

/// SCHED_FIFO for the calling thread; threads that it starts later are not given it. `highest` is the chain's highest priority.
fn set_fifo(priority: u8, highest: u8) -> Result<(), String> {
    set_policy(libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, priority).map_err(|error| {
        format!(
            "priority {priority} (SCHED_FIFO) was refused: {error}; give the user `rtprio {highest}` in \
             /etc/security/limits.d and log in again"
        )
    })
}

/// The scheduling policy and priority of the calling thread.
pub(crate) fn set_policy(policy: libc::c_int, priority: u8) -> std::io::Result<()> {
    let wanted = libc::sched_param { sched_priority: libc::c_int::from(priority) };
    #[allow(unsafe_code)]
    // SAFETY: the call reads the structure that it is given and changes nothing but the scheduling of this thread.
    let result = unsafe { libc::sched_setscheduler(0, policy, &raw const wanted) };
    if result == 0 { Ok(()) } else { Err(std::io::Error::last_os_error()) }
}

/// A short slice for the calling thread, us. Kernels that know no slices take the call and change nothing.
///
/// # Errors
/// One sentence for what the kernel refused; the thread can go on without.
pub fn set_slice(slice_us: u32) -> Result<(), String> {
    #[allow(unsafe_code)]
    // SAFETY: the structure is made of numbers, for which zero is a value.
    let mut wanted: libc::sched_attr = unsafe { core::mem::zeroed() };
    wanted.size = size_of::<libc::sched_attr>() as u32;
    // The call sets everything; what this process has been given by `nice` shall stay.
    wanted.sched_nice = getpriority_process(None).unwrap_or_default();
    wanted.sched_runtime = u64::from(slice_us) * 1000;
    #[allow(unsafe_code)]
    // SAFETY: the call reads the structure that it is given, whose size it is told, and changes nothing but the scheduling of
    // this thread.
    let result = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const wanted, 0) };
    if result == 0 {
        return Ok(());
    }
    Err(format!("a time slice of {slice_us} us was refused: {}; set `slice_us = 0`", std::io::Error::last_os_error()))
}

/// Starts a thread that spins on the calling thread's cores for as long as the process lives, and only while they would
/// otherwise sleep (SCHED_IDLE): everything else runs before it.
fn keep_awake() -> Result<(), String> {
    let refused = |error: std::io::Error| format!("the core is not kept awake: {error}; set `keep_awake = false`");
    let (answer, answered) = std::sync::mpsc::sync_channel(1);
    let spin = move || {
        let is_idle = set_policy(libc::SCHED_IDLE, 0);
        let goes_on = is_idle.is_ok();
        if answer.send(is_idle).is_err() || !goes_on {
            return;
        }
        // No pause instruction: under a hypervisor it may hand the core back.
        let mut x = 1_u64;
        loop {
            x = core::hint::black_box(x.wrapping_add(1));
        }
    };
    std::thread::Builder::new().name("keep-awake".to_owned()).spawn(spin).map_err(refused)?;
    answered.recv().unwrap_or_else(|gone| Err(std::io::Error::other(gone))).map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_named() {
        let error = |wish: Realtime| wish.check().expect_err("out of range").to_string();
        let too_high = error(Realtime { priority: Priority::Fixed(100), ..Realtime::default() });
        assert!(too_high.starts_with("[realtime] priority = 100: expected 0 to 99;"), "{too_high}");
        let no_core = error(Realtime { cores: Cores::Named(vec![0, 4096]), ..Realtime::default() });
        assert!(no_core.contains("[0, 4096]"), "{no_core}");
        assert!(error(Realtime { slice_us: 99, ..Realtime::default() }).contains("slice_us = 99"));
        assert!(error(Realtime { cores: Cores::Named(vec![]), ..Realtime::default() }).contains("cores = []"));
        assert_eq!(Realtime::default().check(), Ok(()));
        assert_eq!(Realtime::ORDINARY.check(), Ok(()));
    }

    #[test]
    fn a_process_nearer_to_the_drives_has_the_shorter_slice() {
        let slices = |slice_us| [0, 1, 2, 3].map(|idx| Realtime { slice_us, ..Realtime::default() }.slice_of(idx));
        assert_eq!(slices(100), [800, 400, 200, 100]);
        assert_eq!(slices(0), [0; 4], "the kernel's own for all");
        assert_eq!(slices(50_000), [100_000, 100_000, 100_000, 50_000], "what the kernel gives at most");
        let slave = crate::Process::ALL.iter().filter_map(|process| process.core_turn()).max();
        assert_eq!(slave, Some(LAST_TURN));
    }

    #[test]
    fn a_process_nearer_to_the_drives_has_the_higher_priority_and_what_works_beside_the_chain_a_lower_one() {
        let wish = |priority| Realtime { priority: Priority::Fixed(priority), ..Realtime::default() };
        let priorities = |priority| [0, 1, 2, 3].map(|idx| wish(priority).priority_of(idx));
        assert_eq!(priorities(40), [37, 38, 39, 40]);
        assert_eq!(priorities(2), [1, 1, 1, 2], "1 is the lowest");
        assert_eq!([40, 2, 0].map(|priority| Beside::before(&wish(priority)).priority), [36, 1, 0]);
    }

    #[test]
    fn a_priority_by_itself_is_that_of_its_number_and_nothing_is_said_where_it_is_refused() {
        let by_itself = Realtime { priority: Priority::Auto, ..Realtime::ORDINARY };
        let asked = Realtime { priority: Priority::Fixed(Priority::BY_ITSELF), ..Realtime::ORDINARY };
        assert_eq!(by_itself.priority_of(0), asked.priority_of(0));
        let [said, told] = [&by_itself, &asked].map(|wish| in_a_thread(|| wish.apply(3, "main")));
        assert!(said.is_empty(), "{said:?}");
        // Where one is given, the other is.
        let standing = |wish: &Realtime| {
            in_a_thread(|| {
                wish.apply(3, "main");
                crate::standing::Standing::of_this_thread()
            })
        };
        assert_eq!(standing(&by_itself), standing(&asked));
        assert!(told.len() <= 1, "{told:?}");
    }

    #[test]
    fn cores_are_read_as_a_user_writes_them() {
        for (text, cores) in [("one", Cores::One), ("any", Cores::Any), ("2,3", Cores::Named(vec![2, 3]))] {
            assert_eq!(text.parse(), Ok(cores.clone()));
            assert_eq!(cores.to_string(), text);
        }
        assert!("all".parse::<Cores>().expect_err("no such word").contains("\"one\""));
    }

    #[test]
    fn a_core_that_does_not_exist_is_refused_in_a_sentence_and_the_process_goes_on() {
        let refused = Realtime { cores: Cores::Named(vec![1023]), ..Realtime::ORDINARY }.apply(5, "main");
        assert!(refused.len() == 1 && refused[0].starts_with("core 1023 could not be had"), "{refused:?}");
        assert_eq!(Realtime::ORDINARY.apply(0, "main"), Vec::<String>::new(), "no wish, no refusal");
    }

    /// In a thread of its own, because its core and its slice stay set.
    fn in_a_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| scope.spawn(work).join().expect("no panic"))
    }

    #[test]
    fn a_thread_beside_a_pinned_process_has_all_of_its_cores_again() {
        in_a_thread(|| {
            let before = sched_getaffinity(None).expect("cores");
            let beside = Beside::before(&Realtime::ORDINARY);
            assert_eq!(Realtime { cores: Cores::One, ..Realtime::ORDINARY }.apply(0, "main"), Vec::<String>::new());
            assert_eq!(sched_getaffinity(None).expect("cores").count(), 1);
            assert_eq!(beside.apply(), Vec::<String>::new());
            assert_eq!(sched_getaffinity(None).expect("cores"), before);
        });
    }

    #[test]
    fn processes_take_the_cores_in_turn() {
        let both = Realtime { cores: Cores::Named(vec![0, 1023]), ..Realtime::ORDINARY };
        in_a_thread(|| {
            assert_eq!(both.apply(2, "main"), Vec::<String>::new(), "the third process gets the first core again");
            assert_eq!(both.apply(3, "main").len(), 1);
        });
    }

    #[test]
    fn the_processes_of_an_instance_share_one_core_and_numbered_instances_take_turns() {
        let n_allowed = std::thread::available_parallelism().expect("known").get();
        let cores: Vec<_> = (0..n_allowed).map(|n| core_of(&format!("arm-{n}")).expect("known")).collect();
        let different: std::collections::BTreeSet<_> = cores.iter().collect();
        assert_eq!(different.len(), n_allowed.min(10), "{cores:?}");
        in_a_thread(|| {
            assert_eq!(Realtime::default().apply(1, "arm-0"), Vec::<String>::new());
            let now = sched_getaffinity(None).expect("known");
            assert!(now.count() == 1 && now.is_set(cores[0]));
        });
    }

    #[test]
    fn a_core_that_is_kept_awake_is_one_that_only_idle_work_keeps_busy() {
        let policies = || -> Vec<String> {
            let threads = std::fs::read_dir("/proc/self/task").expect("threads");
            let stats = threads.filter_map(|t| std::fs::read_to_string(t.ok()?.path().join("stat")).ok());
            let keepers = stats.filter(|stat| stat.contains("(keep-awake)"));
            // Field 41, policy; the second one, the name, ends with the last parenthesis.
            let policy = |stat: &str| stat.rsplit(')').next()?.split_whitespace().nth(38).map(str::to_owned);
            keepers.filter_map(|stat| policy(&stat)).collect()
        };
        in_a_thread(|| {
            let wish = Realtime { keep_awake: true, ..Realtime::default() };
            assert_eq!(wish.apply(1, "main"), Vec::<String>::new());
            assert_eq!(policies(), Vec::<String>::new(), "one thread for a core, not one for each process");
            assert_eq!(wish.apply(0, "main"), Vec::<String>::new());
            assert_eq!(policies(), [libc::SCHED_IDLE.to_string()]);
        });
    }

    #[test]
    fn a_slice_is_taken_and_leaves_what_nice_has_given() {
        in_a_thread(|| {
            let before = getpriority_process(None).expect("known");
            assert_eq!(set_slice(100), Ok(()));
            assert_eq!(getpriority_process(None).expect("known"), before);
        });
    }
}
