//! Other work on the machine, on purpose: a process per core that does nothing but compute.

use crate::BenchError;
use std::process::{Child, Command, Stdio};

/// Processes that keep every core busy until this is dropped.
pub struct Load {
    children: Vec<Child>,
}

impl Load {
    /// Starts one process per core; `command` gives the command that becomes one and calls [`burn`].
    ///
    /// # Errors
    /// [`BenchError::Process`].
    pub fn start(command: &mut dyn FnMut() -> Result<Command, BenchError>) -> Result<Self, BenchError> {
        let n_cores = std::thread::available_parallelism().map_or(1, usize::from);
        let mut load = Self { children: Vec::new() };
        for _ in 0..n_cores {
            let child = command()?.stdin(Stdio::null()).stdout(Stdio::null()).spawn().map_err(|error| {
                BenchError::Process { chain: "load", role: "burn", what: format!("could not be started: {error}") }
            })?;
            load.children.push(child);
        }
        Ok(load)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        for child in &mut self.children {
            let _ended_is_fine = child.kill();
            let _ended_is_fine = child.wait();
        }
    }
}

/// Computes until the process is killed.
pub fn burn() -> ! {
    let mut x = 1u64;
    loop {
        x = core::hint::black_box(x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
    }
}
