//! Another user of the machine: he reads nothing, changes nothing and moves nothing, whatever he prepares or tries.

#![allow(clippy::expect_used, clippy::print_stderr, reason = "a panic is how a test fails; a skipped test says so")]

use core::time::Duration;
use krait_ipc::{InstanceName, ground, resources_of};
use krait_record::Recording;
use krait_tests::{Krait, TempFolder, instance_name, krait_program, processes_of, wait_for_motion};
use rustix::process::{Signal, geteuid};
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;

const PATIENCE: Duration = Duration::from_secs(240);
/// The other user has one ground; the tests that use it take turns.
static OTHERS_GROUND: Mutex<()> = Mutex::new(());
/// The user id that Linux systems keep for nobody.
const OTHER: u32 = 65_534;

fn may_be_others() -> bool {
    let may = geteuid().is_root();
    if !may {
        eprintln!("SKIPPED: only root can act as another user");
    }
    may
}

/// Runs a shell script as the other user; returns what it wrote.
fn as_other(script: &str) -> String {
    let mut shell = Command::new("sh");
    shell.args(["-c", script]).uid(OTHER).gid(OTHER).env_remove("XDG_RUNTIME_DIR").current_dir("/");
    let done = shell.stdin(Stdio::null()).output().expect("a shell can be started");
    String::from_utf8_lossy(&done.stdout).into_owned() + &String::from_utf8_lossy(&done.stderr)
}

/// The configuration that a chain ran with, as its recording embeds it.
fn configuration_of(recording: &str) -> String {
    let recording = Recording::open(Path::new(recording)).expect("readable");
    let found = recording.contents().attachments.iter().find(|attachment| attachment.name == "krait.toml");
    String::from_utf8(found.expect("embedded").data.clone()).expect("text")
}

#[test]
fn what_another_user_prepares_in_public_directories_is_neither_read_nor_written() {
    let (instance, folder) = (instance_name("trap"), TempFolder::new("trap"));
    let (recording, victim) = (folder.file("run.mcap"), folder.file("victim"));
    fs::write(&victim, "precious").expect("written");
    // What an attacker would do who knows the name of the instance; the folder was world-writable once.
    let trap = Path::new("/tmp/krait").join(&instance);
    fs::create_dir_all(&trap).expect("made");
    std::os::unix::fs::symlink(&victim, trap.join("config.toml")).expect("made");
    let krait =
        Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording, "--seconds", "1"]);
    let ended = krait.end(PATIENCE);
    fs::remove_dir_all(&trap).expect("removed");
    assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
    assert_eq!(fs::read_to_string(&victim).expect("there"), "precious");
    assert!(configuration_of(&recording).contains("max_bend_vel_rad_per_s = 2.0"));
}

#[test]
fn every_file_of_a_chain_and_its_recording_is_its_users_alone() {
    let (instance, folder) = (instance_name("modes"), TempFolder::new("modes"));
    let recording = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let files = resources_of(&InstanceName::new(&instance).expect("a name"));
    let mode = |path: &Path| fs::metadata(path).expect("there").permissions().mode() & 0o777;
    assert_eq!(mode(ground()), 0o700, "nobody else enters {}", ground().display());
    assert_eq!(mode(Path::new(&recording)), 0o600);
    assert!(files.len() > 20 && files.iter().all(|file| file.starts_with(ground())), "{files:?}");
    // Outside of the ground there is nothing with a name.
    let owner = fs::metadata(ground()).expect("there").uid();
    for entry in fs::read_dir("/dev/shm").expect("there").flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        assert!(!name.contains(&instance), "{name} of user {owner} lies in a public directory");
    }
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
}

#[test]
fn another_user_can_neither_read_nor_write_nor_stop_a_chain_that_runs() {
    if !may_be_others() {
        return;
    }
    let _turn = OTHERS_GROUND.lock();
    let (instance, folder) = (instance_name("other"), TempFolder::new("other"));
    let recording = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let (ground, program) = (ground().display(), krait_program().display());
    let pids: Vec<String> = processes_of(&instance).iter().map(|(_, pid)| pid.to_string()).collect();
    let pids = pids.join(" ");
    let script = format!(
        "ls {ground} && echo LISTED
         touch {ground}/x && echo WROTE
         cat {recording} && echo READ
         for pid in {pids}; do
           kill -STOP $pid && echo STOPPED
           cat /proc/$pid/environ && echo READ
           ls /proc/$pid/fd/ && echo LISTED
           cat /proc/$pid/fd/0 && echo READ
           head -c 1 /proc/$pid/mem && echo READ
         done
         {program} mark hello --instance {instance} && echo MARKED
         true"
    );
    let said = as_other(&script);
    for word in ["LISTED", "WROTE", "READ", "STOPPED", "MARKED"] {
        assert!(!said.contains(word), "the other user has {word}:\n{said}");
    }
    assert!(said.contains("no chain runs in instance"), "he sees an instance of his own:\n{said}");
    assert_eq!(processes_of(&instance).len(), 7, "all of it still runs");
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
}

#[test]
fn a_ground_that_another_user_took_first_is_refused_with_his_number() {
    if !may_be_others() {
        return;
    }
    let _turn = OTHERS_GROUND.lock();
    // The roles are exchanged: this user takes the name that the other one needs.
    let taken = Path::new("/dev/shm").join(format!("krait-{OTHER}"));
    fs::create_dir_all(&taken).expect("made");
    chown(&taken, Some(0), Some(0)).expect("root may");
    let said = as_other(&format!("{} mark hello; echo code $?", krait_program().display()));
    fs::remove_dir_all(&taken).expect("removed");
    assert!(said.contains("belongs to user id 0, expected 65534") && said.contains("code 2"), "{said}");
    assert!(said.contains("XDG_RUNTIME_DIR"), "it says what to do: {said}");
}
