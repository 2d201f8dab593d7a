//! What `krait doctor` finds on this machine, without its measurement, for the page: a child that gives way and ends at once.

use crate::jobs::giving_way;
use core::time::Duration;
use krait_ipc::clock;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;

/// It looks at some files of the kernel; on a busy machine that takes its time.
const PATIENCE_S: i64 = 20;
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// What the page shows of an answer.
#[derive(Debug, Deserialize, Serialize)]
pub(crate) struct Findings {
    findings: Vec<Finding>,
}

#[derive(Debug, Deserialize, Serialize)]
struct Finding {
    name: String,
    verdict: Grade,
    found: String,
    meaning: String,
    mend: Option<String>,
}

/// In the order in which they are shown: the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
enum Grade {
    Bad,
    Advice,
    Good,
}

/// Asks the command; blocks until it has ended.
///
/// # Errors
/// One sentence: it did not start, took too long, or gave no answer.
pub(crate) fn findings(program: &Path) -> Result<Findings, String> {
    let mut command = giving_way(program);
    let child = command.args(["doctor", "--seconds", "0", "--json"]).stderr(Stdio::null()).spawn();
    let child = child.map_err(|error| format!("krait doctor cannot be started: {error}; ask again."))?;
    let ended = ended(child)?;
    worst_first(&ended)
        .map_err(|error| format!("krait doctor gave no answer that can be read: {error}; try it in a terminal."))
}

/// What it printed. Its answer is far smaller than what a pipe holds, so it never waits for a reader.
fn ended(mut child: Child) -> Result<Vec<u8>, String> {
    let until_ns = clock::monotonic_ns().saturating_add(PATIENCE_S * 1_000_000_000);
    loop {
        match child.try_wait() {
            Ok(Some(_)) => break,
            Ok(None) if clock::monotonic_ns() < until_ns => sleep(LOOK_EVERY),
            _ => {
                let _ended_is_fine = child.kill();
                let _reaped = child.wait();
                return Err(format!("krait doctor has not ended within {PATIENCE_S} s; ask again."));
            }
        }
    }
    child.wait_with_output().map(|output| output.stdout).map_err(|error| format!("krait doctor: {error}; ask again."))
}

fn worst_first(text: &[u8]) -> serde_json::Result<Findings> {
    let mut all: Findings = serde_json::from_slice(text)?;
    all.findings.sort_by_key(|finding| finding.verdict);
    Ok(all)
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;

    #[test]
    fn the_worst_comes_first_and_the_rest_keeps_its_order() {
        let own = |name: &str, verdict: &str| {
            format!(r#"{{"name":"{name}","verdict":"{verdict}","found":"f","meaning":"m","mend":null}}"#)
        };
        let all = [own("a", "good"), own("b", "advice"), own("c", "bad"), own("d", "advice")].join(",");
        let sorted = worst_first(format!(r#"{{"findings":[{all}],"wake_up":[]}}"#).as_bytes()).expect("an answer");
        let names: Vec<&str> = sorted.findings.iter().map(|finding| finding.name.as_str()).collect();
        assert_eq!(names, ["c", "b", "d", "a"]);
        assert!(worst_first(b"nonsense").is_err());
    }
}
