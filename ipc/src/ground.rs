//! The private ground: one directory of one user, in memory, in which every file of every instance lies.
//!
//! Problem: in a directory that every user may write, another user can take a name before krait does, and what krait then
//! opens is his: a FIFO in place of a configuration, a symbolic link, memory that he keeps mapped.
//!
//! Intuition: inside a directory that belongs to this user and that nobody else may enter, no name can be taken, listed or
//! guessed. Only that directory's own name can, and then krait refuses to start.

use rustix::fs::{Mode, OFlags, RawMode, fstat, fstatfs, mkdir, open};
use rustix::process::geteuid;
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Where shared memory is on every Linux system.
const SHARED_MEMORY: &str = "/dev/shm";
/// Where a login session has a private directory in memory.
const SESSION_VARIABLE: &str = "XDG_RUNTIME_DIR";
/// Where each login has its private directory in memory, by user id, whatever the variable says.
const LOGINS: &str = "/run/user";
/// `f_type` of the file systems that live in memory (`man 2 statfs`): tmpfs and ramfs.
const IN_MEMORY: [u32; 2] = [0x0102_1994, 0x8584_58f6];
/// Reading, writing and entering by this user alone.
const PRIVATE: Mode = Mode::RWXU;

/// The directory in which this user's instances are made: `$XDG_RUNTIME_DIR/krait` where that variable names a private directory
/// in memory, else the same of the user's login, else `/dev/shm/krait-<user id>`. It need not be there yet.
pub fn ground() -> &'static Path {
    &grounds()[0]
}

/// Every directory in which instances of this user may lie, [`ground`] first: whoever comes from `cron` or `su` has not the
/// variables of the login that started a chain.
pub fn grounds() -> &'static [PathBuf] {
    static GROUNDS: OnceLock<Vec<PathBuf>> = OnceLock::new();
    GROUNDS.get_or_init(|| {
        let login = Path::new(LOGINS).join(geteuid().as_raw().to_string());
        choose(std::env::var_os(SESSION_VARIABLE).map(PathBuf::from), login)
    })
}

/// The ground on which one of these names is, as an instance has left them; where none is, the first.
pub(crate) fn ground_of(names: &[&str]) -> &'static Path {
    find(grounds(), names)
}

fn find<'a>(grounds: &'a [PathBuf], names: &[&str]) -> &'a Path {
    // A directory that another user has made is no ground, whatever lies in it.
    let has_one =
        |ground: &&PathBuf| open_private(ground).is_ok() && names.iter().any(|name| ground.join(name).exists());
    grounds.iter().find(has_one).unwrap_or(&grounds[0])
}

fn choose(session: Option<PathBuf>, login: PathBuf) -> Vec<PathBuf> {
    let is_fit = |path: &PathBuf| path.is_absolute() && open_private(path).is_ok_and(|folder| is_in_memory(&folder));
    let mut grounds: Vec<PathBuf> =
        session.into_iter().chain([login]).filter(is_fit).map(|path| path.join("krait")).collect();
    grounds.push(Path::new(SHARED_MEMORY).join(format!("krait-{}", geteuid().as_raw())));
    grounds.dedup();
    grounds
}

/// Makes a private directory, or checks the one that is there.
///
/// # Errors
/// One sentence: the name is taken by another user, by something that is no directory, or others may enter it.
pub(crate) fn prepare(folder: &Path) -> io::Result<()> {
    match mkdir(folder, PRIVATE) {
        Ok(()) | Err(rustix::io::Errno::EXIST) => {}
        Err(error) => return Err(refused(folder, &format!("cannot be made: {}", io::Error::from(error)))),
    }
    open_private(folder).map(drop)
}

/// Opens a directory that belongs to this user and that no other user may enter; a symbolic link is not followed.
pub(crate) fn open_private(folder: &Path) -> io::Result<OwnedFd> {
    // PATH: a directory that this user may not read shall be refused for its owner, by his number.
    let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let opened = open(folder, flags, Mode::empty());
    let opened = opened
        .map_err(|error| refused(folder, &format!("is not a directory of this user: {}", io::Error::from(error))))?;
    let stat = fstat(&opened)?;
    if stat.st_uid != geteuid().as_raw() {
        return Err(refused(folder, &format!("belongs to user id {}, expected {}", stat.st_uid, geteuid().as_raw())));
    }
    let others = Mode::from_raw_mode(stat.st_mode as RawMode) & (Mode::RWXG | Mode::RWXO);
    if !others.is_empty() {
        let found = format!("can be entered by other users (mode {:o}, expected 700)", stat.st_mode & 0o777);
        return Err(refused(folder, &found));
    }
    Ok(opened)
}

fn is_in_memory(folder: &OwnedFd) -> bool {
    // The kernel's numbers have 32 bits; the type that carries them is signed on some machines.
    fstatfs(folder).is_ok_and(|stat| IN_MEMORY.contains(&(stat.f_type as u32)))
}

fn refused(folder: &Path, what: &str) -> io::Error {
    let folder = folder.display();
    io::Error::new(
        io::ErrorKind::PermissionDenied,
        format!(
            "{folder} {what}; have it removed, or let {SESSION_VARIABLE} name a directory of mode 700 of your own in memory"
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::{PermissionsExt, chown, symlink};

    struct Place(PathBuf);

    impl Place {
        fn new(what: &str) -> Self {
            let path = Path::new(SHARED_MEMORY).join(format!("krait-test-ground-{what}-{}", std::process::id()));
            fs::create_dir_all(&path).expect("made");
            fs::set_permissions(&path, fs::Permissions::from_mode(0o700)).expect("mode");
            Self(path)
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            let _kept_if_it_cannot_be_removed = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_ground_that_is_made_is_private_and_is_taken_again() {
        let place = Place::new("made");
        let folder = place.0.join("krait");
        prepare(&folder).expect("made");
        assert_eq!(fs::metadata(&folder).expect("there").permissions().mode() & 0o777, 0o700);
        prepare(&folder).expect("taken again");
    }

    #[test]
    fn a_name_that_somebody_took_is_refused_with_what_was_found() {
        let place = Place::new("taken");
        let (open, link, file) = (place.0.join("open"), place.0.join("link"), place.0.join("file"));
        fs::create_dir(&open).expect("made");
        fs::set_permissions(&open, fs::Permissions::from_mode(0o755)).expect("mode");
        symlink(&place.0, &link).expect("made");
        fs::write(&file, "").expect("made");
        for (path, expected) in [(open, "mode 755"), (link, "not a directory"), (file, "not a directory")] {
            let error = prepare(&path).expect_err("taken").to_string();
            assert!(error.contains(expected) && error.contains(SESSION_VARIABLE), "{error}");
        }
    }

    #[test]
    #[allow(clippy::print_stderr, reason = "a test that is skipped says so")]
    fn a_directory_of_another_user_is_refused_with_his_number() {
        if !geteuid().is_root() {
            eprintln!("SKIPPED: only root can give a directory to another user");
            return;
        }
        let place = Place::new("foreign");
        let folder = place.0.join("krait");
        fs::create_dir(&folder).expect("made");
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o700)).expect("mode");
        chown(&folder, Some(65_534), None).expect("root may");
        let error = prepare(&folder).expect_err("foreign").to_string();
        assert!(error.contains("belongs to user id 65534"), "{error}");
    }

    #[test]
    fn a_session_directory_is_taken_only_if_it_is_private_and_in_memory() {
        let (place, none) = (Place::new("session"), PathBuf::from("/run/user/nobody"));
        let usual = Path::new(SHARED_MEMORY).join(format!("krait-{}", geteuid().as_raw()));
        let ours = place.0.join("krait");
        assert_eq!(choose(Some(place.0.clone()), none.clone()), [ours.clone(), usual.clone()]);
        assert_eq!(choose(None, place.0.clone()), [ours.clone(), usual.clone()], "the login's, without its variable");
        assert_eq!(choose(Some(place.0.clone()), place.0.clone()), [ours, usual.clone()], "named once");
        fs::set_permissions(&place.0, fs::Permissions::from_mode(0o770)).expect("mode");
        for session in [Some(place.0.clone()), Some("relative".into()), Some("/proc/self".into()), None] {
            assert_eq!(choose(session, none.clone()), std::slice::from_ref(&usual));
        }
    }

    #[test]
    fn an_instance_is_found_on_whichever_private_ground_it_was_made() {
        let place = Place::new("found");
        let grounds: Vec<PathBuf> = ["first", "second"].into_iter().map(|name| place.0.join(name)).collect();
        assert_eq!(find(&grounds, &["or.lock", "or"]), grounds[0], "nobody has made it, nor a ground");
        for ground in &grounds {
            prepare(ground).expect("made");
        }
        fs::write(grounds[1].join("or.lock"), "").expect("written");
        assert_eq!(find(&grounds, &["or.lock", "or"]), grounds[1]);
        fs::set_permissions(&grounds[1], fs::Permissions::from_mode(0o755)).expect("mode");
        assert_eq!(find(&grounds, &["or.lock", "or"]), grounds[0], "others may have put the lock there");
    }
}
