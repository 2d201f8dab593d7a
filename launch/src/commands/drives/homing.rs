//! Zeros at mechanical stops: one actuator after the other goes slowly to its stop, backs off, and where it stands then is its zero. All
//! motion goes through the slave's own limiter, gate and watchdog; the others hold.

use super::live;
use super::motion::{Motion, TICK};
use super::stop::{Pressed, StopWatch};
use anyhow::{Context, bail, ensure};
use krait_drives::{ServoMake, Units, open_drive};
use krait_ipc::message::SlaveState;
use krait_slave::{ActuatorConfig, Drive, HomingConfig, SlaveConfig};
use std::io::{BufRead, Read, Write, stderr, stdin};
use std::sync::atomic::{AtomicBool, Ordering};

/// Longest answer that is read, bytes.
const ANSWER_BYTES: u64 = 80;
/// Travel of an actuator that only holds, m: the least that a configuration may have.
const HELD_TRAVEL_M: f64 = 1e-4;
/// Time to come to rest after backing off, besides the drives' own delay, ticks.
const SETTLE_TICKS: u32 = 300;
/// Backing off must take the load below this part of the threshold.
const FREE_PART: f64 = 0.5;
/// And bring the encoder so near to where it was told, part of the way back.
const NEAR_PART: f64 = 0.2;

/// Whether any actuator has a stop to look for.
pub(super) fn is_wanted(config: &SlaveConfig) -> bool {
    config.drive.actuator.iter().any(|actuator| actuator.homing.is_some())
}

/// Whether the configuration lets a search come to something.
///
/// # Errors
/// One sentence that names the actuator.
pub(super) fn check(config: &SlaveConfig) -> anyhow::Result<()> {
    live(config, "a search for stops")?;
    for (k, homing) in searches(config) {
        homing.fits(&config.limits_of(k), k + 1)?;
    }
    // While one looks for its stop the loads of all others say whether lines hold each other.
    for (k, actuator) in config.drive.actuator.iter().enumerate() {
        ensure!(
            actuator.newton_metre_per_ampere > 0.0,
            "[slave.drive] actuator {} (id {}): its load is not measured, and a search for stops looks at the loads of all; give \
             newton_metre_per_ampere",
            k + 1,
            actuator.id
        );
    }
    Ok(())
}

/// Asks whether actuators may move.
///
/// # Errors
/// One sentence: nobody said yes.
pub(super) fn consent(config: &SlaveConfig) -> anyhow::Result<()> {
    let mut question =
        String::from("This moves REAL drives, one after the other, until each presses against a mechanical stop:\n");
    for (k, homing) in searches(config) {
        question += &format!(
            "  actuator {}: {:?} at {} mm/s, at most {} mm, until {} N; then {} mm back\n",
            k + 1,
            homing.direction,
            homing.rate_m_per_s * 1e3,
            homing.travel_limit_m * 1e3,
            homing.load_n,
            homing.back_off_m * 1e3
        );
    }
    question += "Lines must be slack enough for that. Type yes to go on, anything else to leave it:\n";
    stderr().lock().write_all(question.as_bytes()).context("the question could not be shown")?;
    let mut answer = String::new();
    let read = stdin().lock().take(ANSWER_BYTES).read_line(&mut answer);
    ensure!(
        read.is_ok() && answer.trim() == "yes",
        "nothing was moved, because a search for a stop moves drives only when it is told to; answer yes"
    );
    Ok(())
}

fn searches(config: &SlaveConfig) -> impl Iterator<Item = (usize, HomingConfig)> {
    config.drive.actuator.iter().enumerate().filter_map(|(k, actuator)| Some((k, actuator.homing?)))
}

/// The counts at which all actuators have their zero: where those without a stop stand, `counts`, and where the searches end.
pub(super) fn zeros(config: &SlaveConfig, counts: &[i32], stop: &AtomicBool) -> anyhow::Result<Vec<i32>> {
    let search = around(config, counts);
    let drive = open_drive(&search, None)?;
    let traits = drive.traits();
    // The stroke is each actuator's own, which its travel bounds.
    let limits = krait_slave::Limits { stroke_m: HELD_TRAVEL_M, ..search.limits.clone() };
    traits.check(&SlaveConfig { limits, ..search.clone() })?;
    let mut hand = Hand { motion: Motion::begin(drive, &search)?, config: &search, stop };
    let found = hand.all();
    let found = hand.motion.end_after(found)?;
    let mut zeros = counts.to_vec();
    for (k, way_m) in found {
        zeros[k] = Units::new(&search.drive.actuator[k], k + 1, ServoMake::COUNTS_PER_TURN)?.counts(way_m);
    }
    Ok(zeros)
}

/// The configuration of the search: all begin at zero where they stand, and go no further than their searches may.
fn around(config: &SlaveConfig, counts: &[i32]) -> SlaveConfig {
    let mut search = config.clone();
    for (actuator, count) in search.drive.actuator.iter_mut().zip(counts) {
        let travel_m = actuator.homing.map_or(HELD_TRAVEL_M, |homing| homing.travel_limit_m);
        *actuator = ActuatorConfig { zero_count: Some(*count), travel_m, ..actuator.clone() };
    }
    let longest_m = searches(config).fold(HELD_TRAVEL_M, |most, (_, homing)| most.max(homing.travel_limit_m));
    search.limits.stroke_m = longest_m;
    search
}

/// Who moves actuators and looks at what they press against.
struct Hand<'a> {
    motion: Motion,
    config: &'a SlaveConfig,
    stop: &'a AtomicBool,
}

impl Hand<'_> {
    /// Each search; which actuators, and how far from where they began they stand now, m.
    fn all(&mut self) -> anyhow::Result<Vec<(usize, f64)>> {
        let config = self.config;
        searches(config).map(|(k, homing)| Ok((k, self.one(k, &homing)?))).collect()
    }

    fn one(&mut self, k: usize, homing: &HomingConfig) -> anyhow::Result<f64> {
        let name = format!("actuator {} (id {})", k + 1, self.config.drive.actuator[k].id);
        let stop_m = self.find(k, homing, &name)?;
        let back_m = stop_m - homing.direction.sign() * homing.back_off_m;
        let state = self.back_off(k, back_m, homing, &name)?;
        let (place_m, load_n) = (state.measured_q_m[k], state.measured_tau_n[k]);
        ensure!(
            (place_m - back_m).abs() < NEAR_PART * homing.back_off_m,
            "{name}: it did not back off from its stop, expected {:.3} mm from where it began, found {:.3} mm; look at it before it \
             moves again",
            back_m * 1e3,
            place_m * 1e3
        );
        ensure!(
            load_n.abs() < FREE_PART * homing.load_n,
            "{name}: it is still loaded {} mm from its stop, expected less than {:.2} N, found {load_n:.2} N; was it the stop, or \
             its line? give back_off_m more, or slacken the line",
            homing.back_off_m * 1e3,
            FREE_PART * homing.load_n
        );
        Ok(place_m)
    }

    /// Goes until the stop is known; where its encoder stands there, m.
    fn find(&mut self, k: usize, homing: &HomingConfig, name: &str) -> anyhow::Result<f64> {
        let sign = homing.direction.sign();
        let mut watch = StopWatch::new(homing.load_n);
        let (mut seen_ns, mut gone_m) = (self.motion.sampled_ns(k), 0.0);
        loop {
            let way_m = homing.rate_m_per_s * TICK.as_secs_f64();
            ensure!(
                gone_m + way_m < homing.travel_limit_m,
                "{name}: no stop within travel_limit_m = {} mm, expected a load of {} N before; it stands there without power now: \
                 is the direction right, and is there a stop?",
                homing.travel_limit_m * 1e3,
                homing.load_n
            );
            gone_m += way_m;
            let state = self.creep(k, sign * way_m, homing, name)?;
            let newest_ns = self.motion.sampled_ns(k);
            if newest_ns == seen_ns {
                continue;
            }
            seen_ns = newest_ns;
            let pressed = Pressed {
                goal_m: sign * self.motion.goal_m(k),
                place_m: sign * state.measured_q_m[k],
                load_n: sign * state.measured_tau_n[k],
            };
            if watch.look(pressed) {
                return Ok(state.measured_q_m[k]);
            }
        }
    }

    /// From where it presses back to a place, and time to come to rest.
    fn back_off(&mut self, k: usize, to_m: f64, homing: &HomingConfig, name: &str) -> anyhow::Result<SlaveState> {
        let way_m = to_m - self.motion.goal_m(k);
        let n_ticks = (way_m.abs() / (homing.rate_m_per_s * TICK.as_secs_f64())).ceil().max(1.0);
        for _ in 0..n_ticks as u32 {
            self.creep(k, way_m / n_ticks, homing, name)?;
        }
        let mut state = self.creep(k, 0.0, homing, name)?;
        for _ in 0..SETTLE_TICKS {
            state = self.creep(k, 0.0, homing, name)?;
        }
        Ok(state)
    }

    /// One tick of the way, with a look at what must not be meanwhile.
    fn creep(&mut self, k: usize, way_m: f64, homing: &HomingConfig, name: &str) -> anyhow::Result<SlaveState> {
        ensure!(!self.stop.load(Ordering::Relaxed), "the search for stops was ended where the actuators stood");
        let state = self.motion.creep(k, way_m).with_context(|| format!("{name}: while it looked for its stop"))?;
        std::thread::sleep(TICK);
        ensure!(
            state.is_engaged(),
            "{name}: this program stood still for so long that the drives have stopped; nothing is known of its stop: begin again"
        );
        for (j, actuator) in self.config.drive.actuator.iter().enumerate() {
            let load_n = state.measured_tau_n[j];
            if load_n.is_nan() {
                bail!(
                    "{name}: the load of actuator {} is not known any more, and a stop is known by loads; it stands",
                    j + 1
                );
            }
            if j != k && load_n.abs() > homing.load_n {
                bail!(
                    "{name}: it was looking for its stop, and the line of actuator {} (id {}) carries {load_n:.2} N, expected at most \
                     load_n = {} N of any other; their lines hold each other: slacken them and begin again",
                    j + 1,
                    actuator.id,
                    homing.load_n
                );
            }
        }
        Ok(state)
    }
}
