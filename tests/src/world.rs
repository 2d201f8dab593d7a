//! The machine around a test: names, folders, processes, patience.

use core::sync::atomic::{AtomicU32, Ordering};
use core::time::Duration;
use krait_ipc::clock;
use std::io::{PipeReader, Write};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

/// An instance name that no other test and no other run has.
pub fn instance_name(what: &str) -> String {
    static N_NAMES: AtomicU32 = AtomicU32::new(0);
    format!("{what}-{}-{}", std::process::id(), N_NAMES.fetch_add(1, Ordering::Relaxed))
}

/// A number in a process's `stat`, by its number in proc(5), from the third on: the second, its name, may hold anything.
pub fn stat_number(pid: u32, field: usize) -> i64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).expect("it lives");
    let behind_name = stat.rsplit_once(')').expect("a name").1;
    behind_name.split_whitespace().nth(field - 3).and_then(|number| number.parse().ok()).expect("a number")
}

/// What a process has computed so far, in ticks of 10 ms.
pub fn cpu_ticks(pid: u32) -> f64 {
    (stat_number(pid, 14) + stat_number(pid, 15)) as f64
}

/// A folder that goes with the test.
pub struct TempFolder(PathBuf);

impl TempFolder {
    /// A new, empty folder.
    pub fn new(what: &str) -> Self {
        let path = std::env::temp_dir().join(format!("krait-test-{}", instance_name(what)));
        std::fs::create_dir_all(&path).expect("a folder can be made");
        Self(path)
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    /// Its own path.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for TempFolder {
    fn drop(&mut self) {
        let _kept_if_it_cannot_be_removed = std::fs::remove_dir_all(&self.0);
    }
}

/// A configuration with three serial drives that nobody has, in a file of the folder: to be refused before anything moves.
pub fn real_drives(folder: &TempFolder) -> String {
    let path = folder.file("real-drives.toml");
    let actuators: String =
        (1..=3).map(|id| format!("[[slave.drive.actuator]]\nid = {id}\nzero_count = 2048\n")).collect();
    let text = format!("[slave.drive]\nkind = \"sts3215\"\nport = \"/dev/null\"\n{actuators}");
    std::fs::write(&path, text).expect("written");
    path
}

/// A pipe that is full and that nobody reads: the write end blocks whoever writes to it, as a terminal after Ctrl-S does.
pub fn held_terminal() -> (PipeReader, OwnedFd) {
    let (read_end, write_end) = std::io::pipe().expect("a pipe");
    let filled = write_end.try_clone().expect("cloned");
    rustix::fs::fcntl_setfl(&filled, rustix::fs::OFlags::NONBLOCK).expect("set");
    let mut filler = std::fs::File::from(OwnedFd::from(filled));
    while filler.write(&[b'.'; 4096]).is_ok() {}
    rustix::fs::fcntl_setfl(&filler, rustix::fs::OFlags::empty()).expect("set back");
    (read_end, write_end.into())
}

/// Name of the subcommand and process id of every living process that was started for an instance.
pub fn processes_of(instance: &str) -> Vec<(String, u32)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc").expect("/proc").flatten() {
        let Some(pid) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
        let Ok(line) = std::fs::read(entry.path().join("cmdline")) else { continue };
        let words: Vec<String> = line.split(|b| *b == 0).map(|w| String::from_utf8_lossy(w).into_owned()).collect();
        let ours = words.windows(2).any(|pair| pair[0] == "--instance" && pair[1] == instance);
        if ours && words[0].ends_with("krait") {
            found.push((words[1].clone(), pid));
        }
    }
    found.sort();
    found
}

/// Says what whoever runs the tests has to see. A test's output is kept back while it holds; this is not, because it does not go by the
/// macros that print.
pub fn say_aloud(text: &str) {
    let _nobody_to_hear_is_fine = writeln!(std::io::stderr(), "{text}");
}

/// The process id of a process of an instance, if it runs.
pub fn pid_of(instance: &str, process: &str) -> Option<u32> {
    processes_of(instance).into_iter().find(|(name, _)| name == process).map(|(_, pid)| pid)
}

/// Looks every 10 ms whether something has become true.
pub fn wait_until(patience: Duration, mut done: impl FnMut() -> bool) -> bool {
    let deadline_ns = clock::monotonic_ns() + patience.as_nanos() as i64;
    loop {
        if done() {
            return true;
        }
        if clock::monotonic_ns() > deadline_ns {
            return false;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}
