//! The machine a measurement was made on: without it a latency is a number without a unit.

use serde::Serialize;
use std::fs;

/// What a reader must know of the machine to judge a figure.
#[derive(Clone, Debug, Serialize)]
pub struct Host {
    /// Processor model.
    pub cpu: String,
    /// Cores that this process may use.
    pub n_cores: usize,
    /// Memory, GB.
    pub memory_gb: f64,
    /// Kernel release and version.
    pub kernel: String,
    /// Preemption model, as the kernel says it in its version.
    pub preemption: &'static str,
    /// Frequency governor of the first core, or why there is none.
    pub governor: String,
    /// Clock source.
    pub clock_source: String,
    /// Whether a hypervisor says that this is a virtual machine.
    pub is_virtual: bool,
    /// Load averages over 1, 5 and 15 minutes when the measurement began.
    pub load_before: String,
    /// The same when it had ended.
    pub load_after: String,
    /// krait's version.
    pub krait: &'static str,
    /// UTC at which the measurement began.
    pub date: String,
}

impl Host {
    /// Looks at the machine; `date` is the time of the measurement.
    pub fn look(date: String) -> Self {
        let kernel = format!("{} {}", read("/proc/sys/kernel/osrelease"), read("/proc/sys/kernel/version"));
        let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let field = |key: &str| {
            let line = info.lines().find(|line| line.starts_with(key))?;
            line.split_once(':').map(|(_, value)| value.trim().to_owned())
        };
        let memory_kb = fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
            text.lines().find(|l| l.starts_with("MemTotal"))?.split_whitespace().nth(1)?.parse::<f64>().ok()
        });
        Self {
            cpu: field("model name").unwrap_or_else(|| "unknown".to_owned()),
            n_cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_gb: (memory_kb.unwrap_or(0.0) / 1e5).round() / 10.0,
            preemption: preemption_of(&kernel),
            kernel,
            governor: match read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").as_str() {
                "" => "none (the machine or its host chooses the frequency)".to_owned(),
                governor => governor.to_owned(),
            },
            clock_source: read("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
            is_virtual: field("flags").is_some_and(|flags| flags.split(' ').any(|flag| flag == "hypervisor")),
            load_before: load(),
            load_after: String::new(),
            krait: env!("CARGO_PKG_VERSION"),
            date,
        }
    }

    /// Notes the load at the end.
    pub fn note_end(&mut self) {
        self.load_after = load();
    }

    /// One line for a reader.
    pub fn line(&self) -> String {
        format!(
            "{}, {} {}cores, {} GB, Linux {} ({}), clock {}, governor {}, krait {}, {}; load average {} before, {} after",
            self.cpu,
            self.n_cores,
            if self.is_virtual { "virtual " } else { "" },
            self.memory_gb,
            self.kernel,
            self.preemption,
            self.clock_source,
            self.governor,
            self.krait,
            self.date,
            self.load_before,
            self.load_after
        )
    }
}

/// The preemption model that a kernel names in its version.
fn preemption_of(kernel: &str) -> &'static str {
    ["PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"]
        .into_iter()
        .find(|word| kernel.contains(word))
        .unwrap_or("no preemption named")
}

fn load() -> String {
    read("/proc/loadavg").split(' ').take(3).collect::<Vec<_>>().join(" ")
}

fn read(path: &str) -> String {
    fs::read_to_string(path).map(|text| text.trim().to_owned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_is_described() {
        let mut host = Host::look("2026-01-01T00:00:00Z".to_owned());
        host.note_end();
        assert!(host.n_cores > 0 && host.memory_gb > 0.0 && !host.kernel.trim().is_empty());
        assert!(host.line().contains(&host.load_after), "{}", host.line());
        assert_eq!(preemption_of("6.18 #1 SMP PREEMPT_RT"), "PREEMPT_RT");
    }
}
