//! The judge's own thread steps aside: on one processor what it does for a device would delay the chain that it times.

use anyhow::{Context, ensure};
use std::process::Command;

/// The difference in niceness between the judge and the chain.
const STEP: i32 = 8;

/// As long as it lives, the thread that made it runs where nobody else wants to, in the kernel too: there the kernel takes a device away, and a
/// real machine has another processor for that. Programs started meanwhile would run so as well.
pub struct Aside(());

impl Aside {
    /// # Errors
    /// The system refuses it.
    pub fn begin() -> anyhow::Result<Self> {
        renice(STEP)?;
        Ok(Self(()))
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        if let Err(error) = renice(-STEP) {
            println!("the judge stays aside: {error:#}");
        }
    }
}

/// This thread alone: the system's own call would be `unsafe` here.
fn renice(step: i32) -> anyhow::Result<()> {
    let thread = std::fs::read_link("/proc/thread-self").context("/proc/thread-self")?;
    let id = thread.file_name().context("/proc/thread-self names no thread")?;
    let status = Command::new("/bin/busybox").args(["renice", "-n", &step.to_string(), "-p"]).arg(id).status();
    ensure!(status.context("starting renice")?.success(), "renice of thread {} by {step} failed", id.display());
    Ok(())
}
