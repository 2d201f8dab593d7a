//! Emergencies without a change of the status word: nothing stops, and the log says each code once.

use super::*;
use krait_ipc::message::DriveCycle;
use krait_slave::DriveError;
use std::cell::RefCell;
use std::fmt::{Debug, Write};
use std::sync::Once;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber, span};

thread_local! {
    /// What was logged in this thread, one line for each warning.
    static LOGGED: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps the warnings of each thread for itself.
struct Log;

impl Subscriber for Log {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::WARN
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn event(&self, event: &Event<'_>) {
        LOGGED.with_borrow_mut(|text| event.record(&mut Line(text)));
    }

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

/// Begins to keep the log, before any test's bench says anything: of two logs that begin and end beside each other `tracing` can take a
/// place in the code for one that nobody listens to.
pub(super) fn keep_log() {
    static BEGUN: Once = Once::new();
    BEGUN.call_once(|| tracing::subscriber::set_global_default(Log).unwrap());
}

struct Line<'a>(&'a mut String);

impl Visit for Line<'_> {
    fn record_debug(&mut self, _: &Field, value: &dyn Debug) {
        writeln!(self.0, "{value:?}").unwrap();
    }
}

/// What was said in this thread since the last look.
fn said() -> Vec<String> {
    LOGGED.take().lines().map(str::to_owned).collect()
}

/// The second drive sends an emergency before the next cycle.
fn send(bench: &Bench, code: u16) {
    let [low, high] = code.to_le_bytes();
    bench.bus.lock().inject(Frame::new(0x082, &[low, high, 3, 0, 0, 0, 0, 0]));
}

#[test]
fn an_emergency_without_a_failure_stops_nothing_and_each_code_is_said_once_until_power_comes_anew() {
    said();
    let mut bench = Bench::powered();
    bench.go(20);
    assert_eq!(said(), [""; 0]);
    for (code, words) in [
        (0x4210, "(code 4210h): it reports that it is too hot"),
        (0x3220, "(code 3220h): it reports a supply voltage out of its range"),
        (0x9000, "(code 9000h): it reports an external error"),
        (0xFF01, "(code FF01h): it reports a failure of its own"),
    ] {
        // Again and again, and that it is over between: as at a threshold.
        for _ in 0..20 {
            send(&bench, code);
            send(&bench, 0);
            bench.go(1);
        }
        let lines = said();
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert!(lines[0].starts_with("drive 2 (id 2) sent an emergency ") && lines[0].contains(words), "{lines:?}");
        assert!(lines[0].contains("look whether the drive is sound"), "{lines:?}");
    }
    assert_eq!((bench.report().failure, bench.states()), (None, [State::OperationEnabled; 3]));
    assert!(!bench.report().has_emergency, "the drive has taken them back");
    bench.power_up();
    assert_eq!(said(), [""; 0], "what was said is not said again by itself");
    send(&bench, 0x4210);
    bench.go(1);
    assert_eq!(said().len(), 1, "power is switched on anew: it is news again");
    let cycles = core::iter::from_fn(|| bench.exchange.cycles.pop::<DriveCycle>());
    let newest = cycles.last().expect("a cycle");
    assert_eq!([0, 1, 2].map(|k| newest.actuators[k].emergency_code), [0, 0x4210, 0], "it stands, and is recorded");
    assert!(bench.report().has_emergency);
    assert_eq!((bench.report().failure, bench.states()), (None, [State::OperationEnabled; 3]));
}

#[test]
fn a_drive_with_ever_new_codes_does_not_fill_the_log_and_the_last_line_says_so() {
    said();
    let mut bench = Bench::powered();
    bench.go(20);
    // Several within a cycle are all said.
    for code in 0x5000..0x5064 {
        send(&bench, code);
        bench.go(usize::from(code % 3 == 0));
    }
    bench.go(1);
    let lines = said();
    assert_eq!(lines.len(), 8, "{lines:?}");
    for (code, line) in (0x5000..).zip(&lines) {
        assert!(line.contains(&format!("(code {code:04X}h)")), "{line}");
    }
    let says_so = |line: &String| line.ends_with("are not said until power is switched on anew");
    assert!(says_so(&lines[7]) && !lines[..7].iter().any(says_so), "{lines:?}");
    assert_eq!(bench.report().failure, None);
}

#[test]
fn the_emergency_of_a_second_drive_that_trips_is_said_though_the_first_failure_alone_is_reported() {
    said();
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().with(0, |drive, out| drive.trip(0x2310, out));
    bench.go(5);
    bench.bus.lock().with(1, |drive, out| drive.trip(0x4310, out));
    bench.go(5);
    let failure = bench.report().failure.and_then(|failure| failure.actuator());
    assert_eq!(failure, Some(1));
    let lines = said();
    assert!(lines.iter().any(|line| line.contains("drive 2 (id 2) sent an emergency (code 4310h)")), "{lines:?}");
}

#[test]
fn who_had_failed_before_the_bus_was_opened_is_named_with_its_code_and_an_enable_resets_it() {
    type Lacks = &'static [u16];
    let cases: [(u16, Lacks, &str); 4] = [
        (0x2310, &[], "error code 2310h (object 603F), so it reports too much current, error register 01h (1001); "),
        (
            0x9000,
            &[0x1001],
            "error code 9000h (object 603F), so it reports an external error, as an emergency stop is; ",
        ),
        (0x2310, &[0x603F], "it tells no error code (object 603F), error register 01h (1001); "),
        (0x2310, &[0x603F, 0x1001], "it tells no error code (object 603F); "),
    ];
    for (code, lacks, words) in cases {
        said();
        let (bus, config) = three();
        bus.lock().with(1, |drive, out| drive.trip(code, out));
        for index in lacks {
            bus.lock().drives[1].remove_object(*index, 0);
        }
        let mut bench = Bench::with((bus, config));
        let begin = "drive 2 (id 2) had failed before its bus was opened: ";
        let expected = format!("{begin}{words}an enable resets that, so check first why it failed");
        let lines: Vec<String> = said().into_iter().filter(|line| line.contains("had failed")).collect();
        assert_eq!(lines, [expected]);
        assert_eq!(bench.states(), [State::SwitchOnDisabled, State::Fault, State::SwitchOnDisabled]);
        // Without power nothing is reset, and it is said once.
        bench.steps(10);
        assert_eq!(bench.states()[1], State::Fault);
        bench.power_up();
        assert!(!said().iter().any(|line| line.contains("had failed")));
    }
}

/// A warning that is over is no reason of what comes later; the code of a failure stays its reason, also when the error is over.
#[test]
fn a_warning_that_is_over_names_no_later_stop_and_a_failure_keeps_its_code() {
    for (is_over, expected) in [(true, DriveError::HardwareStop { actuator: 2, code: 0 }), (false, tripped(0x4210))] {
        let mut bench = Bench::powered();
        send(&bench, 0x4210);
        bench.go(5);
        if is_over {
            send(&bench, 0);
        }
        bench.go(5);
        bench.bus.lock().with(1, |drive, out| drive.press_emergency_stop(None, out));
        bench.go(3);
        assert_eq!(bench.report().failure.map(code_alone), Some(expected), "over: {is_over}");
    }
    let mut bench = Bench::powered();
    bench.bus.lock().with(1, |drive, out| drive.trip(0x3220, out));
    send(&bench, 0);
    bench.go(3);
    assert_eq!(bench.report().failure.map(code_alone), Some(tripped(0x3220)));
}

fn tripped(code: u32) -> DriveError {
    DriveError::Tripped { actuator: 2, code, meaning: "" }
}

fn code_alone(failure: DriveError) -> DriveError {
    match failure {
        DriveError::Tripped { actuator, code, .. } => DriveError::Tripped { actuator, code, meaning: "" },
        other => other,
    }
}
