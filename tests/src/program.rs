//! The krait program under test: built once, started as a user starts it, watched from outside.

use crate::world::wait_until;
use core::time::Duration;
use rustix::process::{Pid, Signal, kill_process};
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::OnceLock;

/// The `krait` program of this build, made up to date once per test program.
pub fn krait_program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let test_program = std::env::current_exe().expect("a test program has a path");
        // target/<profile>/deps/<test> -> target/<profile>
        let folder =
            test_program.parent().and_then(Path::parent).expect("a test program lies in target/<profile>/deps");
        let mut build = Command::new(env!("CARGO"));
        // With the workspace's test features, so that what `cargo test --workspace` has built is not built again.
        build.args(["build", "--quiet", "--workspace", "--bin", "krait", "--test", "tidy", "--manifest-path"]);
        build.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml"));
        build.arg("--target-dir").arg(folder.parent().expect("target"));
        if folder.ends_with("release") {
            build.arg("--release");
        }
        assert!(build.status().expect("cargo can be started").success(), "krait could not be built");
        folder.join("krait")
    })
}

/// How often a run is repeated in which the machine was too busy.
const TRIES: usize = 4;

/// A krait program that runs; it ends with its test, also where that fails.
pub struct Krait {
    child: Child,
}

/// How a krait program ended and what it said.
#[derive(Debug)]
pub struct Ended {
    /// Exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Krait {
    /// Starts `krait` with arguments.
    pub fn start(arguments: &[impl AsRef<OsStr>]) -> Self {
        let mut command = Command::new(krait_program());
        command.args(arguments);
        Self::spawned(command)
    }

    fn spawned(mut command: Command) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self { child: command.spawn().expect("krait can be started") }
    }

    /// Starts `krait` with arguments and with a standard input to write to.
    pub fn start_with_input(arguments: &[impl AsRef<OsStr>]) -> (Self, ChildStdin) {
        let mut command = Command::new(krait_program());
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("krait can be started");
        let input = child.stdin.take().expect("piped");
        (Self { child }, input)
    }

    /// The next line of standard output, waited for.
    pub fn line(&mut self) -> String {
        let stdout = self.child.stdout.as_mut().expect("piped");
        let mut line = Vec::new();
        let mut byte = [0];
        while stdout.read(&mut byte).expect("a pipe can be read") == 1 && byte[0] != b'\n' {
            line.push(byte[0]);
        }
        String::from_utf8_lossy(&line).into_owned()
    }

    /// Process id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal.
    pub fn signal(&self, signal: Signal) {
        send(self.pid(), signal);
    }

    /// Waits for the end; a program that does not end within the patience is killed and fails the test.
    pub fn end(mut self, patience: Duration) -> Ended {
        let mut stdout = self.child.stdout.take().expect("piped");
        let mut stderr = self.child.stderr.take().expect("piped");
        let out = std::thread::spawn(move || read_all(&mut stdout));
        let err = std::thread::spawn(move || read_all(&mut stderr));
        let ended = wait_until(patience, || self.child.try_wait().expect("a child can be watched").is_some());
        if !ended {
            send(self.pid(), Signal::KILL);
        }
        let status = self.child.wait().expect("a child can be waited for");
        let (stdout, stderr) = (out.join().expect("read"), err.join().expect("read"));
        assert!(ended, "krait did not end within {patience:?}; it said:\n{stderr}");
        Ended { code: status.code(), stdout, stderr }
    }
}

impl Drop for Krait {
    /// The kernel tells every process of a chain whose supervisor is killed.
    fn drop(&mut self) {
        let _ended_already_is_fine = self.child.kill();
        let _no_zombie = self.child.wait();
    }
}

/// Starts krait, waits for its end.
impl Ended {
    /// Runs `krait` with arguments to its end.
    pub fn of(arguments: &[impl AsRef<OsStr>], patience: Duration) -> Self {
        Krait::start(arguments).end(patience)
    }

    /// The same with a standard input that holds a text and then ends.
    pub fn fed(arguments: &[impl AsRef<OsStr>], text: &str, patience: Duration) -> Self {
        let (krait, mut input) = Krait::start_with_input(arguments);
        // Whoever has ended by then reads nothing.
        let _it_may_have_ended = input.write_all(text.as_bytes());
        drop(input);
        krait.end(patience)
    }

    /// The same below a shell that has set a limit, as in `ulimit -n 200`.
    pub fn limited(limit: &str, arguments: &[impl AsRef<OsStr>], patience: Duration) -> Self {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit {limit}; exec \"$0\" \"$@\"")]).arg(krait_program()).args(arguments);
        Krait::spawned(shell).end(patience)
    }

    /// Runs a chain once more, a few times at most, where the machine was too busy for commands to come in time: the drives then stopped
    /// by themselves, as they must, and how the chain tracked meanwhile says nothing.
    pub fn in_time(recording: &str, once: impl Fn() -> Self) -> Self {
        for _ in 0..TRIES {
            let ended = once();
            if !ended.stderr.contains("too old to be trusted") {
                return ended;
            }
            std::fs::remove_file(recording).expect("a recording to make again");
        }
        panic!("in {TRIES} runs commands came too late: this machine is too busy to judge how the chain tracks")
    }

    /// The JSON object on standard output.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{e}: {}\n{}", self.stdout, self.stderr))
    }

    /// The one sentence on standard error that begins with `krait: `, after checking that it is one line.
    pub fn sentence(&self) -> &str {
        let mut sentences = self.stderr.lines().filter(|line| line.starts_with("krait: "));
        let first = sentences.next().unwrap_or_else(|| panic!("no sentence in:\n{}", self.stderr));
        assert_eq!(sentences.next(), None, "more than one sentence:\n{}", self.stderr);
        first
    }
}

/// Sends a signal to a process; one that has ended is no error.
pub(crate) fn send(pid: u32, signal: Signal) {
    if let Some(pid) = Pid::from_raw(pid.cast_signed()) {
        let _gone_is_fine = kill_process(pid, signal);
    }
}

fn read_all(stream: &mut impl Read) -> String {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).expect("a pipe can be read");
    String::from_utf8_lossy(&bytes).into_owned()
}
