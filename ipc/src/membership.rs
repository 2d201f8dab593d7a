//! Who is in an instance: a shared file lock that the kernel releases even for a killed process, so that the last one out,
//! or the first one in after a crash, knows that nobody is left and can remove every file of the instance.

use crate::ground::prepare;
use crate::{InstanceName, clock};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use rustix::fs::{FlockOperation, flock};
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};

/// Whoever removes the files of the dead is done after milliseconds; a lock that is held for longer is held in error, ns.
const LOCK_PATIENCE_NS: i64 = 5_000_000_000;
/// How often a lock that is held is tried again.
const TRY_EVERY: Duration = Duration::from_millis(5);

/// Held by everything that uses an instance; the last one to let go removes what is left.
#[derive(Debug)]
pub(crate) struct Membership {
    instance: InstanceName,
    lock: File,
}

impl Membership {
    /// Joins an instance. If nobody is in it, whatever it left behind belonged to the dead and is removed first.
    ///
    /// # Errors
    /// The ground is not private, the lock stayed held for [`LOCK_PATIENCE_NS`], or `stop` was set while it was.
    pub(crate) fn join(instance: &InstanceName, stop: &AtomicBool) -> io::Result<Self> {
        prepare(instance.ground())?;
        let give_up_ns = clock::monotonic_ns() + LOCK_PATIENCE_NS;
        let lock = loop {
            let lock = open_lock(instance)?;
            if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok() && is_current(instance, &lock) {
                remove_files_of(instance);
            }
            let is_in = flock(&lock, FlockOperation::NonBlockingLockShared).is_ok();
            // The last member may have removed the lock file while this process waited for it.
            if is_in && is_current(instance, &lock) {
                break lock;
            }
            wait_a_little(instance, give_up_ns, stop)?;
        };
        prepare(&instance.folder())?;
        Ok(Self { instance: instance.clone(), lock })
    }
}

impl Drop for Membership {
    fn drop(&mut self) {
        // Let go first, then try to be alone: of several that leave at once, the last to let go always succeeds.
        let alone = flock(&self.lock, FlockOperation::Unlock).is_ok()
            && flock(&self.lock, FlockOperation::NonBlockingLockExclusive).is_ok()
            && is_current(&self.instance, &self.lock);
        if alone {
            remove_files_of(&self.instance);
            remove(&self.instance.lock_path());
        }
    }
}

fn wait_a_little(instance: &InstanceName, give_up_ns: i64, stop: &AtomicBool) -> io::Result<()> {
    let lock = instance.lock_path();
    if stop.load(Ordering::Relaxed) {
        let text = format!("stopped while {} was held by another process", lock.display());
        return Err(io::Error::new(io::ErrorKind::Interrupted, text));
    }
    if clock::monotonic_ns() > give_up_ns {
        let text = format!(
            "{} has been held for {} s by a process that `fuser {}` names; end that process",
            lock.display(),
            LOCK_PATIENCE_NS / 1_000_000_000,
            lock.display()
        );
        return Err(io::Error::new(io::ErrorKind::TimedOut, text));
    }
    std::thread::sleep(TRY_EVERY);
    Ok(())
}

fn open_lock(instance: &InstanceName) -> io::Result<File> {
    File::options().create(true).read(true).append(true).mode(0o600).open(instance.lock_path())
}

fn is_current(instance: &InstanceName, lock: &File) -> bool {
    let (Ok(held), Ok(named)) = (lock.metadata(), fs::metadata(instance.lock_path())) else { return false };
    (held.dev(), held.ino()) == (named.dev(), named.ino())
}

fn remove_files_of(instance: &InstanceName) {
    if let Err(error) = fs::remove_dir_all(instance.folder())
        && error.kind() != io::ErrorKind::NotFound
    {
        tracing::warn!(folder = %instance.folder().display(), %error, "an instance's folder could not be removed");
    }
}

fn remove(path: &std::path::Path) {
    if let Err(error) = fs::remove_file(path)
        && error.kind() != io::ErrorKind::NotFound
    {
        tracing::warn!(file = %path.display(), %error, "a file of an ended instance could not be removed");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(what: &str) -> (InstanceName, File) {
        let instance = InstanceName::new(&format!("{what}-{}", std::process::id())).expect("a name");
        prepare(instance.ground()).expect("a private ground");
        let lock = open_lock(&instance).expect("made");
        flock(&lock, FlockOperation::LockExclusive).expect("locked");
        (instance, lock)
    }

    #[test]
    fn waiting_for_a_lock_ends_at_once_when_a_stop_is_asked_for() {
        let (instance, lock) = held("lock-stop");
        let error = Membership::join(&instance, &AtomicBool::new(true)).expect_err("held");
        assert_eq!(error.kind(), io::ErrorKind::Interrupted);
        drop(lock);
        drop(Membership::join(&instance, &AtomicBool::new(true)).expect("free"));
    }

    #[test]
    fn a_lock_that_is_never_let_go_ends_the_wait_with_its_path() {
        let (instance, _lock) = held("lock-hang");
        let error = Membership::join(&instance, &AtomicBool::new(false)).expect_err("held").to_string();
        remove(&instance.lock_path());
        assert!(
            error.contains(&format!("lock-hang-{}.lock", std::process::id())) && error.contains("fuser"),
            "{error}"
        );
    }
}
