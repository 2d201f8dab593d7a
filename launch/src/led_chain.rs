//! A chain that a calibration leads from place to place: its master is the guide of the experiments, told one place after the other, and
//! what encoders and shape were while the actuators rested is read from its channels.

use crate::cli::{EngageKind, MasterKind};
use crate::config::Config;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use anyhow::{Context, bail};
use core::time::Duration;
use krait_ipc::message::{Marker, Shape, SlaveState, three};
use krait_ipc::{ExperimentMark, ReadOptions, Reader, Writer, clock};
use krait_master::{GuideOrder, GuidePlan};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

/// How often the chain is looked at; a child that dies is noticed within this time.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Name of the plan among the instance's files.
const PLAN_FILE: &str = "calibration-plan.toml";
/// What is kept of states and shapes, ns: longer than any rest that is measured.
const KEPT_NS: i64 = 3_000_000_000;

/// What was read while the actuators rested.
#[derive(Clone, Copy, Debug)]
pub struct RestReading {
    /// Mean of the encoders, m.
    pub q_m: [f64; 3],
    /// Mean of the measured bend vectors, rad; none where nobody measured the shape.
    pub bend_rad: Option<[f64; 2]>,
}

/// A chain whose guide awaits orders. It ends when it is dropped.
pub struct LedChain<'s> {
    supervisor: Supervisor,
    stop: &'s AtomicBool,
    orders: Writer<Marker>,
    marks: Reader<Marker>,
    states: Reader<SlaveState>,
    shapes: Reader<Shape>,
    /// (instant ns, encoders m), the newest last.
    encoders: VecDeque<(i64, [f64; 3])>,
    bends: VecDeque<(i64, [f64; 2])>,
    n_ordered: u32,
}

impl<'s> LedChain<'s> {
    /// Starts every process, homes the machine and engages; nothing moves but for homing until [`LedChain::go`].
    ///
    /// # Errors
    /// One sentence: the instance is taken, a process did not come up, or it was stopped.
    pub fn start(
        instance: &str,
        config: &Config,
        plan: &GuidePlan,
        is_real: bool,
        stop: &'s AtomicBool,
    ) -> anyhow::Result<Self> {
        let mut supervisor = Supervisor::new(instance, stop)?;
        if config.record.path.is_some() {
            supervisor.start_recorder(config, stop)?;
        }
        let bus = supervisor.bus();
        let orders = bus.writer_on(Marker::GUIDE_CHANNEL)?;
        let marks = bus.reader_on(Marker::DEVICE_CHANNEL, ReadOptions::observing())?;
        let (states, shapes) = (bus.reader(ReadOptions::observing())?, bus.reader(ReadOptions::observing())?);
        let path = bus.instance().folder().join(PLAN_FILE);
        let text = toml::to_string(plan).context("the plan could not be written as TOML")?;
        std::fs::write(&path, text).with_context(|| format!("{} could not be written", path.display()))?;
        let options = ChainOptions {
            config: config.clone(),
            master: MasterKind::Guide,
            input: Some(path.clone()),
            looped: false,
            // A stall of a busy machine ends an engagement; real drives are then left to the person who watches them.
            engage: Some(if is_real { EngageKind::Once } else { EngageKind::Again }),
            cast: Cast::live(),
        };
        let started = supervisor.start_chain(&options, stop);
        // The master has read it, or never will.
        std::fs::remove_file(&path).with_context(|| format!("{} could not be removed", path.display()))?;
        started?;
        let (encoders, bends) = (VecDeque::new(), VecDeque::new());
        Ok(Self { supervisor, stop, orders, marks, states, shapes, encoders, bends, n_ordered: 0 })
    }

    /// Leads the tip in a straight line to a place in the base frame, m, and reads what is measured once the actuators rest there.
    ///
    /// # Errors
    /// One sentence: the place was not reached or not at rest in time, a process ended, or it was stopped.
    pub fn go(&mut self, tip_pos_in_base_m: [f64; 3]) -> anyhow::Result<RestReading> {
        self.n_ordered += 1;
        let number = self.n_ordered;
        self.order(GuideOrder::Go { number, tip_pos_in_base_m })?;
        loop {
            if let Some((from_ns, until_ns)) = self.look(|mark| match mark {
                ExperimentMark::AtRest { pose, for_ns } if *pose == number => Some(*for_ns),
                _ => None,
            })? {
                return self.reading(from_ns, until_ns);
            }
        }
    }

    /// Lets the guide end and the chain after it.
    ///
    /// # Errors
    /// One sentence: a process did not end by itself.
    pub fn end(mut self) -> anyhow::Result<()> {
        self.order(GuideOrder::End)?;
        while self.look(|mark| matches!(mark, ExperimentMark::Ends).then_some(0))?.is_none() {}
        self.supervisor.end_chain();
        let clean = self.supervisor.end() && self.supervisor.is_unscathed();
        anyhow::ensure!(clean, "a process of the chain did not end by itself and was killed");
        Ok(())
    }

    fn order(&mut self, order: GuideOrder) -> anyhow::Result<()> {
        let mark = Marker::new(self.orders.n_sent() + 1, clock::monotonic_ns(), &order.to_string())?;
        Ok(self.orders.send(&mark)?)
    }

    /// Looks at the chain once; the stretch of time of the mark that is waited for, if it came.
    fn look(&mut self, wanted: impl Fn(&ExperimentMark) -> Option<i64>) -> anyhow::Result<Option<(i64, i64)>> {
        std::thread::sleep(LOOK_EVERY);
        self.supervisor.look()?;
        while let Some(state) = self.states.take()? {
            keep(&mut self.encoders, (state.sample_ns, three(&state.measured_q_m)));
        }
        while let Some(shape) = self.shapes.take()? {
            if let Some(bend_rad) = shape.valid_bend_rad() {
                keep(&mut self.bends, (shape.sample_ns, bend_rad));
            }
        }
        let mut found = None;
        while let Some(mark) = self.marks.take()? {
            match mark.text().and_then(ExperimentMark::parse) {
                Some(ExperimentMark::Failed(sentence)) => bail!("the motion failed {sentence}"),
                Some(other) => found = found.or(wanted(&other).map(|for_ns| (mark.sample_ns - for_ns, mark.sample_ns))),
                None => {}
            }
        }
        if self.stop.load(Ordering::Relaxed) {
            bail!("the calibration was stopped; what was read is kept");
        }
        Ok(found)
    }

    fn reading(&self, from_ns: i64, until_ns: i64) -> anyhow::Result<RestReading> {
        let within = |at_ns: i64| (from_ns..=until_ns).contains(&at_ns);
        let q_m = mean(self.encoders.iter().filter(|(at_ns, _)| within(*at_ns)).map(|(_, q)| *q));
        let q_m = q_m.context("the drives said nothing while the actuators rested")?;
        let bend_rad = mean(self.bends.iter().filter(|(at_ns, _)| within(*at_ns)).map(|(_, bend)| *bend));
        Ok(RestReading { q_m, bend_rad })
    }
}

fn keep<const N: usize>(kept: &mut VecDeque<(i64, [f64; N])>, newest: (i64, [f64; N])) {
    kept.push_back(newest);
    while kept.front().is_some_and(|(at_ns, _)| newest.0 - at_ns > KEPT_NS) {
        kept.pop_front();
    }
}

fn mean<const N: usize>(values: impl Iterator<Item = [f64; N]>) -> Option<[f64; N]> {
    let (mut sum, mut n) = ([0.0; N], 0.0);
    for value in values {
        sum = core::array::from_fn(|k| sum[k] + value[k]);
        n += 1.0;
    }
    (n > 0.0).then(|| sum.map(|s| s / n))
}
