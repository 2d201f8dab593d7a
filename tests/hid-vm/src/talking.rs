//! A program of krait's that goes on and says what it sees: what it has said so far, and its end.

use crate::chain::{User, VmEnded, command, gather};
use crate::spacemouse::wait_for;
use anyhow::{Context, ensure};
use std::io::BufReader;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// The program; it is ended when it is dropped.
pub struct Talking {
    child: Child,
    /// Standard output and standard error.
    said: [Arc<Mutex<String>>; 2],
    listeners: Vec<JoinHandle<()>>,
}

impl Talking {
    /// Starts it.
    ///
    /// # Errors
    /// It could not be started.
    pub fn start(arguments: &[&str]) -> anyhow::Result<Self> {
        let mut command = command(User::Root, arguments);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().context("starting krait")?;
        let said = [Arc::new(Mutex::new(String::new())), Arc::new(Mutex::new(String::new()))];
        let [out, err] = said.each_ref().map(Arc::clone);
        let (stdout, stderr) = (child.stdout.take().context("piped")?, child.stderr.take().context("piped")?);
        let listeners = vec![
            std::thread::Builder::new().spawn(move || gather(BufReader::new(stdout), &out))?,
            std::thread::Builder::new().spawn(move || gather(BufReader::new(stderr), &err))?,
        ];
        Ok(Self { child, said, listeners })
    }

    /// What it has said on standard output.
    pub fn said(&self) -> String {
        text(&self.said[0])
    }

    /// Whether its newest line comes to hold all of these words.
    pub fn comes_to_say(&self, words: &[&str]) -> bool {
        wait_for("a line", || {
            let said = self.said();
            said.lines().last().is_some_and(|line| words.iter().all(|word| line.contains(word)))
        })
        .is_ok()
    }

    /// Whether it has ended.
    pub fn is_over(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|status| status.is_some())
    }

    /// Presses Ctrl-C.
    ///
    /// # Errors
    /// It is gone.
    pub fn interrupt(&self) -> anyhow::Result<()> {
        let status = Command::new("/bin/kill").args(["-INT", &self.child.id().to_string()]).status().context("kill")?;
        ensure!(status.success(), "a program of krait's could not be interrupted");
        Ok(())
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// It does not end.
    pub fn end(mut self) -> anyhow::Result<VmEnded> {
        wait_for("the end of a program of krait's", || self.is_over())?;
        let code = self.child.wait().context("waiting for krait")?.code();
        for listener in self.listeners.drain(..) {
            ensure!(listener.join().is_ok(), "a thread that listens to krait died");
        }
        Ok(VmEnded { code, stdout: text(&self.said[0]), stderr: text(&self.said[1]) })
    }
}

/// A part that ends early leaves no program behind for the next.
impl Drop for Talking {
    fn drop(&mut self) {
        if !self.is_over() {
            let _it_may_be_gone = self.child.kill();
            let _it_was_killed = self.child.wait();
        }
    }
}

fn text(said: &Mutex<String>) -> String {
    said.lock().map_or_else(|_| String::new(), |said| said.clone())
}
