//! What runs full or goes away under a chain: its memory, its disk, its recording. The motion is not affected, and it is said.

#![allow(clippy::expect_used, clippy::print_stderr, reason = "a panic is how a test fails; a skipped test says so")]

use core::time::Duration;
use krait_ipc::message::{OperatingState, SlaveState};
use krait_record::Recording;
use krait_tests::{Ended, Krait, TempFolder, instance_name, krait_program, states_in, wait_for_motion, wait_until};
use rustix::process::{Signal, geteuid};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const PATIENCE: Duration = Duration::from_secs(240);

/// A memory file system of its own, as small as wanted, that goes with the test.
struct Tmpfs(TempFolder);

impl Tmpfs {
    fn mount(what: &str, megabytes: u32) -> Option<Self> {
        let folder = TempFolder::new(what);
        let options = format!("size={megabytes}m,mode=700");
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", &options, "tmpfs"]).arg(folder.path()).output();
        if !geteuid().is_root() || !mount.is_ok_and(|done| done.status.success()) {
            eprintln!("SKIPPED: only root can mount a file system to fill it up");
            return None;
        }
        Some(Self(folder))
    }

    fn path(&self) -> String {
        self.0.path().display().to_string()
    }

    /// Fills it up to its last byte.
    fn fill(&self) {
        let mut room: u64 = 1 << 30;
        let file = fs::File::create(self.0.file("filler")).expect("made");
        let mut length = 0;
        while room >= 4096 {
            match rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), length, room) {
                Ok(()) => length += room,
                Err(_) => room /= 2,
            }
        }
    }
}

impl Drop for Tmpfs {
    fn drop(&mut self) {
        let _kept_if_it_cannot_be_removed = Command::new("umount").arg("-l").arg(self.0.path()).status();
    }
}

/// Runs krait with its ground in a folder.
fn on_ground(ground: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(krait_program());
    command.args(arguments).env("XDG_RUNTIME_DIR", ground).stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

#[test]
fn a_chain_without_room_for_its_memory_does_not_start_and_says_how_much_it_needs() {
    let Some(ground) = Tmpfs::mount("tight", 18) else { return };
    let arguments = ["run", "--instance", &instance_name("tight"), "--no-recording", "--seconds", "1"];
    let ended = on_ground(&ground.path(), &arguments).output().expect("it runs");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(2), "no signal ends it: {:?} {said}", ended.status);
    assert!(said.contains("kB free, expected at least"), "{said}");
}

#[test]
fn memory_that_fills_up_under_a_chain_that_runs_disturbs_nothing() {
    let Some(ground) = Tmpfs::mount("filled", 128) else { return };
    let folder = TempFolder::new("filled-recording");
    let recording = folder.file("run.mcap");
    let arguments = ["run", "--engage=again", "--instance", "filled", "--recording", &recording, "--seconds", "8"];
    let run = on_ground(&ground.path(), &arguments).spawn().expect("it starts");
    let grows = || fs::metadata(&recording).is_ok_and(|file| file.len() > 100_000);
    assert!(wait_until(PATIENCE, grows), "the chain runs");
    ground.fill();
    let mark = on_ground(&ground.path(), &["mark", "full", "--instance", "filled"]).output().expect("it runs");
    assert_eq!(mark.status.code(), Some(2), "whoever comes late is refused, not killed: {mark:?}");
    let ended = run.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(matches!(ended.status.code(), Some(0 | 1)), "{:?}: {said}", ended.status);
    let contents = Recording::open(Path::new(&recording)).expect("readable").contents().clone();
    assert!(contents.missing.is_empty(), "{:?}", contents.missing);
    assert!(contents.channels[&krait_schema::Channel::Command].n_messages > 5000, "it moved to the end");
}

#[test]
fn a_stop_gets_through_although_shared_memory_is_full() {
    let Some(ground) = Tmpfs::mount("full-stop", 128) else { return };
    let (instance, folder) = (instance_name("full-stop"), TempFolder::new("full-stop"));
    let recording = folder.file("run.mcap");
    let arguments = ["run", "--engage=again", "--instance", &instance, "--recording", &recording, "--seconds", "12"];
    let run = on_ground(&ground.path(), &arguments).spawn().expect("it starts");
    let grows = || fs::metadata(&recording).is_ok_and(|file| file.len() > 100_000);
    assert!(wait_until(PATIENCE, grows), "the chain runs");
    ground.fill();
    let stop = on_ground(&ground.path(), &["stop", "--instance", &instance]).output().expect("it runs");
    let said = String::from_utf8_lossy(&stop.stdout).into_owned() + &String::from_utf8_lossy(&stop.stderr);
    assert!(stop.status.code() == Some(0) && said.contains("stand still"), "{said}");
    let ended = run.wait_with_output().expect("it ends");
    assert!(matches!(ended.status.code(), Some(0 | 1)), "{ended:?}");
    let stopped: Vec<SlaveState> = states_in(&recording).into_iter().filter(|state| state.n_stops == 1).collect();
    assert!(stopped.len() > 1000 && stopped.iter().all(|state| !state.is_engaged()), "{} states", stopped.len());
    assert_eq!(stopped[0].operating(), Some(OperatingState::Paused));
}

#[test]
fn a_stop_from_another_login_finds_the_chain_on_its_ground() {
    let Some(session) = Tmpfs::mount("session", 64) else { return };
    let (instance, folder) = (instance_name("login"), TempFolder::new("login"));
    let recording = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    // A login that has a private directory of its own, in which the chain is not.
    for command in ["state", "stop"] {
        let done = on_ground(&session.path(), &[command, "--instance", &instance]).output().expect("it runs");
        assert_eq!(done.status.code(), Some(0), "{command}: {done:?}");
    }
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    assert_eq!(states_in(&recording).last().expect("states").n_stops, 1);
}

#[test]
fn a_recording_that_is_deleted_or_replaced_while_it_is_written_is_noticed() {
    for replaced in [false, true] {
        let (instance, folder) = (instance_name("gone"), TempFolder::new("gone"));
        let recording = folder.file("run.mcap");
        let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
        wait_for_motion(&instance, &recording);
        fs::remove_file(&recording).expect("there");
        if replaced {
            fs::write(&recording, "another's").expect("written");
        }
        std::thread::sleep(Duration::from_secs(3));
        krait.signal(Signal::INT);
        let ended = krait.end(PATIENCE);
        assert!(matches!(ended.code, Some(1 | 2)), "a lost recording is no success: {ended:?}");
        let expected = if replaced { "another file was put in its place" } else { "it was deleted or moved" };
        assert!(ended.stderr.contains(expected), "{}", ended.stderr);
    }
}

#[test]
fn a_disk_that_fills_up_ends_the_recording_and_not_the_motion() {
    let Some(disk) = Tmpfs::mount("disk", 1) else { return };
    let recording = format!("{}/run.mcap", disk.path());
    let arguments =
        ["run", "--engage=again", "--instance", &instance_name("disk"), "--recording", &recording, "--seconds", "12"];
    let ended = Ended::of(&arguments, PATIENCE);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("the motion is not affected"), "{}", ended.stderr);
}
