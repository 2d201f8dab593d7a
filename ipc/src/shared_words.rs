//! A few atomic words that several processes share: the raw material of a wake-up without a socket.

use core::ptr::NonNull;
use core::sync::atomic::AtomicU32;
use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, fstat, open};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::process::geteuid;
use std::io;
use std::os::fd::OwnedFd;
use std::path::Path;

/// Words of shared memory, zero at first, the same for every process that opens the same file.
///
/// The file is not removed here: within an instance the last member does that, elsewhere whoever made it.
#[derive(Debug)]
pub struct SharedWords {
    first: NonNull<AtomicU32>,
    n_words: usize,
}

const FLAGS: OFlags = OFlags::RDWR.union(OFlags::CLOEXEC).union(OFlags::NOFOLLOW);

// SAFETY: the mapping belongs to this value alone until it is dropped, and atomic words may be used from any thread.
#[allow(unsafe_code)]
unsafe impl Send for SharedWords {}
// SAFETY: as above; a shared reference gives nothing but shared references to atomic words.
#[allow(unsafe_code)]
unsafe impl Sync for SharedWords {}

impl SharedWords {
    /// Opens a file on a memory file system (/dev/shm), made and filled with zeros where it is missing.
    ///
    /// # Errors
    /// The file cannot be made or opened, belongs to another user (who could cut it off under this process), or memory is
    /// exhausted.
    pub fn open(path: &Path, n_words: usize) -> io::Result<Self> {
        let file = open(path, FLAGS | OFlags::CREATE, Mode::RUSR | Mode::WUSR)?;
        if !has_room(&file, n_words)? {
            // Room for it as well: a page without would kill whoever touches it.
            fallocate(&file, FallocateFlags::empty(), 0, Self::bytes(n_words) as u64)?;
        }
        Self::map(&file, n_words)
    }

    /// Opens a file that somebody has made, and takes no memory for it; nothing where it is not there yet, or not whole.
    ///
    /// # Errors
    /// The file cannot be opened or belongs to another user.
    pub fn open_existing(path: &Path, n_words: usize) -> io::Result<Option<Self>> {
        let file = match open(path, FLAGS, Mode::empty()) {
            Err(rustix::io::Errno::NOENT) => return Ok(None),
            opened => opened?,
        };
        has_room(&file, n_words)?.then(|| Self::map(&file, n_words)).transpose()
    }

    fn map(file: &OwnedFd, n_words: usize) -> io::Result<Self> {
        let bytes = Self::bytes(n_words);
        #[allow(unsafe_code)]
        // SAFETY: a fresh mapping at an address of the kernel's choice touches nothing that exists; the file is large enough.
        let start = unsafe {
            let access = ProtFlags::READ | ProtFlags::WRITE;
            mmap(core::ptr::null_mut(), bytes, access, MapFlags::SHARED | MapFlags::POPULATE, file, 0)?
        };
        let first = NonNull::new(start.cast()).ok_or(io::ErrorKind::OutOfMemory)?;
        Ok(Self { first, n_words })
    }

    /// The words.
    pub fn words(&self) -> &[AtomicU32] {
        #[allow(unsafe_code)]
        // SAFETY: the mapping is page-aligned, holds at least `n_words` words, lives as long as `self`, and every process
        // touches it through atomics only.
        unsafe {
            core::slice::from_raw_parts(self.first.as_ptr(), self.n_words)
        }
    }

    fn bytes(n_words: usize) -> usize {
        n_words * size_of::<AtomicU32>()
    }
}

/// Whether a file of this user is as long as the words; where it is, its pages are there too.
fn has_room(file: &OwnedFd, n_words: usize) -> io::Result<bool> {
    let stat = fstat(file)?;
    if stat.st_uid != geteuid().as_raw() {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file belongs to another user"));
    }
    Ok(u64::try_from(stat.st_size).unwrap_or(0) >= SharedWords::bytes(n_words) as u64)
}

impl Drop for SharedWords {
    fn drop(&mut self) {
        #[allow(unsafe_code)]
        // SAFETY: this is the mapping that `map` made, and nothing borrows from it any more.
        let unmapped = unsafe { munmap(self.first.as_ptr().cast(), Self::bytes(self.n_words)) };
        if let Err(error) = unmapped {
            tracing::warn!(%error, "shared words could not be unmapped");
        }
    }
}
