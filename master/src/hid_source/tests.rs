//! The live device's thread against devices that signal, vanish, come back and flood.

use super::*;
use crate::LightRole;
use crate::hid::HidPort;
use crate::lights::{HandState, LightShow};
use std::sync::mpsc;

/// What a test's device does at its next read.
pub(crate) enum Act {
    HidReport(Vec<u8>),
    Signal,
    Vanish,
    Drop,
    GiveBack,
}

struct FakePort(Arc<std::sync::Mutex<mpsc::Receiver<Act>>>, Arc<AtomicU64>);

impl HidPort for FakePort {
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], _: Duration) -> Result<usize, ReadFailure> {
        match self.0.lock().expect("acts").recv_timeout(Duration::from_millis(1)) {
            Ok(Act::HidReport(bytes)) => {
                buffer[..bytes.len()].copy_from_slice(&bytes);
                Ok(bytes.len())
            }
            Ok(Act::Signal) => Err(ReadFailure::Interrupted),
            Ok(Act::Drop) => Err(ReadFailure::Dropped),
            Ok(Act::GiveBack) => Err(ReadFailure::GivenBack),
            Ok(Act::Vanish) => Err(ReadFailure::Gone("unexpected poll error (device disconnected)".to_owned())),
            Err(_) => Ok(0),
        }
    }

    fn show(&mut self, lights: Lights) {
        self.1.store(u64::from(lights.is_lit(LightRole::All)), Ordering::SeqCst);
    }

    fn rest_lights(&mut self) {
        self.1.store(0, Ordering::SeqCst);
    }
}

pub(crate) struct FakeHost {
    acts: Arc<std::sync::Mutex<mpsc::Receiver<Act>>>,
    light: Arc<AtomicU64>,
    // How many searches fail before the device is there again.
    n_absent: u32,
    n_opened: u32,
}

impl HidHost for FakeHost {
    fn open(&mut self, choice: &DeviceChoice) -> Result<OpenPort, MasterError> {
        if self.n_opened > 0 && self.n_absent > 0 {
            self.n_absent -= 1;
            return Err(MasterError::NoDevice { looked_for: choice.to_string(), present: "none".to_owned() });
        }
        self.n_opened += 1;
        // How its light is nobody knows.
        self.light.store(7, Ordering::SeqCst);
        let port = Box::new(FakePort(Arc::clone(&self.acts), Arc::clone(&self.light)));
        Ok(OpenPort { port, vid_pid: (0x046d, 0xc626) })
    }
}

/// A host whose device is absent for so many searches once it was lost; what it shall do, and its light.
pub(crate) fn host(n_absent: u32) -> (mpsc::Sender<Act>, Arc<AtomicU64>, FakeHost) {
    let (acts, taken) = mpsc::channel();
    let light = Arc::new(AtomicU64::new(0));
    let acts_taken = Arc::new(std::sync::Mutex::new(taken));
    let host = FakeHost { acts: acts_taken, light: Arc::clone(&light), n_absent, n_opened: 0 };
    (acts, light, host)
}

fn device(n_absent: u32) -> (mpsc::Sender<Act>, Arc<AtomicU64>, HidSource) {
    let (acts, light, host) = host(n_absent);
    let source = HidSource::open_on(Box::new(host), &DeviceChoice::Any, Duration::from_millis(1), None).expect("open");
    (acts, light, source)
}

/// The next event, waiting as the process loop does.
pub(crate) fn wait_for_event(source: &mut impl ReportSource) -> SourceEvent {
    for _ in 0..10_000 {
        source.wait_until(clock::monotonic_ns() + 1_000_000);
        if let Some(event) = source.next_event(clock::monotonic_ns()) {
            return event;
        }
    }
    panic!("no event came");
}

#[test]
fn reports_arrive_in_order_and_signals_are_not_noticed() {
    let (acts, light, mut source) = device(0);
    for k in 0..100_u8 {
        acts.send(Act::Signal).expect("signal");
        acts.send(Act::HidReport(vec![3, k])).expect("report");
    }
    for k in 0..100_u8 {
        let SourceEvent::HidReport { report, .. } = wait_for_event(&mut source) else { panic!("a report") };
        assert_eq!(report.as_bytes(), [3, k]);
    }
    assert_eq!(light.load(Ordering::SeqCst), 1);
    drop(source);
    assert_eq!(light.load(Ordering::SeqCst), 0, "the light goes out at the end");
}

#[test]
fn an_unplugged_device_is_told_and_found_again_after_failed_searches() {
    let (acts, _, mut source) = device(5);
    acts.send(Act::Vanish).expect("vanish");
    assert!(matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::Out, .. }));
    assert!(matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::In, .. }));
    acts.send(Act::HidReport(vec![3, 1])).expect("report");
    assert!(matches!(wait_for_event(&mut source), SourceEvent::HidReport { .. }));
}

#[test]
fn dropped_events_are_a_loss_of_what_was_known_and_the_same_port_goes_on() {
    let (acts, light, mut source) = device(u32::MAX);
    acts.send(Act::Drop).expect("drop");
    acts.send(Act::HidReport(vec![3, 1])).expect("report");
    assert!(matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::Out, .. }));
    assert!(matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::In, .. }));
    assert!(matches!(wait_for_event(&mut source), SourceEvent::HidReport { .. }), "without a search, which would fail");
    assert_eq!(light.load(Ordering::SeqCst), 1);
}

#[test]
fn a_device_that_was_given_back_is_lost_and_not_taken_again() {
    let (acts, light, mut source) = device(0);
    acts.send(Act::GiveBack).expect("give back");
    acts.send(Act::HidReport(vec![3, 1])).expect("nobody reads it");
    assert!(matches!(wait_for_event(&mut source), SourceEvent::GivenBack));
    while !source.thread.as_ref().is_some_and(JoinHandle::is_finished) {
        std::thread::yield_now();
    }
    assert!(source.next_event(0).is_none(), "no search, no report");
    assert_eq!(light.load(Ordering::SeqCst), 0);
}

#[test]
fn the_newest_reports_survive_a_stalled_loop_and_the_dropped_ones_are_counted() {
    let (acts, _, mut source) = device(0);
    let n_sent = QUEUE as u64 + 744;
    for k in 0..n_sent {
        acts.send(Act::HidReport((k as u16).to_le_bytes().to_vec())).expect("report");
    }
    // The loop stalls until the thread has read them all.
    while source.shared.n_drained.load(Ordering::Relaxed) < 744 {
        std::thread::yield_now();
    }
    assert!(matches!(source.next_event(0), Some(SourceEvent::Drained(744))));
    for k in 744..n_sent {
        let SourceEvent::HidReport { report, .. } = wait_for_event(&mut source) else { panic!("a report") };
        assert_eq!(report.as_bytes(), (k as u16).to_le_bytes());
    }
}

#[test]
fn the_light_follows_the_chain_without_a_report_and_a_device_that_comes_back_is_lit_as_the_chain_is() {
    let (acts, light, mut source) = device(0);
    let mut show = LightShow::new(1000);
    let becomes = |is_on: u64| {
        (0..10_000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            light.load(Ordering::SeqCst) == is_on
        })
    };
    assert!(becomes(1), "taken");
    source.show(show.look(Some(HandState::Limit.into())));
    assert!(becomes(0), "the first gap of a limit");
    source.show(show.look(Some(HandState::Engaged.into())));
    assert!(becomes(1));
    source.show(show.look(Some(HandState::Limit.into())));
    assert!(becomes(0));
    acts.send(Act::Vanish).expect("vanish");
    assert!(matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::Out, .. }));
    assert!(matches!(wait_for_event(&mut source), SourceEvent::Plug { device: 0, plug: Plug::In, .. }));
    assert!(becomes(0), "still at the limit");
}
