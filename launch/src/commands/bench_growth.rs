//! `krait bench --growth`: how the latency of krait's chain grows with chains beside it, with the rate and with readers.

use crate::chain_round::{self, Listeners};
use crate::cli_bench::BenchArgs;
use crate::commands::bench::{folder, say, write};
use crate::commands::yardstick::burn_command;
use crate::config::Config;
use crate::print;
use anyhow::Context;
use core::sync::atomic::AtomicBool;
use krait_bench::{ChainFigures, ChainRounds, Growth, Host, Load, Plan, Round};
use krait_ipc::clock;
use krait_report::Table;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// What is varied; the other two stay at one chain, 1 kHz, one reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Varied {
    Chains,
    RateHz,
    Readers,
}

impl Varied {
    const ALL: [Self; 3] = [Self::Chains, Self::RateHz, Self::Readers];

    fn values(self) -> &'static [u32] {
        match self {
            Self::Chains => &[1, 2, 4, 8],
            Self::RateHz => &[250, 500, 1000, 2000, 4000, 8000],
            Self::Readers => &[1, 2, 4, 8, 16],
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Chains => "chains on this machine",
            Self::RateHz => "rate, Hz",
            Self::Readers => "readers of every channel",
        }
    }
}

/// One setting and what was measured with it.
#[derive(Serialize)]
struct Point {
    varied: Varied,
    value: u32,
    #[serde(flatten)]
    figures: ChainFigures,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    host: Host,
    plan: Plan,
    load: bool,
    points: Vec<Point>,
    folder: PathBuf,
}

/// Measures every setting in every round, keeps table, figures and picture, and prints the figures.
pub fn run(config: &Config, plan: &Plan, args: &BenchArgs, stop: &AtomicBool) -> anyhow::Result<ExitCode> {
    let mut host = Host::look(krait_record::utc_text(clock::wall_ns()));
    let _load = args.load.then(|| Load::start(&mut burn_command)).transpose()?;
    let settings: Vec<(Varied, u32)> =
        Varied::ALL.into_iter().flat_map(|varied| varied.values().iter().map(move |value| (varied, *value))).collect();
    let mut rounds: Vec<Vec<Round>> = vec![Vec::new(); settings.len()];
    for round in 1..=plan.n_rounds {
        for ((varied, value), rounds) in settings.iter().zip(&mut rounds) {
            let measured = measure(config, plan, *varied, *value, stop);
            rounds.push(measured.with_context(|| format!("{} {value} in round {round}", varied.title()))?);
        }
        say(&format!("round {round} of {} is done", plan.n_rounds));
    }
    host.note_end();
    let figures = |rounds| ChainRounds { name: "krait", rounds }.figures(None);
    let points = settings.into_iter().zip(rounds);
    let points = points.map(|((varied, value), rounds)| Point { varied, value, figures: figures(rounds) }).collect();
    let folder = folder(args, &host)?;
    let report = Report { host, plan: plan.clone(), load: args.load, points, folder };
    keep(&report)?;
    if args.json {
        print::json(&report)?
    } else {
        print::out(&text(&report))?
    }
    Ok(ExitCode::SUCCESS)
}

/// One round of one setting; chains that run at once are taken together.
fn measure(config: &Config, plan: &Plan, varied: Varied, value: u32, stop: &AtomicBool) -> anyhow::Result<Round> {
    let plan = if varied == Varied::RateHz { Plan { rate_hz: value, ..plan.clone() } } else { plan.clone() };
    let n_observers = if varied == Varied::Readers { value as usize } else { 1 };
    let n_chains = if varied == Varied::Chains { value } else { 1 };
    let listeners = Listeners { recorder: false, n_observers };
    let rounds = std::thread::scope(|scope| {
        let one = || chain_round::run(config, &plan, listeners, stop);
        let chains: Vec<_> = (0..n_chains).map(|_| scope.spawn(one)).collect();
        let ended = chains.into_iter().map(|chain| chain.join().unwrap_or_else(|_| anyhow::bail!("a thread has died")));
        ended.collect::<anyhow::Result<Vec<Round>>>()
    })?;
    Ok(rounds.into_iter().reduce(together).unwrap_or_default())
}

fn together(mut one: Round, other: Round) -> Round {
    one.samples.extend(other.samples);
    one.own_work_ns.extend(other.own_work_ns);
    Round {
        n_sent: one.n_sent + other.n_sent,
        n_lost: one.n_lost + other.n_lost,
        usage: one.usage.beside(other.usage),
        ..one
    }
}

fn keep(report: &Report) -> anyhow::Result<()> {
    let curve = |varied: Varied| {
        let points = report.points.iter().filter(|point| point.varied == varied);
        Growth { title: varied.title(), points: points.map(|p| (f64::from(p.value), p.figures.latency)).collect() }
    };
    let title = format!("krait's chain, three hops; load average {}", report.host.load_before);
    write(&report.folder.join("growth.svg"), &krait_bench::growth_svg(&title, &Varied::ALL.map(curve))?)?;
    write(&report.folder.join("growth.json"), &serde_json::to_string_pretty(report)?)?;
    write(&report.folder.join("growth.txt"), &text(report))
}

fn text(report: &Report) -> String {
    let mut table =
        Table::new(&["varied", "value", "p50", "p90", "p99", "p99.9", "max", "own work", "CPU %", "sent", "lost"]);
    for point in &report.points {
        let (figures, q) = (&point.figures, &point.figures.latency);
        let mut cells = vec![point.varied.title().to_owned(), point.value.to_string()];
        cells.extend([q.p50, q.p90, q.p99, q.p999, q.max].map(|us| format!("{us:.1}")));
        cells.push(figures.own_work.map_or_else(|| "-".to_owned(), |work| format!("{:.1}", work.p50)));
        cells.push(format!("{:.1}", figures.cpu_share * 100.0));
        cells.extend([figures.sent, figures.lost].map(|n| n.to_string()));
        table.row(cells);
    }
    format!(
        "Latency of krait's chain, microseconds; 1 chain, 1000 Hz and 1 reader where nothing else is said; {} s in {} rounds{}\n{table}Host: {}\nTable, figures and picture: {}\n",
        report.plan.seconds,
        report.plan.n_rounds,
        if report.load { ", every core loaded" } else { "" },
        report.host.line(),
        report.folder.display(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_bench::RelaySample;

    #[test]
    fn chains_that_run_at_once_are_counted_together() {
        let round = |n: u64| Round {
            samples: vec![RelaySample { sequence: n, source_ns: 0, arrived_ns: [1, 2, 3] }],
            n_sent: n,
            n_lost: 1,
            ..Round::default()
        };
        let both = together(round(10), round(20));
        assert_eq!((both.samples.len(), both.n_sent, both.n_lost), (2, 30, 2));
    }

    #[test]
    fn every_axis_begins_at_or_passes_what_the_others_hold_still() {
        assert!(Varied::RateHz.values().contains(&1000));
        assert!([Varied::Chains, Varied::Readers].iter().all(|varied| varied.values()[0] == 1));
    }
}
