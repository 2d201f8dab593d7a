//! A pose sender over a real socket drives the real chain: it bends the snake, a second sender and a jump do not, its silence
//! ends the motion, and its recorded packets give the same inputs again, byte for byte.

use core::time::Duration;
use krait_ipc::message::{DeviceState, OperatorInput, SlaveState};
use krait_ipc::{Bus, ReadOptions, Reader, Reason, Reasons};
use krait_master::{Engage, HidRecording, Layout, MasterConfig, MasterCore, PoseConfig, PosePacket};
use krait_schema::Sample;
use krait_tests::{
    Ended, Krait, TempFolder, assert_no_jump, instance_name, real_drives, samples_in, states_in, wait_for, wait_until,
};
use rustix::process::Signal;
use std::net::{SocketAddr, UdpSocket};
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);
/// Long, so that a busy machine that holds this test up is no loss.
const LEASE_S: f64 = 0.5;
const OPEN: f64 = 0.0;
const CLOSED: f64 = 1.0;
/// The hand's way from packet to packet, m: a tenth of a metre a second at the sender's pace.
const STEP_M: f64 = 0.2e-3;

/// A program that sends poses, a packet at a time.
struct PoseProgram {
    socket: UdpSocket,
    to: SocketAddr,
    x_m: f64,
}

impl PoseProgram {
    fn new(to: SocketAddr) -> Self {
        Self { socket: UdpSocket::bind("127.0.0.1:0").expect("a socket"), to, x_m: 0.1 }
    }

    fn send(&mut self, gripper: f64, way_m: f64) {
        self.x_m += way_m;
        let pose = PosePacket { gripper, position: [self.x_m, 0.2, -0.3], orientation: [1.0, 0.0, 0.0, 0.0] };
        self.raw(&pose.encode());
        std::thread::sleep(Duration::from_millis(2));
    }

    fn raw(&self, bytes: &[u8]) {
        // Nobody may listen yet.
        let _refused_is_fine = self.socket.send_to(bytes, self.to);
    }
}

/// What the chain says while a program sends.
struct Watch {
    states: Reader<SlaveState>,
    inputs: Reader<OperatorInput>,
    state: Option<SlaveState>,
    input: Option<OperatorInput>,
}

impl Watch {
    fn of(instance: &str) -> Self {
        let bus = Bus::open(instance, "test").expect("joined");
        let states = bus.reader(ReadOptions::observing()).expect("states");
        Self { states, inputs: bus.reader(ReadOptions::observing()).expect("inputs"), state: None, input: None }
    }

    /// Acts again and again until state and input are as wanted.
    fn until(&mut self, what: &str, mut act: impl FnMut(), is_so: impl Fn(&SlaveState, &OperatorInput) -> bool) {
        let found = wait_until(PATIENCE, || {
            act();
            self.state = self.states.take_newest().expect("states").map(|state| *state).or(self.state);
            self.input = self.inputs.take_newest().expect("inputs").map(|input| *input).or(self.input);
            self.state.as_ref().zip(self.input.as_ref()).is_some_and(|(state, input)| is_so(state, input))
        });
        assert!(found, "never {what}; last {:?} {:?}", self.state, self.input);
    }

    /// Opens and closes the gripper until the slave says that the operator has engaged.
    fn take_hold(&mut self, program: &mut PoseProgram) {
        let mut n = 0;
        let act = || {
            n += 1;
            program.send(if n % 60 < 20 { OPEN } else { CLOSED }, 0.0);
        };
        self.until("engaged", act, |state, _| state.is_engaged());
        // Where the loop ends, the gripper is closed: it engages no other way.
    }
}

fn bend_rad(state: &SlaveState) -> f64 {
    state.setpoint_bend_rad[0].hypot(state.setpoint_bend_rad[1])
}

fn has(bits: u64, reason: Reason) -> bool {
    Reasons::from_bits(bits).contains(reason)
}

fn pose_config(listen: SocketAddr) -> MasterConfig {
    let pose = PoseConfig { listen: Some(listen), lease_s: LEASE_S, ..PoseConfig::default() };
    MasterConfig { pose, engage: Engage::Once, ..MasterConfig::default() }
}

#[test]
fn a_pose_sender_bends_the_snake_and_neither_a_second_one_nor_a_jump_nor_silence_does() {
    let (instance, folder) = (instance_name("pose"), TempFolder::new("pose"));
    let (recording, packets) = (folder.file("run.mcap"), folder.file("hand.krr"));
    let free = UdpSocket::bind("127.0.0.1:0").expect("a port").local_addr().expect("its number");
    let config = folder.file("krait.toml");
    std::fs::write(&config, format!("[master]\nrecord_reports = {packets:?}\n[master.pose]\nlease_s = {LEASE_S}\n"))
        .expect("written");
    let listen = free.to_string();
    let krait = Krait::start(&[
        "run",
        "--master",
        "pose",
        "--listen",
        &listen,
        "--instance",
        &instance,
        "--recording",
        &recording,
        "--config",
        &config,
    ]);
    wait_for(&instance, "ready", SlaveState::is_ready);
    let (mut watch, mut hand, mut other) = (Watch::of(&instance), PoseProgram::new(free), PoseProgram::new(free));

    // Moved before it takes hold, it engages nothing and moves nothing.
    let mut n = 0;
    watch.until("heard", || hand.send(OPEN, STEP_M), |_, input| input.n_reports > 100);
    watch.until("still", || n += 1, |state, _| !state.is_engaged() && bend_rad(state) == 0.0);
    watch.take_hold(&mut hand);
    watch.until("bent to 15 degrees", || hand.send(CLOSED, STEP_M), |state, _| bend_rad(state) > 0.26);

    // A second sender neither drives nor stops.
    let n_refused = watch.input.expect("an input").n_refused;
    let act = || {
        hand.send(CLOSED, -STEP_M);
        other.send(OPEN, 10.0 * STEP_M);
    };
    watch.until("the second is counted", act, |state, input| {
        assert!(state.is_engaged() && input.operator_present(), "{input:?}");
        input.n_refused > n_refused + 50
    });
    let act = || {
        hand.raw(&[0; 71]);
        hand.send(CLOSED, STEP_M);
    };
    watch.until("nonsense is counted", act, |state, input| {
        assert!(state.is_engaged(), "{input:?}");
        input.n_refused > n_refused + 70
    });

    // A jump ends the hold by its name; packets that go on from there do not bring it back.
    hand.send(CLOSED, 0.5);
    watch.until(
        "named",
        || hand.send(CLOSED, STEP_M),
        |state, input| !state.is_engaged() && has(state.reasons, Reason::HandJumped) && !input.operator_present(),
    );
    let n_jumped = watch.input.expect("an input").n_reports;
    watch.until(
        "still held",
        || hand.send(CLOSED, STEP_M),
        |state, input| {
            assert!(!state.is_engaged() && input.flags & OperatorInput::HAND_JUMPED != 0, "{input:?}");
            input.n_reports > n_jumped + 100
        },
    );
    watch.take_hold(&mut hand);
    let bent_rad = bend_rad(&watch.state.expect("a state"));
    watch.until("bent further", || hand.send(CLOSED, STEP_M), |state, _| bend_rad(state) > bent_rad + 0.05);

    // Silence: lost, held, and at rest.
    watch.until(
        "lost",
        || (),
        |state, input| {
            !state.is_engaged() && has(state.reasons, Reason::DeviceLost) && input.device() == Some(DeviceState::Lost)
        },
    );
    let mut still = (0_u64, [0.0; 12]);
    let at = std::cell::Cell::new(0);
    watch.until("at rest", || at.set(at.get() + 1), |state, _| at.get() > 30 && !state.is_engaged());
    for _ in 0..2 {
        let state = watch.state.expect("a state");
        assert!(still.0 == 0 || still.1 == state.setpoint_q_m, "it moves after the loss: {still:?} {state:?}");
        still = (state.sequence, state.setpoint_q_m);
        watch.until("later", || (), |later, _| later.sequence > still.0 + 200);
    }
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(ended.stderr.contains("a second sender of poses is ignored"), "{}", ended.stderr);
    // What the hand can and this snake cannot is named at the start.
    assert!(ended.stderr.contains("a snake of three lines bends in two directions"), "{}", ended.stderr);
    assert!(ended.stderr.contains("expected 72 bytes"), "{}", ended.stderr);

    assert_no_jump(&states_in(&recording));
    let inputs = inputs_in(&recording);
    silence_ends_presence_within_the_lease(&inputs);
    the_packets_give_the_same_inputs(&inputs, &packets, pose_config(free));
    let verified = Ended::of(&["verify", &recording], PATIENCE);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stderr, verified.stdout);
}

fn inputs_in(recording: &str) -> Vec<OperatorInput> {
    let samples = samples_in(recording).into_iter();
    samples.filter_map(|sample| if let Sample::Input(input) = sample { Some(input) } else { None }).collect()
}

/// The last input with presence is no more ticks after the newest packet than the lease has, and two.
fn silence_ends_presence_within_the_lease(inputs: &[OperatorInput]) {
    let last = inputs.iter().rposition(OperatorInput::operator_present).expect("somebody was there");
    let n_reports = inputs[last].n_reports;
    let n_ticks = inputs[..=last].iter().rev().take_while(|input| input.n_reports == n_reports).count();
    assert!(n_ticks <= (LEASE_S * 1e3) as usize + 2, "{n_ticks} inputs with presence after the last packet");
}

/// The recorded packets through a core of the same settings, at the recorded instants: the inputs, byte for byte.
fn the_packets_give_the_same_inputs(inputs: &[OperatorInput], packets: &str, config: MasterConfig) {
    let recording = HidRecording::load(Path::new(packets)).expect("packets");
    assert_eq!(recording.header().layout, Some(Layout::Pose));
    let first = inputs.iter().find(|input| input.n_reports > 0).expect("packets were heard");
    let mut packets = recording.reports();
    let newest_ns = packets.nth(first.n_reports as usize - 1).expect("as many as were heard").0;
    let begun_ns = first.stamps.device_ns - newest_ns;
    let mut core = MasterCore::with_pose(&config).expect("settings");
    let mut packets = recording.reports().peekable();
    let sender = SocketAddr::from(([127, 0, 0, 1], 9));
    let (mut n_taken, mut n_moving) = (0, 0);
    for recorded in inputs {
        while let Some((stamp_ns, bytes)) = packets.next_if(|(ns, _)| begun_ns + ns <= recorded.sample_ns) {
            n_taken += u64::from(core.on_packet(bytes, sender, begun_ns + stamp_ns).is_ok());
        }
        let mut again = core.on_tick(recorded.sample_ns);
        // When it was sent is the machine's; packets of the second sender are not in the recording of the hand's.
        again.stamps = recorded.stamps;
        again.n_refused = recorded.n_refused;
        assert_eq!(again, *recorded);
        n_moving += u32::from(again.tip_vel_in_view_m_per_s != [0.0; 3]);
    }
    assert!(n_taken > 300 && n_moving > 300, "{n_taken} packets, {n_moving} inputs that move");
}

#[test]
fn recorded_packets_drive_the_chain_as_a_recording_of_reports_does() {
    let (instance, folder) = (instance_name("poses"), TempFolder::new("poses"));
    let (recording, packets) = (folder.file("run.mcap"), folder.file("hand.krr"));
    let mut text = "krait-report-recording 1\ndevice 0000:0000\nlayout pose\nreports\n".to_owned();
    let n_packets = 1500;
    for n in 0..n_packets {
        let (gripper, x) = (if n < 300 { OPEN } else { CLOSED }, f64::from(n.max(400)) * STEP_M);
        let pose = PosePacket { gripper, position: [x, 0.0, 0.0], orientation: [1.0, 0.0, 0.0, 0.0] };
        let hex: String = pose.encode().iter().map(|byte| format!("{byte:02x}")).collect();
        text += &format!("{} {hex}\n", i64::from(n) * 2_000_000);
    }
    std::fs::write(&packets, format!("{text}end {n_packets}\n")).expect("written");
    let ended = Ended::of(
        &[
            "run",
            "--engage",
            "--input",
            &packets,
            "--seconds",
            "4.5",
            "--instance",
            &instance,
            "--recording",
            &recording,
        ],
        PATIENCE,
    );
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let states = states_in(&recording);
    assert_no_jump(&states);
    let most_rad = states.iter().map(bend_rad).fold(0.0, f64::max);
    assert!(most_rad > 0.17, "bent by {most_rad} rad");
}

#[test]
fn what_no_pose_sender_may_do_is_refused_with_what_to_do() {
    let folder = TempFolder::new("poses-refused");
    let real = real_drives(&folder);
    for (arguments, words) in [
        (&["--master", "pose"][..], &["--listen 127.0.0.1:5005"][..]),
        (&["--master", "pose", "--listen", "0.0.0.0:5005"], &["[master.pose] listen", "one address of this machine"]),
        (&["--listen", "127.0.0.1:5005"], &["--listen", "--master pose"]),
        (&["--master", "pose", "--listen", "127.0.0.1:5005", "--engage"], &["--engage", "gripper"]),
        (&["--master", "pose", "--listen", "127.0.0.1:5005", "--config", &real], &["real_drives", "authentication"]),
        (&["--master", "pose", "--listen", "192.0.2.1:5005"], &["192.0.2.1:5005", "free port"]),
    ] {
        let instance = instance_name("poses-refused");
        let mut all = vec!["run", "--no-recording", "--instance", &instance];
        all.extend(arguments);
        let ended = Ended::of(&all, PATIENCE);
        assert_eq!(ended.code, Some(2), "{arguments:?}: {}", ended.stderr);
        for word in words {
            assert!(ended.sentence().contains(word), "{word:?} is not in: {}", ended.sentence());
        }
    }
}
