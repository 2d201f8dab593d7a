//! Who is in an instance: a shared file lock that the kernel releases even for a killed process, so that the last one out,
//! or the first one in after a crash, knows that nobody is left and can remove every file of the instance.

use crate::{InstanceName, resources_of};
use rustix::fs::{FlockOperation, flock};
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::PathBuf;

/// Held by everything that uses an instance; the last one to let go removes what is left.
#[derive(Debug)]
pub(crate) struct Membership {
    instance: InstanceName,
    lock: File,
}

impl Membership {
    /// Joins an instance. If nobody is in it, whatever it left behind belonged to the dead and is removed first.
    pub(crate) fn join(instance: &InstanceName) -> io::Result<Self> {
        let lock = loop {
            let lock = open_lock(instance)?;
            if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok() && is_current(instance, &lock) {
                remove_files_of(instance);
            }
            flock(&lock, FlockOperation::LockShared)?;
            // The last member may have removed the lock file while this process waited for it.
            if is_current(instance, &lock) {
                break lock;
            }
        };
        fs::create_dir_all(instance.folder())?;
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
            remove(&lock_path(&self.instance));
        }
    }
}

fn lock_path(instance: &InstanceName) -> PathBuf {
    instance.folder().with_extension("lock")
}

fn open_lock(instance: &InstanceName) -> io::Result<File> {
    let path = lock_path(instance);
    if let Some(folder) = path.parent()
        && !folder.exists()
    {
        fs::create_dir_all(folder)?;
        // Like /tmp itself: every user of the machine may run an instance, none may remove another's.
        fs::set_permissions(folder, fs::Permissions::from_mode(0o1777))?;
    }
    File::options().create(true).read(true).append(true).open(path)
}

fn is_current(instance: &InstanceName, lock: &File) -> bool {
    let (Ok(held), Ok(named)) = (lock.metadata(), fs::metadata(lock_path(instance))) else { return false };
    (held.dev(), held.ino()) == (named.dev(), named.ino())
}

fn remove_files_of(instance: &InstanceName) {
    for path in resources_of(instance) {
        remove(&path);
    }
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
