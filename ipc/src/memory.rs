//! iceoryx2 with its shared memory in files of a folder that is ours, and room that is taken before it is needed.
//!
//! iceoryx2's own `ipc::Service` names its memory in /dev/shm, where every user may take a name first; this one differs only
//! in where the memory lies. A file on tmpfs is the same memory, mapped in the same way.
//!
//! A page of a file that has no room behind it kills whoever touches it (SIGBUS). So every port looks for room before it is
//! made, and takes all of it right after; what then fills the file system up disturbs no chain that runs.

use core::fmt::Debug;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use iceoryx2_cal::shm_allocator::bump_allocator::BumpAllocator;
use iceoryx2_cal::shm_allocator::pool_allocator::PoolAllocator;
use iceoryx2_cal::{
    arc_sync_policy, bag, dynamic_storage, event, hash, monitoring, reactor, resizable_shared_memory, serialize,
    shared_memory, static_storage, zero_copy_connection,
};
use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, fstat, open, statvfs};
use std::io;
use std::path::Path;

/// What a port and its connections may take at most, bytes; a whole chain with its recorder takes 13 MB.
const NEEDED_BYTES: u64 = 16 * 1024 * 1024;

/// The service variant of every krait channel.
#[derive(Debug, Clone)]
pub(crate) struct PrivateMemory {}

impl iceoryx2::service::Service for PrivateMemory {
    type StaticStorage = static_storage::recommended::Ipc;
    type ConfigSerializer = serialize::recommended::Recommended;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = dynamic_storage::file::Storage<T>;
    type Bag = bag::recommended::Recommended;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = dynamic_storage::file::Storage<T>;
    type ServiceNameHasher = hash::recommended::Recommended;
    type SharedMemory = shared_memory::file::Memory<PoolAllocator>;
    type ResizableSharedMemory =
        resizable_shared_memory::dynamic::DynamicMemory<PoolAllocator, shared_memory::file::Memory<PoolAllocator>>;
    type Connection = zero_copy_connection::file::Connection;
    type Event = event::recommended::Ipc;
    type Monitoring = monitoring::recommended::Ipc;
    type Reactor = reactor::recommended::Ipc;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = arc_sync_policy::single_threaded::SingleThreaded<T>;
    type BlackboardMgmt<KeyType: Send + Sync + Debug + ZeroCopySend + 'static> =
        dynamic_storage::file::Storage<KeyType>;
    type BlackboardPayload = shared_memory::file::Memory<BumpAllocator>;
    type UniqueId = <iceoryx2::service::ipc::Service as iceoryx2::service::Service>::UniqueId;
}

impl iceoryx2::service::internal::ServiceInternal<PrivateMemory> for PrivateMemory {}

/// Looks whether a folder's file system has room for another port.
///
/// # Errors
/// One sentence with what is free and what is needed.
pub(crate) fn look_for_room(folder: &Path) -> io::Result<()> {
    let stat = statvfs(folder)?;
    let free_bytes = stat.f_bavail.saturating_mul(stat.f_frsize);
    if free_bytes >= NEEDED_BYTES {
        return Ok(());
    }
    Err(io::Error::new(
        io::ErrorKind::StorageFull,
        format!(
            "the memory file system of {} has {} kB free, expected at least {} kB; remove files from it or make it larger",
            folder.display(),
            free_bytes / 1024,
            NEEDED_BYTES / 1024
        ),
    ))
}

/// Takes room for every file of a folder, so that no page of one can be missing later.
///
/// # Errors
/// What the kernel said: the file system is full.
pub(crate) fn take_room(folder: &Path) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)?.flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_file()) {
            match take_room_for(&entry.path()) {
                // A port that ends takes its files with it.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                done => done?,
            }
        }
    }
    Ok(())
}

fn take_room_for(path: &Path) -> io::Result<()> {
    let file = open(path, OFlags::RDWR | OFlags::NOFOLLOW | OFlags::CLOEXEC, Mode::empty());
    let file = match file {
        // iceoryx2 writes some files once and then makes them read-only, and gives others to their maker until they are ready.
        Err(rustix::io::Errno::ACCESS) => return Ok(()),
        opened => opened?,
    };
    let stat = fstat(&file)?;
    let (length, taken) = (u64::try_from(stat.st_size).unwrap_or(0), u64::try_from(stat.st_blocks).unwrap_or(0) * 512);
    if taken < length {
        fallocate(&file, FallocateFlags::empty(), 0, length)?;
    }
    Ok(())
}
