//! The private ground of the instances: room, permission, and what dead chains left behind.

use super::Finding;
use krait_ipc::{InstanceName, ground, grounds, resources_of};
use rustix::fs::{FlockOperation, StatVfs, flock, statvfs};
use std::collections::BTreeSet;
use std::fs::{self, File};

/// A chain with its recorder takes 13 MB; several of them, and a user's own tools, have room in this much, MB.
const NEEDED_MB: u64 = 128;

/// Whether channels can be made, and have room.
pub fn shared_memory() -> Finding {
    const NAME: &str = "shared memory";
    let probe = format!("doctor-{}", std::process::id());
    if let Err(error) = krait_ipc::Bus::open(&probe, "doctor") {
        let mend = format!("ls -ld {}; sudo mount -o remount,size=50% /dev/shm", ground().display());
        return Finding::bad(NAME, error.to_string(), "no process of krait can start", mend);
    }
    match statvfs(ground()) {
        Err(error) => {
            let mend = "sudo mount -t tmpfs -o mode=1777,size=50% tmpfs /dev/shm".to_owned();
            Finding::bad(NAME, format!("cannot be looked at: {error}"), "no process of krait can start", mend)
        }
        Ok(stat) => judge_room(free_mb(&stat)),
    }
}

fn free_mb(stat: &StatVfs) -> u64 {
    stat.f_bavail.saturating_mul(stat.f_frsize) / (1024 * 1024)
}

fn judge_room(free_mb: u64) -> Finding {
    const NAME: &str = "shared memory";
    let found = format!("{} is private, {free_mb} MB free", ground().display());
    if free_mb >= NEEDED_MB {
        return Finding::good(NAME, found, "the channels of a chain have room, and no other user reaches them");
    }
    let mend = "sudo mount -o remount,size=50% /dev/shm".to_owned();
    Finding::bad(NAME, found, "the channels of a chain may not have room, and it would not start", mend)
}

/// What chains that died left behind.
pub fn stale() -> Finding {
    const NAME: &str = "dead chains";
    let stale: Vec<InstanceName> = instances().into_iter().filter(is_dead).collect();
    if stale.is_empty() {
        return Finding::good(NAME, "none left anything behind".to_owned(), "no shared memory is wasted");
    }
    let n_files: usize = stale.iter().map(|name| resources_of(name).len()).sum();
    let names: Vec<&str> = stale.iter().map(InstanceName::as_str).collect();
    let remove = |name: &InstanceName| format!("rm -rf {} {}", name.folder().display(), name.lock_path().display());
    let mend: Vec<String> = stale.iter().map(remove).collect();
    Finding::advice(
        NAME,
        format!("{} ({n_files} files)", names.join(", ")),
        "memory is held until the next chain of the same name starts, which removes it",
        mend.join("; "),
    )
}

/// Every instance that has a file anywhere.
fn instances() -> Vec<InstanceName> {
    let entries = grounds().iter().filter_map(|ground| fs::read_dir(ground).ok()).flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().trim_end_matches(".lock").to_owned());
    let names: BTreeSet<String> = names.collect();
    names.iter().filter_map(|name| InstanceName::new(name).ok()).collect()
}

/// Whether nobody is in an instance that has left something: its members share a lock that the kernel releases.
fn is_dead(name: &InstanceName) -> bool {
    match File::options().read(true).append(true).open(name.lock_path()) {
        // Let go of at once, with the file.
        Ok(lock) => flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok(),
        Err(_) => !resources_of(name).is_empty(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Grade;

    #[test]
    fn little_room_is_bad_and_says_how_to_make_more() {
        assert_eq!(judge_room(4096).verdict, Grade::Good);
        let little = judge_room(10);
        assert_eq!(little.verdict, Grade::Bad);
        assert!(little.mend.is_some_and(|mend| mend.contains("remount")));
    }

    #[test]
    fn a_living_instance_is_not_dead_and_one_without_members_is() {
        // Not the name that the doctor himself takes, whom another test asks at the same time.
        let name = format!("doctor-test-{}", std::process::id());
        let bus = krait_ipc::Bus::open(&name, "test").expect("bus");
        let instance = bus.instance().clone();
        assert!(instances().contains(&instance) && !is_dead(&instance));
        drop(bus);
        let folder = instance.folder();
        fs::create_dir(&folder).expect("made");
        fs::write(folder.join("left"), [0]).expect("a file as a killed process leaves it");
        assert!(instances().contains(&instance) && is_dead(&instance));
        fs::remove_dir_all(&folder).expect("removed");
    }
}
