//! What comes from outside is refused with one sentence that says what, where and what to do; nothing is left behind.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::{InstanceName, resources_of};
use krait_record::Recording;
use krait_tests::{Ended, TempFolder, instance_name, processes_of};
use std::fs;
use std::path::Path;
use std::process::Command;

const PATIENCE: Duration = Duration::from_secs(240);

/// Runs `krait run` with arguments that cannot work and gives its one sentence.
fn refused(arguments: &[&str]) -> String {
    let (instance, folder) = (instance_name("bad"), TempFolder::new("bad"));
    let recording = folder.file("run.mcap");
    let mut all = vec!["run", "--instance", &instance];
    if !arguments.contains(&"--recording") {
        all.extend(["--recording", &recording]);
    }
    all.extend(arguments);
    let ended = Ended::of(&all, PATIENCE);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert_eq!(processes_of(&instance), [], "no process is left");
    let name = InstanceName::new(&instance).expect("a name");
    assert_eq!(resources_of(&name), Vec::<std::path::PathBuf>::new(), "no shared memory is left");
    assert!(!Path::new(&recording).exists(), "a chain that never ran leaves no recording");
    ended.sentence().to_owned()
}

fn assert_says(sentence: &str, words: &[&str]) {
    for word in words {
        assert!(sentence.contains(word), "{word:?} is not in: {sentence}");
    }
}

#[test]
fn a_missing_hand_controller_is_named_with_what_was_looked_for() {
    if fs::read_dir("/dev").expect("/dev").flatten().any(|e| e.file_name().to_string_lossy().starts_with("hidraw")) {
        println!("SKIPPED: this machine has HID devices, so none can be missing");
        return;
    }
    assert_says(
        &refused(&["--master", "hid"]),
        &["`master`", "hand controller", "046d:c626 (SpaceNavigator)", "device"],
    );
}

#[test]
fn a_node_that_is_no_input_device_is_named_before_anything_starts() {
    let node = |profile: &str, path: &str| refused(&["--master", "hid", "--profile", profile, "--node", path]);
    assert_says(&node("mouse", "/dev/null"), &["/dev/null", "it is no input device; krait devices lists those"]);
    assert_says(&node("mouse", "/dev"), &["/dev could not be read", "it is no input device"]);
    // One that is not there is looked for, and what is there is named.
    assert_says(&node("mouse", "/dev/no-such-node"), &["looked for /dev/no-such-node"]);
}

#[test]
fn a_report_recording_that_is_foreign_truncated_or_damaged_is_refused() {
    let folder = TempFolder::new("krr");
    let shipped =
        fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../master/recordings/default.krr")).expect("shipped");
    let cases: [(&str, Vec<u8>, &[&str]); 4] = [
        ("foreign.krr", b"\x7fELF and so on".to_vec(), &["foreign.krr"]),
        ("empty.krr", Vec::new(), &["empty.krr"]),
        ("cut.krr", shipped[..shipped.len() / 2].to_vec(), &["cut.krr", "line"]),
        ("odd.krr", [&shipped[..], b"nonsense\n"].concat(), &["odd.krr", "line"]),
    ];
    for (name, bytes, words) in cases {
        let path = folder.file(name);
        fs::write(&path, bytes).expect("written");
        assert_says(&refused(&["--input", &path]), words);
    }
    assert_says(&refused(&["--input", &folder.file("nowhere.krr")]), &["nowhere.krr"]);
}

#[test]
fn a_profile_that_is_faulty_or_of_no_device_here_is_refused_with_its_place() {
    let folder = TempFolder::new("profile");
    let (faulty, absent) = (folder.file("faulty.toml"), folder.file("absent.toml"));
    let good = "name = \"Stick\"\nid = \"fffe:fffd\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\n";
    fs::write(&faulty, good.replace("\"x\"", "\"sideways\"")).expect("written");
    fs::write(&absent, good).expect("written");
    let hid = ["--master", "hid", "--profile"];
    assert_says(
        &refused(&[&hid[..], &[&faulty]].concat()),
        &["faulty.toml", "axis 1, key of", "expected x, y, z, rx, ry or rz", "\"sideways\""],
    );
    assert_says(&refused(&[&hid[..], &[&absent]].concat()), &["`master`", "fffe:fffd (Stick)", "plug it in"]);
    assert_says(
        &refused(&[&hid[..], &[&folder.file("nowhere.toml")]].concat()),
        &["nowhere.toml", "could not be read"],
    );
    assert_says(&refused(&["--profile", &absent]), &["--profile", "--master hid"]);
    // A pedal beside the hand: one that does not read, one that says what the hand says, one that is not here, and beside no hand.
    let pedal = folder.file("pedal.toml");
    fs::write(&pedal, "name = \"Pedal\"\nid = \"fffe:fffc\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n")
        .expect("written");
    let beside = |one: &str, hand: &[&str]| refused(&[hand, &["--master", "hid", "--beside", one]].concat());
    assert_says(&beside(&faulty, &[]), &["faulty.toml", "axis 1, key of"]);
    assert_says(&beside(&absent, &[]), &["axis x of the hand", "both the SpaceMouse and \"Stick\"", "leave it out"]);
    assert_says(
        &beside("xbox-360", &["--profile", "extreme-3d-pro"]),
        &["axis x of the hand", "Extreme 3D Pro\" ([master] profile)", "([[master.beside]] number 1)"],
    );
    assert_says(&beside(&pedal, &["--profile", &absent]), &["`master`", "fffe:fffd (Stick)", "plug it in"]);
    assert_says(&beside(&pedal, &[]), &["`master`", "fffe:fffc (Pedal)", "plug it in"]);
    assert_says(&beside(&format!("{pedal}=/dev/input/nobodys"), &[]), &["/dev/input/nobodys (Pedal)", "plug it in"]);
    assert_says(&refused(&["--beside", &pedal]), &["--beside", "--master hid"]);
    // No mouse, no keyboard and no pedal is taken because it is the first one.
    for name in ["mouse", "keyboard", "pedal"] {
        assert_says(
            &refused(&[&hid[..], &[name]].concat()),
            &[name, "--node", "no mouse, keyboard or pedal is taken unasked"],
        );
        assert_says(
            &refused(&[&hid[..], &[name, "--node", "/dev/input/by-id/nobodys"]].concat()),
            &["/dev/input/by-id/nobodys", "plug it in"],
        );
    }
}

#[test]
fn malformed_reports_from_a_device_are_counted_and_move_nothing() {
    let folder = TempFolder::new("malformed");
    let shipped = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../master/recordings/default.krr"));
    let shipped = shipped.expect("shipped");
    // A short, a long, an unknown, an empty-bodied and a far too large report behind every tenth good one.
    let bad = ["01ff", "010100000000000000000000000000000000", "7fffffffffffff", "02", "01ff7fff7fff7f"];
    let (mut text, mut n_bad, mut n_good) = (String::new(), 0_u64, 0);
    for line in shipped.lines() {
        text += &format!("{line}\n");
        let stamp = line.split(' ').next().filter(|word| !word.is_empty() && word.chars().all(|c| c.is_ascii_digit()));
        let Some(stamp) = stamp else { continue };
        n_good += 1;
        if n_good % 10 == 0 {
            text += &format!("{stamp} {}\n", bad[n_bad as usize % bad.len()]);
            n_bad += 1;
        }
    }
    // The file's last line counts its reports.
    let text = text.replace(&format!("end {n_good}\n"), &format!("end {}\n", n_good + n_bad));
    let (path, recording) = (folder.file("malformed.krr"), folder.file("run.mcap"));
    fs::write(&path, text).expect("written");
    let instance = instance_name("malformed");
    let arguments = [
        "run",
        "--engage=again",
        "--json",
        "--instance",
        &instance,
        "--input",
        &path,
        "--recording",
        &recording,
        "--seconds",
        "8",
    ];
    let ended = Ended::of(&arguments, PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let (mut n_refused, mut n_reports, mut fastest_m_per_s) = (0, 0, 0.0_f64);
    for recorded in Recording::open(Path::new(&recording)).expect("readable").samples().expect("samples") {
        if let krait_schema::Sample::Input(input) = recorded.expect("readable").sample {
            (n_refused, n_reports) = (input.n_refused, input.n_reports);
            fastest_m_per_s = input.tip_vel_in_view_m_per_s.iter().fold(fastest_m_per_s, |most, v| most.max(v.abs()));
        }
    }
    assert!(n_refused > 60 && n_reports > 9 * n_refused, "{n_refused} refused beside {n_reports}");
    assert!(fastest_m_per_s < 0.02, "no malformed report moved anything: {fastest_m_per_s} m/s");
}

#[test]
fn a_script_is_refused_by_line_and_column() {
    let folder = TempFolder::new("script");
    let path = folder.file("path.csv");
    fs::write(&path, "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0,0,0\n1,zero,0,0\n").expect("written");
    assert_says(&refused(&["--master", "script", "--input", &path]), &["path.csv", "line 3, column 2", "zero"]);
    assert_says(&refused(&["--master", "script"]), &["--input"]);
}

#[test]
fn a_configuration_is_refused_by_file_line_key_and_range() {
    let folder = TempFolder::new("config");
    let path = folder.file("krait.toml");
    let cases: [(&str, &[&str]); 7] = [
        ("[resolve]\nmax_bent_rad = 1.0\n", &["krait.toml", "line 2", "`max_bent_rad`", "did you mean `max_bend_rad`"]),
        ("[resolv]\n", &["krait.toml", "`resolv`", "did you mean `resolve`"]),
        ("[resolve]\nmax_bend_rad = 60.0\n", &["krait.toml", "max_bend_rad = 60", "0.05 to"]),
        ("[machine]\nr_m = 0.0\n", &["krait.toml", "line 1", "`machine`"]),
        ("[resolve]\nmax_bend_rad = nan\n", &["krait.toml", "max_bend_rad"]),
        ("compensation = \"perfect\"\n", &["krait.toml", "perfect", "estimated"]),
        ("[slave]\nwatchdog_ms = -1.0\n", &["krait.toml", "watchdog_ms"]),
    ];
    for (text, words) in cases {
        fs::write(&path, text).expect("written");
        assert_says(&refused(&["--config", &path]), words);
    }
    assert_says(&refused(&["--config", &folder.file("nowhere.toml")]), &["nowhere.toml", "could not be read"]);
}

#[test]
fn a_truth_file_is_refused_by_key() {
    let folder = TempFolder::new("truth");
    let path = folder.file("truth.toml");
    fs::write(&path, "[effects]\nplay_mm = 0.2\n").expect("written");
    assert_says(&refused(&["--truth", &path]), &["truth.toml", "play_mm", "play_m"]);
    fs::write(&path, "[effects]\nload_scale = -3.0\n").expect("written");
    assert_says(&refused(&["--truth", &path]), &["truth.toml", "load_scale", "-3"]);
}

#[test]
fn a_recording_is_never_overwritten_and_a_bad_place_is_named() {
    let folder = TempFolder::new("place");
    let path = folder.file("precious.mcap");
    fs::write(&path, "precious").expect("written");
    let instance = instance_name("bad");
    let ended = Ended::of(&["run", "--instance", &instance, "--recording", &path], PATIENCE);
    assert_eq!(ended.code, Some(2));
    assert_says(ended.sentence(), &["precious.mcap", "exists already"]);
    // Whatever fails afterwards, a file that was not this run's own is left alone.
    let flick = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/flick.mcap");
    let ended = Ended::of(&["replay", flick, "--to", "1", "--instance", &instance, "--recording", &path], PATIENCE);
    assert_eq!(ended.code, Some(2));
    assert_says(ended.sentence(), &["precious.mcap", "exists already"]);
    assert_eq!(fs::read(&path).expect("still there"), b"precious");
    assert_says(&refused(&["--recording", &folder.file("run.csv")]), &["run.csv", ".mcap"]);
    assert_says(&refused(&["--recording", "/proc/krait/run.mcap"]), &["/proc/krait/run.mcap"]);
}

#[test]
fn an_instance_name_that_is_no_name_is_refused() {
    let ended = Ended::of(&["run", "--instance", "Left Arm"], PATIENCE);
    assert_eq!(ended.code, Some(2));
    assert_says(ended.sentence(), &["Left Arm", "--instance"]);
}

#[test]
fn a_full_disk_stops_the_recording_and_never_the_motion() {
    let folder = TempFolder::new("full");
    let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", "size=600k", "tmpfs"]).arg(folder.path()).output();
    if !mounted.as_ref().is_ok_and(|output| output.status.success()) {
        println!("SKIPPED: a small disk could not be mounted here, so it cannot be filled: {mounted:?}");
        return;
    }
    let (instance, path) = (instance_name("full"), folder.file("run.mcap"));
    let ended = Ended::of(
        &["run", "--engage=again", "--json", "--instance", &instance, "--recording", &path, "--seconds", "6"],
        PATIENCE,
    );
    let opened = Recording::open(Path::new(&path));
    let unmounted = Command::new("umount").arg(folder.path()).status().expect("umount runs");
    assert!(unmounted.success());
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("No space left") && ended.stderr.contains("motion is not affected"),
        "{}",
        ended.stderr
    );
    let figures = ended.json();
    assert_eq!(figures["recording_is_whole"], false);
    let contents = opened.expect("what was recorded is readable");
    let n_commands = contents.contents().channels[&krait_schema::Channel::Command].n_messages;
    assert!(n_commands > 500, "{n_commands} commands were kept");
    // More than a second of the six at least, also where the processes took long to start.
    let n_received = figures["samples"]["received"].as_u64().unwrap_or_default();
    assert!(n_received > n_commands + 1000, "the motion went on: {n_commands} commands were kept, {figures}");
}
