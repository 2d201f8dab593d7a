//! The real `krait` program inside the machine: started as a user starts it, and what it left behind.

use crate::spacemouse::wait_for;
use anyhow::{Context, ensure};
use krait_ipc::message::{Command as LineCommand, Health, OperatorInput, Setpoint, SlaveState};
use krait_ipc::{Process, Reasons};
use krait_record::Recording;
use krait_schema::Sample;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

const KRAIT: &str = "/bin/krait";
/// The user and group `nobody`.
const NOBODY: u32 = 65534;

/// Whom a program belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum User {
    /// May open every node.
    Root,
    /// May open what its permissions allow.
    Nobody,
}

/// How a program ended and what it said.
#[derive(Debug)]
pub struct VmEnded {
    /// Exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl VmEnded {
    /// Runs krait to its end.
    ///
    /// # Errors
    /// It could not be started.
    pub fn of(user: User, arguments: &[&str]) -> anyhow::Result<Self> {
        let output = command(user, arguments).output().context("starting krait")?;
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Ok(Self { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) })
    }

    /// The JSON on standard output.
    ///
    /// # Errors
    /// There is none.
    pub fn json(&self) -> anyhow::Result<serde_json::Value> {
        serde_json::from_str(&self.stdout).with_context(|| format!("no JSON, but {:?} {}", self.stdout, self.stderr))
    }
}

/// A chain on the live device that runs.
pub struct VmChain {
    child: Child,
    stdout: JoinHandle<String>,
    stderr: JoinHandle<()>,
    said: Arc<Mutex<String>>,
    recording: PathBuf,
}

impl VmChain {
    /// Starts `krait run --master hid` and waits until the chain runs; it ends by itself after `seconds`.
    ///
    /// # Errors
    /// It ended or did not come up.
    pub fn start(name: &str, user: User, seconds: f64) -> anyhow::Result<Self> {
        Self::start_with(name, user, seconds, &[])
    }

    /// The same with more arguments.
    ///
    /// # Errors
    /// It ended or did not come up.
    pub fn start_with(name: &str, user: User, seconds: f64, more: &[&str]) -> anyhow::Result<Self> {
        let recording = PathBuf::from(format!("/tmp/{name}.mcap"));
        let (path, seconds) = (recording.display().to_string(), seconds.to_string());
        let arguments =
            ["run", "--master", "hid", "--json", "--seconds", &seconds, "--recording", &path, "--instance", name];
        let mut child = command(user, &[&arguments[..], more].concat())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .context("starting krait")?;
        let mut out = child.stdout.take().context("piped")?;
        let err = child.stderr.take().context("piped")?;
        let said = Arc::new(Mutex::new(String::new()));
        let heard = Arc::clone(&said);
        let stdout = std::thread::Builder::new().spawn(move || read_all(&mut out))?;
        let stderr = std::thread::Builder::new().spawn(move || gather(BufReader::new(err), &heard))?;
        let mut chain = Self { child, stdout, stderr, said, recording };
        let mut is_over = false;
        wait_for("the chain's first line of progress", || {
            is_over = chain.child.try_wait().is_ok_and(|status| status.is_some());
            is_over || chain.said().contains("Running, compensation")
        })
        .with_context(|| chain.said())?;
        ensure!(!is_over, "the chain ended at once: {}", chain.said());
        Ok(chain)
    }

    /// Waits for the end.
    ///
    /// # Errors
    /// It could not be watched, or left no recording that can be read.
    pub fn end(self) -> anyhow::Result<(VmEnded, Journal)> {
        let (ended, journal, recording) = self.end_with_recording()?;
        std::fs::remove_file(&recording).context("removing a recording")?;
        Ok((ended, journal))
    }

    /// The same, and the recording stays where it is.
    ///
    /// # Errors
    /// As [`VmChain::end`].
    pub fn end_with_recording(mut self) -> anyhow::Result<(VmEnded, Journal, PathBuf)> {
        let status = self.child.wait().context("waiting for krait")?;
        let stdout = self.stdout.join().unwrap_or_default();
        ensure!(self.stderr.join().is_ok(), "the thread that listens to krait died");
        let stderr = self.said.lock().map_or_else(|_| String::new(), |said| said.clone());
        let ended = VmEnded { code: status.code(), stdout, stderr };
        let journal = Journal::read(&self.recording).with_context(|| ended.stderr.clone())?;
        Ok((ended, journal, self.recording))
    }

    fn said(&self) -> String {
        self.said.lock().map_or_else(|_| String::new(), |said| said.clone())
    }
}

/// What a chain recorded of itself, in order.
#[derive(Debug, Default)]
pub struct Journal {
    /// What the hand asked for.
    pub inputs: Vec<OperatorInput>,
    /// Where the snake should be.
    pub setpoints: Vec<Setpoint>,
    /// What the actuators were told.
    pub commands: Vec<LineCommand>,
    /// What the drives did.
    pub states: Vec<SlaveState>,
    /// How the master fared at its end.
    pub master: Option<Box<Health>>,
}

impl Journal {
    fn read(path: &Path) -> anyhow::Result<Self> {
        let mut journal = Self::default();
        for recorded in Recording::open(path)?.samples()? {
            match recorded?.sample {
                Sample::Input(input) => journal.inputs.push(input),
                Sample::Setpoint(setpoint) => journal.setpoints.push(setpoint),
                Sample::Command(command) => journal.commands.push(command),
                Sample::State(state) => journal.states.push(state),
                Sample::Health(Process::Master, health) => journal.master = Some(health),
                _ => {}
            }
        }
        Ok(journal)
    }

    /// The newest input at an instant (CLOCK_MONOTONIC, ns).
    pub fn input_at(&self, instant_ns: i64) -> Option<&OperatorInput> {
        self.inputs.iter().rfind(|input| input.sample_ns <= instant_ns)
    }

    /// The setpoints of a stretch of time.
    pub fn setpoints_within(&self, from_ns: i64, to_ns: i64) -> impl Iterator<Item = &Setpoint> + Clone {
        self.setpoints.iter().filter(move |setpoint| (from_ns..to_ns).contains(&setpoint.sample_ns))
    }

    /// How far the commanded bend ever was, within a stretch of time, from where it was at its beginning, deg.
    pub fn moved_deg(&self, from_ns: i64, to_ns: i64) -> f64 {
        let bends = self.setpoints_within(from_ns, to_ns).map(|setpoint| setpoint.bend_rad);
        let Some([x0, y0]) = bends.clone().next() else { return f64::NAN };
        bends.map(|[x, y]| (x - x0).hypot(y - y0)).fold(0.0, f64::max).to_degrees()
    }

    /// The reasons that the master has ever given.
    pub fn master_reasons(&self) -> Reasons {
        self.master.as_ref().map_or(Reasons::NONE, |health| Reasons::from_bits(health.reasons_ever))
    }
}

/// The process of the chain that a word of krait's command line names, and nobody else in this machine.
///
/// # Errors
/// There is none.
pub fn pid_of(verb: &str) -> anyhow::Result<String> {
    let entries = std::fs::read_dir("/proc").context("/proc")?.flatten();
    let mut pids = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let is_it = |pid: &String| {
        let line = std::fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        line.split('\0').nth(1) == Some(verb) && line.split('\0').any(|word| word == "--instance")
    };
    pids.find(is_it).with_context(|| format!("no process `{verb}`"))
}

/// Sends it a signal, by name.
///
/// # Errors
/// There is no such process, or it cannot be signalled.
pub fn signal(verb: &str, signal: &str) -> anyhow::Result<()> {
    let status = Command::new("/bin/kill").args([&format!("-{signal}"), &pid_of(verb)?]).status().context("kill")?;
    ensure!(status.success(), "process `{verb}` could not be signalled");
    Ok(())
}

/// krait as that user starts it.
pub fn command(user: User, arguments: &[&str]) -> Command {
    let mut command = Command::new(KRAIT);
    command.args(arguments);
    if user == User::Nobody {
        command.uid(NOBODY).gid(NOBODY);
    }
    command
}

/// Keeps the lines that come.
pub fn gather(lines: impl BufRead, heard: &Mutex<String>) {
    for line in lines.lines().map_while(Result::ok) {
        if let Ok(mut said) = heard.lock() {
            said.push_str(&line);
            said.push('\n');
        }
    }
}

fn read_all(stream: &mut impl Read) -> String {
    let mut bytes = Vec::new();
    match stream.read_to_end(&mut bytes) {
        Ok(_) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) => error.to_string(),
    }
}
