//! Another user of the machine: he reads nothing, changes nothing and moves nothing, whatever he prepares or tries.

#![allow(clippy::expect_used, clippy::print_stderr, reason = "a panic is how a test fails; a skipped test says so")]

use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{OperatingState, OperatorInput, SlaveState};
use krait_ipc::{InstanceName, ground, resources_of};
use krait_master::PosePacket;
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{
    Console, Ended, Krait, TempFolder, instance_name, krait_program, processes_of, states_in, wait_for_motion,
};
use rustix::fs::{CWD, Mode, mkfifoat};
use rustix::process::{Signal, geteuid};
use std::fs;
use std::net::UdpSocket;
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
    let arguments = ["run", "--engage=again", "--instance", &instance, "--recording", &recording, "--seconds", "1"];
    let linked = Ended::of(&arguments, PATIENCE);
    // A pipe from which he would feed faster limits to whoever opens it, and a lock that he holds.
    fs::remove_file(trap.join("config.toml")).expect("made before");
    mkfifoat(CWD, trap.join("config.toml"), Mode::RWXU | Mode::RWXG | Mode::RWXO).expect("made");
    let held = fs::File::create(trap.with_extension("lock")).expect("made");
    held.lock().expect("his");
    let (second, piped) = (
        folder.file("second.mcap"),
        Ended::of(&[&arguments[..5], &[&folder.file("second.mcap")], &arguments[6..]].concat(), PATIENCE),
    );
    fs::remove_dir_all(&trap).expect("removed");
    fs::remove_file(trap.with_extension("lock")).expect("removed");
    assert_eq!(fs::read_to_string(&victim).expect("there"), "precious");
    for (ended, recording) in [(linked, recording), (piped, second)] {
        assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
        assert!(configuration_of(&recording).contains("max_bend_vel_rad_per_s = 2.0"));
    }
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

/// Every command that reaches a chain that runs, or a file of it; each must fail. `$recording` and `$model` are the chain's.
const COMMANDS: [&str; 38] = [
    "stop",
    "state",
    "state enable",
    "state disable",
    "state pause",
    "state resume",
    "state home",
    "state unhome",
    "state clear-fault",
    "state --scale 0.5",
    "state --lock translation",
    "state --unlock rotation",
    "mark hello",
    "watch --once",
    "model exchange $model",
    "verify $recording",
    "replay $recording",
    "compare $recording $recording",
    "export $recording --out /tmp/x-$$.csv",
    "recover $recording --out /tmp/x-$$.mcap",
    "console $recording",
    "model save-learnt $recording --out /tmp/x-$$.toml",
    "lab diagnose --model $model --data $recording",
    "experiment poses --from $recording",
    "experiment fig10 --model $model --engage",
    "run --no-recording --seconds 1 --engage --model $model",
    "run --no-recording --seconds 1 --engage --input $recording",
    "run --no-recording --seconds 1 --config $model",
    "replay $recording --real-time --engage",
    "model show $model",
    "model check $model",
    "model compensate $model --in $recording --out /tmp/x-$$.csv",
    "lab init $recording --map-out /tmp/x-$$.toml --model-out /tmp/y-$$.toml",
    "lab compare --model $model --data $recording",
    "lab add backlash --model $model --data $recording --out /tmp/x-$$.toml",
    "lab fit --model $model --data $recording --out /tmp/x-$$.toml",
    "calibrate photo $recording",
    "config --config $model",
];

/// What publishes without being asked who is there: none may join another user's chain.
const WRITERS: [&str; 8] = ["master", "resolve", "compensate", "slave", "estimate", "record", "shape", "console"];

/// What the other user does to the files and processes of a chain, and to the chain itself. He says a word in capitals where
/// he gets through.
fn attack(instance: &str, recording: &str, model: &str, trap: &str) -> String {
    let (ground, program) = (ground().display(), krait_program().display());
    let files = resources_of(&InstanceName::new(instance).expect("a name"));
    assert!(files.len() > 20, "{files:?}");
    let files: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
    let pids: Vec<String> = processes_of(instance).iter().map(|(_, pid)| pid.to_string()).collect();
    let pids = pids.join(" ");
    let mut script = format!(
        "recording={recording} model={model}
         ls {ground} && echo LISTED
         touch {ground}/x && echo WROTE
         for file in {recording} {model} $(cat <<'END'\n{files}END\n); do
           (cat $file >/dev/null) && echo READ $file
           (: >> $file) && echo WROTE $file
           (chmod 666 $file) && echo WROTE $file
           (mv $file $file.old) && echo MOVED $file
           rm $file && echo REMOVED $file
         done
         for pid in {pids}; do
           for signal in STOP TERM KILL WINCH; do kill -$signal $pid && echo SIGNALLED; done
           for part in environ mem maps auxv stack io fd/0 fd/1 fd/3; do
             (head -c 1 /proc/$pid/$part >/dev/null) && echo READ /proc/$pid/$part
           done
           ls /proc/$pid/fd/ /proc/$pid/cwd/ /proc/$pid/root/ /proc/$pid/map_files/ && echo LISTED
           (echo 0 > /proc/$pid/mem) && echo WROTE
           (echo 1000 > /proc/$pid/oom_score_adj) && echo WROTE
           renice -n 5 -p $pid && echo SLOWED
         done\n"
    );
    // His own ground, and one that only looks like his: a link to the other's.
    for (place, commands) in
        [("", &COMMANDS[..]), (&format!("XDG_RUNTIME_DIR={trap} "), &[&COMMANDS[..], &WRITERS[..]].concat()[..])]
    {
        for command in commands {
            let begun = format!("{place}timeout 20 {program} {command} --instance {instance} </dev/null");
            let begun = match command.contains("$recording") && !command.starts_with("replay") {
                true => begun.replace(&format!(" --instance {instance}"), ""),
                false => begun,
            };
            script += &format!("{begun} >/dev/null; code=$?; [ $code = 2 ] || echo DONE $code: '{place}{command}'\n");
        }
    }
    script
}

#[test]
fn another_user_can_neither_read_nor_write_nor_stop_a_chain_that_runs() {
    if !may_be_others() {
        return;
    }
    let _turn = OTHERS_GROUND.lock();
    let (instance, folder) = (instance_name("other"), TempFolder::new("other"));
    let (recording, model) = (folder.file("run.mcap"), folder.file("model.toml"));
    fs::write(&model, Ended::of(&["model", "show", "naive"], PATIENCE).stdout).expect("written");
    fs::set_permissions(&model, fs::Permissions::from_mode(0o600)).expect("mine");
    // A runtime directory of the other user's in memory, whose `krait` is a link to this user's ground.
    let trap = format!("/dev/shm/krait-test-{instance}");
    fs::create_dir(&trap).expect("made");
    fs::set_permissions(&trap, fs::Permissions::from_mode(0o700)).expect("mine");
    std::os::unix::fs::symlink(ground(), Path::new(&trap).join("krait")).expect("made");
    chown(&trap, Some(OTHER), Some(OTHER)).expect("root may");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let said = as_other(&attack(&instance, &recording, &model, &trap));
    fs::remove_dir_all(&trap).expect("removed");
    for word in ["LISTED", "WROTE", "READ", "SIGNALLED", "MOVED", "REMOVED", "SLOWED", "DONE"] {
        assert!(!said.contains(word), "the other user has {word}:\n{said}");
    }
    assert!(said.contains("no chain runs in instance"), "he sees an instance of his own:\n{said}");
    assert!(said.contains("krait is not a directory of this user"), "a link to another's ground is refused:\n{said}");
    assert!(said.contains("Permission denied") && said.contains("not permitted"), "{said}");
    assert_eq!(processes_of(&instance).len(), 7, "all of it still runs");
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let whole = Recording::open(Path::new(&recording)).expect("readable");
    let heard = whole.samples().expect("samples").map(|recorded| recorded.expect("readable").sample);
    let locks = OperatorInput::TRANSLATION_LOCKED | OperatorInput::ROTATION_LOCKED;
    let reached = heard.filter(|sample| match sample {
        Sample::State(state) => state.n_stops != 0 || state.operating() == Some(OperatingState::Paused),
        Sample::Input(input) => input.scale_permille != 1000 || input.flags & locks != 0,
        Sample::Marker(_) => true,
        _ => false,
    });
    assert_eq!(reached.count(), 0, "nothing that he asked for has reached the chain");
}

#[test]
fn another_user_gets_nothing_from_the_consoles_ports() {
    if !may_be_others() {
        return;
    }
    let (instance, folder) = (instance_name("ports"), TempFolder::new("ports"));
    let recording = folder.file("run.mcap");
    let run = ["run", "--engage=again", "--console", "--foxglove", "--instance", &instance, "--recording", &recording];
    let mut krait = Krait::start(&run);
    let console = Console::of(&mut krait);
    wait_for_motion(&instance, &recording);
    let (page, stop) = (console.port, console.stop_port());
    // What he can guess; the tokens he cannot, and they stand on no command line.
    let mut script = String::new();
    for (port, request) in [
        (page, "GET /live"),
        (page, "GET /recordings"),
        (page, "GET /recordings/run.mcap"),
        (page, "GET /lab/job"),
        (page, "POST /lab/job"),
        (page, "POST /token"),
        (page, "GET /foxglove/00000000000000000000000000000000"),
        (stop, "GET /stop"),
        (stop, "POST /stop"),
        (stop, "POST /stop/00000000000000000000000000000000"),
    ] {
        script += &format!(
            "exec 3<>/dev/tcp/127.0.0.1/{port} && printf '{request} HTTP/1.1\\r\\nHost: 127.0.0.1:{port}\\r\\nOrigin: http://127.0.0.1:{port}\\r\\nContent-Length: 0\\r\\nConnection: close\\r\\n\\r\\n' >&3 && echo \"{request}: $(timeout 5 head -n 1 <&3)\"\n"
        );
    }
    script += "cat /proc/[0-9]*/cmdline | tr '\\0' ' '\n";
    let said = as_other(&format!("bash <<'END'\n{script}END\n"));
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let answers: Vec<&str> = said.lines().filter(|line| line.contains("HTTP/1.1 ")).collect();
    assert_eq!(answers.len(), 10, "{said}");
    let refused = [" 400", " 401", " 403", " 404", " 405"];
    assert!(answers.iter().all(|line| refused.iter().any(|code| line.contains(code))), "{said}");
    let tokens = [console.token.clone(), console.stop_path().replace("/stop/", "")];
    assert!(said.contains("--recording") && !tokens.iter().any(|token| said.contains(token)), "a command line: {said}");
    assert!(states_in(&recording).iter().all(|state| state.n_stops == 0), "nothing was stopped");
}

#[test]
fn another_users_poses_are_refused_with_his_number_and_move_nothing() {
    if !may_be_others() {
        return;
    }
    let (instance, folder) = (instance_name("poses"), TempFolder::new("poses"));
    let recording = folder.file("run.mcap");
    let port = UdpSocket::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a port").port();
    let listen = format!("127.0.0.1:{port}");
    let run = ["run", "--master", "pose", "--listen", &listen, "--instance", &instance, "--recording", &recording];
    let krait = Krait::start(&run);
    wait_for_motion(&instance, &recording);
    // What takes hold of the snake when this user sends it (`pose_hand`): an open gripper, then a closed one that moves.
    let mut script = format!("exec 4<>/dev/udp/127.0.0.1/{port}\n");
    for k in 0..60 {
        let (gripper, n_times) = if k == 0 { (0.0, 100) } else { (1.0, 5) };
        let position = [0.1 + 1e-3 * f64::from(k), 0.2, -0.3];
        let bytes = PosePacket { gripper, position, orientation: [1.0, 0.0, 0.0, 0.0] }.encode();
        let octal: String = bytes.iter().map(|byte| format!("\\{byte:03o}")).collect();
        script += &format!("for k in $(seq {n_times}); do printf '{octal}' >&4; read -t 0.002 -u 4 nothing; done\n");
    }
    let said = as_other(&format!("bash <<'END'\n{script}echo SENT\nEND\n"));
    assert!(said.contains("SENT"), "{said}");
    let until_ns = monotonic_ns();
    // The same from this user takes hold, so it is the sender that was refused.
    let own = Command::new("bash").args(["-c", &format!("{script}true")]).status().expect("a shell can be started");
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert!(own.success() && ended.code == Some(0), "{}", ended.stderr);
    assert!(ended.stderr.contains("the socket belongs to user id 65534, expected 0"), "{}", ended.stderr);
    let states = states_in(&recording);
    let (before, after): (Vec<SlaveState>, Vec<SlaveState>) =
        states.into_iter().partition(|state| state.sample_ns < until_ns);
    assert!(before.iter().all(|state| !state.is_engaged() && state.command_sequence == 0), "another's hand");
    assert!(after.iter().any(|state| state.is_engaged() && state.command_sequence > 0), "this user's own");
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
