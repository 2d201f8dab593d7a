//! The judge's own thread steps aside: on one processor what it does for a device would delay the chain that it times.

use anyhow::{Context, ensure};
use std::process::Command;

/// As long as it lives, the thread that made it runs where nobody else wants to, in the kernel too: there the kernel takes a device away, and a
/// real machine has another processor for that. Programs started meanwhile would run so as well.
pub struct Aside(());

impl Aside {
    /// # Errors
    /// The system refuses it.
    pub fn begin() -> anyhow::Result<Self> {
        stand("--idle")?;
        Ok(Self(()))
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        if let Err(error) = stand("--other") {
            println!("the judge stays aside: {error:#}");
        }
    }
}

/// Gives this thread alone a class: idle, or other, as everybody's. The system's own call would be `unsafe` here. A lower niceness is not enough:
/// a thread of that kind keeps the processor for a whole slice once it has it.
fn stand(class: &str) -> anyhow::Result<()> {
    let thread = std::fs::read_link("/proc/thread-self").context("/proc/thread-self")?;
    let id = thread.file_name().context("/proc/thread-self names no thread")?;
    let status = Command::new("/bin/chrt").args([class, "--pid", "0"]).arg(id).status();
    ensure!(status.context("starting chrt")?.success(), "chrt {class} of thread {} failed", id.display());
    Ok(())
}
