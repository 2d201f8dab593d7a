//! Ends the machine where one of its parts does not end, and says where every process waits; without it the rig would stand still until its host's limit.

use std::fs;
use std::sync::mpsc;
use std::time::Duration;

/// What no part takes, of the machine's own time: the longest sends for 90 s.
const LIMIT: Duration = Duration::from_secs(300);

/// Does a part; where it does not end in time, the part and the machine's verdict are FAIL, and this process ends.
pub fn watched<T>(rig: &'static str, name: &str, part: impl FnOnce() -> T) -> T {
    let (ended, end) = mpsc::channel::<()>();
    let name = name.to_owned();
    std::thread::spawn(move || {
        if end.recv_timeout(LIMIT) == Err(mpsc::RecvTimeoutError::Timeout) {
            println!(
                "{rig} {name} FAIL it has not ended in {} s of the machine's time; where each thread waits:",
                LIMIT.as_secs()
            );
            threads().iter().for_each(|line| println!("{rig} | {line}"));
            println!("{rig} verdict FAIL");
            std::process::exit(1);
        }
    });
    let done = part();
    drop(ended);
    done
}

/// Every thread of every program: number, name, state and what it waits for in the kernel.
fn threads() -> Vec<String> {
    let numbered = |folder: &str| -> Vec<String> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries
            .filter_map(|entry| entry.file_name().into_string().ok())
            .filter(|name| name.parse::<u32>().is_ok())
            .collect()
    };
    let read = |path: String| fs::read_to_string(path).unwrap_or_default();
    let mut lines = Vec::new();
    for process in numbered("/proc") {
        let command = read(format!("/proc/{process}/cmdline")).replace('\0', " ");
        // The kernel's own threads have none.
        if command.is_empty() {
            continue;
        }
        lines.push(format!("process {process}: {command}"));
        for thread in numbered(&format!("/proc/{process}/task")) {
            let of = format!("/proc/{process}/task/{thread}");
            let state =
                read(format!("{of}/stat")).rsplit(')').next().unwrap_or_default().chars().take(2).collect::<String>();
            lines.push(format!(
                "  thread {thread} {}{state} {}",
                read(format!("{of}/comm")).trim(),
                read(format!("{of}/wchan"))
            ));
        }
    }
    lines
}
