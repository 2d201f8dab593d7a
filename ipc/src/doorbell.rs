//! The wake-up beside a channel's data: a futex word in shared memory, the cheapest way that the kernel has to wake a
//! process.
//!
//! Problem: a reader must never sleep through a message, and a writer must not pay for readers that do not sleep.
//!
//! Intuition: the writer counts its rings in one word; a reader remembers the count, looks whether there is a message, and
//! lets the kernel put it to sleep only if the count is still the same. A second word says how many sleep. Either the reader
//! has entered itself there before the writer looks, or the writer has rung before the kernel compares: both use
//! sequentially consistent operations, so one of the two sees the other.
//!
//! Failure: a reader that is killed in its sleep stays counted, which costs its writer a system call per message until the
//! instance ends and nothing else. A writer that is killed between publishing and ringing leaves its last message to be found
//! when the reader's time is up; every sleep has a time.

use crate::shared_words::SharedWords;
use core::sync::atomic::{AtomicU32, Ordering::SeqCst};
use core::time::Duration;
use rustix::io::Errno;
use rustix::thread::futex;
use rustix::time::Timespec;
use std::io;
use std::path::Path;

/// The counts lie a cache line apart, so that a reader that enters itself does not slow the writer's count.
const N_WORDS: usize = 32;
const RINGS: usize = 0;
const SLEEPERS: usize = 16;

/// One channel's doorbell.
///
/// ```no_run
/// use core::time::Duration;
/// let doorbell = krait_ipc::Doorbell::open("/dev/shm/example.doorbell".as_ref())?;
/// let heard = doorbell.rings();
/// // ... look for a message here; only if there is none:
/// doorbell.sleep(heard, Duration::from_millis(20))?;
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Doorbell {
    words: SharedWords,
}

impl Doorbell {
    /// Opens a doorbell by its file on a memory file system; whoever comes first makes it.
    ///
    /// # Errors
    /// As [`SharedWords::open`].
    pub fn open(path: &Path) -> io::Result<Self> {
        Ok(Self { words: SharedWords::open(path, N_WORDS)? })
    }

    /// How often it has rung; to be asked before looking for a message.
    pub fn rings(&self) -> u32 {
        self.word(RINGS).load(SeqCst)
    }

    /// Wakes every reader that sleeps. A system call only if there is one.
    ///
    /// # Errors
    /// What the kernel said; it does not refuse a word that is mapped.
    pub fn ring(&self) -> Result<(), Errno> {
        self.word(RINGS).fetch_add(1, SeqCst);
        if self.word(SLEEPERS).load(SeqCst) > 0 {
            futex::wake(self.word(RINGS), futex::Flags::empty(), i32::MAX.unsigned_abs())?;
        }
        Ok(())
    }

    /// Sleeps until it has rung since `heard`, or the time is up (false), or a signal came (false).
    ///
    /// # Errors
    /// As [`Doorbell::ring`].
    pub fn sleep(&self, heard: u32, timeout: Duration) -> Result<bool, Errno> {
        let timeout = Timespec {
            tv_sec: i64::try_from(timeout.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: i64::from(timeout.subsec_nanos()),
        };
        self.word(SLEEPERS).fetch_add(1, SeqCst);
        let slept = futex::wait(self.word(RINGS), futex::Flags::empty(), heard, Some(&timeout));
        self.word(SLEEPERS).fetch_sub(1, SeqCst);
        match slept {
            Ok(()) | Err(Errno::AGAIN) => Ok(true),
            Err(Errno::TIMEDOUT | Errno::INTR) => Ok(false),
            Err(error) => Err(error),
        }
    }

    fn word(&self, idx: usize) -> &AtomicU32 {
        &self.words.words()[idx]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct File(std::path::PathBuf);

    impl File {
        fn new(what: &str) -> Self {
            Self(Path::new("/dev/shm").join(format!("krait-test-{what}-{}.doorbell", std::process::id())))
        }
    }

    impl Drop for File {
        fn drop(&mut self) {
            let _gone_is_fine = std::fs::remove_file(&self.0);
        }
    }

    #[test]
    fn a_ring_before_the_sleep_is_not_slept_through() {
        let file = File::new("before");
        let (writer, reader) = (Doorbell::open(&file.0).expect("doorbell"), Doorbell::open(&file.0).expect("doorbell"));
        let heard = reader.rings();
        writer.ring().expect("ring");
        assert!(reader.sleep(heard, Duration::from_secs(60)).expect("sleep"));
        assert!(!reader.sleep(reader.rings(), Duration::from_millis(1)).expect("sleep"), "nothing rang since");
    }

    #[test]
    fn every_sleeper_wakes_and_none_stays_counted() {
        let file = File::new("many");
        let writer = Doorbell::open(&file.0).expect("doorbell");
        std::thread::scope(|scope| {
            let sleepers: Vec<_> = (0..4)
                .map(|_| {
                    let reader = Doorbell::open(&file.0).expect("doorbell");
                    scope.spawn(move || reader.sleep(0, Duration::from_secs(60)).expect("sleep"))
                })
                .collect();
            while writer.word(SLEEPERS).load(SeqCst) < 4 {
                std::thread::yield_now();
            }
            writer.ring().expect("ring");
            assert!(sleepers.into_iter().all(|sleeper| sleeper.join().expect("woken")));
        });
        assert_eq!(writer.word(SLEEPERS).load(SeqCst), 0);
    }

    #[test]
    fn no_ring_is_lost_between_two_threads_that_race() {
        const N: u32 = 200_000;
        let file = File::new("race");
        let (writer, reader) = (Doorbell::open(&file.0).expect("doorbell"), Doorbell::open(&file.0).expect("doorbell"));
        std::thread::scope(|scope| {
            scope.spawn(move || (0..N).for_each(|_| writer.ring().expect("ring")));
            loop {
                let heard = reader.rings();
                if heard == N {
                    break;
                }
                assert!(reader.sleep(heard, Duration::from_secs(60)).expect("sleep"), "slept through a ring");
            }
        });
    }
}
