//! `krait shape`: measured shapes of another program, line by line, onto the channel of a chain.

use crate::cli::{Common, ShapeArgs};
use crate::config::Config;
use crate::{print, signals};
use anyhow::Context;
use krait_ipc::Bus;
use krait_shape::Counts;
use std::process::ExitCode;

/// Its name among the members of an instance: a chain may start beside it.
pub const NAME: &str = "shape";

/// Publishes what comes on standard input until it ends or is stopped, and says what became of it.
pub fn run(common: &Common, args: &ShapeArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let config = Config::load(common.config.as_deref())?;
    let bus = Bus::open(&common.instance, NAME)?;
    if bus.members().iter().all(|(_, pid)| *pid == std::process::id()) {
        tracing::warn!("no chain runs in instance {:?} yet; shapes are published all the same", common.instance);
    }
    let counts = krait_shape::run(&bus, config.shape, std::io::stdin(), &stop).context("standard input")?;
    if args.json {
        print::json(&counts)?;
    } else {
        print::out(&sentence(&counts, &common.instance))?;
    }
    Ok(if counts.lines > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn sentence(counts: &Counts, instance: &str) -> String {
    if counts.lines == 0 {
        return "nothing came on standard input; each line of it is a shape, as docs/shapes.md says\n".to_owned();
    }
    let named: Vec<String> = counts.named().into_iter().map(|(name, count)| format!("{count} {name}")).collect();
    let rest = if named.is_empty() { "nothing was wrong with them".to_owned() } else { named.join(", ") };
    let (shapes, lines) = (print::counted(counts.published, "shape"), print::counted(counts.lines, "line"));
    format!("published {shapes} of {lines} in instance {instance:?}: {rest}\n")
}
