//! What the kernel says about the processes of an instance: processor time and memory.

use krait_ipc::Process;
use serde::Serialize;
use std::collections::{BTreeSet, HashMap};
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
    pids: HashMap<String, (BTreeSet<u32>, u32)>,
}

impl Processes {
    /// Looks once, at an instant on the monotonic clock.
    pub fn look(&mut self, members: Vec<(String, u32)>, now_ns: i64) -> Vec<ProcessUsage> {
        let mut seen = HashMap::new();
        let mut usages = Vec::new();
        // One process may be in the instance more than once.
        let members: BTreeSet<_> = members.into_iter().collect();
        let mut pids: HashMap<&str, BTreeSet<u32>> = HashMap::new();
        for (name, pid) in &members {
            pids.entry(name).or_default().insert(*pid);
        }
        for (name, now) in pids {
            let (known, n_restarts) = self.pids.entry(name.to_owned()).or_insert_with(|| (now.clone(), 0));
            // Whoever comes beside the others takes nobody's place.
            *n_restarts += now.difference(known).count().min(known.difference(&now).count()) as u32;
            *known = now;
        }
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
            let n_restarts = self.pids.get(&name).map_or(0, |(_, n_restarts)| *n_restarts);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_restart_is_a_place_that_another_has_taken_and_two_of_one_name_are_none() {
        let mut processes = Processes::default();
        let mut restarts = |pids: &[(&str, u32)]| -> Vec<u32> {
            let members = pids.iter().map(|(name, pid)| ((*name).to_owned(), *pid)).collect();
            processes.look(members, 0).iter().map(|usage| usage.n_restarts).collect()
        };
        // Ids that no process has: nothing is read of them.
        let [a, b, c, d] = [u32::MAX, u32::MAX - 1, u32::MAX - 2, u32::MAX - 3];
        assert_eq!(restarts(&[("slave", a), ("console", b)]), [0, 0]);
        for _ in 0..3 {
            assert_eq!(restarts(&[("slave", a), ("console", b), ("console", c)]), [0, 0, 0], "one page server more");
        }
        assert_eq!(restarts(&[("console", b), ("console", c)]), [0, 0], "the slave is gone");
        assert_eq!(restarts(&[("slave", d), ("console", b), ("console", c)]), [1, 0, 0], "and another takes its place");
        assert_eq!(restarts(&[("slave", d), ("console", a), ("console", c)]), [1, 1, 1], "one server for another");
        assert_eq!(restarts(&[("slave", d), ("console", c)]), [1, 1]);
    }
}
