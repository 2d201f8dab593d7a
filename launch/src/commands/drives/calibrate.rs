//! Finds which way each configured actuator pulls, by small moves of one after the other while the others hold, and writes the
//! configuration with these signs. Nothing is written where anything contradicts.

use super::directions::{Answer, Sweep, agree, pull_way};
use super::loads::{LoadUnit, measured};
use super::motion::{LONGEST_MM, Motion, TICK};
use super::numbers::{self, SIGN};
use super::{alone, live, real};
use crate::cli::Common;
use crate::cli_drives::DrivesArgs;
use crate::config::Config;
use crate::{print, signals};
use anyhow::{Context, bail, ensure};
use core::time::Duration;
use krait_drives::open_drive;
use krait_ipc::message::{Actuators, MAX_ACTUATORS};
use krait_report::Table;
use krait_slave::{Drive, SlaveConfig};
use serde::Serialize;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Steps one way at most.
const MOST_STEPS: u32 = 5;
/// Besides the drives' own delay: so long a step has to come to rest, and a load is averaged at least.
const REST: Duration = Duration::from_millis(20);
/// A load's change is clear beyond so many of its standard deviations at rest.
const NOISES: f64 = 5.0;

/// One actuator, as `--json` prints it.
#[derive(Serialize)]
struct Found {
    actuator: usize,
    id: u32,
    load_unit: &'static str,
    load_per_mm_counts_up: f64,
    load_per_mm_counts_down: f64,
    sign: i32,
    configured_sign: i32,
}

/// All of them.
#[derive(Serialize)]
struct Calibration {
    actuators: Vec<Found>,
    written: Option<String>,
}

/// Moves, judges, prints, writes.
pub(super) fn run(common: &Common, args: &DrivesArgs) -> anyhow::Result<ExitCode> {
    let path = common.config.as_deref().context("which actuators? name their configuration with --config")?;
    numbers::refuse_out(args)?;
    let stop = signals::stop_flag()?;
    let text = Config::text(path)?;
    let config = Config::read(&text, path)?;
    real(&config)?;
    if config.slave.drive.names_groups() {
        config.check_drives()?;
    }
    live(&config.slave, "a calibration")?;
    let _bus = alone(common, &stop)?;
    let (slave, units) = measured(&config.slave)?;
    let drive = open_drive(&slave, None)?;
    // Limits are of loads that are known in newtons.
    let knows_newtons = drive.traits().measures_load && units.iter().all(|unit| unit.is_newton());
    krait_slave::DriveTraits { measures_load: knows_newtons, ..drive.traits() }.check(&slave)?;
    let ticks = |time: Duration| (time.as_secs_f64() / TICK.as_secs_f64()).ceil() as u32;
    let (delay, periods) = (ns(drive.traits().delay_ns), ns(2 * drive.traits().period_ns));
    let (settle_ticks, window_ticks) = (ticks(delay + REST), ticks(periods.max(REST)));
    let motion = Motion::begin(drive, &slave)?;
    if !args.json {
        print::out(&format!(
            "Each of {} actuators moves by at most {} mm either way while the others hold; Ctrl-C ends it and takes the power.\n",
            slave.drive.n_together(),
            f64::from(MOST_STEPS) * LONGEST_MM
        ))?;
    }
    let mut hand = Hand { motion, slave: &slave, units: &units, settle_ticks, window_ticks, stop: &stop };
    let asked = hand.ask_all();
    let (answers, ways) = hand.motion.end_after(asked).context("nothing is written")?;
    agree(&answers, &ways).context("nothing is written")?;
    let found: Vec<Found> = (0..answers.len()).map(|k| found(&slave, k, &answers[k], ways[k])).collect();
    let jaw = slave.drive.actuator.get(found.len()..).unwrap_or_default();
    let signs: Vec<i32> = found.iter().map(|found| found.sign).chain(jaw.iter().map(|own| own.sign)).collect();
    let n_changed = numbers::write(args, &text, &SIGN, &signs)?;
    tell(found, n_changed, args)?;
    if !jaw.is_empty() && !args.json {
        print::out(&format!(
            "Actuator {} is a gripper's and was not moved: --jog shows which way it opens the jaw.\n",
            signs.len()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Who moves actuators and looks at what their loads answer.
struct Hand<'a> {
    motion: Motion,
    slave: &'a SlaveConfig,
    units: &'a [LoadUnit],
    settle_ticks: u32,
    window_ticks: u32,
    stop: &'a AtomicBool,
}

/// Loads and encoders, averaged, and how much the loads varied meanwhile.
struct Look {
    load: Actuators,
    deviation: Actuators,
    q_m: Actuators,
}

impl Hand<'_> {
    fn ask_all(&mut self) -> anyhow::Result<(Vec<Answer>, Vec<f64>)> {
        let (mut answers, mut ways) = (Vec::new(), Vec::new());
        // A gripper's wire stands alone: no other line tells whether it pulls, and its jaw may have nothing to pull against.
        for k in 0..self.slave.drive.n_together() {
            let answer = self.ask(k)?;
            ways.push(pull_way(k, &answer)?);
            answers.push(answer);
        }
        Ok((answers, ways))
    }

    /// Both ways of one actuator; it ends where it began.
    fn ask(&mut self, k: usize) -> anyhow::Result<Answer> {
        let name = format!("actuator {} (id {})", k + 1, self.slave.drive.actuator[k].id);
        let rest = self.look()?;
        ensure!(
            rest.load.iter().take(self.units.len()).all(|load| load.is_finite()),
            "{name}: loads are not measured by these drives, expected all; without them directions are found with --jog"
        );
        let unit = &self.units[k];
        let clear = unit.least.max(NOISES * rest.deviation[k]);
        let mut sweep = |way| self.sweep(k, way, clear, &name);
        let sweeps = [sweep(1.0)?, sweep(-1.0)?];
        Ok(Answer { name, sweeps, clear, unit: unit.name })
    }

    /// Steps until the load answers clearly, and back again.
    fn sweep(&mut self, k: usize, way: f64, clear: f64, name: &str) -> anyhow::Result<Sweep> {
        let before = self.look()?;
        let step_m = way * LONGEST_MM * 1e-3;
        let mut sweep =
            Sweep { way_m: 0.0, before: before.load, after: before.load, went_m: [0.0; MAX_ACTUATORS], left_m: 0.0 };
        let mut refused = None;
        while refused.is_none() && sweep.way_m.abs() < (f64::from(MOST_STEPS) - 0.5) * step_m.abs() {
            refused = self.step(k, step_m, self.settle_ticks)?;
            let look = self.look()?;
            sweep.way_m += step_m;
            sweep.after = look.load;
            sweep.went_m = core::array::from_fn(|j| look.q_m[j] - before.q_m[j]);
            if sweep.growth(k).abs() > 2.0 * clear || !sweep.has_followed(k) {
                break;
            }
        }
        if let Some(why) = refused {
            bail!(
                "{name}: a step of {:+.1} mm was not made as asked: {why}; mend that and calibrate again",
                step_m * 1e3
            );
        }
        let n_steps = (sweep.way_m / step_m).round() as u32;
        for _ in 0..n_steps {
            if let Some(why) = self.step(k, -step_m, 0)? {
                bail!("{name}: it could not come back to where it began: {why}; look at it before it moves again");
            }
        }
        sweep.left_m = self.settled()?.q_m[k] - before.q_m[k];
        Ok(sweep)
    }

    /// One step, unless somebody wants the end; why it was not made as asked.
    fn step(&mut self, k: usize, step_m: f64, settle_ticks: u32) -> anyhow::Result<Option<String>> {
        ensure!(!self.stop.load(Ordering::Relaxed), "the calibration was ended where the actuators stood");
        Ok(self.motion.step(k, step_m, settle_ticks)?.refused)
    }

    /// Looks once the last step has had time.
    fn settled(&mut self) -> anyhow::Result<Look> {
        self.motion.stand(self.settle_ticks)?;
        self.look()
    }

    fn look(&mut self) -> anyhow::Result<Look> {
        let n = f64::from(self.window_ticks);
        let (mut sum, mut squares, mut places) = ([0.0; MAX_ACTUATORS], [0.0; MAX_ACTUATORS], [0.0; MAX_ACTUATORS]);
        for _ in 0..self.window_ticks {
            let state = self.motion.keep()?;
            for k in 0..self.units.len() {
                sum[k] += state.measured_tau_n[k] / n;
                squares[k] += state.measured_tau_n[k].powi(2) / n;
                places[k] += state.measured_q_m[k] / n;
            }
            std::thread::sleep(TICK);
        }
        let deviation = core::array::from_fn(|k: usize| (squares[k] - sum[k] * sum[k]).max(0.0).sqrt());
        Ok(Look { load: sum, deviation, q_m: places })
    }
}

fn ns(time_ns: i64) -> Duration {
    Duration::from_nanos(time_ns.unsigned_abs())
}

/// One actuator's row: counts grow with the push by the configured sign.
fn found(slave: &SlaveConfig, k: usize, answer: &Answer, way: f64) -> Found {
    let actuator = &slave.drive.actuator[k];
    let [push, pull] = answer.sweeps.map(|sweep| sweep.growth_per_mm(k));
    let (up, down) = if actuator.sign > 0 { (push, pull) } else { (pull, push) };
    Found {
        actuator: k + 1,
        id: actuator.id,
        load_unit: answer.unit,
        load_per_mm_counts_up: up,
        load_per_mm_counts_down: down,
        sign: if way < 0.0 { actuator.sign } else { -actuator.sign },
        configured_sign: actuator.sign,
    }
}

fn tell(found: Vec<Found>, n_changed: usize, args: &DrivesArgs) -> anyhow::Result<()> {
    if args.json {
        let written = args.out.as_ref().map(|out| out.display().to_string());
        return print::json(&Calibration { actuators: found, written });
    }
    let mut table =
        Table::new(&["actuator", "id", "counts up", "counts down", "unit", "pulls", "sign", "configured", "verdict"]);
    for one in &found {
        let is_right = one.sign == one.configured_sign;
        table.row(vec![
            one.actuator.to_string(),
            one.id.to_string(),
            format!("{:+.3}", one.load_per_mm_counts_up),
            format!("{:+.3}", one.load_per_mm_counts_down),
            format!("{}/mm", one.load_unit),
            if one.sign > 0 { "down" } else { "up" }.to_owned(),
            one.sign.to_string(),
            one.configured_sign.to_string(),
            if is_right { "right" } else { "reversed" }.to_owned(),
        ]);
    }
    print::out(&table.to_string())?;
    print::out(&numbers::sentence(args.out.as_deref(), n_changed, "signs"))
}
