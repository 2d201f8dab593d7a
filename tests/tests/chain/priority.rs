//! The priority that a chain has by itself: before ordinary work where its user has the right and another core is left, and none where not.

use core::time::Duration;
use krait_ipc::{Priority, Realtime, allowed_cores};
use krait_tests::{Krait, TempFolder, instance_name, is_moving, processes_of, stat_number, wait_for};
use rustix::process::Signal;
use rustix::thread::{CpuSet, sched_setaffinity};

const PATIENCE: Duration = Duration::from_secs(120);
/// Field of a process's `stat`, proc(5).
const RT_PRIORITY: usize = 40;

/// SCHED_FIFO priorities of master, resolve, compensate and slave; 0: time sharing.
fn priorities(instance: &str) -> [i64; 4] {
    let processes = processes_of(instance);
    ["master", "resolve", "compensate", "slave"].map(|name| {
        let (_, pid) = processes.iter().find(|(own, _)| own == name).expect("it runs");
        stat_number(*pid, RT_PRIORITY)
    })
}

/// What a chain has by itself, started by a thread that may use all cores or one.
fn priorities_on(cores: &[usize]) -> [i64; 4] {
    let (instance, folder) = (instance_name("priority"), TempFolder::new("priority"));
    let recording = folder.file("run.mcap");
    let mut set = CpuSet::new();
    cores.iter().for_each(|core| set.set(*core));
    let krait = std::thread::scope(|scope| {
        let start = || {
            sched_setaffinity(None, &set).expect("own cores");
            Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording])
        };
        scope.spawn(start).join().expect("it starts")
    });
    wait_for(&instance, "moving", is_moving);
    let found = priorities(&instance);
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    found
}

#[test]
fn a_chain_goes_first_by_itself_where_it_may_and_leaves_a_core_to_others() {
    let asked = Realtime { priority: Priority::Fixed(Priority::BY_ITSELF), ..Realtime::ORDINARY };
    let may = std::thread::scope(|scope| scope.spawn(|| asked.apply(3, "")).join()).expect("tried").is_empty();
    let cores = allowed_cores();
    let expected = if may && cores.len() > 1 { [37, 38, 39, 40] } else { [0; 4] };
    println!("the right to a priority: {may}; cores: {}", cores.len());
    assert_eq!(priorities_on(&cores), expected);
    assert_eq!(priorities_on(&cores[..1]), [0; 4], "on one core everybody else would wait");
}
