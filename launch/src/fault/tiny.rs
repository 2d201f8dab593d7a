//! A file system in memory of a scene's own, small enough to be filled up, which goes with the scene.

use anyhow::{Context, bail};
use rustix::fs::{FallocateFlags, fallocate};
use rustix::process::geteuid;
use std::fs;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A mounted file system.
pub struct TinyDisk(PathBuf);

impl TinyDisk {
    /// Mounts one in a folder; `None` where this user may not.
    ///
    /// # Errors
    /// One sentence when the folder cannot be made.
    pub fn mount(folder: &Path, megabytes: u32) -> anyhow::Result<Option<Self>> {
        let made = fs::DirBuilder::new().mode(0o700).create(folder);
        made.with_context(|| format!("{} could not be made", folder.display()))?;
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", &format!("size={megabytes}m,mode=700"), "tmpfs"]).arg(folder);
        let is_mounted = geteuid().is_root() && mount.output().is_ok_and(|done| done.status.success());
        Ok(is_mounted.then(|| Self(folder.to_owned())))
    }
}

impl Drop for TinyDisk {
    fn drop(&mut self) {
        let _kept_if_it_cannot_be_unmounted = Command::new("umount").arg("-l").arg(&self.0).output();
    }
}

/// Fills a file system up to its last block, if it is one that [`TinyDisk::mount`] has made.
///
/// # Errors
/// One sentence: the folder is on the same file system as the one around it, or no file can be made in it.
pub fn fill(folder: &Path) -> anyhow::Result<()> {
    use std::os::unix::fs::MetadataExt;
    let around = folder.parent().context("a file system of its own has a folder around it")?;
    let device = |path: &Path| fs::metadata(path).map(|found| found.dev());
    if device(folder)? == device(around)? {
        bail!("{} is no file system of its own, and will not be filled up", folder.display());
    }
    let path = folder.join("filler");
    let file = fs::File::create(&path).with_context(|| format!("{} could not be made", path.display()))?;
    let (mut length, mut piece) = (0, 1 << 30);
    while piece >= 4096 {
        match fallocate(&file, FallocateFlags::empty(), length, piece) {
            Ok(()) => length += piece,
            Err(_) => piece /= 2,
        }
    }
    Ok(())
}
