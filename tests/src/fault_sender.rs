//! A slave's states in FAULT without a slave: with what flags and reasons, a test says.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use core::time::Duration;
use krait_ipc::message::{OperatingState, SlaveState};
use krait_ipc::{Bus, Reason, clock};
use std::sync::Arc;
use std::thread::JoinHandle;

#[derive(Default)]
struct Said {
    flags: AtomicU32,
    reasons: AtomicU64,
    ends: AtomicBool,
}

/// Says a state in FAULT sixty times a second, until it is dropped.
pub struct FaultSender {
    said: Arc<Said>,
    thread: Option<JoinHandle<()>>,
}

impl FaultSender {
    /// Begins, as the slave of an instance, without flags and reasons.
    pub fn start(instance: &str) -> Self {
        let bus = Bus::open(instance, "slave").expect("bus");
        let said = Arc::new(Said::default());
        let own = Arc::clone(&said);
        let thread = std::thread::spawn(move || {
            let mut writer = bus.writer::<SlaveState>().expect("the writer");
            for sequence in 1.. {
                let state = SlaveState {
                    sequence,
                    sample_ns: clock::monotonic_ns(),
                    operating_state: OperatingState::Fault as u32,
                    flags: own.flags.load(Ordering::Relaxed),
                    n_actuators: 3,
                    reasons: own.reasons.load(Ordering::Relaxed),
                    ..SlaveState::default()
                };
                writer.send(&state).expect("sent");
                if own.ends.load(Ordering::Relaxed) {
                    return;
                }
                std::thread::sleep(Duration::from_millis(16));
            }
        });
        Self { said, thread: Some(thread) }
    }

    /// From now on every state has these flags and these reasons.
    pub fn say(&self, flags: u32, reasons: &[Reason]) {
        self.said.flags.store(flags, Ordering::Relaxed);
        self.said.reasons.store(reasons.iter().fold(0, |bits, reason| bits | 1 << *reason as u32), Ordering::Relaxed);
    }
}

impl Drop for FaultSender {
    fn drop(&mut self) {
        self.said.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("it sent to the end");
        }
    }
}
