//! `krait calibrate poses --chain`: krait's own chain takes the machine from pose to pose, led by the guide of the experiments.

use super::calibrate::Terminal;
use crate::cli::Common;
use crate::cli_calibrate::PosesArgs;
use crate::config::Config;
use crate::led_chain::LedChain;
use crate::signals;
use anyhow::{Context, bail, ensure};
use krait_calibrate::CalibrateError;
use krait_calibrate::poses::{self, PoseGoal, PosePlan, PoseReached, PoseSettings, Poses};
use krait_model::Snake;
use nalgebra::Vector2;
use std::path::absolute;

/// Asks, starts the chain on the model file, goes through the plan and ends the chain; the fit is that of every robot.
///
/// # Errors
/// One sentence: nobody said yes, the chain does not allow the plan's bends, or could not go on. What was read is kept.
pub fn poses(
    common: &Common,
    args: &PosesArgs,
    mut settings: PoseSettings,
    eta: f64,
    dialogue: &mut Terminal,
) -> anyhow::Result<Poses> {
    let mut config = Config::load(common.config.as_deref())?;
    let is_real = args.machine.apply(&mut config)?;
    config.model = Some(absolute(&args.files.model)?);
    config.record.path = args.recording.as_deref().map(absolute).transpose()?;
    config.record.metadata.insert("run".to_owned(), "calibrate poses".to_owned());
    widen(&mut config, common.config.is_none() && !is_real, settings.plan.largest_deg());
    config.check()?;
    if let Some(said) = keep_within(&config, &mut settings, args, eta)? {
        dialogue.say(&said)?;
    }
    if let Some(said) = poses::price(&settings)? {
        dialogue.say(&said)?;
    }
    let snake = Snake::new(&settings.machine)?;
    let mut plan = args.guide.plan(settings.machine.l_m, config.resolve.view_roll_rad)?;
    plan.awaits_orders = true;
    ask(dialogue, is_real, args.engage, &settings.plan)?;
    let stop = signals::stop_flag()?;
    // Started at the first motion: a calibration that is taken up again only to be fitted moves nothing.
    let mut chain: Option<LedChain> = None;
    let found = poses::run(dialogue, &args.files.csv, args.bends.as_deref(), &settings, |_, goal: PoseGoal| {
        let robot = |error: anyhow::Error| CalibrateError::Robot(format!("{error:#}"));
        let chain = match &mut chain {
            Some(chain) => chain,
            none => none.insert(LedChain::start(&common.instance, &config, &plan, is_real, &stop).map_err(robot)?),
        };
        reached(chain, &snake, goal.bend_rad, args).map_err(robot)
    });
    if let Some(chain) = chain {
        match &found {
            // Where it failed, the chain has ended already or is ended as it is dropped.
            Err(CalibrateError::Robot(_)) => drop(chain),
            _ => chain.end()?,
        }
    }
    Ok(found?)
}

fn reached(
    chain: &mut LedChain,
    snake: &Snake,
    bend_rad: Vector2<f64>,
    args: &PosesArgs,
) -> anyhow::Result<PoseReached> {
    let read = chain.go(snake.tip_pos_in_base_m(bend_rad).into())?;
    let is_asked = args.typed || args.bends.is_some();
    if !is_asked && read.bend_rad.is_none() {
        bail!(
            "nobody measures the shape, so there is nothing to calibrate with; let `program | krait shape` run beside --shape external, or type the bends with --typed"
        );
    }
    Ok(PoseReached { q_m: read.q_m.into(), bend_rad: read.bend_rad.filter(|_| !is_asked) })
}

/// A simulated chain without a configuration is given the room that the plan needs.
fn widen(config: &mut Config, may: bool, largest_deg: f64) {
    let resolve = &mut config.resolve;
    if may && (resolve.max_bend_rad - resolve.bend_margin_rad).to_degrees() < largest_deg {
        resolve.bend_margin_rad = 1e-3;
        resolve.max_bend_rad = resolve.max_bend_rad.max(largest_deg.to_radians() + 2e-3);
    }
}

/// No pose beyond what the chain may bend, and what its actuators may travel and its lines bear with the model's stiffness: the plan becomes
/// as large as that, which is said; a plan that was asked for by `--largest-deg` is refused.
fn keep_within(
    config: &Config,
    settings: &mut PoseSettings,
    args: &PosesArgs,
    eta: f64,
) -> anyhow::Result<Option<String>> {
    let (resolve, limits) = (&config.resolve, &config.slave.limits);
    let free_deg = (resolve.max_bend_rad - resolve.bend_margin_rad).to_degrees();
    let travel_m = config.compensate.max_stroke_m.min(limits.stroke_m);
    let load_n = limits.pull_n.min(limits.push_n);
    let wanted_deg = settings.plan.largest_deg();
    let found_deg = poses::largest_deg_within(settings, eta, (wanted_deg.min(free_deg), travel_m, load_n))?;
    if free_deg >= wanted_deg && found_deg >= wanted_deg.floor() {
        return Ok(None);
    }
    let chain = format!(
        "the chain's limits allow bends up to {found_deg:.0} deg ([resolve] max_bend_rad less bend_margin_rad is {free_deg:.1} deg, the stroke \
         is {:.2} mm, a line may carry {load_n:.0} N)",
        travel_m * 1e3
    );
    ensure!(
        args.largest_deg.is_none(),
        "{chain}, and --largest-deg is {wanted_deg}; give {found_deg:.0} or less, or raise the limits in the configuration"
    );
    settings.plan = PosePlan::new(args.front_deg(), found_deg).with_context(|| chain.clone())?;
    Ok(Some(chain))
}

/// Nothing moves by itself: `--engage` answers for simulated drives, real ones are asked about always.
fn ask(dialogue: &mut Terminal, is_real: bool, engage: bool, plan: &PosePlan) -> anyhow::Result<()> {
    if engage && !is_real {
        return Ok(());
    }
    let drives = if is_real { "REAL drives" } else { "the simulated snake" };
    let question = format!(
        "This homes and moves {drives} through up to {} poses of up to {:.0} deg. Type yes to go on, anything else to leave it:",
        plan.n_poses(),
        plan.largest_deg()
    );
    if dialogue.ask(&question)?.as_deref() == Some("yes") {
        return Ok(());
    }
    let how = if is_real { "answer yes" } else { "answer yes, or add --engage" };
    bail!("nothing was moved, because a calibration moves the machine only when it is told to; {how}")
}
