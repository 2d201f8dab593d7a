//! `krait bench`: krait's chain beside the floor of the machine and beside other ways to pass a message, turn by turn.

use crate::chain_round::{self, Listeners};
use crate::cli::Common;
use crate::cli_bench::{BenchArgs, WaitKind};
use crate::commands::bench_growth;
use crate::commands::yardstick::{burn_command, stage_command};
use crate::config::Config;
use crate::{print, signals};
use anyhow::{Context, bail};
use core::sync::atomic::{AtomicBool, Ordering};
use krait_bench::{Broken, ChainFigures, ChainKind, ChainRounds, Host, Load, Plan};
use krait_ipc::{Priority, Realtime, WaitMode, clock};
use krait_report::Table;
use krait_slave::DriveConfig;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What `--json` prints, and what is kept beside the raw samples.
#[derive(Serialize)]
struct Report {
    host: Host,
    plan: Plan,
    /// What krait's own processes ask of the kernel.
    krait_realtime: Realtime,
    /// How krait's own processes wait: `resolve`, `compensate` and the slave.
    krait_wait: [WaitMode; 3],
    load: bool,
    chains: Vec<ChainFigures>,
    skipped: Vec<Skipped>,
    /// Limits of the budget that krait's own chains broke; absent where the floor was not measured beside them.
    budget_broken: Option<Vec<Broken>>,
    folder: PathBuf,
}

/// A chain that could not be measured, and why.
#[derive(Serialize)]
struct Skipped {
    name: &'static str,
    reason: String,
}

impl Skipped {
    fn aloud(kind: ChainKind, reason: String) -> Self {
        say(&format!("skipped: {} ({reason})", kind.name()));
        Self { name: kind.name(), reason }
    }
}

/// Measures the chains in rounds, keeps raw samples, figures and picture, and prints the figures.
pub fn run(common: &Common, args: &BenchArgs) -> anyhow::Result<ExitCode> {
    if cfg!(debug_assertions) {
        bail!(
            "a debug build is many times slower than what users run, so it is not measured; build with `cargo build --release`"
        );
    }
    let stop = signals::stop_flag()?;
    let mut config = Config::load(common.config.as_deref())?;
    // A measurement engages by itself, so it never has real drives.
    config.slave.drive = DriveConfig::default();
    let plan = Plan { realtime: asked(args, &Realtime::ORDINARY), ..plan(args) };
    plan.check()?;
    config.realtime = asked(args, &config.realtime);
    if let Some(wait) = args.wait.map(mode) {
        (config.resolve.wait, config.compensate.wait, config.slave.wait) = (wait, wait, wait);
    }
    if args.growth {
        return bench_growth::run(&config, &plan, args, &stop);
    }
    let (kinds, mut skipped) = chains(args);
    let mut host = Host::look(krait_record::utc_text(clock::wall_ns()));
    let _load = args.load.then(|| Load::start(&mut burn_command)).transpose()?;
    let rounds = measure(&config, &plan, &kinds, &mut skipped, &stop)?;
    host.note_end();
    let floor = rounds.iter().find(|chain| chain.name == ChainKind::FloorFutex.name());
    let figures: Vec<ChainFigures> = rounds.iter().map(|chain| chain.figures(floor)).collect();
    let budget_broken = check(&config, &figures);
    if args.check && budget_broken.is_none() {
        bail!(
            "--check compares krait's chain with the floor: --chains must name floor-futex and krait or krait-recorded"
        );
    }
    let folder = folder(args, &host)?;
    let report = Report {
        host,
        plan,
        krait_wait: [config.resolve.wait, config.compensate.wait, config.slave.wait],
        krait_realtime: config.realtime,
        load: args.load,
        chains: figures,
        skipped,
        budget_broken,
        folder,
    };
    keep(&report, &rounds)?;
    if args.json {
        print::json(&report)?
    } else {
        print::out(&text(&report))?
    }
    let is_broken = report.budget_broken.as_ref().is_some_and(|broken| !broken.is_empty());
    Ok(if args.check && is_broken { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The limits of the budget, as multiples of the floor, that krait's chains break: end to end, and hop by hop. A hop of the
/// chain includes the work of the stage at its end, and the first one the master's own.
fn check(config: &Config, figures: &[ChainFigures]) -> Option<Vec<Broken>> {
    let floor = figures.iter().find(|chain| chain.name == ChainKind::FloorFutex.name())?;
    let ours = [ChainKind::Krait.name(), ChainKind::KraitRecorded.name()];
    let mut chains = figures.iter().filter(|chain| ours.contains(&chain.name)).peekable();
    chains.peek()?;
    let hops = &config.budget.hops()[1..];
    let mut broken = Vec::new();
    for chain in chains {
        let limits = config.budget.end_to_end.floors();
        let what = format!("{} end to end", chain.name);
        broken.extend(krait_bench::broken(&what, &limits, &chain.latency, &floor.latency, chain.ratio_to_floor));
        let ways = chain.per_hop.iter().zip(&floor.per_hop).zip(hops);
        for (hop, ((found, floor), allowed)) in ways.enumerate() {
            let what = format!("{} hop {}", chain.name, hop + 1);
            broken.extend(krait_bench::broken(&what, &allowed.floors(), found, floor, None));
        }
    }
    Some(broken)
}

fn plan(args: &BenchArgs) -> Plan {
    Plan {
        rate_hz: args.rate,
        seconds: args.seconds,
        n_rounds: args.rounds,
        payload_bytes: args.payload,
        // To be awake ahead is krait's own; a relay then sleeps.
        wait: if args.wait == Some(WaitKind::Polling) { WaitMode::Polling } else { WaitMode::Blocking },
        realtime: Realtime::ORDINARY,
    }
}

fn mode(wait: WaitKind) -> WaitMode {
    match wait {
        WaitKind::Blocking => WaitMode::Blocking,
        WaitKind::Ahead => WaitMode::Ahead,
        WaitKind::Polling => WaitMode::Polling,
    }
}

/// What the processes of a chain ask of the kernel when nothing else is asked for on the command line.
fn asked(args: &BenchArgs, otherwise: &Realtime) -> Realtime {
    // One priority for every chain that is measured, or none.
    let mut realtime = Realtime { priority: Priority::Fixed(args.priority), ..otherwise.clone() };
    realtime.lock_memory |= args.priority > 0;
    if let Some(cores) = &args.cores {
        realtime.cores = cores.clone();
    }
    realtime.keep_awake |= args.keep_awake;
    realtime
}

/// The chains to measure, and those that cannot be, which are named aloud.
fn chains(args: &BenchArgs) -> (Vec<ChainKind>, Vec<Skipped>) {
    let wanted = if args.chains.is_empty() { &ChainKind::ALL[..] } else { &args.chains };
    let (mut kinds, mut skipped) = (Vec::new(), Vec::new());
    for kind in wanted {
        match kind.missing() {
            Some(reason) => skipped.push(Skipped::aloud(*kind, reason)),
            None => kinds.push(*kind),
        }
    }
    (kinds, skipped)
}

/// Every chain has its turn in every round; a peer that fails is skipped from then on, as if it were not installed.
fn measure(
    config: &Config,
    plan: &Plan,
    kinds: &[ChainKind],
    skipped: &mut Vec<Skipped>,
    stop: &AtomicBool,
) -> anyhow::Result<Vec<ChainRounds>> {
    let mut chains: Vec<ChainRounds> =
        kinds.iter().map(|kind| ChainRounds { name: kind.name(), rounds: Vec::new() }).collect();
    for round in 1..=plan.n_rounds {
        for kind in kinds {
            let Some(chain) = chains.iter_mut().find(|chain| chain.name == kind.name()) else { continue };
            let measured = match kind {
                ChainKind::Krait => chain_round::run(config, plan, Listeners::default(), stop),
                ChainKind::KraitRecorded => {
                    chain_round::run(config, plan, Listeners { recorder: true, n_observers: 1 }, stop)
                }
                relay => krait_bench::run_relay_round(*relay, plan, stop, &mut stage_command).map_err(Into::into),
            };
            match measured.with_context(|| format!("chain {} in round {round}", kind.name())) {
                Err(error) if kind.is_peer() && !stop.load(Ordering::Relaxed) => {
                    skipped.push(Skipped::aloud(*kind, format!("{error:#}")));
                    chains.retain(|chain| chain.name != kind.name());
                }
                measured => chain.rounds.push(measured?),
            }
        }
        let medians = chains
            .iter()
            .map(|chain| format!("{} {:.1}", chain.name, chain.p50_of_rounds().last().copied().unwrap_or(f64::NAN)));
        let medians = medians.collect::<Vec<_>>().join(", ");
        say(&format!("round {round} of {}, p50 in us: {medians}", plan.n_rounds));
    }
    Ok(chains)
}

pub(super) fn folder(args: &BenchArgs, host: &Host) -> anyhow::Result<PathBuf> {
    let by_date = || Path::new("measurements").join(format!("{}-{}", host.date, std::process::id()));
    let folder = args.out.clone().unwrap_or_else(by_date);
    std::fs::create_dir_all(&folder).with_context(|| format!("{} could not be made", folder.display()))?;
    Ok(folder)
}

/// Raw samples, figures and picture.
fn keep(report: &Report, rounds: &[ChainRounds]) -> anyhow::Result<()> {
    let comment = format!("krait bench: stamps and latencies in ns, CLOCK_MONOTONIC\n{}", report.host.line());
    let rows = rounds.iter().flat_map(|chain| {
        chain.rounds.iter().enumerate().map(|(idx, round)| (chain.name, idx + 1, round.samples.as_slice()))
    });
    krait_bench::write_csv(&report.folder.join("samples.csv"), &comment, rows)?;
    let title = format!(
        "{} Hz, {} B, {} rounds, load average {}",
        report.plan.rate_hz, report.plan.payload_bytes, report.plan.n_rounds, report.host.load_before
    );
    write(&report.folder.join("latency.svg"), &krait_bench::histogram_svg(&title, rounds)?)?;
    write(&report.folder.join("figures.json"), &serde_json::to_string_pretty(report)?)?;
    write(&report.folder.join("table.txt"), &text(report))
}

pub(super) fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("{} could not be written", path.display()))
}

fn text(report: &Report) -> String {
    let plan = &report.plan;
    let mut text = format!(
        "Latency of three hops through four processes, microseconds; {} Hz, payload {} B, {} s in {} rounds{}\n  waits of the relays: {}; of krait: {}\n  priority, cores and slice of the relays: {}; of krait: {}\n",
        plan.rate_hz,
        plan.payload_bytes,
        plan.seconds,
        plan.n_rounds,
        if report.load { ", every core loaded" } else { "" },
        plan.wait.name(),
        report.krait_wait.map(WaitMode::name).join(", "),
        wishes(&plan.realtime),
        wishes(&report.krait_realtime),
    );
    text += &table(&report.chains).to_string();
    for skipped in &report.skipped {
        text += &format!("  skipped: {} ({})\n", skipped.name, skipped.reason);
    }
    if let Some(broken) = &report.budget_broken {
        text += if broken.is_empty() {
            "Budget, in multiples of the floor: kept\n"
        } else {
            "Budget, in multiples of the floor: not kept\n"
        };
        for limit in broken {
            text += &format!("  {} {}: {:.2}, {} allowed\n", limit.what, limit.quantile, limit.found, limit.limit);
        }
    }
    text += &format!("Host: {}\n", report.host.line());
    text += &format!("Raw samples, figures and picture: {}\n", report.folder.display());
    text
}

fn wishes(realtime: &Realtime) -> String {
    let awake = if realtime.keep_awake { ", kept awake" } else { "" };
    format!("{}, {}, {} us{awake}", realtime.priority, realtime.cores, realtime.slice_us)
}

fn table(chains: &[ChainFigures]) -> Table {
    let mut table = Table::new(&[
        "chain", "p50", "p90", "p99", "p99.9", "max", "x floor", "own work", "CPU %", "switches", "sent", "lost",
    ]);
    for chain in chains {
        let q = &chain.latency;
        let mut cells = vec![chain.name.to_owned()];
        cells.extend([q.p50, q.p90, q.p99, q.p999, q.max].map(|us| format!("{us:.1}")));
        cells.push(chain.ratio_to_floor.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.2}")));
        cells.push(chain.own_work.map_or_else(|| "-".to_owned(), |work| format!("{:.1}", work.p50)));
        cells.push(format!("{:.1}", chain.cpu_share * 100.0));
        cells.push(format!("{:.1}", chain.switches_per_sample));
        cells.extend([chain.sent, chain.lost].map(|n| n.to_string()));
        table.row(cells);
    }
    table
}

/// Progress and what was left out, on standard error: standard output belongs to the figures.
#[allow(clippy::print_stderr)]
pub(super) fn say(sentence: &str) {
    eprintln!("krait bench: {sentence}");
}
