//! A disable of a bent snake on the real processes: the lines are relaxed first, everybody who looks is told, and the recording shows
//! that load falls, within the bounds, before power goes.

use core::time::Duration;
use krait_ipc::message::{OperatingState, SlaveState, StateRequest, Transition};
use krait_ipc::{Bus, Process, ReadOptions, Reason, Reasons};
use krait_schema::Sample;
use krait_tests::{
    Console, Ended, Krait, TempFolder, assert_no_jump, instance_name, next_of_kind, processes_of, samples_in,
    states_in, step_m, wait_for,
};
use rustix::process::{Pid, Signal, kill_process};

const PATIENCE: Duration = Duration::from_secs(240);
/// A way that takes seconds, so that everybody has time to look.
const CONFIG: &str = "[slave.drive]\nrelax_n = 0.5\ndisable_relax_m = 0.008\ndisable_relax_ms = 6000.0\n";
/// Longest way within which each actuator may go, m, and at what speed, m/s.
const WAY_M: f64 = 8e-3;
const RATE_M_PER_S: f64 = 2e-3;
/// The hand bends the snake as far as it may.
const SCRIPT: &str = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0.008,0.002,0\n240,0.008,0.002,0\n";

fn largest_n(state: &SlaveState) -> f64 {
    state.measured_tau_n.iter().fold(0.0, |largest: f64, tau| largest.max(tau.abs()))
}

fn has(state: &SlaveState, reason: Reason) -> bool {
    Reasons::from_bits(state.reasons).contains(reason)
}

fn is_bent(state: &SlaveState) -> bool {
    state.is_engaged() && largest_n(state) > 35.0
}

fn state(instance: &str, ask: &[&str]) -> Ended {
    let shown = Ended::of(&[&["state"], ask, &["--instance", instance]].concat(), PATIENCE);
    assert_eq!(shown.code, Some(0), "{ask:?}: {}", shown.stderr);
    shown
}

#[test]
fn a_disable_of_a_bent_snake_relaxes_its_lines_says_so_everywhere_and_a_stop_ends_it() {
    let (instance, folder) = (instance_name("relax"), TempFolder::new("relax"));
    let (path, config, script) = (folder.file("run.mcap"), folder.file("krait.toml"), folder.file("hand.csv"));
    std::fs::write(&config, CONFIG).expect("written");
    std::fs::write(&script, SCRIPT).expect("written");
    let run = ["run", "--engage=again", "--console", "--compensation=naive", "--instance", &instance];
    let more = ["--config", &config, "--recording", &path, "--master", "script", "--input", &script];
    let mut krait = Krait::start(&[&run[..], &more].concat());
    let console = Console::of(&mut krait);
    wait_for(&instance, "bent", is_bent);

    let disabled = std::thread::scope(|scope| {
        let disabling = scope.spawn(|| state(&instance, &["disable"]));
        wait_for(&instance, "relaxing", SlaveState::is_letting_go);
        let told =
            [state(&instance, &[]).stdout, Ended::of(&["watch", "--once", "--instance", &instance], PATIENCE).stdout];
        assert!(told[0].starts_with("PAUSED (DISABLED was asked for)"), "{}", told[0]);
        assert!(
            told[0].contains(Reason::Relaxing.sentence()) && told[0].contains("beside the limit 0.5000 N"),
            "{}",
            told[0]
        );
        assert!(told[1].starts_with("RELAXING ") && told[1].contains("The lines are being relaxed."), "{}", told[1]);
        let frame = next_of_kind(&mut console.page(), "frame");
        assert_eq!(frame["shown"], "relaxing", "{frame}");
        disabling.join().expect("it ends")
    });
    assert!(disabled.stdout.starts_with("DISABLED"), "it waits until the power has gone: {}", disabled.stdout);

    // Once more, and a stop in between.
    state(&instance, &["enable"]);
    wait_for(&instance, "bent again", |state| largest_n(state) > 5.0 && state.is_ready());
    let until_off = std::thread::scope(|scope| {
        let disabling = scope.spawn(|| state(&instance, &["disable"]));
        wait_for(&instance, "relaxing", SlaveState::is_letting_go);
        let stopped = Ended::of(&["stop", "--instance", &instance], PATIENCE);
        assert_eq!(stopped.code, Some(0), "{}", stopped.stderr);
        disabling.join().expect("it ends")
    });
    assert!(until_off.stdout.starts_with("DISABLED"), "{}", until_off.stdout);
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    judge(&path);
}

/// A slave that hangs confirms no stop, so the page's server asks for power off. The slave that wakes up then stops and relaxes the
/// lines of the bent snake before the power goes, and the page has said so.
#[test]
fn power_that_the_page_s_server_asks_off_behind_an_unconfirmed_stop_goes_behind_the_load() {
    let (instance, folder) = (instance_name("unconfirmed"), TempFolder::new("unconfirmed"));
    let (path, script) = (folder.file("run.mcap"), folder.file("hand.csv"));
    std::fs::write(&script, SCRIPT).expect("written");
    let run = ["run", "--engage=again", "--console", "--compensation=naive", "--instance", &instance];
    let mut krait =
        Krait::start(&[&run[..], &["--recording", &path, "--master", "script", "--input", &script]].concat());
    let console = Console::of(&mut krait);
    let bent = wait_for(&instance, "bent", is_bent);
    let bus = Bus::open(&instance, "test").expect("bus");
    let mut requests = bus.reader::<StateRequest>(ReadOptions::observing()).expect("a reader");
    let slave = processes_of(&instance).into_iter().find(|(name, _)| name == "slave").expect("a slave").1;
    let slave = Pid::from_raw(slave.cast_signed()).expect("a process");

    kill_process(slave, Signal::STOP).expect("frozen");
    let said = std::thread::scope(|scope| {
        let document = scope.spawn(|| console.press_stop());
        let asks = |request: &StateRequest| request.transition() == Some(Transition::Disable);
        while !document.is_finished() && !requests.take().expect("taken").is_some_and(|request| asks(&request)) {
            std::thread::sleep(Duration::from_millis(2));
        }
        kill_process(slave, Signal::CONT).expect("awake");
        document.join().expect("an answer")
    });
    assert!(said.contains("The stop was not confirmed, so power was asked off after"), "{said}");
    assert!(said.contains("Relaxing, then power goes off."), "{said}");
    wait_for(&instance, "off", |state| state.operating() == Some(OperatingState::Disabled));
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));

    let states = states_in(&path);
    assert_no_jump(&states);
    let relaxing: Vec<&SlaveState> = states.iter().filter(|state| state.is_letting_go()).collect();
    let last = relaxing.last().expect("it relaxes");
    assert!(relaxing.iter().all(|state| state.n_stops == bent.n_stops + 1), "behind the stop");
    assert!(
        largest_n(last) < 0.1 * largest_n(&bent),
        "{} of {} N with the default bounds",
        largest_n(last),
        largest_n(&bent)
    );
}

fn judge(path: &str) {
    let states = states_in(path);
    assert_no_jump(&states);
    let runs: Vec<&[SlaveState]> = states
        .chunk_by(|before, after| before.is_letting_go() == after.is_letting_go())
        .filter(|run| run[0].is_letting_go())
        .collect();
    assert_eq!(runs.len(), 2);
    for run in &runs {
        assert!(run.iter().all(|state| has(state, Reason::Relaxing) && !has(state, Reason::DriveFault)));
        let end = run[run.len() - 1];
        let next = states.iter().find(|state| state.sequence == end.sequence + 1).expect("a state behind it");
        assert_eq!(next.operating(), Some(OperatingState::Disabled));
        assert_eq!(next.setpoint_q_m, end.setpoint_q_m, "power goes at rest");
    }
    let (whole, stopped) = (runs[0], runs[1]);
    // At rest from where the first step of giving way begins.
    let (first, last) = (whole[0], whole[whole.len() - 1]);
    // The motion that was under way is braked first, at 1 m/s2 from 30 mm/s at most.
    let braked = whole.iter().position(|state| state.sample_ns > first.sample_ns + 40_000_000).expect("it goes on");
    let fastest = whole[braked..].windows(2).map(|pair| {
        let since_s = (pair[1].setpoint_ns - pair[0].setpoint_ns).clamp(0, 1_000_000) as f64 * 1e-9;
        step_m(&pair[0], &pair[1]) - RATE_M_PER_S * since_s
    });
    assert!(fastest.fold(f64::MIN, f64::max) < 1e-8, "never faster than 2 mm/s");
    assert!(step_m(&first, &last) <= WAY_M && step_m(&first, &last) > 0.5e-3, "{} m", step_m(&first, &last));
    assert!(largest_n(&last) < 0.5 * largest_n(&first), "{} N of {} N", largest_n(&last), largest_n(&first));
    let stop = stopped.iter().position(|state| state.n_stops != stopped[0].n_stops);
    let moved_m = stop.map(|at| step_m(&stopped[at], &stopped[stopped.len() - 1]));
    assert!(moved_m.is_none_or(|moved_m| moved_m < 10e-6), "{moved_m:?} m behind the stop");

    let told = samples_in(path).into_iter().any(|sample| match sample {
        Sample::Health(Process::Slave, health) => Reasons::from_bits(health.reasons_now).contains(Reason::Relaxing),
        _ => false,
    });
    assert!(told, "the slave's health names it");
    assert!(!states.iter().any(|state| has(state, Reason::MismatchTrip)), "the shape is explained all the way");
}
