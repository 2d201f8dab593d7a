//! The kernel: how it preempts, what clock it has, how it drives the cores.

use super::{Finding, read};

/// A chain's four processes share one; with fewer than this everything else shares it too.
const CORES_OF_A_CHAIN: usize = 2;

/// How the kernel lets one process interrupt another.
pub fn preemption() -> Finding {
    judge_preemption(
        read("/sys/kernel/realtime").as_deref() == Some("1"),
        &read("/proc/sys/kernel/version").unwrap_or_default(),
        read("/sys/kernel/debug/sched/preempt").as_deref(),
    )
}

fn judge_preemption(is_realtime: bool, version: &str, mode: Option<&str>) -> Finding {
    const NAME: &str = "kernel preemption";
    const MEANING: &str = "without PREEMPT_RT the kernel's own work can hold up a woken process for milliseconds";
    if is_realtime || version.contains("PREEMPT_RT") {
        return Finding::good(NAME, "PREEMPT_RT".to_owned(), "a woken process of high priority runs at once");
    }
    let mode = mode.map_or_else(String::new, |mode| format!(", mode {mode}"));
    let kind = ["PREEMPT_DYNAMIC", "PREEMPT"].into_iter().find(|word| version.contains(word));
    let found = format!("{}{mode}", kind.unwrap_or("no preemption"));
    let mend = "install a PREEMPT_RT kernel (Debian: `apt install linux-image-rt-amd64`), or boot with `preempt=full`";
    Finding::advice(NAME, found, MEANING, mend.to_owned())
}

/// How the frequency of the cores is chosen.
pub fn governor() -> Finding {
    const NAME: &str = "frequency governor";
    match read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor") {
        None => {
            Finding::good(NAME, "none".to_owned(), "the machine or its host chooses the frequency; nothing to set here")
        }
        Some(governor) if governor == "performance" => {
            Finding::good(NAME, governor, "the cores do not have to speed up after a sleep")
        }
        Some(governor) => Finding::advice(
            NAME,
            governor,
            "a core that slept starts slowly, which adds tens of microseconds to each wake-up",
            "cpupower frequency-set --governor performance".to_owned(),
        ),
    }
}

/// Where the time comes from.
pub fn clock_source() -> Finding {
    const NAME: &str = "clock source";
    let found = read("/sys/devices/system/clocksource/clocksource0/current_clocksource").unwrap_or_default();
    // The ones that a process reads without a system call.
    if ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"].contains(&found.as_str()) {
        return Finding::good(NAME, found, "a stamp costs some tens of nanoseconds");
    }
    let mend = "boot with `clocksource=tsc tsc=reliable`, if the machine's TSC is stable".to_owned();
    let found = if found.is_empty() { "unknown".to_owned() } else { found };
    Finding::advice(NAME, found, "a stamp may cost a system call, about a microsecond, eight times a sample", mend)
}

/// How many cores this process may use.
pub fn cores() -> Finding {
    const NAME: &str = "cores";
    let n_cores = std::thread::available_parallelism().map_or(1, usize::from);
    let isolated = read("/sys/devices/system/cpu/isolated").filter(|list| !list.is_empty());
    let found = match &isolated {
        Some(list) => format!("{n_cores}; isolated: {list}"),
        None => format!("{n_cores}; none isolated"),
    };
    if isolated.is_some() {
        let meaning = "a chain that `[realtime] cores` puts on an isolated core shares it with nothing";
        return Finding::good(NAME, found, meaning);
    }
    if n_cores >= CORES_OF_A_CHAIN {
        let meaning = "a chain has one core, and recorder, camera and console have the others";
        return Finding::good(NAME, found, meaning);
    }
    let mend = "use a machine of two cores or more; on it isolate one with `isolcpus=` at boot, and name it in `[realtime] cores`";
    Finding::advice(NAME, found, "a chain shares its one core with everything else", mend.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Grade;

    #[test]
    fn a_realtime_kernel_is_good_and_others_are_named() {
        assert_eq!(judge_preemption(false, "#1 SMP PREEMPT_RT Debian", None).verdict, Grade::Good);
        assert_eq!(judge_preemption(true, "#1 SMP", None).verdict, Grade::Good);
        let other = judge_preemption(false, "#1 SMP PREEMPT_DYNAMIC", Some("none (voluntary) full"));
        assert_eq!(
            (other.verdict, other.found.as_str()),
            (Grade::Advice, "PREEMPT_DYNAMIC, mode none (voluntary) full")
        );
    }
}
