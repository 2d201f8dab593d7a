//! The settings of an experiment: one configuration for each pass, and what every pass shares.

use crate::cli::{Common, MasterKind};
use crate::cli_experiment::ExperimentArgs;
use crate::config::Config;
use crate::device;
use crate::in_force::{Compensation, OWN_MODEL};
use anyhow::{Context, ensure};
use krait_master::{GuideLeg, GuidePlan};
use krait_model::Snake;
use krait_paper::experiment::{Announced, AnnouncedPass, METADATA_KEY, Protocol};
use std::path::{PathBuf, absolute};

/// Room that a simulated chain is given beyond the largest bend, rad, and over how much its motion fades there.
const ROOM_RAD: f64 = 0.01;
const FADING_RAD: f64 = 1e-3;

/// An experiment before it begins.
pub struct Settings {
    /// What is done in each pass.
    pub protocol: Protocol,
    /// The passes.
    pub passes: Vec<ExperimentPass>,
    /// Where the recording goes.
    pub recording: PathBuf,
    /// Whether the drives are real.
    pub is_real: bool,
}

/// One pass.
pub struct ExperimentPass {
    /// The compensation's name.
    pub name: &'static str,
    /// The settings of its chain.
    pub config: Config,
    /// What its guide follows.
    pub plan: GuidePlan,
}

impl Settings {
    /// Puts configuration, command line and protocol together.
    ///
    /// # Errors
    /// One sentence: a setting or file that does not fit, or a bend that the chain does not allow.
    pub fn of(common: &Common, args: &ExperimentArgs, protocol: Protocol) -> anyhow::Result<Self> {
        let mut config = Config::load(common.config.as_deref())?;
        let is_real = args.machine.apply(&mut config)?;
        let recording = crate::recording_path(args.recording.as_deref(), "experiment")?;
        config.record.path = Some(recording.clone());
        if let Some(model) = &args.model {
            config.model = Some(absolute(model)?);
        }
        let configs = configs_of_passes(&config, args)?;
        let learns = |config: &Config| Ok::<_, anyhow::Error>(!config.model()?.machine.learnt().is_empty());
        let mut announced = Announced { protocol: protocol.clone(), passes: Vec::new() };
        for (name, config) in &configs {
            announced.passes.push(AnnouncedPass { compensation: (*name).to_owned(), learns: learns(config)? });
        }
        let text = serde_json::to_string(&announced).context("the experiment could not be written as JSON")?;
        let mut passes = Vec::new();
        for ((name, mut config), about) in configs.into_iter().zip(&announced.passes) {
            make_room(&mut config, protocol.largest_bend_deg(about.learns), common.config.is_none() && !is_real)?;
            config.record.metadata.insert("run".to_owned(), "experiment".to_owned());
            config.record.metadata.insert(METADATA_KEY.to_owned(), text.clone());
            device::enter(&mut config.record.metadata, &config.master, MasterKind::Guide, None);
            config.check()?;
            let plan = plan(&config, args, &protocol, about.learns)?;
            passes.push(ExperimentPass { name, config, plan });
        }
        Ok(Self { protocol, passes, recording, is_real })
    }
}

/// The built-in models that are named, then the file; without either the three of the demo.
fn configs_of_passes(config: &Config, args: &ExperimentArgs) -> anyhow::Result<Vec<(&'static str, Config)>> {
    let mut built_in = args.compensation.clone();
    let has_own = config.model.is_some();
    if built_in.is_empty() && !has_own {
        built_in = Compensation::ALL.to_vec();
    }
    for (k, name) in built_in.iter().enumerate() {
        ensure!(!built_in[..k].contains(name), "--compensation {} is named twice; name each once", name.name());
    }
    let of_built_in =
        |compensation: Compensation| (compensation.name(), Config { compensation, model: None, ..config.clone() });
    let mut configs: Vec<_> = built_in.into_iter().map(of_built_in).collect();
    if has_own {
        let label = config.model()?.label;
        ensure!(
            label == OWN_MODEL,
            "the model file is the built-in model {label}; name it with --compensation {label} instead"
        );
        configs.push((label, config.clone()));
    }
    Ok(configs)
}

/// A simulated chain without a configuration of its own may bend as far as the experiment wants; any other keeps its limit.
fn make_room(config: &mut Config, largest_deg: f64, may_widen: bool) -> anyhow::Result<()> {
    let resolve = &mut config.resolve;
    let free_rad = resolve.max_bend_rad - resolve.bend_margin_rad;
    let largest_rad = largest_deg.to_radians();
    if largest_rad <= free_rad {
        return Ok(());
    }
    ensure!(
        may_widen,
        "the experiment bends {largest_deg:.1} deg, and the chain's limit ([resolve] max_bend_rad less bend_margin_rad) is {:.1} deg; choose smaller bends, or raise the limit in the configuration",
        free_rad.to_degrees()
    );
    resolve.max_bend_rad = (largest_rad + ROOM_RAD).clamp(resolve.max_bend_rad, core::f64::consts::FRAC_PI_2);
    resolve.bend_margin_rad = FADING_RAD;
    Ok(())
}

/// The ways of the protocol as places of the tip.
fn plan(config: &Config, args: &ExperimentArgs, protocol: &Protocol, learns: bool) -> anyhow::Result<GuidePlan> {
    let machine = *config.model()?.snake("krait experiment")?.machine();
    let snake = Snake::new(&machine)?;
    let leg = |leg: &krait_paper::experiment::Leg| GuideLeg {
        pose: leg.pose,
        tip_pos_in_base_m: leg.bends_rad.iter().map(|bend| snake.tip_pos_in_base_m(*bend).into()).collect(),
    };
    let mut plan = args.guide.plan(machine.l_m, config.resolve.view_roll_rad)?;
    plan.leg = protocol.legs(learns).iter().map(leg).collect();
    Ok(plan)
}
