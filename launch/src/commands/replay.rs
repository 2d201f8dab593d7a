//! `krait replay FILE`: a recording or a trajectory through the real processes, in its own time or on the machine's clock.

use crate::cli::{Common, MasterKind};
use crate::cli_replay::{ReplayArgs, ReplaySlave, Speed};
use crate::commands::process::with_attachments;
use crate::commands::replay_slave;
use crate::device::{DEVICE_KEY, SERIAL_KEY};
use crate::replay_orders::{Order, Orders};
use crate::replay_setup::ReplaySetup;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use crate::{print, recorded, signals};
use core::time::Duration;
use krait_ipc::message::three;
use krait_ipc::{Process, clock};
use krait_record::{About, WallClock};
use krait_replay::{Keeper, LivePlayer, PlayCounts, Player, Program, Turn};
use krait_report::{JointScore, Lanes, SCORED_FROM_S, Spread, TOO_SHORT, Tracked};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// How often the processes are looked at while samples flow, ns.
const LOOK_EVERY_NS: i64 = 20_000_000;
/// How long the replay sleeps at most while nothing comes back.
const PATIENCE: Duration = Duration::from_millis(20);
/// How long it sleeps at most between two samples that are due by the clock.
const PACED_PATIENCE: Duration = Duration::from_micros(500);

/// What a replay came to.
#[derive(Debug, Serialize)]
struct Figures {
    /// What was played.
    played: PathBuf,
    /// Whose time passed: the recording's own, or the machine's clock.
    time: &'static str,
    /// Samples of one loop, as far as it was played.
    samples_in_loop: u64,
    /// Loops asked for.
    loops: u64,
    /// Loops played to their end.
    loops_played: u64,
    /// Samples read from the file, over all loops.
    samples_read: u64,
    /// Recorded samples that were left out, over all loops, because `resolve` would refuse them.
    samples_refused: u64,
    /// What was sent and what came back.
    samples: PlayCounts,
    /// Messages sent to the chain; on the machine's clock there may be several on the way to one sample.
    messages_sent: u64,
    /// Commands that the slave refused.
    commands_refused: u64,
    /// How often the machine held the replay up for longer than it makes up for.
    times_late: u64,
    /// Length of what was played, s.
    played_s: f64,
    /// Time that this took, through the processes and into the new recording, s.
    took_s: f64,
    /// The one by the other.
    times_real_time: f64,
    /// Measured shape against setpoint, from `scored_from_s` after the first motion on, deg; null for a shorter motion.
    tracking_error_deg: Option<Spread>,
    /// The same of joints, in their own unit; null for a snake.
    joints: Option<JointScore>,
    /// See above, s.
    scored_from_s: f64,
    /// Whether it was stopped before its end.
    stopped: bool,
    /// The new recording.
    recording: Option<PathBuf>,
}

/// Plays a file and says what came of it.
pub fn run(common: &Common, args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    if args.slave == ReplaySlave::Recorded {
        return replay_slave::run(common, args);
    }
    let stop = signals::stop_flag()?;
    let mut supervisor = Supervisor::new(&recorded::instance_of(&common.instance, "replay"), &stop)?;
    let setup = ReplaySetup::of(common, args, &supervisor.bus().instance().folder())?;
    let recording = match args.no_recording {
        true => None,
        false => Some(crate::recording_path(args.recording.as_deref(), "replay")?),
    };
    let setup = described(setup, args, recording.as_deref());
    let played = if args.real_time {
        play_live(&mut supervisor, setup, args, &stop)
    } else {
        play(&mut supervisor, setup, args, &stop)
    };
    supervisor.end_chain();
    supervisor.end();
    let figures = match (played, &recording) {
        (Ok(figures), _) => figures,
        (Err(error), Some(path)) => {
            tell_what_is_left(path);
            return Err(error);
        }
        (Err(error), None) => return Err(error),
    };
    if args.json {
        print::json(&figures)?;
    } else {
        print::out(&sentence(&figures))?;
    }
    Ok(if is_whole(&figures) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What the new recording says about itself.
fn described(mut setup: ReplaySetup, args: &ReplayArgs, recording: Option<&Path>) -> ReplaySetup {
    let speed = match args.speed {
        _ if args.step => "step".to_owned(),
        Speed::Max => "max".to_owned(),
        Speed::Times(times) => times.to_string(),
    };
    let compensation = setup.label.to_owned();
    let [device, serial] = setup.device.clone();
    let record = &mut setup.config.record;
    record.path = recording.map(Path::to_owned);
    for (key, value) in [
        ("run", "replay".to_owned()),
        ("replay_of", args.file.display().to_string()),
        ("replay_speed", speed),
        ("replay_time", time_of(args).to_owned()),
        ("compensation", compensation),
        (DEVICE_KEY, device),
        (SERIAL_KEY, serial),
    ] {
        record.metadata.insert(key.to_owned(), value);
    }
    setup
}

fn time_of(args: &ReplayArgs) -> &'static str {
    if args.real_time { "clock" } else { "recorded" }
}

fn options(setup: &ReplaySetup, recorded_time_ns: Option<i64>) -> ChainOptions {
    let mut processes = vec![Process::Slave, Process::Estimate, Process::Compensate];
    processes.extend(setup.program.sends_inputs().then_some(Process::Resolve));
    let cast = Cast { processes, recorded_time_ns, comes_back: false };
    ChainOptions {
        config: setup.config.clone(),
        master: MasterKind::Replay,
        input: None,
        looped: false,
        engage: None,
        cast,
    }
}

/// In the recording's own time, to the simulated snake.
fn play(
    supervisor: &mut Supervisor,
    setup: ReplaySetup,
    args: &ReplayArgs,
    stop: &AtomicBool,
) -> anyhow::Result<Figures> {
    let keeper = setup.config.record.path.as_deref().map(|path| keeper(&setup, supervisor, path)).transpose()?;
    let options = options(&setup, Some(setup.start_ns));
    let mut player = Player::open(supervisor.bus(), setup.program, keeper, setup.has_estimate)?;
    supervisor.start_chain(&options, stop)?;
    player.begin()?;
    let begun_ns = clock::monotonic_ns();
    let stopped = Pace::new(args, player.now_ns()).drive(&mut player, supervisor, stop)?;
    let mut figures = figures(args, &options, player.program(), player.tracking(), player.counts(), stopped);
    figures.commands_refused = player.newest().state.map_or(0, |state| state.n_refused);
    figures.messages_sent = figures.samples.sent();
    player.finish()?;
    figures.took(begun_ns);
    Ok(figures)
}

/// The clock of a new recording maps the replay's own time to now.
fn keeper(setup: &ReplaySetup, supervisor: &Supervisor, path: &Path) -> anyhow::Result<Keeper> {
    let record = with_attachments(&setup.config)?;
    let instance = supervisor.bus().instance().as_str();
    let mut about = About::run(instance, &record.metadata, record.attachments);
    about.clock = WallClock { offset_ns: clock::wall_ns().saturating_sub(setup.start_ns) };
    about.metadata.insert("clock_offset_ns".to_owned(), about.clock.offset_ns.to_string());
    Ok(Keeper::create(path, &about)?)
}

/// How fast the replay's own time passes.
struct Pace {
    speed: Speed,
    is_stepped: bool,
    is_paused: bool,
    n_steps: u64,
    until_ns: f64,
    looked_ns: i64,
}

impl Pace {
    fn new(args: &ReplayArgs, start_ns: i64) -> Self {
        let speed = if args.step { Speed::Max } else { args.speed };
        let (until_ns, looked_ns) = (start_ns as f64, clock::monotonic_ns());
        Self { speed, is_stepped: args.step, is_paused: false, n_steps: 0, until_ns, looked_ns }
    }

    /// Plays to the end or to a stop; returns whether it was stopped.
    fn drive(mut self, player: &mut Player, supervisor: &mut Supervisor, stop: &AtomicBool) -> anyhow::Result<bool> {
        let mut orders = Orders::listen()?;
        let mut look_ns = self.looked_ns;
        let mut stopped = false;
        loop {
            let mut wants_stop = stop.load(Ordering::Relaxed) || (self.is_stepped && orders.has_ended());
            while let Some(order) = orders.next() {
                match order {
                    Order::Pause => self.is_paused = true,
                    Order::Resume => self.is_paused = false,
                    Order::Step => self.n_steps += 1,
                    Order::Stop => wants_stop = true,
                }
            }
            // The steps that were asked for before the end of the orders are still taken.
            if wants_stop && !stopped && (self.n_steps == 0 || !orders.has_ended()) {
                stopped = true;
                player.stop();
            }
            let now_ns = clock::monotonic_ns();
            let (until_ns, patience) = self.pass_time(now_ns, stopped);
            let n_most = if self.is_stepped { self.n_steps.min(1) } else { u64::MAX };
            let (turn, n_sent) = player.turn(until_ns, n_most, patience)?;
            if self.is_stepped && n_sent > 0 {
                self.n_steps -= n_sent;
                while !player.is_idle() {
                    player.turn(until_ns, 0, PATIENCE)?;
                }
                print::out(&step_line(player))?;
            }
            if turn == Turn::Done {
                return Ok(stopped);
            }
            if now_ns >= look_ns {
                look_ns = now_ns + LOOK_EVERY_NS;
                supervisor.look()?;
            }
        }
    }

    /// Until when samples are due, and how long to sleep for them.
    fn pass_time(&mut self, now_ns: i64, stopped: bool) -> (i64, Duration) {
        let elapsed_ns = (now_ns - std::mem::replace(&mut self.looked_ns, now_ns)) as f64;
        match self.speed {
            // Coming to rest is not part of what is watched: it takes a moment at any speed.
            _ if stopped => (i64::MAX, PATIENCE),
            _ if self.is_paused => (self.until_ns as i64, PATIENCE),
            Speed::Max => (i64::MAX, PATIENCE),
            Speed::Times(times) => {
                self.until_ns += elapsed_ns * times;
                (self.until_ns as i64, PACED_PATIENCE)
            }
        }
    }
}

fn step_line(player: &Player) -> String {
    let newest = player.newest();
    let sequence = newest.setpoint.map_or(0, |setpoint| setpoint.input_sequence);
    let following = newest.state.is_some_and(|state| state.flags & krait_ipc::message::SlaveState::FOLLOWING != 0);
    let word = if following { "follows" } else { "holds" };
    if let Some(setpoint) = newest.setpoint.filter(|setpoint| setpoint.n_joints > 0) {
        let (unit, per_si) = player.program().steering().unit();
        let n = setpoint.n_joints as usize;
        let joints: Vec<f64> = setpoint.joints_rad.iter().take(n).map(|joint| joint * per_si).collect();
        let n_actuators = player.program().steering().n_commanded();
        let q_mm: Vec<f64> =
            newest.command.iter().flat_map(|command| command.q_tilde_m).take(n_actuators).map(|q| q * 1e3).collect();
        let what = if setpoint.n_segments() > 0 { "bend vectors" } else { "joints" };
        return format!("sample {sequence}: {what} {joints:.4?} {unit}, q~ {q_mm:.5?} mm, the slave {word}\n");
    }
    let deg = |bend: Option<[f64; 2]>| bend.unwrap_or([f64::NAN; 2]).map(f64::to_degrees);
    let [x, y] = deg(newest.setpoint.map(|setpoint| setpoint.bend_rad));
    let [a, b, c] = newest.command.map_or([f64::NAN; 3], |command| three(&command.q_tilde_m)).map(|q| q * 1e3);
    format!("sample {sequence}: bend {x:.4} {y:.4} deg, q~ {a:.5} {b:.5} {c:.5} mm, the slave {word}\n")
}

/// On the machine's clock, to any slave.
fn play_live(
    supervisor: &mut Supervisor,
    setup: ReplaySetup,
    args: &ReplayArgs,
    stop: &AtomicBool,
) -> anyhow::Result<Figures> {
    let Speed::Times(rate) = args.speed else {
        anyhow::bail!("--speed max --real-time: on the machine's clock a replay needs a speed; choose 0.01 to 1000");
    };
    if !args.engage {
        anyhow::bail!(
            "--real-time without --engage: on the machine's clock a replay could move real drives; add --engage"
        );
    }
    if setup.config.record.path.is_some() {
        supervisor.start_recorder(&setup.config, stop)?;
    }
    let options = options(&setup, None);
    let mut player = LivePlayer::open(supervisor.bus(), setup.program, rate)?;
    supervisor.start_chain(&options, stop)?;
    let begun_ns = clock::monotonic_ns();
    let stopped = drive_live(&mut player, supervisor, rate, stop)?;
    supervisor.end_chain();
    let mut figures = figures(args, &options, player.program(), player.tracking(), player.counts(), stopped);
    let state = supervisor.newest_state();
    figures.samples.answered = state.map_or(0, |state| state.n_commands);
    figures.commands_refused = state.map_or(0, |state| state.n_refused);
    (figures.messages_sent, figures.times_late) = (player.n_sent(), player.n_late());
    supervisor.end();
    figures.took(begun_ns);
    Ok(figures)
}

fn drive_live(
    player: &mut LivePlayer,
    supervisor: &mut Supervisor,
    rate: f64,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let mut orders = Orders::listen()?;
    let (mut stopped, mut look_ns) = (false, 0);
    loop {
        stopped |= stop.load(Ordering::Relaxed);
        while let Some(order) = orders.next() {
            match order {
                Order::Pause => player.set_rate(0.0),
                Order::Resume => player.set_rate(rate),
                Order::Stop => stopped = true,
                Order::Step => {}
            }
        }
        if stopped {
            player.stop();
        }
        let now_ns = clock::monotonic_ns();
        if player.turn(now_ns)? == Turn::Done {
            return Ok(stopped);
        }
        if now_ns >= look_ns {
            look_ns = now_ns + LOOK_EVERY_NS;
            supervisor.look()?;
        }
        let left_ns = player.due_ns().saturating_sub(clock::monotonic_ns());
        std::thread::sleep(Duration::from_nanos(u64::try_from(left_ns).unwrap_or(0)));
    }
}

fn figures(
    args: &ReplayArgs,
    options: &ChainOptions,
    program: &Program,
    tracking: &Tracked,
    samples: PlayCounts,
    stopped: bool,
) -> Figures {
    let (tally, read) = (program.tally(), program.track_counts());
    Figures {
        played: args.file.clone(),
        time: time_of(args),
        samples_in_loop: tally.n_in_loop,
        loops: args.loops,
        loops_played: tally.n_loops,
        samples_read: read.map_or(tally.n_in_loop * tally.n_loops, |read| read.n_read),
        samples_refused: read.map_or(0, |read| read.n_refused),
        samples,
        messages_sent: 0,
        commands_refused: 0,
        times_late: 0,
        played_s: tally.played_ns as f64 * 1e-9,
        took_s: 0.0,
        times_real_time: 0.0,
        tracking_error_deg: tracking.bend.score().error_deg,
        joints: tracking.joints(program.steering().lanes()),
        scored_from_s: SCORED_FROM_S,
        stopped,
        recording: options.config.record.path.clone(),
    }
}

impl Figures {
    fn took(&mut self, begun_ns: i64) {
        self.took_s = (clock::monotonic_ns() - begun_ns) as f64 * 1e-9;
        self.times_real_time = self.played_s / self.took_s;
    }
}

/// Every sample was sent, every message was answered, and nothing was lost.
fn is_whole(figures: &Figures) -> bool {
    let samples = &figures.samples;
    let all = figures.stopped || (figures.loops_played == figures.loops && samples.recorded == figures.samples_read);
    all && samples.lost == 0 && samples.answered == figures.messages_sent
}

fn sentence(figures: &Figures) -> String {
    let Figures { samples, tracking_error_deg: error, played_s, took_s, times_real_time, .. } = figures;
    let mut text = format!(
        "Played {} samples ({played_s:.1} s) in {took_s:.2} s, {times_real_time:.1} times real time; {} messages sent, {} \
         answered, {} lost, {} commands refused by the slave\n",
        samples.recorded, figures.messages_sent, samples.answered, samples.lost, figures.commands_refused
    );
    if figures.samples_refused > 0 {
        text += &format!("Left out: {} recorded samples that resolve would refuse\n", figures.samples_refused);
    }
    text += &format!("Tracking error from {SCORED_FROM_S:.0} s after the first motion on: ");
    let (error, unit, what) = match &figures.joints {
        Some(joints) if joints.each == Lanes::Segments.each() => (joints.error, joints.unit, "bends of segments"),
        Some(joints) => (joints.error, joints.unit, "joint positions"),
        None => (*error, "deg", "shapes"),
    };
    text += &match error {
        Some(Spread { n, rms, p95, max }) => {
            format!("{rms:.2} {unit} rms, {p95:.2} p95, {max:.2} max over {n} {what}\n")
        }
        None => format!("{TOO_SHORT}\n"),
    };
    if figures.stopped {
        text += "It was stopped before its end.\n";
    }
    if let Some(path) = &figures.recording {
        text += &format!("Recording: {}\n", path.display());
    }
    text
}

/// After a failure: an empty recording is removed, and what was recorded is named.
fn tell_what_is_left(path: &Path) {
    let holds_samples = krait_record::Recording::open(path).is_ok_and(|r| !r.contents().channels.is_empty());
    if holds_samples {
        tracing::warn!(path = %path.display(), "what was recorded before the failure is kept");
    } else if let Err(error) = std::fs::remove_file(path) {
        tracing::debug!(path = %path.display(), %error, "there was no recording to discard");
    }
}
