//! What a replay plays and with which settings: a recording's own, but for the stages that are replaced.

use crate::cli::Common;
use crate::cli_replay::{ReplayArgs, ReplaySlave};
use crate::config::Config;
use crate::{log, recorded};
use anyhow::{Context, bail, ensure};
use krait_bridge::{JointMachine, LiveModel};
use krait_ipc::Process;
use krait_model::Snake;
use krait_record::Recording;
use krait_replay::{
    Beginning, InputChoice, InputTrack, MachinePose, Program, ReplayError, Score, Steering, Trajectory,
    TrajectoryLimits, end_of_range,
};
use krait_slave::{DriveConfig, DriveKind, ShapeSource};
use std::path::{Path, absolute};

/// Where a trajectory's own time begins, ns: after zero, so that nothing comes out negative.
const TRAJECTORY_START_NS: i64 = 1_000_000_000;

/// A setpoint may stand beyond its limit by so much, which rounding can pass, rad or m.
const ROUNDING: f64 = 1e-6;

/// A replay before it begins.
#[derive(Debug)]
pub struct ReplaySetup {
    /// What is sent.
    pub program: Program,
    /// The settings of the processes.
    pub config: Config,
    /// What the model of the chain is called.
    pub label: &'static str,
    /// Whether `estimate` takes part.
    pub has_estimate: bool,
    /// Where the replay's own time begins, ns.
    pub start_ns: i64,
    /// Device and serial number of the hand that is replayed, as the recording names them.
    pub device: [String; 2],
}

impl ReplaySetup {
    /// Reads the file and the settings; files that a recording embeds are written into `folder`.
    ///
    /// # Errors
    /// One sentence that names the file, the option or the key.
    pub fn of(common: &Common, args: &ReplayArgs, folder: &Path) -> anyhow::Result<Self> {
        let to_s = args.to.unwrap_or(f64::INFINITY);
        if !(args.from >= 0.0 && args.from < to_s) {
            let to = args.to.map_or(String::new(), |to_s| format!(" --to {to_s}"));
            bail!("--from {}{to}: expected 0 s or later, and an end after the beginning", args.from);
        }
        let is_table = args.file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
        if is_table { Self::of_table(common, args, to_s) } else { Self::of_recording(common, args, to_s, folder) }
    }

    fn of_recording(common: &Common, args: &ReplayArgs, to_s: f64, folder: &Path) -> anyhow::Result<Self> {
        let named = || format!("recording {}", args.file.display());
        let recording = Recording::open_beginning(&args.file)?;
        let choice = InputChoice { path: args.file.clone(), pass: args.pass, range_s: args.from..to_s };
        let beginning = Beginning::read(&choice).with_context(named)?;
        let mut config = recorded::config_of(&recording, folder).with_context(named)?;
        config = recorded::config_of_pass(&recording, &config, beginning.model, folder).with_context(named)?;
        // The simulated snake of a replay is another than the one that was measured, so its own camera looks at it.
        config.slave.shape = ShapeSource::Camera;
        let config = replaced(common, args, config)?;
        let score = Score::Inputs(InputTrack::new(choice));
        let start =
            (beginning.start, Found { n_joints: beginning.n_joints as usize, n_segments: beginning.n_segments });
        Self::new(config, score, start, beginning.first.sample_ns, args.loops)
            .map(|setup| Self { device: recorded::device_of(&recording), ..setup })
    }

    fn of_table(common: &Common, args: &ReplayArgs, to_s: f64) -> anyhow::Result<Self> {
        let config = Config::load(common.config.as_deref())?;
        let config = with_options(args, config)?;
        let (trajectory, found) = match &config.model()?.machine {
            LiveModel::Snake(chain) => {
                let limits = TrajectoryLimits::Snake {
                    snake: &Snake::new(chain.machine())?,
                    max_bend_rad: config.resolve.max_bend_rad,
                    max_bend_vel_rad_per_s: config.resolve.max_bend_vel_rad_per_s,
                };
                (Trajectory::load(&args.file, &limits)?, Found { n_joints: 0, n_segments: 0 })
            }
            LiveModel::Joints(joints) => {
                let machine = JointMachine::new(joints, &config.joints)?;
                let limits = TrajectoryLimits::Joints {
                    range: machine.range_rad().map(|values| &values[..machine.n()]),
                    max_vel_per_s: machine.max_vel_per_s(),
                    slides: machine.slides(),
                };
                (Trajectory::load(&args.file, &limits)?, Found { n_joints: machine.n(), n_segments: 0 })
            }
            LiveModel::Segments(_) => bail!(
                "trajectory {}: tables are for snakes and joints, and the model is of kind segments; replay a recording of them, or make \
                 commands of a table with `krait model compensate`",
                args.file.display()
            ),
        };
        let Some(trajectory) = trajectory.between(args.from, to_s) else {
            bail!(
                "trajectory {}: nothing of it lies between --from {} s and {}",
                args.file.display(),
                args.from,
                end_of_range(to_s)
            );
        };
        let start = (trajectory.start(), found);
        Self::new(config, Score::Trajectory(trajectory), start, TRAJECTORY_START_NS, args.loops)
    }

    fn new(
        config: Config,
        score: Score,
        (start, found): (MachinePose, Found),
        start_ns: i64,
        n_loops: u64,
    ) -> anyhow::Result<Self> {
        let model = config.model()?;
        let expected = Found::of(&model.machine);
        if found != expected {
            return Err(ReplayError::OtherMachine { found: found.words(), expected: expected.words() }.into());
        }
        let steering = match &model.machine {
            LiveModel::Snake(chain) => {
                check_bend(&[start[0], start[1]], config.resolve.max_bend_rad)?;
                let has_gripper = chain.gripper().is_some();
                Steering::snake(Snake::new(chain.machine())?, has_gripper, config.resolve.view_roll_rad)
            }
            LiveModel::Joints(joints) => {
                let machine = JointMachine::new(joints, &config.joints)?;
                check_joints(&start, &machine, joints.n())?;
                Steering::joints(machine.rates(), joints.n(), machine.si_per_rad(), joints.slides())
            }
            LiveModel::Segments(segments) => {
                let machine = segments.chain().machine();
                for (segment, limit_rad) in
                    segments.max_bend_rad(&config.resolve).into_iter().enumerate().take(machine.n())
                {
                    check_bend(&[start[2 * segment], start[2 * segment + 1]], limit_rad)?;
                }
                Steering::segments(machine.clone(), config.resolve.view_roll_rad)
            }
        };
        let program = Program::new(score, start, n_loops, steering, model.machine.hash());
        let device = ["trajectory".to_owned(), "none (trajectory)".to_owned()];
        let has_estimate = model.machine.needs_estimate();
        Ok(Self { program, config, label: model.label, has_estimate, start_ns, device })
    }
}

/// What a recording or a model is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Found {
    /// Joints, or bends of segments; 0 for a snake.
    n_joints: usize,
    /// Segments; 0 for a snake and for joints.
    n_segments: usize,
}

impl Found {
    fn of(model: &LiveModel) -> Self {
        match model {
            LiveModel::Snake(_) => Self { n_joints: 0, n_segments: 0 },
            LiveModel::Joints(joints) => Self { n_joints: joints.n(), n_segments: 0 },
            LiveModel::Segments(segments) => {
                let machine = segments.chain().machine();
                Self { n_joints: machine.n_bends(), n_segments: machine.n() }
            }
        }
    }

    fn words(self) -> String {
        match (self.n_joints, self.n_segments) {
            (0, _) => "a snake".to_owned(),
            (n, 0) => format!("{n} joints"),
            (_, n) => format!("{n} segments"),
        }
    }
}

fn check_bend(&found: &[f64; 2], limit: f64) -> Result<(), ReplayError> {
    // Written so that NaN is refused; a setpoint may stand at its limit, which rounding can pass.
    let is_within = (0.0..=limit + ROUNDING).contains(&found[0].hypot(found[1]));
    if is_within { Ok(()) } else { Err(ReplayError::StartBend { found, limit }) }
}

fn check_joints(start: &MachinePose, machine: &JointMachine, n: usize) -> Result<(), ReplayError> {
    let [lows, highs] = machine.range_rad();
    for (idx, ((&found, &low), &high)) in start.iter().zip(lows).zip(highs).enumerate().take(n) {
        if !(low - ROUNDING..=high + ROUNDING).contains(&found) {
            return Err(ReplayError::StartJoint { joint: idx + 1, found, low, high });
        }
    }
    Ok(())
}

/// The recording's settings, with those of the replaced stages from the command line. An option that is one stage's own says
/// which stage is meant.
fn replaced(common: &Common, args: &ReplayArgs, recorded: Config) -> anyhow::Result<Config> {
    let wants = |stage| args.replace.contains(&stage);
    if let Some(sentence) = inferred(args) {
        log::say(&sentence);
    }
    let Some(path) = common.config.as_deref() else { return with_options(args, recorded) };
    ensure!(
        !args.replace.is_empty(),
        "--config {}: a recording brings its own settings; name the stage that shall have these with --replace STAGE",
        path.display()
    );
    let other = Config::load(Some(path))?;
    let mut config = recorded;
    if wants(Process::Resolve) {
        config.resolve = other.resolve;
    }
    if wants(Process::Compensate) {
        (config.compensate, config.compensation, config.model) =
            (other.compensate, other.compensation, other.model.clone());
    }
    if wants(Process::Estimate) {
        config.estimate = other.estimate;
    }
    if wants(Process::Slave) {
        config.slave = other.slave.clone();
    }
    with_options(args, config)
}

/// The line that says which stages options replace that --replace does not name; `None` where there are none.
fn inferred(args: &ReplayArgs) -> Option<String> {
    let options = [
        (args.model.is_some(), Process::Compensate, "--model"),
        (args.compensation.is_some(), Process::Compensate, "--compensation"),
        (args.truth.is_some(), Process::Slave, "--truth"),
    ];
    let unnamed = options.into_iter().filter(|(given, stage, _)| *given && !args.replace.contains(stage));
    let said: Vec<String> = unnamed.map(|(_, stage, option)| format!("{option} replaces {stage}")).collect();
    (!said.is_empty()).then(|| format!("{}; the other stages are as recorded\n", said.join(", ")))
}

fn with_options(args: &ReplayArgs, mut config: Config) -> anyhow::Result<Config> {
    match args.slave {
        ReplaySlave::Sim => config.slave.drive = DriveConfig::default(),
        ReplaySlave::Sts3215 => check_real(args, &config, DriveKind::Sts3215)?,
        ReplaySlave::Xl330 => check_real(args, &config, DriveKind::Xl330)?,
        ReplaySlave::Cia402 => check_real(args, &config, DriveKind::Cia402)?,
        ReplaySlave::Recorded => {
            bail!("--slave recorded takes a recording (.mcap), and {} is none", args.file.display())
        }
    }
    if let Some(truth) = &args.truth {
        config.slave.truth = Some(absolute(truth)?);
    }
    if let Some(model) = &args.model {
        config.model = Some(absolute(model)?);
    }
    if let Some(compensation) = args.compensation {
        let is_of_segments = args.model.is_none() && config.model()?.machine.segments().is_some();
        config = config.with_compensation(compensation, args.model.is_some() || is_of_segments)?;
    }
    config.check()?;
    Ok(config)
}

fn check_real(args: &ReplayArgs, config: &Config, kind: DriveKind) -> anyhow::Result<()> {
    ensure!(
        args.real_time && config.slave.drive.kind == kind,
        "--slave sts3215, xl330 or cia402 moves real drives: it takes --real-time, and --replace slave with a --config that describes them"
    );
    Ok(())
}
