//! What the kernel says about the processes of an instance: processor time and memory.

use krait_ipc::Process;
use serde::Serialize;
use std::collections::HashMap;
use std::fs;

/// A process of the instance, as the kernel sees it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProcessUsage {
    /// Name in the instance.
    pub name: String,
    /// Process id.
    pub pid: u32,
    /// Part of one core since the last look, percent; null at the first look.
    pub cpu_percent: Option<f64>,
    /// Memory in use, bytes; null where the kernel does not say.
    pub memory_bytes: Option<u64>,
    /// How often another process has taken this one's place since the console began.
    pub n_restarts: u32,
}

/// Looks at processes again and again.
#[derive(Debug, Default)]
pub struct Processes {
    last: HashMap<u32, (i64, u64)>,
    pids: HashMap<String, (u32, u32)>,
}

impl Processes {
    /// Looks once, at an instant on the monotonic clock.
    pub fn look(&mut self, members: Vec<(String, u32)>, now_ns: i64) -> Vec<ProcessUsage> {
        let mut seen = HashMap::new();
        let mut usages = Vec::new();
        // One process may be in the instance more than once.
        let members: std::collections::BTreeSet<_> = members.into_iter().collect();
        for (name, pid) in members {
            let cpu_ns = cpu_ns(pid);
            let before = self.last.get(&pid);
            let cpu_percent = match (cpu_ns, before) {
                (Some(cpu_ns), Some((then_ns, then_cpu_ns))) if now_ns > *then_ns => {
                    Some(100.0 * cpu_ns.saturating_sub(*then_cpu_ns) as f64 / (now_ns - then_ns) as f64)
                }
                _ => None,
            };
            if let Some(cpu_ns) = cpu_ns {
                seen.insert(pid, (now_ns, cpu_ns));
            }
            let known = self.pids.entry(name.clone()).or_insert((pid, 0));
            if known.0 != pid {
                *known = (pid, known.1 + 1);
            }
            let n_restarts = known.1;
            usages.push(ProcessUsage { name, pid, cpu_percent, memory_bytes: memory_bytes(pid), n_restarts });
        }
        self.last = seen;
        usages.sort_by(|a, b| order(&a.name).cmp(&order(&b.name)).then(a.pid.cmp(&b.pid)));
        usages
    }
}

/// The way of a sample, then those beside it.
fn order(name: &str) -> usize {
    let of_the_chain = Process::from_name(name).map(|process| process as usize);
    of_the_chain.unwrap_or(if name == "launch" { Process::ALL.len() } else { Process::ALL.len() + 1 })
}

/// Processor time of all threads; the file of the process itself counts its main thread alone.
fn cpu_ns(pid: u32) -> Option<u64> {
    let threads = fs::read_dir(format!("/proc/{pid}/task")).ok()?;
    let of_thread = |path: std::path::PathBuf| -> Option<u64> {
        fs::read_to_string(path.join("schedstat")).ok()?.split_whitespace().next()?.parse().ok()
    };
    Some(threads.flatten().filter_map(|thread| of_thread(thread.path())).sum())
}

fn memory_bytes(pid: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = text.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}
