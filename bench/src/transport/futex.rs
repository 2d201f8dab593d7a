//! The floor: a ring of slots and a count in shared memory, and the kernel's futex to sleep on the count. Written as a
//! programmer would who wants nothing but speed: no version, no check, one reader.

use super::{PATIENCE, Place};
use crate::BenchError;
use crate::relay::{Inlet, Outlet};
use core::sync::atomic::{AtomicU32, Ordering};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::{SharedWords, WaitMode};
use rustix::io::Errno;
use rustix::thread::futex;
use rustix::time::Timespec;
use std::path::Path;

/// Messages that the ring holds.
const N_SLOTS: u32 = 64;
/// The count has a cache line of its own.
const COUNT_WORDS: usize = 16;

/// Either end of one hop.
pub(crate) struct Ring {
    words: SharedWords,
    slot_words: usize,
    count: u32,
    mode: WaitMode,
}

impl Ring {
    pub(crate) fn open(place: &Place, hop: usize) -> Result<Self, BenchError> {
        let slot_words = place.plan.payload_bytes.div_ceil(4);
        let path = Path::new("/dev/shm").join(format!("{}{hop}.ring", place.prefix));
        let words = SharedWords::open(&path, COUNT_WORDS + N_SLOTS as usize * slot_words)
            .map_err(BenchError::file("mapped", &path))?;
        Ok(Self { words, slot_words, count: 0, mode: place.plan.wait })
    }

    fn sent(&self) -> &AtomicU32 {
        &self.words.words()[0]
    }

    fn slot(&self) -> &[AtomicU32] {
        let first = COUNT_WORDS + (self.count % N_SLOTS) as usize * self.slot_words;
        &self.words.words()[first..first + self.slot_words]
    }

    /// Whether there is a message; sleeps for at most the patience.
    fn wait(&self) -> Result<bool, BenchError> {
        let deadline_ns = monotonic_ns() + PATIENCE.as_nanos() as i64;
        let timeout = Timespec { tv_sec: PATIENCE.as_secs().cast_signed(), tv_nsec: 0 };
        while self.sent().load(Ordering::Acquire) == self.count {
            match self.mode {
                WaitMode::Polling if monotonic_ns() > deadline_ns => return Ok(false),
                WaitMode::Polling => core::hint::spin_loop(),
                WaitMode::Blocking | WaitMode::Ahead => {
                    match futex::wait(self.sent(), futex::Flags::empty(), self.count, Some(&timeout)) {
                        Ok(()) | Err(Errno::AGAIN | Errno::INTR) => {}
                        Err(Errno::TIMEDOUT) => return Ok(false),
                        Err(error) => return Err(BenchError::transport("floor-futex", "waiting")(error)),
                    }
                }
            }
        }
        Ok(true)
    }
}

impl Inlet for Ring {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, BenchError> {
        if !self.wait()? {
            return Ok(false);
        }
        // What the ring no longer holds is lost, and shows as a gap.
        let sent = self.sent().load(Ordering::Acquire);
        if sent.wrapping_sub(self.count) > N_SLOTS {
            self.count = sent.wrapping_sub(N_SLOTS);
        }
        for (bytes, word) in message.chunks_mut(4).zip(self.slot()) {
            bytes.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes()[..bytes.len()]);
        }
        self.count = self.count.wrapping_add(1);
        Ok(true)
    }
}

impl Outlet for Ring {
    fn send(&mut self, message: &[u8]) -> Result<(), BenchError> {
        for (bytes, word) in message.chunks(4).zip(self.slot()) {
            let mut four = [0; 4];
            four[..bytes.len()].copy_from_slice(bytes);
            word.store(u32::from_le_bytes(four), Ordering::Relaxed);
        }
        self.count = self.count.wrapping_add(1);
        self.sent().store(self.count, Ordering::Release);
        if self.mode != WaitMode::Polling {
            futex::wake(self.sent(), futex::Flags::empty(), 1)
                .map_err(BenchError::transport("floor-futex", "waking"))?;
        }
        Ok(())
    }
}
