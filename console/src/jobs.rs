//! Work that takes a while, as children of low priority: the lab's commands with the same code and the same answers.
//!
//! One job at a time; cancelling it ends its process. What is asked for is built here from names that the lists hold; no
//! text of a page becomes an option or a path.

use serde::Serialize;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Bytes of an answer.
const MOST_ANSWER_BYTES: u64 = 16 * 1024 * 1024;
/// Characters of a line of progress.
const MOST_SAID: usize = 300;

/// How a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum JobStage {
    /// At work.
    Running,
    /// Its answer is there.
    Done,
    /// It ended without an answer and has said why.
    Failed,
    /// Somebody ended it.
    Cancelled,
}

/// What a page is told of a job.
#[derive(Clone, Debug, Serialize)]
pub struct JobReport {
    /// Counts jobs from 1.
    pub id: u64,
    /// The command, as it could be typed.
    pub command: String,
    /// How it stands.
    pub stage: JobStage,
    /// Its last line of progress, or its sentence of failure.
    pub said: String,
    /// Its answer.
    pub answer: Option<serde_json::Value>,
}

struct Job {
    report: JobReport,
    child: Option<Child>,
}

/// Starts jobs, one at a time.
pub struct Jobs {
    program: PathBuf,
    current: Arc<Mutex<Option<Job>>>,
}

impl Jobs {
    /// Jobs are subcommands of this program.
    pub fn new(program: PathBuf) -> Self {
        Self { program, current: Arc::default() }
    }

    /// Starts a subcommand.
    ///
    /// # Errors
    /// One sentence: another job is at work, or the program cannot be started.
    pub fn start(&self, arguments: &[String]) -> Result<JobReport, String> {
        let mut current = lock(&self.current);
        if current.as_ref().is_some_and(|job| job.report.stage == JobStage::Running) {
            return Err("Another job is at work; cancel it, or wait for it.".to_owned());
        }
        let mut child = giving_way(&self.program)
            .args(arguments)
            .env(crate::STAGES, "1")
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("The job cannot be started: {error}."))?;
        let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
        let id = current.as_ref().map_or(0, |job| job.report.id) + 1;
        let command = format!("krait {}", arguments.join(" "));
        let report = JobReport { id, command, stage: JobStage::Running, said: String::new(), answer: None };
        *current = Some(Job { report: report.clone(), child: Some(child) });
        drop(current);
        let listener = stderr.map(|stderr| {
            let slot = Arc::clone(&self.current);
            std::thread::spawn(move || listen(stderr, &slot, id))
        });
        if let Some(stdout) = stdout {
            let slot = Arc::clone(&self.current);
            std::thread::spawn(move || finish(stdout, listener, &slot, id));
        }
        Ok(report)
    }

    /// The job that runs or was the last.
    pub fn report(&self) -> Option<JobReport> {
        lock(&self.current).as_ref().map(|job| job.report.clone())
    }

    /// Ends the job that runs.
    pub fn cancel(&self) {
        let mut current = lock(&self.current);
        if let Some(job) = current.as_mut().filter(|job| job.report.stage == JobStage::Running) {
            job.report.stage = JobStage::Cancelled;
            if let Some(Err(error)) = job.child.as_mut().map(Child::kill) {
                tracing::warn!(%error, "a job could not be ended");
            }
        }
    }
}

impl Drop for Jobs {
    fn drop(&mut self) {
        self.cancel();
    }
}

/// krait itself, giving way to every other process, without input, whose output is read.
pub(crate) fn giving_way(program: &Path) -> Command {
    let mut command = Command::new(program);
    command.env(crate::GIVES_WAY, "1").stdin(Stdio::null()).stdout(Stdio::piped());
    command
}

fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps the last line that a job has said.
fn listen(stderr: ChildStderr, slot: &Mutex<Option<Job>>, id: u64) {
    for line in BufReader::new(stderr).split(b'\n').map_while(Result::ok) {
        let line = String::from_utf8_lossy(&line);
        let last = line.rsplit('\r').next().unwrap_or_default().trim();
        let plain: String = last.chars().filter(|c| !c.is_control()).take(MOST_SAID).collect();
        if let Some(job) = lock(slot).as_mut().filter(|job| job.report.id == id && !plain.is_empty()) {
            job.report.said = plain;
        }
    }
}

/// Takes the answer and how the process ended.
fn finish(stdout: ChildStdout, listener: Option<JoinHandle<()>>, slot: &Mutex<Option<Job>>, id: u64) {
    let mut text = Vec::new();
    let read = stdout.take(MOST_ANSWER_BYTES).read_to_end(&mut text);
    let Some(mut child) = lock(slot).as_mut().filter(|job| job.report.id == id).and_then(|job| job.child.take()) else {
        return;
    };
    let ended = child.wait();
    // Its last line on standard error is its sentence of failure.
    if listener.is_some_and(|listener| listener.join().is_err()) {
        tracing::warn!("what a job said was lost");
    }
    let answer = read.ok().and_then(|_| serde_json::from_slice(&text).ok());
    if let Some(job) = lock(slot).as_mut().filter(|job| job.report.id == id && job.report.stage == JobStage::Running) {
        // Exit code 1 is an answer too: work that was done and found a failure; and 2 with an answer, which has the refusal.
        let has_answer = answer.is_some() && ended.is_ok_and(|status| matches!(status.code(), Some(0..=2)));
        job.report.stage = if has_answer { JobStage::Done } else { JobStage::Failed };
        job.report.answer = answer;
    }
}
