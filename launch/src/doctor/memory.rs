//! Shared memory and the instances' files: room, permission, and what dead chains left behind.

use super::Finding;
use krait_ipc::{InstanceName, resources_of};
use rustix::fs::{FlockOperation, StatVfs, flock, statvfs};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::Path;

const SHARED_MEMORY: &str = "/dev/shm";
const FOLDER: &str = "/tmp/krait";
/// A chain with its recorder needs this much room in shared memory, MB, several times over.
const NEEDED_MB: u64 = 256;

/// Whether shared memory can be written, and has room.
pub fn shared_memory() -> Finding {
    const NAME: &str = "/dev/shm";
    let probe = Path::new(SHARED_MEMORY).join(format!("krait-doctor-{}", std::process::id()));
    let written = fs::write(&probe, [1]);
    let _gone_is_fine = fs::remove_file(&probe);
    if let Err(error) = written {
        let mend = "sudo mount -t tmpfs -o mode=1777,size=50% tmpfs /dev/shm".to_owned();
        return Finding::bad(NAME, format!("cannot be written: {error}"), "no process of krait can start", mend);
    }
    match statvfs(SHARED_MEMORY) {
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
    const NAME: &str = "/dev/shm";
    let found = format!("writable, {free_mb} MB free");
    if free_mb >= NEEDED_MB {
        return Finding::good(NAME, found, "the channels of a chain have room");
    }
    let mend = "sudo mount -o remount,size=50% /dev/shm".to_owned();
    Finding::bad(NAME, found, "the channels of a chain may not have room, and it would not start", mend)
}

/// Whether the folder of the instances can be written.
pub fn folder() -> Finding {
    const NAME: &str = "/tmp/krait";
    let folder = Path::new(FOLDER);
    if !folder.exists() {
        return Finding::good(NAME, "not there yet".to_owned(), "the first chain makes it");
    }
    let probe = folder.join(format!("doctor-{}", std::process::id()));
    let written = fs::write(&probe, [1]);
    let _gone_is_fine = fs::remove_file(&probe);
    match written {
        Ok(()) => Finding::good(NAME, "writable".to_owned(), "instances can keep their small files"),
        Err(error) => {
            let mend = "sudo chmod 1777 /tmp/krait".to_owned();
            Finding::bad(NAME, format!("cannot be written: {error}"), "no process of krait can start", mend)
        }
    }
}

/// What chains that died left behind.
pub fn stale() -> Finding {
    const NAME: &str = "dead chains";
    let stale: Vec<String> = instances().into_iter().filter(|name| is_dead(name)).collect();
    if stale.is_empty() {
        return Finding::good(NAME, "none left anything behind".to_owned(), "no shared memory is wasted");
    }
    let count = |name: &String| InstanceName::new(name).map_or(0, |name| resources_of(&name).len());
    let n_files: usize = stale.iter().map(count).sum();
    let mend: Vec<String> = stale
        .iter()
        .map(|name| format!("rm -rf /dev/shm/krait.{name}.* {FOLDER}/{name} {FOLDER}/{name}.lock"))
        .collect();
    Finding::advice(
        NAME,
        format!("{} ({n_files} files)", stale.join(", ")),
        "memory is held until the next chain of the same name starts, which removes it",
        mend.join("; "),
    )
}

/// Names of every instance that has a file anywhere.
fn instances() -> BTreeSet<String> {
    let names_in = |folder: &str, name_of: fn(&str) -> Option<&str>| {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| name_of(&entry.file_name().to_string_lossy()).map(str::to_owned));
        names.collect::<Vec<_>>()
    };
    let mut names = names_in(SHARED_MEMORY, |file| file.strip_prefix("krait.")?.split('.').next());
    names.extend(names_in(FOLDER, |file| Some(file.strip_suffix(".lock").unwrap_or(file))));
    names.into_iter().filter(|name| InstanceName::new(name).is_ok()).collect()
}

/// Whether nobody is in an instance that has left something: its members share a lock that the kernel releases.
fn is_dead(name: &str) -> bool {
    let Ok(name) = InstanceName::new(name) else { return false };
    let has_files = !resources_of(&name).is_empty();
    match File::options().read(true).append(true).open(name.folder().with_extension("lock")) {
        // Let go of at once, with the file.
        Ok(lock) => flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok(),
        Err(_) => has_files,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn little_room_is_bad_and_says_how_to_make_more() {
        assert_eq!(judge_room(4096).verdict, Verdict::Good);
        let little = judge_room(10);
        assert_eq!(little.verdict, Verdict::Bad);
        assert!(little.mend.is_some_and(|mend| mend.contains("remount")));
    }

    #[test]
    fn a_living_instance_is_not_dead_and_one_without_members_is() {
        let name = format!("doctor-{}", std::process::id());
        let bus = krait_ipc::Bus::open(&name, "test").expect("bus");
        assert!(instances().contains(&name) && !is_dead(&name));
        drop(bus);
        let left = Path::new(SHARED_MEMORY).join(format!("krait.{name}.left"));
        fs::write(&left, [0]).expect("a file as a killed process leaves it");
        assert!(instances().contains(&name) && is_dead(&name));
        fs::remove_file(&left).expect("removed");
    }
}
