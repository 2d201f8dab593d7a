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

/// Who begins anew when the model is exchanged: that is no restart.
const EXCHANGED: [Process; 4] = [Process::Resolve, Process::Compensate, Process::Estimate, Process::Record];
/// So far apart may the beginning of a stage and its first command with the new model be, ns.
const EXCHANGE_NS: i64 = 10_000_000_000;

/// Looks at processes again and again.
#[derive(Debug, Default)]
pub struct Processes {
    last: HashMap<u32, (i64, u64)>,
    places: HashMap<String, Place>,
    model_hash: Option<u64>,
    /// When another model was seen in the commands.
    exchanged_ns: Option<i64>,
}

/// Who has a name.
#[derive(Debug)]
struct Place {
    pids: BTreeSet<u32>,
    n_restarts: u32,
    /// The last restart that was counted and can still turn out to be an exchange.
    counted_ns: Option<i64>,
    /// Whether the newest exchange has been allowed for.
    is_allowed_for: bool,
}

impl Place {
    /// The model was exchanged: the restart that was counted just before was that.
    fn exchanged(&mut self, now_ns: i64) {
        let was_it = self.counted_ns.take().is_some_and(|then_ns| now_ns - then_ns < EXCHANGE_NS);
        self.n_restarts -= u32::from(was_it);
        self.is_allowed_for = was_it;
    }
}

impl Processes {
    /// Looks once, at an instant on the monotonic clock.
    ///
    /// `model_hash` is that of the newest command.
    pub fn look(&mut self, members: Vec<(String, u32)>, now_ns: i64, model_hash: Option<u64>) -> Vec<ProcessUsage> {
        let mut seen = HashMap::new();
        let mut usages = Vec::new();
        // One process may be in the instance more than once.
        let members: BTreeSet<_> = members.into_iter().collect();
        let mut pids: HashMap<&str, BTreeSet<u32>> = HashMap::new();
        for (name, pid) in &members {
            pids.entry(name).or_default().insert(*pid);
        }
        for (name, now) in pids {
            let new = || Place { pids: now.clone(), n_restarts: 0, counted_ns: None, is_allowed_for: true };
            let place = self.places.entry(name.to_owned()).or_insert_with(new);
            // Whoever comes beside the others takes nobody's place.
            let mut n_new = now.difference(&place.pids).count().min(place.pids.difference(&now).count()) as u32;
            let is_exchanging = self.exchanged_ns.is_some_and(|then_ns| now_ns - then_ns < EXCHANGE_NS);
            if n_new > 0 && is_exchanging && !place.is_allowed_for {
                (place.is_allowed_for, n_new) = (true, n_new - 1);
            }
            if n_new > 0 {
                place.counted_ns = Some(now_ns);
            }
            place.n_restarts += n_new;
            place.pids = now;
        }
        let is_other = |hash: &u64| Some(*hash) != self.model_hash;
        let before = model_hash.filter(is_other).and_then(|hash| self.model_hash.replace(hash));
        if before.is_some() {
            self.exchanged_ns = Some(now_ns);
            for process in EXCHANGED {
                if let Some(place) = self.places.get_mut(process.name()) {
                    place.exchanged(now_ns);
                }
            }
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
            let n_restarts = self.places.get(&name).map_or(0, |place| place.n_restarts);
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
            processes.look(members, 0, None).iter().map(|usage| usage.n_restarts).collect()
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

    #[test]
    fn an_exchange_of_the_model_is_no_restart_and_the_next_death_is_one() {
        let [a, b, c, d, e] = [1, 2, 3, 4, 5].map(|k| u32::MAX - k);
        let mut processes = Processes::default();
        let mut restarts = |compensate: u32, record: u32, now_s: i64, hash: u64| -> Vec<u32> {
            let members = vec![("compensate".to_owned(), compensate), ("record".to_owned(), record)];
            let seen = processes.look(members, now_s * 1_000_000_000, Some(hash));
            seen.iter().map(|usage| usage.n_restarts).collect()
        };
        assert_eq!(restarts(a, b, 0, 7), [0, 0]);
        assert_eq!(restarts(c, b, 1, 7), [1, 0], "another in its place, and the same model so far");
        assert_eq!(restarts(c, b, 2, 8), [0, 0], "it was the exchange");
        assert_eq!(restarts(c, d, 3, 8), [0, 0], "the recorder begins anew behind it");
        assert_eq!(restarts(c, e, 4, 8), [0, 1], "once");
        assert_eq!(restarts(a, e, 60, 8), [1, 1], "a death without another model");
    }
}
