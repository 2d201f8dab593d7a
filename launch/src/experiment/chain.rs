//! The passes of an experiment: a chain of real processes for each compensation, led by the guide, in one recording.

use super::Settings;
use super::settings::ExperimentPass;
use crate::cli::{EngageKind, MasterKind};
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use anyhow::{Context, bail};
use core::time::Duration;
use krait_ipc::message::{Marker, Shape};
use krait_ipc::{ExperimentMark, ReadOptions, Reader};
use std::io::{Write, stderr};
use std::sync::atomic::{AtomicBool, Ordering};

/// How often the chain is looked at; a child that dies is noticed within this time.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Name of the plan among the instance's files.
const PLAN_FILE: &str = "experiment-plan.toml";

/// Runs every pass and ends.
///
/// # Errors
/// One sentence: a process ended, a pose was not reached or did not rest, or it was stopped. What was recorded is kept.
pub fn run_passes(instance: &str, settings: &Settings, stop: &AtomicBool) -> anyhow::Result<()> {
    let mut supervisor = Supervisor::new(instance, stop)?;
    let Some(first) = settings.passes.first() else { bail!("an experiment without a pass is none") };
    // The recording embeds the model file of the last pass, which alone may be one of the user's own.
    let of_recorder = settings.passes.last().unwrap_or(first);
    supervisor.start_recorder(&of_recorder.config, stop)?;
    let n_passes = settings.passes.len();
    for (k, pass) in settings.passes.iter().enumerate() {
        let label = format!("pass {} of {n_passes}, compensation {}", k + 1, pass.name);
        let done = run_pass(&mut supervisor, settings, pass, &label, stop);
        supervisor.end_chain();
        done.with_context(|| {
            format!("{label}; what was recorded until then is kept in {}", settings.recording.display())
        })?;
    }
    let clean = supervisor.end() && supervisor.is_unscathed();
    anyhow::ensure!(clean, "a process of the experiment did not end by itself and was killed");
    Ok(())
}

fn run_pass(
    supervisor: &mut Supervisor,
    settings: &Settings,
    pass: &ExperimentPass,
    label: &str,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    let plan_path = supervisor.bus().instance().folder().join(PLAN_FILE);
    let plan = toml::to_string(&pass.plan).context("the plan could not be written as TOML")?;
    std::fs::write(&plan_path, plan).with_context(|| format!("{} could not be written", plan_path.display()))?;
    let marks = supervisor.bus().reader_on(Marker::DEVICE_CHANNEL, ReadOptions::observing())?;
    let shapes = supervisor.bus().reader(ReadOptions::glancing())?;
    let options = ChainOptions {
        config: pass.config.clone(),
        master: MasterKind::Guide,
        input: Some(plan_path.clone()),
        looped: false,
        // A stall of a busy machine ends an engagement; real drives are then left to the person who watches them.
        engage: Some(if settings.is_real { EngageKind::Once } else { EngageKind::Again }),
        cast: Cast::live(),
    };
    let started = supervisor.start_chain(&options, stop);
    // The master has read it, or never will.
    std::fs::remove_file(&plan_path).with_context(|| format!("{} could not be removed", plan_path.display()))?;
    started?;
    Watch { marks, shapes, n_shapes: 0, n_poses: settings.protocol.poses.len() }.until_the_end(supervisor, label, stop)
}

/// Follows the marks of a pass.
struct Watch {
    marks: Reader<Marker>,
    shapes: Reader<Shape>,
    n_shapes: u64,
    n_poses: usize,
}

impl Watch {
    fn until_the_end(mut self, supervisor: &mut Supervisor, label: &str, stop: &AtomicBool) -> anyhow::Result<()> {
        tell(&format!("{label}\n"));
        loop {
            supervisor.look()?;
            while let Some(shape) = self.shapes.take()? {
                self.n_shapes += u64::from(shape.valid_bend_rad().is_some());
            }
            while let Some(mark) = self.marks.take()? {
                match mark.text().and_then(ExperimentMark::parse) {
                    Some(ExperimentMark::AtRest { pose, .. }) => self.at_rest(pose)?,
                    Some(ExperimentMark::Failed(sentence)) => bail!("the experiment failed {sentence}"),
                    Some(ExperimentMark::Ends) => return Ok(()),
                    Some(ExperimentMark::Begins) | None => {}
                }
            }
            if stop.load(Ordering::Relaxed) {
                bail!("the experiment was stopped before its end");
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    fn at_rest(&self, pose: u32) -> anyhow::Result<()> {
        tell(&format!("  pose {pose} of {}\n", self.n_poses));
        if self.n_shapes == 0 {
            bail!(
                "nobody measures the shape, so there is nothing to compare; let `program | krait shape` run, or choose --shape camera where the drive has one"
            );
        }
        Ok(())
    }
}

/// Progress is a courtesy: a closed standard error must not end a chain.
fn tell(text: &str) {
    if stderr().lock().write_all(text.as_bytes()).is_err() {
        tracing::debug!("standard error is closed");
    }
}
