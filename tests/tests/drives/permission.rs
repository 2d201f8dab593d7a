//! A serial port that belongs to others: the kernel itself refuses it, and what a person reads says whose it is.

use super::*;
use rustix::process::geteuid;
use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::process::{Command, Output};

/// The user and group that Linux systems keep for nobody.
const NOBODY: u32 = 65_534;

/// krait as somebody who has no right to root's port: as nobody. Who is not root has no right to his own, which is taken from himself.
fn as_somebody_else(arguments: &[&str]) -> Output {
    let mut krait = Command::new(krait_tests::krait_program());
    if geteuid().is_root() {
        krait.uid(NOBODY).gid(NOBODY).env_remove("XDG_RUNTIME_DIR").current_dir("/");
    }
    krait.args(arguments).output().expect("krait can be started")
}

#[test]
fn a_port_without_permission_is_refused_by_what_would_open_it_and_is_found_once_there_is_one() {
    let (instance, folder) = (instance_name("rights"), TempFolder::new("rights"));
    let emulator = emulator(ServoMake::Sts3215);
    let config = configuration(ServoMake::Sts3215, &folder, &emulator, "");
    let allow = |path: &Path, mode| set_permissions(path, Permissions::from_mode(mode)).expect("one's own");
    allow(folder.path(), 0o755);
    allow(Path::new(&config), 0o644);
    let port = emulator.path().display().to_string();
    // What another program calls the group, which is tty where pseudo-terminals have one.
    let group = Command::new("stat").args(["-c", "%G", &port]).output().expect("stat can be started");
    let group = String::from_utf8_lossy(&group.stdout).trim().to_owned();
    let looks = ["drives", "--port", &port, "--last-id", "3", "--json"];
    let kernel = port.trim_start_matches("/dev/");
    // Only root's own right keeps out a group that may; whoever is not root is in it, and is kept out of his own.
    let rights: &[u32] = if geteuid().is_root() { &[0o600, 0o620, 0o660] } else { &[0o000] };
    for mode in rights {
        allow(emulator.path(), *mode);
        let is_joined = mode & 0o060 == 0o060 && group != "root";
        for arguments in [&looks[..], &["drives", "--jog", "1", "--config", &config, "--instance", &instance]] {
            let refused = as_somebody_else(arguments);
            let said = String::from_utf8_lossy(&refused.stderr).into_owned();
            assert_eq!(refused.status.code(), Some(2), "{arguments:?}: {said}");
            let by = if is_joined {
                format!("it belongs to the group {group}; join it with `sudo usermod -aG {group} $USER`")
            } else {
                format!(
                    "no group that you could join may read and write it (group {group}, rights {mode:03o}); write the line SUBSYSTEM==\"tty\", KERNEL==\"{kernel}\""
                )
            };
            assert!(said.contains(&format!("the serial port {port} may not be opened: {by}")), "{mode:o}: {said}");
            assert_eq!(said.contains("usermod"), is_joined, "{said}");
        }
    }
    assert_eq!(emulator.wire().n_requests, 0, "nobody on the bus was told or asked anything");
    allow(emulator.path(), 0o666);
    let found = as_somebody_else(&looks);
    let servos: serde_json::Value = serde_json::from_slice(&found.stdout).expect("JSON");
    assert_eq!(servos.as_array().map(Vec::len), Some(3), "{}", String::from_utf8_lossy(&found.stderr));
}
