//! The master's loop on a real bus: what a reader of the channel meets.

#![allow(clippy::expect_used, clippy::panic, reason = "the helpers of a test fail as the test does")]

use krait_ipc::message::{DeviceState, Health, HopStamps, Message, OperatingState, OperatorInput, SlaveState};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, clock, health_channel};
use krait_master::{Engage, HidRecording, MasterConfig, MasterError, Script, SourceChoice, run};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

fn instance(test: &str) -> String {
    format!("m-{test}-{}", std::process::id())
}

struct Chain {
    bus: Bus,
    inputs: Reader<OperatorInput>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), MasterError>>>,
}

impl Chain {
    fn start(test: &str, config: MasterConfig, source: SourceChoice) -> Self {
        let bus = Bus::open(&instance(test), "test").expect("bus");
        let inputs = bus.reader(ReadOptions::observing()).expect("reader");
        let stop = Arc::new(AtomicBool::new(false));
        let (name, stop_seen) = (instance(test), Arc::clone(&stop));
        let work = move || run(&Bus::open(&name, "master").expect("bus"), &config, source, &stop_seen);
        let thread = std::thread::Builder::new().spawn(work).expect("thread");
        Self { bus, inputs, stop, thread: Some(thread) }
    }

    /// Gathers inputs until one satisfies a condition, which has to happen within a minute.
    fn until(&mut self, is_last: impl Fn(&OperatorInput) -> bool) -> Vec<OperatorInput> {
        let (mut gathered, give_up_ns) = (Vec::new(), clock::monotonic_ns() + 60_000_000_000);
        while clock::monotonic_ns() < give_up_ns {
            while let Some(input) = self.inputs.take().expect("take") {
                gathered.push(*input);
                if is_last(&input) {
                    return gathered;
                }
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        panic!("it did not happen within {} inputs", gathered.len());
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().expect("once").join().expect("no panic").expect("a clean end");
    }
}

fn shipped(duration_s: f64) -> SourceChoice {
    SourceChoice::Recording {
        recording: HidRecording::shipped().expect("built in").first_s(duration_s),
        looping: false,
    }
}

fn at_once() -> MasterConfig {
    MasterConfig { start_when_ready: false, engage: Engage::Once, ..MasterConfig::default() }
}

fn slave_state(sequence: u64, operating: OperatingState) -> SlaveState {
    SlaveState {
        sequence,
        sample_ns: clock::monotonic_ns(),
        stamps: HopStamps::default(),
        command_sequence: 0,
        operating_state: operating as u32,
        flags: SlaveState::IS_HOMED,
        setpoint_q_m: [0.0; 12],
        setpoint_bend_rad: [0.0; 2],
        setpoint_joints_rad: [0.0; 8],
        n_actuators: 3,
        n_joints: 0,
        measured_q_m: [0.0; 12],
        measured_tau_n: krait_ipc::message::lines([f64::NAN; 3]),
        reasons: 0,
        n_commands: 0,
        n_refused: 0,
        ..SlaveState::default()
    }
}

fn ended(input: &OperatorInput) -> bool {
    input.device() == Some(DeviceState::Ended)
}

#[test]
fn the_shipped_recording_reaches_a_reader_whole_in_order_and_with_its_speed_and_buttons() {
    let (mut chain, n_reports) = (Chain::start("whole", at_once(), shipped(2.5)), reports_in(2.5));
    let inputs = chain.until(ended);
    assert_eq!((chain.inputs.n_lost(), chain.inputs.n_out_of_order()), (0, 0));
    for pair in inputs.windows(2) {
        assert_eq!(pair[1].sequence, pair[0].sequence + 1);
        assert!(pair[1].sample_ns > pair[0].sample_ns, "time runs forwards");
    }
    assert!(inputs.iter().all(|i| i.stamps.device_ns <= i.sample_ns && i.sample_ns <= i.stamps.input_sent_ns));
    let peak = inputs.iter().map(|i| i.tip_vel_in_view_m_per_s[0]).fold(0.0, f64::max);
    assert!((0.012..0.025).contains(&peak), "the first stroke goes to the right at up to {peak} m/s");
    assert!(inputs.iter().any(|i| i.buttons == 1) && inputs.iter().any(|i| i.operator_present()));
    let last = inputs.last().expect("some");
    assert_eq!((last.n_reports, last.n_refused, last.flags), (n_reports, 0, 0));
    assert_eq!(last.tip_vel_in_view_m_per_s, [0.0; 3], "an ended recording moves nothing");
    chain.until(|i| i.sequence > last.sequence + 20 && ended(i));
    chain.end();
}

fn reports_in(duration_s: f64) -> u64 {
    HidRecording::shipped().expect("built in").first_s(duration_s).n_reports() as u64
}

#[test]
fn the_recording_waits_for_the_slave_while_inputs_without_motion_go_on() {
    let mut chain =
        Chain::start("ready", MasterConfig { engage: Engage::Once, ..MasterConfig::default() }, shipped(0.6));
    let mut slave = chain.bus.writer::<SlaveState>().expect("slave");
    slave.send(&slave_state(1, OperatingState::Disabled)).expect("send");
    let waiting = chain.until(|i| i.sequence >= 300);
    assert!(waiting.iter().all(|i| i.device() == Some(DeviceState::Waiting) && i.n_reports == 0 && i.flags == 0));
    slave.send(&slave_state(2, OperatingState::Enabled)).expect("send");
    let played = chain.until(ended);
    assert!(played.iter().any(|i| i.operator_present()), "the presence button of the recording was played");
    assert_eq!(chain.inputs.n_lost(), 0);
    chain.end();
}

#[test]
fn health_says_ready_counts_and_names_why_nothing_moves() {
    let bus = Bus::open(&instance("health"), "watcher").expect("bus");
    let mut healths: Reader<Health> =
        bus.reader_on(&health_channel(Process::Master), ReadOptions::observing()).expect("health");
    let mut chain = Chain::start("health", at_once(), shipped(0.1));
    let inputs = chain.until(ended);
    let first = *healths.take().expect("take").expect("the first word");
    assert_eq!((first.sequence, first.sequence(), first.n_sent, first.pid), (1, 1, 0, std::process::id()));
    chain.end();
    let last = *healths.take_newest().expect("take").expect("the last word");
    assert!(last.n_sent >= inputs.len() as u64);
    let reasons = Reasons::from_bits(last.reasons_now);
    assert!(reasons.contains(Reason::OperatorAbsent) && reasons.contains(Reason::InputEnded));
}

#[test]
fn a_script_moves_the_tip_as_it_says_and_ends() {
    let text = b"time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0,0.01,0\n0.3,0,0.01,0\n";
    let script = Script::parse("script", text).expect("script");
    let mut chain = Chain::start("script", at_once(), SourceChoice::Script { script, looping: false });
    let inputs = chain.until(ended);
    let n_moving = inputs.iter().filter(|i| i.tip_vel_in_view_m_per_s == [0.0, 0.01, 0.0]).count();
    assert_eq!(n_moving, inputs.len() - 1, "every input but the last");
    chain.end();
}

#[test]
fn played_reports_can_be_recorded_and_are_the_same_bytes() {
    let path = std::env::temp_dir().join(format!("krait-{}.krr", instance("tap")));
    let config = MasterConfig { record_reports: Some(path.clone()), ..at_once() };
    let mut chain = Chain::start("tap", config.clone(), shipped(0.9));
    chain.until(ended);
    chain.end();
    let (again, original) =
        (HidRecording::load(&path).expect("whole"), HidRecording::shipped().expect("built in").first_s(0.9));
    assert!(again.reports().map(|(_, bytes)| bytes).eq(original.reports().map(|(_, bytes)| bytes)));
    assert_eq!(again.header().layout, original.header().layout);
    let bus = Bus::open(&instance("tap2"), "master").expect("bus");
    let error = run(&bus, &config, shipped(0.1), &AtomicBool::new(true)).expect_err("never over an existing file");
    assert!(error.to_string().contains("could not be written"), "{error}");
    std::fs::remove_file(path).expect("remove");
}

#[test]
fn a_bad_setting_and_a_missing_device_are_told_before_anything_is_published() {
    let bus = Bus::open(&instance("refuse"), "master").expect("bus");
    let stop = AtomicBool::new(true);
    let config = MasterConfig { rate_hz: 50, ..at_once() };
    let error = run(&bus, &config, shipped(0.1), &stop).expect_err("out of range");
    assert!(error.to_string().contains("rate_hz = 50"), "{error}");
    let device = "1209:0001:no-such-serial".to_owned().try_into().expect("choice");
    let error = run(&bus, &MasterConfig { device, ..at_once() }, SourceChoice::Hid, &stop).expect_err("no such device");
    assert!(error.to_string().contains("looked for 1209:0001:no-such-serial"), "{error}");
}
