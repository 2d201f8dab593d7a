//! Keeps the chain going and its slave's states: every one, as an observer hears them.

use crate::supervisor::Supervisor;
use anyhow::bail;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::SlaveState;
use krait_ipc::{Bus, ReadOptions, Reader, clock};

/// How often the chain is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// The instances of a scene and the slave's states.
pub struct SceneWatch<'a> {
    /// The supervisors, the slave's first.
    pub supervisors: Vec<Supervisor>,
    /// Every state of the slave.
    pub states: Vec<SlaveState>,
    reader: Reader<SlaveState>,
    stop: &'a AtomicBool,
}

impl<'a> SceneWatch<'a> {
    /// Begins to listen.
    ///
    /// # Errors
    /// One sentence when the channel cannot be had.
    pub fn open(slaves: Supervisor, stop: &'a AtomicBool) -> anyhow::Result<Self> {
        let reader = slaves.bus().reader(ReadOptions::observing())?;
        Ok(Self { supervisors: vec![slaves], states: Vec::new(), reader, stop })
    }

    /// Begins to listen to a chain that another process supervises.
    ///
    /// # Errors
    /// As [`SceneWatch::open`].
    pub fn beside(bus: &Bus, stop: &'a AtomicBool) -> anyhow::Result<Self> {
        Ok(Self { supervisors: Vec::new(), states: Vec::new(), reader: bus.reader(ReadOptions::observing())?, stop })
    }

    /// The supervisor that has a process.
    pub fn supervisor_of(&self, process: krait_ipc::Process) -> Option<(&Supervisor, u32)> {
        self.supervisors.iter().find_map(|supervisor| {
            let found = supervisor.processes().into_iter().find(|(known, _)| *known == process);
            found.map(|(_, pid)| (supervisor, pid))
        })
    }

    /// Watches until something is so.
    ///
    /// # Errors
    /// One sentence: it did not come about in time, a process was lost for good, or a stop was asked for.
    pub fn until(&mut self, patience_s: f64, what: &str, is_so: impl Fn(&Self) -> bool) -> anyhow::Result<()> {
        let give_up_ns = clock::monotonic_ns() + (patience_s * 1e9) as i64;
        while !is_so(self) {
            self.look()?;
            if clock::monotonic_ns() > give_up_ns {
                bail!(
                    "{what}: that did not come about within {patience_s} s; the newest state: {:?}",
                    self.states.last()
                );
            }
        }
        Ok(())
    }

    /// Watches for some time.
    ///
    /// # Errors
    /// As [`SceneWatch::until`].
    pub fn run(&mut self, time_s: f64) -> anyhow::Result<()> {
        let end_ns = clock::monotonic_ns() + (time_s * 1e9) as i64;
        while clock::monotonic_ns() < end_ns {
            self.look()?;
        }
        Ok(())
    }

    fn look(&mut self) -> anyhow::Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            bail!("stopped before the fault had been tried");
        }
        for supervisor in &mut self.supervisors {
            supervisor.look()?;
        }
        while let Some(state) = self.reader.take()? {
            self.states.push(*state);
        }
        std::thread::sleep(LOOK_EVERY);
        Ok(())
    }
}
